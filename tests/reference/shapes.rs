//! Shapes at rest.

use super::*;

/// Drop and reach of the tip of a heavy strip clamped level, over its free length.
///
/// The first edge is the clamp. Curvature sits at vertices and stands for half an edge on
/// either side, so the free length counts from the middle of that edge to half an edge short
/// of nothing: `edges - 1/2` edges.
fn cantilever(family: Family, gamma: f64, edges: usize) -> [f64; 2] {
    let free = 0.2;
    let edge = free / (edges as f64 - 0.5);
    let strip = strip(family, edge * edges as f64, edges);
    let stiffness = AREAL_MASS * GRAVITY * free.powi(3) / gamma;
    let config = TwinConfig {
        bending_stiffness: BendingStiffness::NewtonMetre(stiffness),
        viscosity: 0.1,
        ..bare()
    };
    let mut twin = Twin::new(&strip, &config).unwrap();
    let s = along(&strip);
    for (v, s) in s.iter().enumerate() {
        if *s < 1.5 * edge {
            twin.fix(v as u32);
        }
    }
    let relaxed = twin.relax(None, 1e-6, 6.0).unwrap();
    assert!(relaxed.is_at_rest, "{relaxed:?}");
    let middle = |at: f64| {
        let near = (0..s.len()).filter(|&v| (s[v] - at).abs() < 1e-9);
        let x: Vec<[f64; 3]> = near.map(|v| twin.position(v as u32)).collect();
        let axis = usize::from(strip.rows > strip.columns);
        [x[0][axis] + x[1][axis], x[0][2] + x[1][2]].map(|sum| 0.5 * sum)
    };
    let (clamp, tip) = (middle(0.0), middle(edge * edges as f64));
    [-tip[1] / free, (tip[0] - clamp[0] - 0.5 * edge) / free]
}

/// The heavy elastica theta'' = -Gamma (1 - s) cos theta at Gamma = 8.
#[test]
fn cantilever_hangs_as_the_elastica_and_converges() {
    let (drop, reach) = (0.64063, 0.72442);
    for family in [Family::Warp, Family::Weft] {
        let errors = [8, 16].map(|edges| {
            let [found_drop, found_reach] = cantilever(family, 8.0, edges);
            (found_drop / drop - 1.0)
                .abs()
                .max((found_reach / reach - 1.0).abs())
        });
        assert!(errors[1] < 0.01, "{errors:?}");
        let order = (errors[0] / errors[1]).log2();
        assert!((1.5..2.6).contains(&order), "order {order} of {errors:?}");
    }
}

/// Mean strain rho g L / (2 E h) of a strip that hangs, and the pull at its clamp.
#[test]
fn hanging_strip_has_the_stiffness_of_table_2() {
    for (family, modulus) in [(Family::Warp, 600e6), (Family::Weft, 5e6 / 0.006)] {
        let (length, edges, gravity) = (0.37, 16, 200.0 * GRAVITY);
        let strip = strip(family, length, edges);
        let config = TwinConfig {
            gravity,
            viscosity: 0.1,
            ..bare()
        };
        let mut twin = Twin::new(&strip, &config).unwrap();
        let s = along(&strip);
        let width = length / edges as f64;
        let hung: Vec<[f64; 3]> = (s.iter().zip(&strip.rest))
            .map(|(s, rest)| [rest[usize::from(strip.rows <= strip.columns)], 0.0, -s])
            .collect();
        twin.set_positions(&hung);
        let top: Vec<u32> = (0..s.len() as u32)
            .filter(|&v| s[v as usize] < 1e-9)
            .collect();
        for &v in &top {
            twin.fix(v);
        }
        let relaxed = twin.relax(None, 1e-9, 1.0).unwrap();
        assert!(relaxed.is_at_rest, "{relaxed:?}");
        let weight = AREAL_MASS * gravity * length * width;
        close(-twin.pull(&top)[2], weight, 1e-4);
        let tip = (0..s.len()).filter(|&v| (s[v] - length).abs() < 1e-9);
        let way = tip
            .map(|v| -twin.position(v as u32)[2] - length)
            .sum::<f64>()
            / 2.0;
        let strain = AREAL_MASS * gravity * length / (2.0 * modulus * 0.35e-3);
        close(way / length, strain, 2e-3);
    }
}

/// A +-45 degree strip between clamps: force against the closed form for a linear shear law,
/// F = sqrt2 G h gamma (W L - 1.25 W^2) / (D0 sin(pi/4 - gamma/2)).
#[test]
fn bias_extension_has_the_force_of_the_closed_form() {
    let (length, width) = (0.170, 0.050);
    let config = BlankConfig {
        size_mm: [1e3 * length, 1e3 * width],
        cell_mm: Some(10.0 / 2f64.sqrt()),
        yarn_angle_deg: -45.0,
        mass: MassModel::Datasheet,
        ..BlankConfig::default()
    };
    let lamina = Lamina::new(&config, Material::interglas_92125()).unwrap();
    let config = TwinConfig {
        gravity: 0.0,
        bending_stiffness: BendingStiffness::NewtonMetre(0.0),
        viscosity: 0.1,
        ..bare()
    };
    let mut twin = Twin::new(&lamina, &config).unwrap();
    let end = |sign: f64| -> Vec<u32> {
        let at_end = |v: &u32| sign * lamina.rest[*v as usize][0] > 0.5 * length - 1e-6;
        (0..lamina.vertex_count() as u32).filter(at_end).collect()
    };
    let [left, right] = [-1.0, 1.0].map(end);
    for &v in &left {
        twin.fix(v);
    }
    let d0 = length - width;
    for (way, expected) in [(0.010, 0.301), (0.020, 0.725)] {
        for &v in &right {
            twin.drive(v, [1.0, 0.0, 0.0]);
        }
        twin.advance(None, 0.010).unwrap();
        for &v in &right {
            twin.fix(v);
        }
        eprintln!("{:?}", twin.relax(None, 1e-7, 2.0).unwrap());
        let found = -twin.pull(&right)[0];
        let gamma = std::f64::consts::FRAC_PI_2 - 2.0 * ((d0 + way) / (2f64.sqrt() * d0)).acos();
        let middle = (lamina.triangles.iter().zip(twin.strains()))
            .min_by(|a, b| {
                let square = |t: &[u32; 3]| {
                    let c = t.map(|v| lamina.rest[v as usize]);
                    let [x, y] = [0, 1].map(|k| c.iter().map(|c| c[k]).sum::<f64>());
                    x * x + y * y
                };
                square(a.0).total_cmp(&square(b.0))
            })
            .unwrap();
        eprintln!(
            "{way}: {found} N for {expected}, {} for {gamma}",
            middle.1.shear
        );
        close(middle.1.shear.abs(), gamma, 0.05);
        close(found, expected, 0.15);
    }
}
