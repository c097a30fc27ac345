//! Cloth on tools: lift-off without friction, sticking and slipping with it.

use super::*;

/// A heavy strip of length 2 R, clamped at the crown of a frictionless cylinder: where it lifts
/// off, and its tip over R.
#[test]
fn strip_lifts_off_a_cylinder() {
    let radius = 0.1;
    let cylinder = Cylinder {
        radius_mm: 1e3 * radius,
        length_mm: 100.0,
        segment_count: 512,
        ..Cylinder::default()
    };
    let cylinder = tool(Shape::Cylinder(cylinder), Pose::default(), 2.0);
    for (g_r, angle, tip) in [
        (2.0, 39.892, [1.34870, -0.31890]),
        (5.0, 56.538, [1.18984, -0.39390]),
    ] {
        let edges = 48;
        let edge = 2.0 * radius / (edges as f64 - 0.5);
        let strip = strip(Family::Weft, edge * edges as f64, edges);
        // Wound on, then let go: it comes to its place from the inner side.
        let mut state = placed(&strip, |s, t| {
            let s = s - 0.5 * edge;
            if s < edge {
                return [t, s, radius];
            }
            [
                t,
                radius * (s / radius).sin(),
                radius * (s / radius).cos() + 1e-4,
            ]
        });
        fix(&strip, &mut state, &[0, 1]);
        let stiffness = AREAL_MASS * GRAVITY * radius.powi(3) / g_r;
        let physics = PhysicsConfig {
            bending: Bending::Yarns,
            bending_stiffness: BendingStiffness::NewtonMetre(stiffness),
            damping: 8.0,
            contact_interval: 5,
            ..yarns_alone()
        };
        let h = super::bending::resolving(g_r * 8.0, edges, 100.0) * (2.0 * radius).sqrt();
        let end = run(&Model::new(&strip, &physics), &cylinder, &state, h, 3.0);
        assert!(end.v_rms() < 1e-4, "still moves at {} m/s", end.v_rms());
        let found = mean_at(&strip, &end, edges);
        for (found, expected) in [found.y, found.z].into_iter().zip(tip) {
            assert!(
                (found / radius - expected).abs() < 0.01,
                "{} is not {expected}",
                found / radius
            );
        }
        // Beyond the line of contact the gap grows with the cube of the distance.
        let gaps: Vec<[f64; 2]> = (0..=edges)
            .map(|k| mean_at(&strip, &end, k))
            .map(|x| [x.y.atan2(x.z).to_degrees(), x.y.hypot(x.z) - radius])
            .filter(|[_, gap]| (1.5e-4..1.2e-3).contains(gap))
            .map(|[angle, gap]| [angle, gap.cbrt()])
            .collect();
        let ([a, p], [b, q]) = (gaps[0], gaps[gaps.len() - 1]);
        let lift_off = a - p * (b - a) / (q - p);
        assert!(
            (lift_off - angle).abs() < 0.5,
            "{lift_off} is not {angle} degrees"
        );
    }
}

/// How far a sheet slides down an incline in `seconds` [m].
fn slide(angle: f64, seconds: f64) -> f64 {
    let incline = Incline {
        angle_deg: angle.to_degrees(),
        plate_mm: [2000.0, 400.0],
        ..Incline::default()
    };
    let incline = tool(Shape::Incline(incline), Pose::default(), 50.0);
    let sheet = lamina([0.1, 0.08], [6, 5]);
    let down = [angle.cos(), 0.0, -angle.sin()];
    let state = placed(&sheet, |s, t| [down[0] * s, t, down[2] * s]);
    let physics = PhysicsConfig {
        friction: true,
        shear: true,
        bending: Bending::Yarns,
        ..yarns_alone()
    };
    let end = run(
        &Model::new(&sheet, &physics),
        &incline,
        &state,
        1e-3,
        seconds,
    );
    let along = |x: &[f64; 3]| x[0] * down[0] + x[2] * down[2];
    let sum: f64 =
        end.position.iter().map(along).sum::<f64>() - state.position.iter().map(along).sum::<f64>();
    sum / state.position.len() as f64
}

#[test]
fn sheet_sticks_below_the_angle_of_friction_and_slips_above() {
    let [stick, slip] = Material::interglas_92125().friction();
    let margin = 0.2f64.to_radians();
    let t = 0.5;
    let creep = slide(stick.atan() - margin, t);
    assert!(creep.abs() < 1e-6, "creeps {creep} m");
    let angle = stick.atan() + margin;
    let acceleration = GRAVITY * (angle.sin() - slip * angle.cos());
    close(slide(angle, t), 0.5 * acceleration * t * (t + 1e-3), 0.01);
}
