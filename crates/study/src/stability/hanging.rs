//! Trials that hang: strips and sheets of which only weight and length decide where they end.
//!
//! They are let go off their place with enough damping to arrive there, so that the way there
//! is tried as well.

use super::trial::{FRAME, Knobs, Trial, Tried, damped, mean_error, size, speeds};
use crate::cloth::{AREAL_MASS, GRAVITY, Piece, clamped, evened, fix, hung, laid, placed, sheet};
use crate::truth;
use crate::verify::length::CATENARY;
use drape_cloth::fabric::{Curve, Lamina, Material};
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::sim::{Bending, PhysicsConfig};

/// Damping and duration that bring a hanging strip of 160 mm to rest: its slowest swing has
/// 9.4 rad/s and decays to 1/1800.
const DAMPING: f64 = 15.0;
const SECONDS: f64 = 1.0;
/// The strip that most of these trials hang [m], and its edges.
const LENGTH: f64 = 0.16;
const WIDTH: f64 = 0.01;
pub const EDGES: usize = 16;

/// A strip of the built-in fabric along y with two vertices across.
fn strip(width: f64, length: f64, edges: usize) -> Lamina {
    let material = Material::interglas_92125();
    evened(sheet([width, length], [2, edges + 1], material))
}

/// The strip that most of these trials hang.
fn usual() -> Lamina {
    strip(WIDTH, LENGTH, EDGES)
}

/// A strip that starts `tilt` degrees off the vertical, held against the weight that each edge
/// carries.
fn hang(strip: Lamina, physics: PhysicsConfig, seconds: f64, tilt: f64) -> Tried {
    let start = hung(&strip, tilt);
    let expected = if physics.gravity == 0.0 {
        start.position.clone()
    } else {
        let yarn = strip.yarns.last().expect("a blank has wefts");
        let modulus = strip.material.weft.tension.modulus();
        let k = modulus * strip.material.thickness() * yarn.width / yarn.rest_length;
        let mass: Vec<f64> = strip.mass.chunks_exact(2).map(|row| row[0]).collect();
        let lengths = truth::hanging(&mass, yarn.rest_length, 1.0 / k, physics.gravity);
        let rows = strip.rest.iter().enumerate();
        rows.map(|(v, [x, _])| [*x, 0.0, -lengths[v / 2]]).collect()
    };
    arrive(Piece::new(strip, physics, start), seconds, expected)
}

/// Held against a place to come to rest at: what jitters about it has not arrived.
fn arrive(piece: Piece, seconds: f64, expected: Vec<[f64; 3]>) -> Tried {
    Trial::new(piece, seconds, move |lamina, state| {
        let moved = FRAME * speeds(state).sum::<f64>() / expected.len() as f64;
        mean_error(lamina, state, &expected).max(moved / size(lamina))
    })
}

/// y: frame [s].
pub fn time_step(_: &Knobs) -> Tried {
    hang(usual(), damped(DAMPING, Bending::Off), SECONDS, 30.0)
}

/// y: compliance of an edge [m/N].
pub fn compliance(knobs: &Knobs) -> Tried {
    // k = E t b / a with half the strip for a yarn.
    let mut strip = usual();
    let thickness = strip.material.thickness();
    let modulus = LENGTH / EDGES as f64 / (thickness * 0.5 * WIDTH * knobs.y);
    for law in [&mut strip.material.warp, &mut strip.material.weft] {
        law.tension = Curve::line(modulus);
        law.compression = Curve::line(modulus);
    }
    let mut physics = damped(DAMPING, Bending::Off);
    // Next to the softest yarns the diagonals would carry the weight.
    physics.shear = false;
    hang(strip, physics, SECONDS, 30.0)
}

/// y: mass of the rows, 0 to [`EDGES`], that are `chosen`, over that of the others.
pub fn heavy(knobs: &Knobs, chosen: fn(usize) -> bool) -> Tried {
    let mut strip = usual();
    for (v, mass) in strip.mass.iter_mut().enumerate() {
        if chosen(v / 2) {
            *mass *= knobs.y;
        }
    }
    hang(strip, damped(DAMPING, Bending::Off), SECONDS, 30.0)
}

/// y: gravity over that of the earth.
pub fn gravity(knobs: &Knobs) -> Tried {
    // Swings are faster by the root of gravity, and so is their damping.
    let pace = if knobs.y > 0.0 { knobs.y.sqrt() } else { 1.0 };
    let mut physics = damped(DAMPING * pace, Bending::Off);
    (physics.gravity, physics.speed_cap) = (GRAVITY * knobs.y, 0.0);
    let seconds = SECONDS * pace.recip().max(1.0);
    hang(usual(), physics, seconds, 30.0)
}

/// y: vertices along the strip.
pub fn strip_grid(knobs: &Knobs) -> Tried {
    let strip = strip(WIDTH, 0.37, knobs.y as usize - 1);
    hang(strip, damped(12.0, Bending::Off), 1.2, 20.0)
}

/// x: vertices along a strip of 1 m, y: its width [mm].
pub fn needle(knobs: &Knobs) -> Tried {
    let strip = strip(1e-3 * knobs.y, 1.0, knobs.x as usize - 1);
    hang(strip, damped(6.0, Bending::Off), 2.0, 10.0)
}

/// y: stiffness of warps over that of the built-in fabric. A sheet hangs on its upper border from
/// a crumpled, tilted start.
pub fn warp_ratio(knobs: &Knobs) -> Tried {
    let cells = 6;
    let mut material = Material::interglas_92125();
    let warp = &mut material.warp;
    warp.tension = warp.tension.scaled(knobs.y);
    warp.compression = warp.compression.scaled(knobs.y);
    let sheet = sheet([WIDTH * cells as f64; 2], [cells + 1; 2], material);
    let top = sheet.rest[0][1];
    let mut stream = Stream::new(1, Purpose::Evaluation, 0);
    let (sin, cos) = 30f64.to_radians().sin_cos();
    let mut start = laid(&sheet, |[x, y]| {
        let along = y - top;
        let share = if along > 0.0 { 0.05 } else { 0.0 };
        [x, along * sin, -along * cos].map(|x| x + share * WIDTH * stream.normal())
    });
    start.fixed.insert_range(0..cells + 1);
    // What a weft stretches under its own weight is below 1e-6 of its length.
    let expected = sheet.rest.iter().map(|[x, y]| [*x, 0.0, top - y]).collect();
    let piece = Piece::new(sheet, damped(DAMPING, Bending::Yarns), start);
    arrive(piece, SECONDS, expected)
}

/// y: bending stiffness [N m]. A strip is clamped level and held against the heavy elastica.
pub fn bending(knobs: &Knobs) -> Tried {
    let edge = LENGTH / EDGES as f64;
    let mut piece = clamped(usual(), edge, knobs.y, DAMPING);
    piece.physics = PhysicsConfig {
        bending_stiffness: piece.physics.bending_stiffness,
        ..damped(DAMPING, Bending::Yarns)
    };
    let free = LENGTH - 0.5 * edge;
    let shape = truth::elastica(AREAL_MASS * GRAVITY * free.powi(3) / knobs.y);
    let expected = piece.start.position.iter().map(|&[x, y, _]| {
        let [reach, drop] = truth::along(&shape, (x / free).max(0.0));
        let x = if x < 0.0 { x } else { free * reach };
        [x, y, -free * drop]
    });
    let expected = expected.collect();
    arrive(piece, 1.5 * SECONDS, expected)
}

/// y: frame [s]. A strip of 370 mm hangs by both ends, 300 mm apart, and starts as a sine. (Swung
/// out of its plane it can come to rest twisted, 2 % off: the strip is a row of stiff triangles.)
pub fn catenary(_: &Knobs) -> Tried {
    let ([length, span], edges) = (CATENARY, 32);
    let strip = strip(WIDTH, length, edges);
    let half = 0.5 * length;
    let sag = truth::catenary(span, length, half)[1];
    let mut start = placed(&strip, |s, t| {
        let s = s - half;
        let down = sag * (std::f64::consts::FRAC_PI_2 * s / half).cos();
        [t, span / length * s, -down]
    });
    // The ends themselves stay where the strip is held.
    fix(&strip, &mut start, &[0, edges]);
    let expected = strip.rest.iter().map(|&[x, y]| {
        let [along, up] = truth::catenary(span, length, y);
        [x, along, up - sag]
    });
    let expected = expected.collect();
    let piece = Piece::new(strip, damped(12.0, Bending::Off), start);
    arrive(piece, 3.0, expected)
}
