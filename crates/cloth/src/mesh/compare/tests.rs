use std::f64::consts::PI;

use super::wrinkles::high_pass;
use super::*;
use crate::math::Vec3;
use crate::mesh::{OrientationFault, TriMesh};

/// A square of side 1 in the middle, `cells` to a side, lifted to `height`(x, y).
fn square(cells: u32, height: impl Fn(f64, f64) -> f64) -> TriMesh {
    let at = |i: u32| f64::from(i) / f64::from(cells) - 0.5;
    let points = (0..=cells).flat_map(|j| (0..=cells).map(move |i| (at(i), at(j))));
    let vertices = points.map(|(x, y)| Vec3::new(x, y, height(x, y))).collect();
    let triangles = (0..cells).flat_map(|j| {
        (0..cells).flat_map(move |i| {
            let v = j * (cells + 1) + i;
            let up = v + cells + 1;
            [[v, v + 1, up + 1], [v, up + 1, up]]
        })
    });
    TriMesh {
        vertices,
        triangles: triangles.collect(),
    }
}

/// A cap of the sphere of radius `r` about the origin: a square on the tangent plane of the
/// pole, seen from the centre, up to 37 degrees along its middle lines.
fn cap(r: f64, cells: u32) -> TriMesh {
    let mut mesh = square(cells, |_, _| 0.0);
    for x in &mut mesh.vertices {
        *x = Vec3::new(1.5 * x.x, 1.5 * x.y, 1.0).normalize() * r;
    }
    mesh
}

fn moved(mut mesh: TriMesh, by: Vec3) -> TriMesh {
    for x in &mut mesh.vertices {
        *x += by;
    }
    mesh
}

fn deviation(a: &TriMesh, b: &TriMesh) -> Distances {
    let sheet = Sheet::new(b).unwrap();
    let values = a.vertices.iter().map(|&x| sheet.foot(x).deviation);
    Distances::new(values.zip(a.vertex_areas())).unwrap()
}

#[test]
fn weights_decide_mean_and_percentile() {
    let spread = Distances::new([(-3.0, 1.0), (1.0, 94.0), (2.0, 5.0)]).unwrap();
    assert!((spread.mean - 1.01).abs() < 1e-12);
    assert!((spread.rms - 1.23f64.sqrt()).abs() < 1e-12);
    assert_eq!((spread.p95, spread.min, spread.max), (2.0, -3.0, 2.0));
    let spread = Distances::new([(-3.0, 1.0), (1.0, 95.0), (2.0, 4.0)]).unwrap();
    assert_eq!(spread.p95, 1.0);
    assert_eq!(Distances::new([]), None);
    assert_eq!(Distances::new([(1.0, 0.0)]), None);
}

/// A plane that is moved along its normal lies that far away, whichever way it is inclined,
/// and upwards is positive.
#[test]
fn shifted_plane_deviates_by_the_shift() {
    let plane = square(7, |x, y| 0.3 * x - 0.2 * y);
    let normal = Vec3::new(-0.3, 0.2, 1.0).normalize();
    for d in [0.013, -0.013] {
        let found = deviation(
            &moved(square(5, |x, y| 0.3 * x - 0.2 * y), normal * d),
            &plane,
        );
        for value in [found.mean, found.min, found.max] {
            assert!((value - d).abs() < 1e-12, "{found:?}");
        }
        assert!((found.rms - 0.013).abs() < 1e-12 && (found.p95 - 0.013).abs() < 1e-12);
    }
}

/// What a shift leaves sideways of the border is not counted as height, but known.
#[test]
fn sideways_of_the_border_only_height_counts() {
    let sheet = Sheet::new(&square(4, |_, _| 0.0)).unwrap();
    let foot = sheet.foot(Vec3::new(0.8, 0.1, 0.4));
    assert!((foot.deviation - 0.4).abs() < 1e-12 && foot.is_beyond);
    assert!((foot.distance - 0.5).abs() < 1e-12);
    let foot = sheet.foot(Vec3::new(0.5, 0.1, -0.4));
    assert!((foot.deviation + 0.4).abs() < 1e-12 && !foot.is_beyond);
}

/// Concentric caps of radii R + d and R: d less than the facets' sagitta apart.
#[test]
fn concentric_caps_deviate_by_their_radii() {
    let (r, d) = (0.1, 0.004);
    for cells in [20, 40] {
        let found = deviation(&cap(r + d, 17), &cap(r, cells));
        // Half of the longest edge subtends this angle, the facets lie this deep.
        let half = 1.5 / 2f64.sqrt() / f64::from(cells);
        let sagitta = r * (1.0 - half.cos());
        // At the rim only what lies along the normal of the last facets counts.
        assert!(found.min > 0.98 * d && found.max < d + sagitta, "{found:?}");
        assert!((found.mean - d).abs() < sagitta);
    }
    // From the other side it is the same with the other sign.
    let found = deviation(&cap(r, 17), &cap(r + d, 40));
    assert!(found.max < -0.9 * d && found.min > -d - 1e-9, "{found:?}");
}

#[test]
fn ridges_and_their_ends_have_a_side() {
    // A roof, whose ridge is nearest to everything above it.
    let sheet = Sheet::new(&square(2, |x, _| -2.0 * x.abs())).unwrap();
    for y in [-0.2, 0.0, 0.2] {
        assert!((sheet.foot(Vec3::new(0.01, y, 0.3)).deviation - 0.3).abs() < 1e-3);
        assert!(sheet.foot(Vec3::new(0.01, y, -0.3)).deviation < 0.0);
    }
}

#[test]
fn what_cannot_be_measured_against_is_refused() {
    let mut mesh = square(3, |_, _| 0.0);
    // In a corner: two of its edges are border.
    mesh.triangles[4].swap(0, 1);
    let error = Sheet::new(&mesh).unwrap_err();
    assert_eq!(
        error,
        OrientationFault::Misoriented { edge_count: 1 }.into()
    );
    let mut mesh = square(3, |_, _| 0.0);
    mesh.triangles.push([
        mesh.triangles[4][1],
        mesh.triangles[4][2],
        mesh.triangles[4][0],
    ]);
    let error = Sheet::new(&mesh).unwrap_err();
    assert_eq!(error, OrientationFault::Duplicate { count: 1 }.into());
    let mut flat = square(3, |_, _| 0.0);
    for x in &mut flat.vertices {
        x.x = 0.0;
    }
    assert_eq!(Sheet::new(&flat).unwrap_err(), SheetError::Empty);
    assert_eq!(
        Sheet::new(&TriMesh::default()).unwrap_err(),
        SheetError::Empty
    );
}

/// Triangles without area neither hide their neighbours nor spoil the numbers.
#[test]
fn collapsed_triangles_are_passed_over() {
    let mut mesh = square(4, |_, _| 0.0);
    mesh.vertices[6] = mesh.vertices[7];
    let sheet = Sheet::new(&mesh).unwrap();
    for x in square(9, |_, _| 0.25).vertices {
        let foot = sheet.foot(x);
        assert!((foot.deviation - 0.25).abs() < 1e-12, "{foot:?}");
        assert!(foot.triangle < mesh.triangles.len());
    }
}

fn contours_apart(a: &TriMesh, b: &TriMesh) -> Option<ContourDeviation> {
    Contour::new(a)?.deviation(&Contour::new(b)?)
}

/// Holes say nothing about the outer contour, be they one or twelve cells, touch each other or the
/// border at a corner, or have a piece in them.
#[test]
fn holes_and_islands_are_no_contour() {
    let whole = square(20, |_, y| y * y);
    // From column, row to column, row; and the second triangle of a cell at the border.
    let holes = [[3, 4, 4, 5], [4, 5, 5, 6], [9, 8, 13, 11]];
    let (island, half) = ([10, 9, 11, 10], 35);
    let mut scan = whole.clone();
    let mut numbers = 0..;
    scan.triangles.retain(|_| {
        let t: usize = numbers.next().expect("without end");
        let (x, y) = (t / 2 % 20, t / 40);
        let is_in = |[x0, y0, x1, y1]: [usize; 4]| (x0..x1).contains(&x) && (y0..y1).contains(&y);
        t != half && (!holes.iter().any(|&hole| is_in(hole)) || is_in(island))
    });
    let contour = Contour::new(&scan).unwrap();
    assert_eq!((contour.holes.count, contour.piece_count), (4, 2));
    // A cell's width times the chord over rows.
    let row = |from: i32, to: i32| {
        let [a, b] = [from, to].map(|k| 0.05 * f64::from(k) - 0.5);
        0.05 * f64::hypot(b - a, b * b - a * a)
    };
    let exact = row(4, 5) + row(5, 6) + 4.0 * row(8, 11) + 0.5 * row(0, 1);
    let found = contour.holes.area;
    assert!((found - exact).abs() < 1e-12, "{found} for {exact}");
    let off = |a: &TriMesh, b: &TriMesh| contours_apart(a, b).unwrap().max;
    assert!(off(&scan, &whole) < 1e-15 && off(&whole, &scan) < 1e-15);
}

/// One side moves outwards by s. The opposite one moves inwards by s, but its ends stay nearer
/// to the sides across; of these a length s sticks out, which makes up for it.
#[test]
fn contour_of_a_shifted_square() {
    let s = 0.06;
    let a = moved(square(6, |_, _| 0.0), Vec3::new(s, 0.0, 0.0));
    let found = contours_apart(&a, &square(5, |_, _| 0.0)).unwrap();
    assert!((found.max - s).abs() < 1e-12);
    let mean = s / 2.0;
    assert!((found.mean / mean - 1.0).abs() < 1e-4, "{found:?}");
    let same = contours_apart(&a, &a).unwrap();
    assert!(same.max < 1e-15);
}

#[test]
fn closed_surfaces_have_no_contour() {
    let open = square(1, |_, _| 0.0);
    let mut closed = open.clone();
    closed
        .triangles
        .extend(open.triangles.iter().map(|&[a, b, c]| [a, c, b]));
    assert!(Contour::new(&closed).is_none() && Contour::new(&open).is_some());
}

/// Five waves of a known amplitude on a plane, much shorter than the cutoff.
#[test]
fn wrinkles_have_their_amplitude_and_number() {
    let amplitude = 0.004;
    let filter = WrinkleFilter {
        cutoff: 0.45,
        height: 0.001,
    };
    let mesh = square(60, |x, y| {
        0.1 * x + 0.2 * y + amplitude * (10.0 * PI * x).cos()
    });
    let found = wrinkles(&mesh, filter).unwrap();
    // Waves start and end in a trough: five crests between.
    assert_eq!(found.count, 5, "{found:?}");
    // Heights are measured across the inclined plane.
    let expected = amplitude / 1.05f64.sqrt();
    assert!((found.amplitude / expected - 1.0).abs() < 0.06, "{found:?}");
    let rms = expected / 2f64.sqrt();
    assert!((found.rms / rms - 1.0).abs() < 0.06, "{found:?}");
}

/// The filter passes half of a wave as long as the cutoff, and a paraboloid entirely.
#[test]
fn filter_cuts_where_it_says() {
    let wave = square(50, |x, _| 0.001 * (2.0 * PI * x / 0.25).cos());
    let middle = 25 * 51 + 25;
    let half = high_pass(&wave, 0.25)[middle];
    assert!((half / 0.001 - 0.5).abs() < 0.03, "{half}");
    let bowl = square(30, |x, y| 0.1 * x * x + 0.05 * x * y + 0.02 * y);
    let most = high_pass(&bowl, 0.2)
        .iter()
        .fold(0.0f64, |m, d| m.max(d.abs()));
    // The frame turns with the normal, so that a paraboloid stays one to third order.
    assert!(most < 2e-5, "{most}");
    let none = wrinkles(
        &bowl,
        WrinkleFilter {
            cutoff: 0.2,
            height: 0.001,
        },
    );
    assert_eq!(none.unwrap().count, 0);
}
