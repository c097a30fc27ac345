//! Cloth on tools: lift-off without friction, sticking and slipping with it, adhesion.

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

/// How far a sheet slides down an incline of some tack [kPa] in `seconds` [m].
fn slide(angle: f64, adhesion: f64, solver: Solver, seconds: f64) -> f64 {
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
        adhesion,
        solver,
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
        ..yarns_alone()
    };
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
