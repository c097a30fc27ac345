use super::*;
use crate::fabric::{BlankConfig, Material};
use crate::math::{Purpose, Stream};
use crate::sim::Parameters;
use crate::twin::pack::zeros;

fn sheet(angle: f64, membranes: bool) -> Lamina {
    let config = BlankConfig {
        size_mm: [20.0, 15.0],
        vertices: [5, 4],
        yarn_angle_deg: angle,
        ..BlankConfig::default()
    };
    let material = Material::interglas_92125();
    if membranes {
        Lamina::of_membranes(&config, material).unwrap()
    } else {
        Lamina::new(&config, material).unwrap()
    }
}

fn membranes(lamina: &Lamina) -> Membranes {
    Membranes::new(
        lamina,
        Laws::new(&lamina.material, true, &Parameters::default()),
    )
}

fn placed(lamina: &Lamina, at: impl Fn([f64; 2]) -> [f64; 3]) -> Field {
    let mut x = zeros(lamina.vertex_count());
    for (v, rest) in lamina.rest.iter().enumerate() {
        for (x, at) in x.iter_mut().zip(at(*rest)) {
            x[v] = at;
        }
    }
    x
}

#[test]
fn arc_sine_is_that_of_the_standard_library() {
    for k in 0..=2000 {
        let x = f64::from(k - 1000) / 1000.0;
        let found = asin(&[x; WIDTH])[3];
        assert!(
            (found - x.asin()).abs() <= 5e-16 * x.asin().abs(),
            "{x}: {found}"
        );
    }
}

/// Force = -dW/dx by central differences, on crumpled sheets with every branch of every law.
#[test]
fn forces_are_the_slope_of_the_energy() {
    let mut stream = Stream::new(5, Purpose::Evaluation, 0);
    for (angle, of_membranes) in [(0.0, false), (30.0, true), (20.0, false)] {
        let lamina = sheet(angle, of_membranes);
        let membranes = membranes(&lamina);
        let mut x = placed(&lamina, |[u, v]| {
            [1.02 * u + 0.4 * v, 0.97 * v, 2.0 * u * v / 0.01]
        });
        for axis in &mut x {
            for x in axis.iter_mut().take(lamina.vertex_count()) {
                *x += 4e-4 * (stream.uniform() - 0.5);
            }
        }
        let mut f = zeros(lamina.vertex_count());
        membranes.add_elastic_forces(&x, &mut f);
        let total = |x: &Field| membranes.energy(x).iter().sum::<f64>();
        let size = f.iter().flatten().fold(0.0f64, |most, f| most.max(f.abs()));
        for v in 0..lamina.vertex_count() {
            for axis in 0..3 {
                let h = 1e-9;
                let at = |step: f64| {
                    let mut x = x.clone();
                    x[axis][v] += step;
                    total(&x)
                };
                let slope = (at(h) - at(-h)) / (2.0 * h);
                let off = (slope + f[axis][v]).abs();
                assert!(off < 2e-6 * size, "{} is not {slope}", -f[axis][v]);
            }
        }
    }
}

/// A homogeneous deformation has its strains in every triangle, whatever the mesh.
#[test]
fn strains_are_those_of_the_deformation() {
    for (angle, of_membranes) in [(0.0, false), (25.0, true), (90.0, true), (70.0, false)] {
        let lamina = sheet(angle, of_membranes);
        let (sin, cos) = f64::to_radians(angle).sin_cos();
        let gamma: f64 = 0.3;
        // Warp stays, weft turns towards it by gamma; stretched by 1 % and 2 %.
        let x = placed(&lamina, |[x, y]| {
            let (along, across) = (x * cos + y * sin, y * cos - x * sin);
            [
                1.01 * along + 1.02 * across * gamma.sin(),
                0.0,
                1.02 * across * gamma.cos(),
            ]
        });
        for some in membranes(&lamina).triangles {
            let columns = some.columns(&x);
            let shear = asin(&columns.sine);
            let used = some.block.elements.len();
            let [warp, weft] = columns.strain;
            for (found, expected) in [(warp, 0.01), (weft, 0.02), (shear, gamma)] {
                assert!(found[..used].iter().all(|x| (x - expected).abs() < 1e-12));
            }
        }
    }
}

/// Force per width on a homogeneously stretched sheet is Table 2's, within round-off.
#[test]
fn uniaxial_force_per_width_is_that_of_table_2() {
    let cases = [
        (0, 0.005, 1050.0),
        (0, 0.02, 14_000.0),
        (1, 0.006, 1750.0),
        (1, 0.025, 21_000.0),
    ];
    for (angle, of_membranes) in [(0.0, false), (0.0, true)] {
        let lamina = sheet(angle, of_membranes);
        for (family, strain, expected) in cases {
            let mut stretch = [1.0; 2];
            stretch[family] += strain;
            let x = placed(&lamina, |r| [r[0] * stretch[0], r[1] * stretch[1], 0.0]);
            let mut f = zeros(lamina.vertex_count());
            membranes(&lamina).add_elastic_forces(&x, &mut f);
            let end = [0.010, 0.0075][family];
            let pull: f64 = (0..lamina.vertex_count())
                .filter(|&v| lamina.rest[v][family] > end - 1e-9)
                .map(|v| -f[family][v])
                .sum();
            let width = [0.015, 0.020][family];
            let found = pull / width;
            assert!(
                (found / expected - 1.0).abs() < 1e-9,
                "{found} is not {expected}"
            );
        }
    }
}

/// Pure shear of a picture frame: inextensible yarns, energy G t A gamma^2 / 2, beyond locking at
/// 0.7 more by 19 G t A (gamma - 0.7)^2 / 2, and nothing in the yarns.
#[test]
fn picture_frame_has_the_energy_of_shear() {
    for (of_membranes, angle) in [(false, 0.0), (true, 45.0)] {
        let lamina = sheet(angle, of_membranes);
        let (sin, cos) = f64::to_radians(angle).sin_cos();
        for (gamma, modulus) in [
            (0.31_f64, 50_000.0),
            (-0.31, 36_000.0),
            (0.9, 50_000.0),
            (-1.3, 36_000.0),
        ] {
            let half = 0.5 * gamma;
            let x = placed(&lamina, |[x, y]| {
                let (a, b) = (x * cos + y * sin, y * cos - x * sin);
                [
                    a * half.cos() + b * half.sin(),
                    a * half.sin() + b * half.cos(),
                    0.0,
                ]
            });
            let [stretch, shear] = membranes(&lamina).energy(&x);
            let square = gamma * gamma + 19.0 * (gamma.abs() - 0.7).max(0.0).powi(2);
            let expected = 0.5 * modulus * square * 0.35e-3 * lamina.area();
            assert!(
                (shear / expected - 1.0).abs() < 1e-9,
                "{shear} is not {expected}"
            );
            assert!(stretch < 1e-18, "{stretch}");
        }
    }
}

/// Where yarns have turned on to each other forces stay finite.
#[test]
fn degenerate_triangles_have_finite_forces() {
    let lamina = sheet(0.0, false);
    let mut membranes = membranes(&lamina);
    for at in [
        |_: [f64; 2]| [0.0; 3],
        |[x, y]: [f64; 2]| [x + y, 0.0, 0.0],
        |[x, y]: [f64; 2]| [x, -y, 0.0],
    ] {
        let x = placed(&lamina, at);
        let mut f = zeros(lamina.vertex_count());
        let pass = membranes.add_forces(&x, &mut f, Some(0.5));
        assert!(f.iter().flatten().all(|f| f.is_finite()));
        assert!(pass.dissipated.is_finite());
    }
}
