//! Directions and shear against closed forms, mapping on to other meshes, and files that hold all of it.

use drape_cloth::fabric::{BlankConfig, Drape, Lamina, Material};
use drape_cloth::math::Vec3;
use drape_cloth::mesh::TriMesh;
use drape_field::{Field, OntoError};

const CELL: f64 = 2e-3;
const RADIUS: f64 = 0.05;

fn lamina(yarn_angle_deg: f64, side_mm: f64) -> Lamina {
    let config = BlankConfig {
        size_mm: [side_mm; 2],
        cell_mm: Some(1e3 * CELL),
        yarn_angle_deg,
        ..BlankConfig::default()
    };
    Lamina::new(&config, Material::interglas_92125()).unwrap()
}

fn field(lamina: &Lamina, positions: &[Vec3], feet: &[Vec3]) -> Field {
    let positions: Vec<[f64; 3]> = positions.iter().map(|&x| x.into()).collect();
    let drape = Drape::new(lamina, &positions);
    Field::new(&drape, feet, lamina.cell(), 0.35e-3)
}

/// Any two orthogonal unit vectors.
fn plane() -> [Vec3; 2] {
    let along = Vec3::new(0.48, 0.6, 0.64);
    [along, along.cross(&Vec3::new(0.0, 0.8, -0.75)).normalize()]
}

/// A blank that is sheared by the same angle everywhere, in a plane anywhere: on cells along its sides, across them, and cut.
#[test]
fn an_affine_map_has_its_directions_and_its_shear() {
    let [p, q] = plane();
    for (yarn_angle_deg, degrees) in [(0.0, 30.0), (0.0, -20.0), (45.0, 50.0), (20.0, 10.0)] {
        let lamina = lamina(yarn_angle_deg, 20.0);
        let (sin, cos) = f64::to_radians(degrees).sin_cos();
        let [x, y] = lamina.warp;
        let weft = p * sin + q * cos;
        let place = |at: &[f64; 2]| {
            let (along, across) = (at[0] * x + at[1] * y, at[1] * x - at[0] * y);
            p * along + weft * across
        };
        let positions: Vec<Vec3> = lamina.rest.iter().map(place).collect();
        // On the tool, warps have nine tenths of their length.
        let short = |x: &Vec3| {
            let across = x.dot(&q) / cos;
            p * (0.9 * (x.dot(&p) - across * sin)) + weft * across
        };
        let feet: Vec<Vec3> = positions.iter().map(short).collect();
        let field = field(&lamina, &positions, &feet);
        assert_eq!(field.elements().count(), lamina.triangles.len());
        for (t, fibre) in field.elements() {
            assert!(
                (fibre.warp - p).norm() < 1e-9 && (fibre.weft - weft).norm() < 1e-9,
                "{t}"
            );
            assert!((fibre.shear_deg - degrees).abs() < 1e-9);
            assert!((fibre.thickness_factor - 1.0 / cos).abs() < 1e-12);
            assert!((fibre.surplus - 0.1 * CELL).abs() < 1e-12);
        }
        let summary = field.summary();
        assert!((summary.max_shear_deg - f64::abs(degrees)).abs() < 1e-9);
        assert!((summary.mean_shear_deg - f64::abs(degrees)).abs() < 1e-9);
        assert!((summary.mean_thickness_factor - 1.0 / cos).abs() < 1e-12);
        assert_eq!((summary.unmapped, summary.over_80_deg), (0, 0));
    }
}

/// Yarns without length and places that are no numbers have no fibres, and crushed cells a thickness that is finite.
#[test]
fn what_is_crushed_or_lost_is_told() {
    let lamina = lamina(0.0, 8.0);
    let place = |shear: f64| {
        let (sin, cos) = f64::to_radians(shear).sin_cos();
        let place = |&[x, y]: &[f64; 2]| Vec3::new(x + sin * y, cos * y, 0.0);
        lamina.rest.iter().map(place).collect::<Vec<_>>()
    };
    let crushed = place(89.0);
    let found = field(&lamina, &crushed, &crushed);
    let summary = found.summary();
    assert_eq!(summary.over_80_deg, lamina.triangles.len());
    assert!((summary.mean_thickness_factor - 1.0 / f64::to_radians(80.0).cos()).abs() < 1e-9);
    let flat = vec![Vec3::zeros(); lamina.vertex_count()];
    let lost = vec![Vec3::repeat(f64::NAN); lamina.vertex_count()];
    for positions in [flat, lost] {
        let summary = field(&lamina, &positions, &positions).summary();
        assert_eq!(summary.unmapped, lamina.triangles.len());
        assert_eq!(
            (summary.mean_shear_deg, summary.mean_thickness_factor),
            (0.0, 0.0)
        );
    }
}

/// Pins of a net on a sphere, `CELL` apart along both yarns, from two great circles that cross at the pole: each is the mirror
/// image of the one across its cell. Rows and columns from the pole.
fn fishnet(count: usize) -> Vec<Vec<Vec3>> {
    let step = 2.0 * (0.5 * CELL / RADIUS).asin();
    let on_circle = |k: usize, along: Vec3| {
        let (sin, cos) = (step * k as f64).sin_cos();
        (along * sin + Vec3::z() * cos) * RADIUS
    };
    let mut net = vec![vec![Vec3::zeros(); count]; count];
    net[0] = (0..count).map(|k| on_circle(k, Vec3::x())).collect();
    for (k, row) in net.iter_mut().enumerate() {
        row[0] = on_circle(k, Vec3::y());
    }
    for j in 1..count {
        for i in 1..count {
            let normal = net[j - 1][i].cross(&net[j][i - 1]).normalize();
            let across = net[j - 1][i - 1];
            net[j][i] = across - normal * (2.0 * normal.dot(&across));
        }
    }
    net
}

/// A blank that lies on the sphere as the net does.
fn draped() -> (Lamina, Field) {
    let lamina = lamina(0.0, 100.0);
    let net = fishnet(26);
    let place = |&[x, y]: &[f64; 2]| {
        let number = |x: f64| (x.abs() / CELL).round() as usize;
        let pin = net[number(y)][number(x)];
        Vec3::new(pin.x.copysign(x), pin.y.copysign(y), pin.z)
    };
    let positions: Vec<Vec3> = lamina.rest.iter().map(place).collect();
    let field = field(&lamina, &positions, &positions);
    (lamina, field)
}

/// Shear [rad] of the net of infinitely small cells where `t` = u v / R^2, u and v being the lengths along the yarns from the
/// two great circles: of gamma_uv = cos(gamma) / R^2 (Gauss's equation of a Chebyshev net on a sphere), with gamma = 0
/// along these, what depends on u v only. Then t g'' + g' = cos g, by Runge and Kutta's rule.
fn shear(t: f64) -> f64 {
    let slope = |t: f64, [g, s]: [f64; 2]| [s, (g.cos() - s) / t];
    let start = 1e-6f64;
    let (steps, mut y) = (200, [start, 1.0]);
    let h = (t.abs() - start).max(0.0) / f64::from(steps);
    let add = |y: [f64; 2], k: [f64; 2], h: f64| [y[0] + h * k[0], y[1] + h * k[1]];
    for n in 0..steps {
        let t = start + h * f64::from(n);
        let k1 = slope(t, y);
        let k2 = slope(t + h / 2.0, add(y, k1, h / 2.0));
        let k3 = slope(t + h / 2.0, add(y, k2, h / 2.0));
        let k4 = slope(t + h, add(y, k3, h));
        y = [0, 1].map(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    }
    y[0].copysign(t)
}

/// The field of a fishnet on a hemisphere has the shear of the smooth net, within a twentieth of a degree up to 52 degrees.
#[test]
fn shear_on_a_hemisphere_is_that_of_the_fishnet() {
    let (lamina, field) = draped();
    let mut greatest = 0.0f64;
    for (t, fibre) in field.elements() {
        // Of both halves of a cell: opposite angles of a rhombus are the same.
        let corners = lamina.triangles[t].map(|v| lamina.rest[v as usize]);
        let [u, v] = [0, 1].map(|k| {
            let all = corners.map(|x| x[k]);
            0.5 * (all.iter().fold(f64::MAX, |a, b| a.min(*b))
                + all.iter().fold(f64::MIN, |a, b| a.max(*b)))
        });
        let exact = shear(u * v / (RADIUS * RADIUS)).to_degrees();
        greatest = greatest.max(exact.abs());
        assert!(
            (fibre.shear_deg - exact).abs() < 0.05,
            "{} at {u}, {v}, exact {exact}",
            fibre.shear_deg
        );
        let factor = 1.0 / exact.to_radians().cos();
        assert!((fibre.thickness_factor / factor - 1.0).abs() < 0.002);
    }
    assert!(greatest > 52.0, "{greatest}");
}

/// Every triangle cut in four, with the new corners moved by `place`.
fn finer(mesh: &TriMesh, place: impl Fn(Vec3) -> Vec3) -> TriMesh {
    let mut fine = TriMesh::default();
    for t in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(t);
        let [ab, bc, ca] = [a + b, b + c, c + a].map(|sum| place(sum / 2.0));
        for corners in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
            let first = fine.vertices.len() as u32;
            fine.vertices.extend(corners);
            fine.triangles.push([first, first + 1, first + 2]);
        }
    }
    fine
}

/// On a finer mesh of the same surface, every element has what the triangle has in which it lies; on one of the sphere between
/// its pins, directions turn by no more than the plane does. Which side is up does not count.
#[test]
fn a_finer_mesh_has_the_same_fibres() {
    let (_, field) = draped();
    let fine = field.onto(finer(&field.mesh, |x| x), 1e-3).unwrap();
    for (t, fibre) in fine.elements() {
        let from = field.fibres[t / 4].unwrap();
        assert!((fibre.warp - from.warp).norm() < 1e-6 && (fibre.weft - from.weft).norm() < 1e-6);
        assert_eq!(
            [fibre.shear_deg, fibre.surplus],
            [from.shear_deg, from.surplus]
        );
    }
    assert_eq!(fine.summary().unmapped, 0);
    assert_eq!(fine.summary().elements, 4 * field.fibres.len());
    let mut mesh = finer(&field.mesh, |x| x.normalize() * RADIUS);
    let round = field.onto(mesh.clone(), 1e-3).unwrap();
    mesh.flip();
    let flipped = field.onto(mesh, 1e-3).unwrap();
    let mut mapped = 0;
    for (t, fibre) in round.elements() {
        let [a, b, c] = round.mesh.corners(t);
        let normal = (b - a).cross(&(c - a)).normalize();
        assert!(fibre.warp.dot(&normal).abs() < 1e-9 && fibre.weft.dot(&normal).abs() < 1e-9);
        assert!((fibre.warp.norm() - 1.0).abs() < 1e-12);
        let from = field.fibres[t / 4].unwrap();
        assert!(fibre.warp.angle(&from.warp).to_degrees() < 4.0, "{t}");
        let other = flipped.fibres[t].unwrap();
        assert!((other.warp - fibre.warp).norm() < 1e-12);
        mapped += 1;
    }
    // Beside the border there is nothing.
    assert!(mapped > round.fibres.len() * 95 / 100, "{mapped}");
}

/// Elements that are too far away or stand across have no fibres; where there is none at all, that is an error.
#[test]
fn elements_without_fabric_are_left_out() {
    let (_, field) = draped();
    let moved = |by: f64| {
        let mut mesh = field.mesh.clone();
        mesh.vertices.iter_mut().for_each(|x| *x *= by);
        mesh
    };
    assert!(field.onto(moved(1.05), 3e-3).unwrap().summary().unmapped < 1300);
    let error = field.onto(moved(1000.0), 3e-3).unwrap_err();
    assert!(
        matches!(error, OntoError::Nowhere { elements: 5000, .. }),
        "{error}"
    );
    let text = error.to_string();
    assert!(
        text.starts_with("none of its 5000 elements has fabric within 3 mm, the nearest is "),
        "{text}"
    );
    // A wall through the pole, and a plate on it.
    let mut mesh = TriMesh {
        vertices: vec![
            Vec3::new(0.0, 0.0, 0.049),
            Vec3::new(0.002, 0.0, 0.049),
            Vec3::new(0.001, 0.0, 0.052),
        ],
        triangles: vec![[0, 1, 2]],
    };
    assert!(matches!(
        field.onto(mesh.clone(), 3e-3),
        Err(OntoError::Nowhere { .. })
    ));
    mesh.vertices[2] = Vec3::new(0.001, 0.002, 0.049);
    mesh.triangles.push([0, 1, 2]);
    assert_eq!(field.onto(mesh, 3e-3).unwrap().elements().count(), 2);
}
