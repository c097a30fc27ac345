//! Shapes at rest.

use super::*;
use drape_cloth::tool::Cylinder;

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
        bending_stiffness: Some([stiffness; 2]),
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
    assert!(twin.relax(None, 1e-6, 6.0).unwrap());
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
        assert!(twin.relax(None, 1e-9, 1.0).unwrap());
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

/// Force of a +-45 degree strip between clamps, and the rest of that search.
fn bias_extension(cell_diagonal: f64) -> [f64; 2] {
    let (length, width) = (0.170, 0.050);
    let config = BlankConfig {
        size_mm: [1e3 * length, 1e3 * width],
        cell_mm: Some(1e3 * cell_diagonal / 2f64.sqrt()),
        yarn_angle_deg: -45.0,
        mass: MassModel::Datasheet,
        ..BlankConfig::default()
    };
    let lamina = Lamina::new(&config, Material::interglas_92125()).unwrap();
    let config = TwinConfig {
        gravity: 0.0,
        bending_stiffness: Some([0.0; 2]),
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
    [0.010, 0.010].map(|way| {
        for &v in &right {
            twin.drive(v, [1.0, 0.0, 0.0]);
        }
        twin.advance(None, way).unwrap();
        for &v in &right {
            twin.fix(v);
        }
        assert!(twin.relax(None, 1e-6, 4.0).unwrap());
        -twin.pull(&right)[0]
    })
}

/// F = sqrt2 G h gamma (W L - 1.25 W^2) / (D0 sin(pi/4 - gamma/2)) for a linear shear law. It
/// supposes zones of even shear. The cloth is free to shear unevenly in the middle, as it does
/// (0.146 instead of 0.175 rad in the centre after 10 mm), so its force is a little less.
#[test]
fn bias_extension_has_the_force_of_the_closed_form() {
    for (found, expected) in bias_extension(0.010).into_iter().zip([0.301, 0.725]) {
        let share = found / expected;
        assert!((0.96..1.0).contains(&share), "{found} N for {expected} N");
    }
}

/// A heavy strip of length 2 R, clamped at the crown of a frictionless cylinder, lifts off it:
/// the tip from the axis, over R, for w R^3 / D = 2.
#[test]
fn strip_on_a_cylinder_lifts_off_to_its_tip() {
    let radius = 0.1;
    let cylinder = Cylinder {
        radius_mm: 1e3 * radius,
        length_mm: 100.0,
        segment_count: 512,
        ..Cylinder::default()
    };
    let cylinder = tool(Shape::Cylinder(cylinder), 2.0);
    let edges = 24;
    let edge = 2.0 * radius / (edges as f64 - 0.5);
    let strip = strip(Family::Weft, edge * edges as f64, edges);
    let config = TwinConfig {
        bending_stiffness: Some([AREAL_MASS * GRAVITY * radius.powi(3) / 2.0; 2]),
        viscosity: 0.1,
        ..bare()
    };
    let mut twin = Twin::new(&strip, &config).unwrap();
    let s: Vec<f64> = along(&strip).iter().map(|s| s - 0.5 * edge).collect();
    // Wound on, then let go: it comes to its place from the inner side.
    let wound: Vec<[f64; 3]> = (s.iter().zip(&strip.rest))
        .map(|(&s, rest)| {
            if s < edge {
                return [rest[0], s, radius];
            }
            let (sin, cos) = (s / radius).sin_cos();
            [rest[0], radius * sin, radius * cos + 1e-4]
        })
        .collect();
    twin.set_positions(&wound);
    for (v, s) in s.iter().enumerate() {
        if *s < edge {
            twin.fix(v as u32);
        }
    }
    assert!(twin.relax(Some(&cylinder), 1e-6, 6.0).unwrap());
    let tips = (0..s.len()).filter(|&v| s[v] > 2.0 * radius - 1e-9);
    let mut found = [0.0; 2];
    for v in tips {
        let x = twin.position(v as u32);
        found[0] += 0.5 * x[1] / radius;
        found[1] += 0.5 * x[2] / radius;
    }
    for (found, expected) in found.into_iter().zip([1.34870, -0.31890]) {
        assert!((found - expected).abs() < 0.01, "{found} is not {expected}");
    }
}
