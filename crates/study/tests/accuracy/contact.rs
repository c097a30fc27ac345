//! Cloth on tools: lift-off without friction, sticking and slipping with it, adhesion.

use drape_study::verify::contact::{LIFT_OFF, creep, lift_off};

use super::*;

/// Where a strip of length 2 R, clamped at the crown of a frictionless cylinder, lifts off, and
/// its tip over R.
#[test]
fn strip_lifts_off_a_cylinder() {
    for (g_r, angle, tip) in LIFT_OFF {
        let h = super::bending::resolving(g_r * 8.0, 48, 100.0) * 0.2f64.sqrt();
        let end = lift_off(&fast(Solver::Yarn, h), g_r, 48);
        assert!(end.v_rms < 1e-4, "still moves at {} m/s", end.v_rms);
        for (found, expected) in end.tip.into_iter().zip(tip) {
            assert!((found - expected).abs() < 0.01, "{found} is not {expected}");
        }
        let found = end.angle;
        assert!(
            (found - angle).abs() < 0.5,
            "{found} is not {angle} degrees"
        );
    }
}

/// A rope holds just below e^(mu pi) and slips just above, at a substep that resolves its tension.
#[test]
fn rope_round_a_drum_slips_at_the_capstans_ratio() {
    let mu = 0.28;
    let limit = (mu * std::f64::consts::PI).exp();
    for solver in [Solver::Yarn, Solver::GaussSeidel] {
        let fast = fast(solver, 1.0 / 12_000.0);
        let way = creep(&fast, mu, 0.99 * limit);
        assert!(way < 1e-9, "creeps {way} m");
        let way = creep(&fast, mu, 1.01 * limit);
        assert!(way > 5e-4, "slips {way} m");
    }
}

/// How far a sheet slides down an incline of some tack [kPa] in `seconds` [m].
fn slide(angle: f64, adhesion: f64, solver: Solver, seconds: f64) -> f64 {
    let incline = Incline {
        angle_deg: angle.to_degrees(),
        plate_mm: [2000.0, 400.0],
        ..Incline::default()
    };
    let incline = tool(Shape::Incline(incline), Pose::default(), 50.0).into();
    let sheet = lamina([0.1, 0.08], [6, 5]);
    let down = [angle.cos(), 0.0, -angle.sin()];
    let state = placed(&sheet, |s, t| [down[0] * s, t, down[2] * s]);
    let physics = PhysicsConfig {
        friction: true,
        shear: true,
        bending: Bending::Yarns,
        adhesion,
        solver,
        ..yarns_alone(0.0)
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
    let creep = slide(stick.atan() - margin, 0.0, Solver::Yarn, t);
    assert!(creep.abs() < 1e-6, "creeps {creep} m");
    let angle = stick.atan() + margin;
    let acceleration = GRAVITY * (angle.sin() - slip * angle.cos());
    let way = slide(angle, 0.0, Solver::Yarn, t);
    close(way, 0.5 * acceleration * t * (t + 1e-3), 0.01);
}

/// Weight of the cloth per area [kPa].
const WEIGHT: f64 = 1e-3 * AREAL_MASS * GRAVITY;

/// tan(angle) = mu (1 + tack / (weight cos(angle))), weight per area.
#[test]
fn adhesion_raises_the_angle_of_friction() {
    let [stick, slip] = Material::interglas_92125().friction();
    let (sin, cos) = 50.0f64.to_radians().sin_cos();
    let critical = WEIGHT * (sin / stick - cos);
    for solver in [Solver::Yarn, Solver::GaussSeidel] {
        let t = 0.5;
        let creep = slide(sin.asin(), 1.01 * critical, solver, t);
        assert!(creep.abs() < 1e-6, "creeps {creep} m");
        let load = cos + 0.99 * critical / WEIGHT;
        let acceleration = GRAVITY * (sin - slip * load);
        let way = slide(sin.asin(), 0.99 * critical, solver, t);
        close(way, 0.5 * acceleration * t * (t + 1e-3), 0.01);
    }
}

/// Heights of all vertices of a sheet on a plate under gravity that points up, from 0 on [m].
fn drop(adhesion: f64, solver: Solver, h: f64, seconds: f64) -> Vec<f64> {
    let plate = tool(Shape::Plate(Plate::default()), Pose::default(), 20.0);
    let sheet = lamina([0.1, 0.08], [6, 5]);
    let state = placed(&sheet, |s, t| [s, t, 0.0]);
    let physics = PhysicsConfig {
        friction: true,
        shear: true,
        bending: Bending::Yarns,
        gravity: -GRAVITY,
        adhesion,
        solver,
        ..yarns_alone(0.0)
    };
    let plate = plate.into();
    let end = run(&Model::new(&sheet, &physics), &plate, &state, h, seconds);
    end.position.iter().map(|x| x[2]).collect()
}

/// It holds against any weight below the tack. Beyond, it falls with the rest of its weight
/// through the range of 0.2 mm and freely from there on.
#[test]
fn adhesion_holds_what_weighs_less_than_the_tack() {
    for solver in [Solver::Yarn, Solver::GaussSeidel] {
        for z in drop(1.02 * WEIGHT, solver, 1e-3, 1.0) {
            assert!(z.abs() < 1e-9, "fell {z} m");
        }
        let (range, slow) = (2e-4, 0.02 * GRAVITY);
        let first = (2.0 * range / slow).sqrt();
        let t = 0.1;
        let way = range + slow * first * (t - first) + 0.5 * GRAVITY * (t - first).powi(2);
        for z in drop(0.98 * WEIGHT, solver, 2e-5, t) {
            close(z, way, 5e-3);
        }
    }
}
