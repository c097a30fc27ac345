//! Cloth on tools: slipping, ropes round a drum, lift-off.

use std::f64::consts::PI;
use std::sync::{Arc, LazyLock};

use super::solve::{Answer, Ask, Solve};
use crate::cloth::{
    AREAL_MASS, GRAVITY, Piece, clamped, evened, mean_at, on_slope, placed, rubbing, section,
    sheet, slid, strip, tool, yarns_alone,
};
use crate::study::Effort;
use crate::truth::halved;
use drape_cloth::fabric::Family;
use drape_cloth::sim::Bending;
use drape_cloth::tool::{Cylinder, Pose, Shape, Tool};

/// Incline, capstan, without the twin where it has to be quick, and lift-off.
pub(super) fn asks(effort: Effort) -> Vec<Ask> {
    let incline = [0.28f64, 0.25].map(|mu| -> Ask {
        Box::new(move |solver| {
            let case = format!("incline: slips with friction {mu} at");
            let angles = [mu.atan(), slip_angle(solver, mu)];
            vec![Answer::new(case, "deg", angles.map(f64::to_degrees))]
        })
    });
    let capstan = [0.28f64, 0.25].map(|mu| -> Ask {
        Box::new(move |solver| {
            if effort == Effort::Quick && solver.fast().is_none() {
                return Vec::new();
            }
            let case = format!("capstan: slips with friction {mu} at");
            let numbers = [(mu * PI).exp(), slip_ratio(solver, mu)];
            vec![Answer::new(case, "-", numbers)]
        })
    });
    let cylinder = LIFT_OFF.map(|(g_r, angle, tip)| -> Ask {
        Box::new(move |solver| {
            let lift = lift_off(solver, g_r, 48);
            let of = |what| format!("strip on a cylinder, {g_r}: {what}");
            vec![
                Answer::new(of("lifts off at"), "deg", [angle, lift.angle]),
                Answer::new(of("tip beside the axis"), "-", [tip[0], lift.tip[0]]),
                Answer::new(of("tip above the axis"), "-", [tip[1], lift.tip[1]]),
            ]
        })
    });
    let all = incline.into_iter().chain(capstan);
    all.chain(cylinder).collect()
}

/// The largest value for which `holds` says yes, from a bracket whose lower end should hold and
/// whose upper end should not; NaN where one of them is not as it should.
fn threshold([low, high]: [f64; 2], holds: impl Fn(f64) -> bool) -> f64 {
    if !holds(low) || holds(high) {
        return f64::NAN;
    }
    let [low, high] = halved([low, high], 9, holds);
    0.5 * (low + high)
}

/// Angle of an incline at which a sheet with friction `mu` begins to slip [rad].
pub fn slip_angle(solver: &dyn Solve, mu: f64) -> f64 {
    let expected = mu.atan();
    let mut physics = yarns_alone(0.0);
    (physics.friction, physics.shear) = (true, true);
    physics.bending = Bending::Yarns;
    threshold([0.9 * expected, 1.1 * expected], |angle| {
        let sheet = sheet([0.1, 0.08], [6, 5], rubbing([mu; 2]));
        let piece = on_slope(sheet, physics.clone(), angle);
        slid(&piece.start, &solver.run(&piece, 0.2), angle) < 1e-6
    })
}

/// Radius of the drum [m], and edges of the rope on its half and that hang down on either side.
const DRUM: f64 = 0.05;
const WOUND: usize = 32;
const HANGING: usize = 4;

static DRUM_TOOL: LazyLock<Arc<Tool>> = LazyLock::new(|| cylinder(DRUM, 100.0));

/// A cylinder of `radius` [m] over a base.
fn cylinder(radius: f64, base_mm: f64) -> Arc<Tool> {
    let cylinder = Cylinder {
        radius_mm: 1e3 * radius,
        length_mm: 100.0,
        base_mm,
        segment_count: 512,
    };
    tool(Shape::Cylinder(cylinder), Pose::default(), 2.0).into()
}

/// Ratio of the tensions where a strip meets and leaves a half cylinder of friction `mu` at which
/// it begins to slip, e^(mu pi) for one without weight.
pub fn slip_ratio(solver: &dyn Solve, mu: f64) -> f64 {
    let expected = (mu * PI).exp();
    let holds = |ratio| creep(solver, mu, ratio) < 2e-5;
    threshold([0.5 * expected, 1.5 * expected], holds)
}

/// Displacement of the strip [m] in half a second, after as long for it to find its tension. The
/// load on the end that is drawn up is five times its weight.
///
/// `ratio` is that of the tensions in units in which the strip has no weight: with the weight
/// W = w R, dT / dphi = mu (T + W cos phi) - W sin phi over the drum, so at the point of
/// slipping T1 - B = e^(mu pi) (T0 + B) with B = 2 mu W / (1 + mu^2).
pub fn creep(solver: &dyn Solve, mu: f64, ratio: f64) -> f64 {
    let edge = PI * DRUM / WOUND as f64;
    let count = WOUND + 2 * HANGING;
    let length = edge * count as f64;
    let mut strip = evened(strip(Family::Weft, length, count));
    strip.material = rubbing([mu; 2]);
    let weight: f64 = strip.mass.iter().sum();
    let (hangs, on_drum) = (HANGING as f64 * edge / length, DRUM / length);
    let correction = 2.0 * mu * on_drum / (1.0 + mu * mu);
    let upper = 5.0 + hangs;
    let lower = ratio * (upper + correction) + correction;
    // The end rows bear what their own weight is short of.
    for (k, load) in [(0, upper - hangs), (count, lower - hangs)] {
        for v in section(&strip, k) {
            strip.mass[v] += 0.5 * load * weight;
        }
    }
    let start = placed(&strip, |s, t| {
        let s = s - 0.5 * length;
        let quarter = 0.5 * PI * DRUM;
        if s.abs() < quarter {
            let (sin, cos) = (s / DRUM).sin_cos();
            [t, DRUM * sin, DRUM * cos]
        } else {
            [t, DRUM * s.signum(), quarter - s.abs()]
        }
    });
    let mut piece = Piece::new(strip, yarns_alone(20.0), start).on(&DRUM_TOOL);
    piece.physics.friction = true;
    let mut crown = || {
        piece.start = solver.run(&piece, 0.5);
        mean_at(&piece.lamina, &piece.start, count / 2)
    };
    let taut = crown();
    (crown() - taut).norm()
}

/// A strip of length 2 R clamped at the crown of a frictionless cylinder: G_R = w R^3 / D, angle
/// at which it lifts off [degrees], tip from the axis over R.
pub const LIFT_OFF: [(f64, f64, [f64; 2]); 2] = [
    (2.0, 39.892, [1.34870, -0.31890]),
    (5.0, 56.538, [1.18984, -0.39390]),
];

/// Where a strip leaves a cylinder [degrees], its tip from the axis over the radius, and its speed
/// then [m/s].
pub struct LiftOff {
    pub angle: f64,
    pub tip: [f64; 2],
    pub v_rms: f64,
}

/// Radius of that cylinder [m].
const CYLINDER: f64 = 0.1;

static CYLINDER_TOOL: LazyLock<Arc<Tool>> =
    LazyLock::new(|| cylinder(CYLINDER, Cylinder::default().base_mm));

/// Lets the strip come to rest on a cylinder of 100 mm. Cloth has no thickness in contact, so the
/// mid-surface has the tool's radius.
pub fn lift_off(solver: &dyn Solve, g_r: f64, edges: usize) -> LiftOff {
    let radius = CYLINDER;
    let edge = 2.0 * radius / (edges as f64 - 0.5);
    let strip = strip(Family::Weft, edge * edges as f64, edges);
    let stiffness = AREAL_MASS * GRAVITY * radius.powi(3) / g_r;
    let mut piece = clamped(strip, edge, stiffness, 8.0).on(&CYLINDER_TOOL);
    // Wound on and down beside, then let go: it comes to its place from the inner side.
    let quarter = 0.5 * PI * radius;
    let wound = placed(&piece.lamina, |s, t| {
        let s = s - 0.5 * edge;
        if s < edge {
            return [t, s, radius];
        }
        let (sin, cos) = (s.min(quarter) / radius).sin_cos();
        let down = (s - quarter).max(0.0);
        [t, radius * sin + 1e-4, radius * cos + 1e-4 - down]
    });
    piece.start.position = wound.position;
    let end = solver.settle(&piece, [1e-6, 4.0]);
    // Beyond the line of contact the gap grows with the cube of the distance.
    let gaps: Vec<[f64; 2]> = (0..=edges)
        .map(|k| mean_at(&piece.lamina, &end, k))
        .map(|x| [x.y.atan2(x.z).to_degrees(), x.y.hypot(x.z) - radius])
        .filter(|[_, gap]| (1.5e-4..1.2e-3).contains(gap))
        .map(|[angle, gap]| [angle, gap.cbrt()])
        .collect();
    let angle = match (gaps.first(), gaps.last()) {
        (Some([a, p]), Some([b, q])) if q > p => a - p * (b - a) / (q - p),
        _ => f64::NAN,
    };
    let tip = mean_at(&piece.lamina, &end, edges) / radius;
    LiftOff {
        angle,
        tip: [tip.y, tip.z],
        v_rms: end.v_rms(),
    }
}
