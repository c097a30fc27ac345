//! Trials that touch nothing: momentum, energy, drag, and yarns that find back their length.

use super::trial::{Knobs, Trial, Tried, damped, mean_error, speeds};
use crate::cloth::{GRAVITY, Piece, laid, momenta};
use crate::truth;
use drape_cloth::fabric::{Lamina, Material};
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::sim::{Bending, Snapshot};

/// A small sheet that starts flat in free space, with one damping [1/s].
fn sheet(damping: f64) -> Piece {
    let lamina = crate::cloth::sheet([0.08; 2], [7; 2], Material::interglas_92125());
    let start = laid(&lamina, |[x, y]| [x, y, 0.0]);
    Piece::new(lamina, damped(damping, Bending::Yarns), start)
}

/// A flat sheet whose vertices have random velocities times a `factor` flies without gravity or
/// damping. The error is that of its momentum over its momentum, or what its kinetic energy has
/// gained over what it had, whichever is larger. Beyond some hundred metres a second the sheet
/// leaves the space that the simulator takes for finite, which it has to say.
pub fn fly(factor: f64) -> Tried {
    let mut piece = sheet(0.0);
    (piece.physics.gravity, piece.physics.speed_cap) = (0.0, 0.0);
    let mut stream = Stream::new(3, Purpose::Evaluation, 0);
    for v in &mut piece.start.velocity {
        *v = [0.5, -0.4, 0.3].map(|mean| factor * (mean + 0.3 * stream.normal()));
    }
    let motion = |lamina: &Lamina, state: &Snapshot| {
        let masses = speeds(state).zip(&lamina.mass);
        let energy: f64 = masses.map(|(v, m)| 0.5 * m * v * v).sum();
        (momenta(lamina, state)[0], energy)
    };
    let before = motion(&piece.lamina, &piece.start);
    Trial::new(piece, 0.2, move |lamina, state| {
        let (momentum, energy) = motion(lamina, state);
        let gain = energy / before.1 - 1.0;
        gain.max((momentum - before.0).norm() / before.0.norm())
    })
}

/// y: damping [1/s]. A sheet is thrown level and falls with drag.
pub fn damping(knobs: &Knobs) -> Tried {
    const SECONDS: f64 = 0.1;
    let mut piece = sheet(knobs.y);
    piece.start.velocity.fill([1.0, 0.0, 0.0]);
    let seconds = knobs.frame * knobs.frames(SECONDS) as f64;
    let moved = |v0, g| truth::dragged(v0, g, knobs.y, seconds);
    let [dx, dz] = [moved(1.0, 0.0), moved(0.0, -GRAVITY)];
    let rest = piece.lamina.rest.iter();
    let expected: Vec<_> = rest.map(|[x, y]| [x + dx, *y, dz]).collect();
    Trial::new(piece, SECONDS, move |lamina, state| {
        mean_error(lamina, state, &expected)
    })
}

/// How a sheet can start that no one would lay out.
pub const STARTS: [&str; 8] = [
    "as cut",
    "upside down",
    "mirrored",
    "folded",
    "crumpled 0.1",
    "crumpled 1",
    "random in a box",
    "all in one point",
];

/// y: the start. In free space the yarns have to find back their length: the error is the mean
/// strain of the yarn edges.
pub fn start(knobs: &Knobs) -> Tried {
    let mut piece = sheet(5.0);
    piece.physics.gravity = 0.0;
    let cell = piece.lamina.yarns[0].rest_length;
    let mut stream = Stream::new(4, Purpose::Evaluation, 0);
    let mut off =
        |[x, y]: [f64; 2], share: f64| [x, y, 0.0].map(|x| x + share * cell * stream.normal());
    piece.start = laid(&piece.lamina, |[x, y]| match STARTS[knobs.y as usize] {
        "as cut" => [x, y, 0.0],
        "upside down" => [x, -y, 0.0],
        "mirrored" => [-x, y, 0.0],
        "folded" => off([x.abs(), y], 0.01),
        "crumpled 0.1" => off([x, y], 0.1),
        "crumpled 1" => off([x, y], 1.0),
        "random in a box" => off([0.0, 0.0], 3.0),
        _ => [0.0; 3],
    });
    Trial::new(piece, 1.0, |lamina, state| {
        let strain = lamina.yarn_strain(&state.position);
        strain.iter().map(|s| s.abs()).sum::<f64>() / strain.len() as f64
    })
}
