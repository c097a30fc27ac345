use super::*;
use crate::math::{Purpose, Stream, Vec3};
use crate::sim::model::EdgeLaw;

fn close(found: Vec3x<f64>, expected: Vec3, tolerance: f64) {
    let off = (Vec3::from(found.0) - expected).norm();
    assert!(
        off <= tolerance,
        "{:?} is not {expected:?}: {off:e}",
        found.0
    );
}

fn random_vector(stream: &mut Stream) -> Vec3 {
    Vec3::from_fn(|_, _| stream.normal())
}

#[test]
fn arc_tangent_keeps_its_bound() {
    let mut worst = 0.0f64;
    // Evenly in the angle, and densely where the polynomial is reflected.
    for i in 0..=200_000 {
        let angle = std::f64::consts::FRAC_PI_2 * f64::from(i) / 200_001.0;
        worst = worst.max((arc_tangent(angle.tan()) - angle).abs());
        let t = 1.0 + (f64::from(i) - 1e5) * 1e-9;
        worst = worst.max((arc_tangent(t) - t.atan()).abs());
    }
    assert!(worst < 2e-6, "{worst:e}");
    assert_eq!(arc_tangent(0.0f64), 0.0);
    let infinite = arc_tangent(f32::INFINITY);
    assert!((infinite - std::f32::consts::FRAC_PI_2).abs() < 2e-6);
}

fn pair(rest_length: f64) -> EdgeClass {
    EdgeClass {
        vertices: vec![[0, 1]],
        rest_length: vec![rest_length],
        law: vec![EdgeLaw {
            tension: 1.0,
            compression: 3.0,
        }],
    }
}

/// An edge of length 5 along (0.6, 0.8), mobility 1 and 3.
#[test]
fn edge_moves_as_worked_by_hand() {
    let start = [[0.0; 3], [3.0, 4.0, 0.0]].map(Vec3x);
    // C = 1, compliance 1: lambda = -1 / (1 + 3 + 1).
    let mut x = start;
    project_edges(&pair(4.0), &mut x, &[1.0, 3.0]);
    close(x[0], Vec3::new(0.12, 0.16, 0.0), 1e-15);
    close(x[1], Vec3::new(2.64, 3.52, 0.0), 1e-15);
    // C = -1, compliance 3: lambda = 1 / (1 + 3 + 3).
    let mut x = start;
    project_edges(&pair(6.0), &mut x, &[1.0, 3.0]);
    close(x[0], Vec3::new(-0.6 / 7.0, -0.8 / 7.0, 0.0), 1e-15);
    close(
        x[1],
        Vec3::new(3.0 + 1.8 / 7.0, 4.0 + 2.4 / 7.0, 0.0),
        1e-15,
    );
    // Pinned or collapsed edges do not move.
    for (x, w) in [(start, [0.0; 2]), ([Vec3x([1.0; 3]); 2], [1.0, 3.0])] {
        let mut moved = x;
        project_edges(&pair(4.0), &mut moved, &w);
        assert_eq!(moved.map(|x| x.0), x.map(|x| x.0));
    }
}

/// Beyond its limit of 0.5 N an edge of compliance 1 has compliance 0.25 or 4: C = 0.5 + 0.25
/// (f - 0.5), or 0.5 + 4 (f - 0.5). Mobilities 1 and 3: f = (C - offset) / (4 + compliance).
#[test]
fn limited_edge_moves_as_worked_by_hand() {
    let start = [[0.0; 3], [3.0, 4.0, 0.0]].map(Vec3x);
    let force = |rest: f64, compliance: f64| -> f64 {
        let limit = Limit {
            force: 0.5,
            compliance,
            offset: 0.5 - 0.5 * compliance,
        };
        let mut x = start;
        project_limited_edges(&pair(rest), &[limit], &mut x, &[1.0, 3.0]);
        x[0].0[0] / 0.6
    };
    for (rest, compliance, expected) in [
        // C = 5 - 0.375 = 4.625 over 4.25, C = 5 + 1.5 over 8.
        (0.0, 0.25, 4.625 / 4.25),
        (0.0, 4.0, 6.5 / 8.0),
        // Within the limit, and compressed.
        (4.0, 0.25, 0.2),
        (4.0, 4.0, 0.2),
        (6.0, 0.25, -1.0 / 7.0),
        (6.0, 4.0, -1.0 / 7.0),
    ] {
        let found = force(rest, compliance);
        assert!(
            (found - expected).abs() < 1e-14,
            "{found} is not {expected}"
        );
    }
}

/// C = (0, 0, -2), mobility 1 everywhere, compliance 2: lambda = 2 / (1 + 4 + 1 + 2).
#[test]
fn triple_moves_as_worked_by_hand() {
    let triple = BendTriple {
        vertices: [0, 1, 2],
        compliance: 2.0,
    };
    let mut x = [[0.0; 3], [1.0, 0.0, 1.0], [2.0, 0.0, 0.0]].map(Vec3x);
    project_triples(&[triple], &mut x, &[1.0; 3]);
    close(x[0], Vec3::new(0.0, 0.0, 0.25), 1e-15);
    close(x[1], Vec3::new(1.0, 0.0, 0.5), 1e-15);
    close(x[2], Vec3::new(2.0, 0.0, 0.25), 1e-15);
}

/// Signed angle between the normals of (0, 1, 2) and (1, 0, 3), by the textbook.
fn dihedral_angle(x: &[Vec3; 4]) -> f64 {
    let e = (x[1] - x[0]).normalize();
    let n1 = (x[1] - x[0]).cross(&(x[2] - x[0])).normalize();
    let n2 = (x[0] - x[1]).cross(&(x[3] - x[1])).normalize();
    n1.cross(&n2).dot(&e).atan2(n1.dot(&n2))
}

/// Under a large compliance a hinge moves each vertex by -w angle grad / compliance: this
/// shows its gradient, sign included, for finite differences of the angle to confirm.
#[test]
fn hinge_follows_the_gradient_of_its_angle() {
    let mut stream = Stream::new(2, Purpose::Evaluation, 0);
    for _ in 0..100 {
        let mut x = [[0.0; 3], [1.0, 0.0, 0.0], [0.4, 0.9, 0.0], [0.6, -0.8, 0.0]].map(Vec3::from);
        for x in &mut x {
            *x += 0.2 * random_vector(&mut stream);
        }
        let angle = dihedral_angle(&x);
        let compliance = 1e8;
        let hinge = BendHinge {
            vertices: [0, 1, 2, 3],
            compliance,
        };
        let w = [1.0, 2.0, 0.5, 3.0];
        let start = x.map(|x| Vec3x(x.into()));
        let mut moved = start;
        project_hinges(&[hinge], &mut moved, &w);
        for v in 0..4 {
            let gradient = Vec3::from_fn(|k, _| {
                let shifted = |by: f64| {
                    let mut x = x;
                    x[v][k] += by;
                    dihedral_angle(&x)
                };
                (shifted(1e-6) - shifted(-1e-6)) / 2e-6
            });
            let expected = gradient * -angle;
            let found = Vec3::from((moved[v] - start[v]).0) * (compliance / w[v]);
            let off = (found - expected).norm();
            // The arc tangent is good to 4e-6 for the whole angle; 1e8 magnifies rounding.
            assert!(
                off < 1e-5 * (1.0 + gradient.norm()),
                "vertex {v} is {off:e} off"
            );
        }
    }
}

/// A stiff hinge is flat after few projections, whichever way it was folded.
#[test]
fn rigid_hinge_unfolds() {
    for fold in [0.7, -0.7, 2.5, -2.5f64] {
        let flap = Vec3::new(0.5, -fold.cos(), fold.sin());
        let start = [Vec3::zeros(), Vec3::x(), Vec3::new(0.5, 1.0, 0.0), flap];
        let mut x = start.map(|x| Vec3x(x.into()));
        let hinge = BendHinge {
            vertices: [0, 1, 2, 3],
            compliance: 0.0,
        };
        for _ in 0..20 {
            project_hinges(&[hinge], &mut x, &[1.0; 4]);
        }
        let angle = dihedral_angle(&x.map(|x| Vec3::from(x.0)));
        assert!(angle.abs() < 1e-5, "{angle} left of {fold}");
    }
}
