//! Trials that touch nothing: momentum, energy, drag, and yarns that find back their length.

use super::trial::{Clock, FRAME, Judge, Refusal, Setting, Trial, mean_error, physics};
use crate::cloth::{GRAVITY, laid};
use crate::truth;
use drape_cloth::fabric::{Lamina, Material};
use drape_cloth::math::{Purpose, Stream, Vec3};
use drape_cloth::sim::{Bending, PhysicsConfig, Snapshot};

const SIDE: f64 = 0.08;
const VERTICES: usize = 7;

fn sheet() -> Lamina {
    crate::cloth::sheet([SIDE; 2], [VERTICES; 2], Material::interglas_92125())
}

/// x: substeps, y: frame [s]. A flat sheet whose vertices have random velocities flies
/// without gravity or damping. The error is that of its momentum over its momentum, or what
/// its kinetic energy has gained over what it had, whichever is larger.
pub(super) fn flight(setting: &Setting) -> Result<Trial, Refusal> {
    fly(setting, setting.y, 1.0)
}

/// x: substeps, y: factor on these velocities. Beyond some hundred metres a second the sheet
/// leaves the space that the simulator takes for sound, which it has to say.
pub(super) fn speed(setting: &Setting) -> Result<Trial, Refusal> {
    fly(setting, FRAME, setting.y)
}

fn fly(setting: &Setting, frame: f64, factor: f64) -> Result<Trial, Refusal> {
    let sheet = sheet();
    let mut stream = Stream::new(3, Purpose::Evaluation, 0);
    let mut start = laid(&sheet, |[x, y]| [x, y, 0.0]);
    for v in &mut start.velocity {
        *v = [0.5, -0.4, 0.3].map(|mean| factor * (mean + 0.3 * stream.normal()));
    }
    let before = motion(&sheet, &start);
    let judge: Judge = Box::new(move |lamina, state| {
        let (momentum, energy) = motion(lamina, state);
        let gain = energy / before.1 - 1.0;
        gain.max((momentum - before.0).norm() / before.0.norm())
    });
    let physics = PhysicsConfig {
        gravity: 0.0,
        speed_cap: 0.0,
        bending: Bending::Yarns,
        ..physics(setting, 0.0)
    };
    let clock = Clock::new(0.2, frame, setting.x);
    Trial::new(sheet, &physics, None, start, clock, judge)
}

/// Linear momentum [kg m/s] and kinetic energy [J].
fn motion(lamina: &Lamina, state: &Snapshot) -> (Vec3, f64) {
    let mut sum = (Vec3::zeros(), 0.0);
    for (v, m) in state.velocity.iter().zip(&lamina.mass) {
        let v = Vec3::from(*v);
        sum.0 += v * *m;
        sum.1 += 0.5 * m * v.norm_squared();
    }
    sum
}

/// x: substeps, y: damping [1/s]. A sheet is thrown level and falls with drag.
pub(super) fn damping(setting: &Setting) -> Result<Trial, Refusal> {
    let sheet = sheet();
    let mut start = laid(&sheet, |[x, y]| [x, y, 0.0]);
    start.velocity.fill([1.0, 0.0, 0.0]);
    let clock = Clock::new(0.1, FRAME, setting.x);
    let moved = |v0, g| truth::dragged(v0, g, setting.y, clock.seconds());
    let [dx, dz] = [moved(1.0, 0.0), moved(0.0, -GRAVITY)];
    let expected: Vec<_> = sheet.rest.iter().map(|[x, y]| [x + dx, *y, dz]).collect();
    let judge: Judge = Box::new(move |lamina, state| mean_error(lamina, state, &expected));
    let physics = PhysicsConfig {
        bending: Bending::Yarns,
        ..physics(setting, setting.y)
    };
    Trial::new(sheet, &physics, None, start, clock, judge)
}

/// How a sheet can start that no one would lay out.
pub(super) const STARTS: [&str; 8] = [
    "as cut",
    "upside down",
    "mirrored",
    "folded",
    "crumpled 0.1",
    "crumpled 1",
    "random in a box",
    "all in one point",
];

/// x: substeps, y: the start. In free space the yarns have to find back their length: the
/// error is the mean strain of the yarn edges.
pub(super) fn start(setting: &Setting) -> Result<Trial, Refusal> {
    let sheet = sheet();
    let cell = sheet.yarns[0].rest_length;
    let mut stream = Stream::new(4, Purpose::Evaluation, 0);
    let mut off = |x: [f64; 2], share: f64| {
        let [x, y, z] = [x[0], x[1], 0.0].map(|x| x + share * cell * stream.normal());
        [x, y, z]
    };
    let start = laid(&sheet, |[x, y]| match STARTS[setting.y as usize] {
        "as cut" => [x, y, 0.0],
        "upside down" => [x, -y, 0.0],
        "mirrored" => [-x, y, 0.0],
        "folded" => off([x.abs(), y], 0.01),
        "crumpled 0.1" => off([x, y], 0.1),
        "crumpled 1" => off([x, y], 1.0),
        "random in a box" => off([0.0, 0.0], 3.0),
        _ => [0.0; 3],
    });
    let judge: Judge = Box::new(|lamina, state| {
        let strain = lamina.yarn_strain(&state.position);
        strain.iter().map(|s| s.abs()).sum::<f64>() / strain.len() as f64
    });
    let physics = PhysicsConfig {
        gravity: 0.0,
        bending: Bending::Yarns,
        ..physics(setting, 5.0)
    };
    let clock = Clock::new(1.0, FRAME, setting.x);
    Trial::new(sheet, &physics, None, start, clock, judge)
}
