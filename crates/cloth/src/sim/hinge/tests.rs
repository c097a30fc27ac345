use super::*;
use crate::math::{Purpose, Stream, Vec3};

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
        project_hinges(&[hinge], &mut moved, &w, None);
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
            project_hinges(&[hinge], &mut x, &[1.0; 4], None);
        }
        let angle = dihedral_angle(&x.map(|x| Vec3::from(x.0)));
        assert!(angle.abs() < 1e-5, "{angle} left of {fold}");
    }
}
