use super::*;
use std::f64::consts::PI;

/// Triangle soup: each three points are one triangle.
fn soup(points: &[[f64; 3]]) -> TriMesh {
    let count = points.len() as u32;
    TriMesh {
        vertices: points.iter().map(|&p| p.into()).collect(),
        triangles: (0..count / 3)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect(),
    }
}

fn sphere(radius: f64, rings: u32) -> TriMesh {
    let mut mesh = TriMesh::default();
    for i in 0..=rings {
        for j in 0..2 * rings {
            let theta = PI * f64::from(i) / f64::from(rings);
            let phi = PI * f64::from(j) / f64::from(rings);
            let ring = Vec3::new(phi.cos(), phi.sin(), 0.0) * theta.sin();
            mesh.vertices
                .push(radius * (ring + Vec3::z() * theta.cos()));
        }
    }
    for i in 0..rings {
        for j in 0..2 * rings {
            let at = |i: u32, j: u32| i * 2 * rings + j % (2 * rings);
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// From above at 100 pixels per metre: the margin leaves 92 % of 200 pixels for 1.84 m.
fn camera() -> Camera {
    Camera::top((Vec3::repeat(-0.92), Vec3::repeat(0.92)))
}

const SIDE: usize = 200;

/// The pixel that shows (x, y) [m].
fn pixel(image: &Image, x: f64, y: f64) -> Color {
    let [column, row] = [100.0 + 100.0 * x, 100.0 - 100.0 * y];
    image.pixels[row as usize * image.width + column as usize]
}

fn empty() -> Drawing {
    Drawing::new(&camera(), [SIDE; 2])
}

fn dark() -> Drawing {
    let mut drawing = empty();
    drawing.samples.pixels.fill([0; 3]);
    drawing
}

fn white(mesh: &TriMesh) -> Image {
    let mut scene = dark();
    scene.mesh(mesh, |_| [255; 3], 0.0);
    scene.image()
}

/// Area that is not black, in pixels; a pixel at an edge counts as its brightness. `full`
/// is the colour of a pixel that is covered.
fn covered(image: &Image, full: Color) -> f64 {
    let share = |pixel: &Color| f64::from(pixel[0]) / f64::from(full[0]);
    image.pixels.iter().map(share).sum()
}

#[test]
fn triangle_covers_its_area() {
    let points = [[-0.71, -0.63, 0.0], [0.83, -0.22, 0.0], [-0.13, 0.78, 0.0]];
    let image = white(&soup(&points));
    // Half of |(1.54, 0.41) x (0.58, 1.41)| = 0.9668 m², at 10 000 px/m².
    let area = covered(&image, pixel(&image, 0.0, 0.0));
    assert!((area - 9668.0).abs() < 10.0, "{area} pixels");
}

#[test]
fn neighbours_share_no_sample_and_leave_none_out() {
    // A fan around an odd point: every sample of the square is seen exactly once, so the
    // square is covered evenly; a gap would be black, a double hit is excluded by the sum.
    let corners = [[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]];
    let fan = |from: usize| {
        let [a, b] = [corners[from], corners[(from + 1) % 4]];
        [[a[0], a[1], 0.0], [b[0], b[1], 0.0], [0.1234, -0.3217, 0.0]]
    };
    let whole = white(&soup(&[fan(0), fan(1), fan(2), fan(3)].concat()));
    let area = |image: &Image| covered(image, pixel(&whole, 0.0, 0.0));
    let parts: f64 = (0..4).map(|i| area(&white(&soup(&fan(i))))).sum();
    assert!((area(&whole) - 180.0 * 180.0).abs() < 1e-6);
    // A pixel is rounded to 1/225 of its brightness.
    assert!((parts - area(&whole)).abs() < 5.0, "{parts} pixels");
}

#[test]
fn sphere_has_the_silhouette_of_a_disc() {
    let ball = sphere(0.8, 60);
    let image = white(&ball);
    let seen = image.pixels.iter().filter(|p| p[0] > 0).count() as f64;
    // π 80² = 20 106 pixels. A pixel at the rim counts when one of its samples is hit,
    // which adds up to half a pixel all around: 251.
    assert!((seen - 20_106.0 - 125.0).abs() < 140.0, "{seen} pixels");
}

#[test]
fn the_nearer_triangle_hides_the_farther_one_in_any_order() {
    let low = soup(&[[-0.9, -0.9, 0.0], [0.9, -0.9, 0.0], [0.0, 0.9, 0.0]]);
    let high = soup(&[[-0.5, -0.5, 0.3], [0.5, -0.5, 0.3], [0.0, 0.5, 0.3]]);
    let (red, blue) = ([200, 0, 0], [0, 0, 200]);
    for order in [[(&low, red), (&high, blue)], [(&high, blue), (&low, red)]] {
        let mut scene = empty();
        for (mesh, color) in order {
            scene.mesh(mesh, |_| color, 0.0);
        }
        let image = scene.image();
        let [inside, outside] = [pixel(&image, 0.0, 0.0), pixel(&image, 0.0, -0.8)];
        assert!(inside[0] == 0 && inside[2] > 100, "{inside:?}");
        assert!(outside[2] == 0 && outside[0] > 100, "{outside:?}");
    }
}

#[test]
fn triangles_that_cross_part_at_their_crossing() {
    // Two planes z = ±x over the same square meet at x = 0.
    let plane = |k: f64| {
        let p = |x: f64, y: f64| [x, y, k * x];
        let [a, b, c, d] = [p(-0.9, -0.9), p(0.9, -0.9), p(0.9, 0.9), p(-0.9, 0.9)];
        soup(&[a, b, c, a, c, d])
    };
    let (rising, falling) = (plane(1.0), plane(-1.0));
    let mut scene = empty();
    scene.mesh(&rising, |_| [200, 0, 0], 0.0);
    scene.mesh(&falling, |_| [0, 0, 200], 0.0);
    let image = scene.image();
    for i in 0..160 {
        let y = -0.8 + 0.01 * f64::from(i) + 0.005;
        assert_eq!(pixel(&image, 0.015, y)[2], 0);
        assert_eq!(pixel(&image, -0.015, y)[0], 0);
    }
}

#[test]
fn depth_bias_decides_between_equals() {
    let mesh = soup(&[[-0.9, -0.9, 0.0], [0.9, -0.9, 0.0], [0.0, 0.9, 0.0]]);
    for (bias, seen) in [(0.001, 2), (-0.001, 0)] {
        let mut scene = empty();
        scene.mesh(&mesh, |_| [200, 0, 0], 0.0);
        scene.mesh(&mesh, |_| [0, 0, 200], bias);
        let image = scene.image();
        assert!(pixel(&image, 0.0, 0.0)[seen] > 100);
        assert_eq!(pixel(&image, 0.0, 0.0)[2 - seen], 0);
    }
}

#[test]
fn colors_are_mixed_by_barycentric_coordinates() {
    let points = [[-0.9, -0.9, 0.0], [0.9, -0.9, 0.0], [-0.9, 0.9, 0.0]];
    let colors = [[250, 0, 0], [0, 250, 0], [0, 0, 250]];
    let mut scene = dark();
    scene.mesh(&soup(&points), |v| colors[v], 0.0);
    let image = scene.image();
    let brightness = light([0.0, 0.0, 1.0]);
    for (x, y) in [(-0.5, -0.5), (0.1, -0.4), (-0.8, 0.2), (-0.3, 0.1)] {
        let (x, y) = (x + 0.005, y - 0.005);
        let [u, v] = [(x + 0.9) / 1.8, (y + 0.9) / 1.8];
        let expected = [1.0 - u - v, u, v].map(|w| w as f32 * 250.0 * brightness);
        let found = pixel(&image, x, y);
        for c in 0..3 {
            assert!(
                (f32::from(found[c]) - expected[c]).abs() <= 1.0,
                "{found:?} {expected:?}"
            );
        }
    }
}

#[test]
fn cloth_looks_the_same_from_behind() {
    let front = soup(&[[-0.9, -0.9, 0.0], [0.9, -0.9, 0.5], [0.0, 0.9, 0.0]]);
    let mut back = front.clone();
    back.triangles[0].swap(0, 1);
    assert!(white(&front) == white(&back));
}

#[test]
fn light_comes_from_the_upper_left_and_never_goes_out() {
    let unit = KEY_LIGHT.iter().map(|x| x * x).sum::<f32>();
    assert!((unit - 1.0).abs() < 1e-6);
    assert!((light(KEY_LIGHT) - 1.0).abs() < 1e-6);
    assert!((light(KEY_LIGHT.map(|x| -3.0 * x)) - AMBIENT).abs() < 1e-6);
    assert_eq!(light([0.0; 3]), AMBIENT);
    let ball = white(&sphere(0.8, 40));
    assert!(pixel(&ball, -0.4, 0.4)[0] > pixel(&ball, 0.4, -0.4)[0] + 40);
}

#[test]
fn empty_and_degenerate_scenes_show_the_background() {
    let image = Drawing::new(&camera(), [8, 6]).image();
    assert!(image == Image::new(8, 6, BACKGROUND));
    assert!(Drawing::new(&camera(), [0, 0]).image() == Image::new(0, 0, BACKGROUND));

    let nan = f64::NAN;
    let degenerate = soup(
        &[
            [[0.1, 0.2, 0.0]; 3],
            [[-0.5, -0.5, 0.0], [0.0, 0.0, 0.0], [0.5, 0.5, 0.0]],
            [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, nan, 0.0]],
            [[-0.5, 0.0, 0.0], [0.5, 0.0, nan], [0.0, 0.5, 0.0]],
            [[-0.5, 0.0, 0.0], [f64::INFINITY, 0.0, 0.0], [0.0, 0.5, 0.0]],
            // Seen edge-on from above.
            [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5]],
        ]
        .concat(),
    );
    assert!(white(&degenerate) == Image::new(SIDE, SIDE, [0; 3]));
}

#[test]
fn triangles_beyond_the_edges_are_cut_there() {
    let huge = soup(&[
        [-900.0, -900.0, 0.0],
        [900.0, -900.0, 0.0],
        [0.0, 900.0, 0.0],
    ]);
    let image = white(&huge);
    let middle = pixel(&image, 0.0, 0.0);
    assert!(middle[0] > 0 && image.pixels.iter().all(|&p| p == middle));
    let aside = soup(&[[5.0, 5.0, 0.0], [6.0, 5.0, 0.0], [5.0, 6.0, 0.0]]);
    assert!(white(&aside) == Image::new(SIDE, SIDE, [0; 3]));
}

#[test]
fn marks_have_their_size_and_hide_behind_what_is_nearer() {
    let mut scene = dark();
    scene.disc(Vec3::zeros(), 20.0, [200; 3]);
    let area = covered(&scene.image(), [200; 3]);
    assert!((area - 400.0 * PI).abs() < 8.0, "{area} pixels");

    let line = |scene: &mut Drawing| {
        let points = [Vec3::x() * -0.5, Vec3::x() * 0.5, Vec3::repeat(f64::NAN)];
        scene.line(&points, 8.0, [200; 3]);
    };
    let mut scene = dark();
    line(&mut scene);
    // 100 pixels long, 8 wide, with a half disc at each end.
    let area = covered(&scene.image(), [200; 3]);
    assert!((area - 800.0 - 16.0 * PI).abs() < 8.0, "{area} pixels");

    for (height, seen) in [(2.0 * MARK_BIAS, 0), (0.5 * MARK_BIAS, 200)] {
        let z = f64::from(height);
        let roof = soup(&[[-0.9, -0.9, z], [0.9, -0.9, z], [0.0, 0.9, z]]);
        let mut scene = dark();
        line(&mut scene);
        scene.mesh(&roof, |_| [0, 100, 0], 0.0);
        assert_eq!(pixel(&scene.image(), 0.0, 0.0)[0], seen);
    }
}

#[test]
fn path_has_a_disc_per_point_and_a_larger_one_at_its_end() {
    let mut scene = empty();
    scene.path(&[vec![Vec3::x() * -0.5, Vec3::x() * 0.5]], [250, 240, 80]);
    let image = scene.image();
    let rows = |x: f64| {
        let column = (100.0 + 100.0 * x) as usize;
        let lit = |row: &usize| image.pixels[row * SIDE + column] == [250, 240, 80];
        (0..SIDE).filter(lit).count()
    };
    let [first, between, last] = [-0.5, 0.0, 0.495].map(rows);
    assert!(between < first && first < last, "{between} {first} {last}");
}

#[test]
fn jump_is_thinner_than_a_stroke() {
    let light = |strokes: &[Vec<Vec3>]| {
        let mut scene = empty();
        scene.path(strokes, [250, 240, 80]);
        let image = scene.image();
        let background = empty().image();
        let of = |row: usize| {
            let pixel = |image: &Image| u32::from(image.pixels[row * SIDE + 100][0]);
            pixel(&image) - pixel(&background)
        };
        (0..SIDE).map(of).sum::<u32>()
    };
    let [from, to] = [Vec3::x() * -0.5, Vec3::x() * 0.5];
    let (stroke, jump) = (light(&[vec![from, to]]), light(&[vec![from], vec![to]]));
    assert!(0 < jump && 2 * jump <= stroke, "{jump} {stroke}");
}
