//! Trials that hang: strips and sheets of which only weight and length decide where they end.
//!
//! They are let go off their place with enough damping to arrive there, so that the way there
//! is tried as well.

use super::trial::{
    Clock, FRAME, Judge, Refusal, SUBSTEPS, Setting, Trial, mean_error, physics, size,
};
use crate::cloth::{AREAL_MASS, GRAVITY, evened, laid, rigid, sheet};
use crate::truth;
use drape_cloth::fabric::{Curve, Lamina, Material};
use drape_cloth::math::{Purpose, Stream, Vec3};
use drape_cloth::sim::{Bending, BendingStiffness, PhysicsConfig};

/// Damping and duration that bring a hanging strip of 160 mm to rest: its slowest swing has
/// 9.4 rad/s and decays to 1/1800.
const DAMPING: f64 = 15.0;
const SECONDS: f64 = 1.0;
/// The strip that most of these trials hang [m], and its edges.
const LENGTH: f64 = 0.16;
const WIDTH: f64 = 0.01;
const EDGES: usize = 16;

/// A strip along y with two vertices across, rows 0 to `edges` at distance s from its end.
fn strip(width: f64, length: f64, edges: usize, material: Material) -> Lamina {
    evened(sheet([width, length], [2, edges + 1], material))
}

/// A strip that starts straight, `tilt` degrees off the vertical, fixed at its first row; held
/// against the weight that each edge carries.
fn hang(strip: Lamina, physics: &PhysicsConfig, clock: Clock, tilt: f64) -> Result<Trial, Refusal> {
    let (sin, cos) = tilt.to_radians().sin_cos();
    let top = strip.rest[0][1];
    let mut start = laid(&strip, |[x, y]| [x, (y - top) * sin, -(y - top) * cos]);
    start.fixed.insert_range(0..2);
    let expected = if physics.gravity == 0.0 {
        start.position.clone()
    } else {
        let yarn = strip.yarns.last().expect("a blank has wefts");
        let modulus = strip.material.weft.tension.modulus();
        let k = modulus * strip.material.thickness() * yarn.width / yarn.rest_length;
        let mass: Vec<f64> = strip.mass.chunks_exact(2).map(|row| row[0]).collect();
        let lengths = truth::hanging(&mass, yarn.rest_length, 1.0 / k, physics.gravity);
        (0..strip.vertex_count())
            .map(|v| [strip.rest[v][0], 0.0, -lengths[v / 2]])
            .collect()
    };
    Trial::new(strip, physics, None, start, clock, to(expected))
}

/// Held against a place to come to rest at: what jitters about it has not arrived.
fn to(expected: Vec<[f64; 3]>) -> Judge {
    Box::new(move |lamina, state| {
        let speeds = state.velocity.iter().map(|v| Vec3::from(*v).norm());
        let moved = FRAME * speeds.sum::<f64>() / expected.len() as f64;
        mean_error(lamina, state, &expected).max(moved / size(lamina))
    })
}

/// x: substeps, y: frame [s].
pub(super) fn time_step(setting: &Setting) -> Result<Trial, Refusal> {
    let strip = strip(WIDTH, LENGTH, EDGES, Material::interglas_92125());
    let clock = Clock::new(SECONDS, setting.y, setting.x);
    hang(strip, &physics(setting, DAMPING), clock, 30.0)
}

/// x: substeps, y: compliance of an edge [m/N].
pub(super) fn compliance(setting: &Setting) -> Result<Trial, Refusal> {
    // k = E t b / a with half the strip for a yarn.
    let thickness = Material::interglas_92125().thickness();
    let modulus = LENGTH / EDGES as f64 / (thickness * 0.5 * WIDTH * setting.y);
    let mut material = Material::interglas_92125();
    for law in [&mut material.warp, &mut material.weft] {
        law.tension = Curve::line(modulus);
        law.compression = Curve::line(modulus);
    }
    let strip = strip(WIDTH, LENGTH, EDGES, material);
    let physics = PhysicsConfig {
        // Next to the softest yarns the diagonals would carry the weight.
        shear: false,
        ..physics(setting, DAMPING)
    };
    hang(strip, &physics, Clock::new(SECONDS, FRAME, setting.x), 30.0)
}

/// x: substeps, y: mass of every other row over that of its neighbours.
pub(super) fn neighbour_mass(setting: &Setting) -> Result<Trial, Refusal> {
    heavy(setting, |row| row % 2 == 1)
}

/// x: substeps, y: mass of the lower border over that of the inside.
pub(super) fn border_mass(setting: &Setting) -> Result<Trial, Refusal> {
    heavy(setting, |row| row == EDGES)
}

fn heavy(setting: &Setting, chosen: fn(usize) -> bool) -> Result<Trial, Refusal> {
    let mut strip = strip(WIDTH, LENGTH, EDGES, Material::interglas_92125());
    for (v, mass) in strip.mass.iter_mut().enumerate() {
        if chosen(v / 2) {
            *mass *= setting.y;
        }
    }
    let clock = Clock::new(SECONDS, FRAME, setting.x);
    hang(strip, &physics(setting, DAMPING), clock, 30.0)
}

/// x: substeps, y: gravity over that of the earth.
pub(super) fn gravity(setting: &Setting) -> Result<Trial, Refusal> {
    let strip = strip(WIDTH, LENGTH, EDGES, Material::interglas_92125());
    // Swings are faster by the root of gravity, and so is their damping.
    let pace = if setting.y > 0.0 {
        setting.y.sqrt()
    } else {
        1.0
    };
    let physics = PhysicsConfig {
        gravity: GRAVITY * setting.y,
        speed_cap: 0.0,
        ..physics(setting, DAMPING * pace)
    };
    let seconds = SECONDS * pace.recip().max(1.0);
    hang(strip, &physics, Clock::new(seconds, FRAME, setting.x), 30.0)
}

/// x: substeps, y: vertices along the strip.
pub(super) fn strip_grid(setting: &Setting) -> Result<Trial, Refusal> {
    let (length, edges) = (0.37, setting.y as usize - 1);
    let strip = strip(WIDTH, length, edges, Material::interglas_92125());
    let clock = Clock::new(1.2, FRAME, setting.x);
    hang(strip, &physics(setting, 12.0), clock, 20.0)
}

/// x: vertices along a strip of 1 m, y: its width [mm].
pub(super) fn needle(setting: &Setting) -> Result<Trial, Refusal> {
    let edges = setting.x as usize - 1;
    let strip = strip(1e-3 * setting.y, 1.0, edges, Material::interglas_92125());
    let clock = Clock::new(2.0, FRAME, SUBSTEPS);
    hang(strip, &physics(setting, 6.0), clock, 10.0)
}

/// x: substeps, y: stiffness of warps over that of the built-in fabric. A sheet hangs on its
/// upper border from a crumpled, tilted start.
pub(super) fn warp_ratio(setting: &Setting) -> Result<Trial, Refusal> {
    let cells = 6;
    let side = WIDTH * cells as f64;
    let mut material = Material::interglas_92125();
    let warp = &mut material.warp;
    warp.tension = warp.tension.scaled(setting.y);
    warp.compression = warp.compression.scaled(setting.y);
    let sheet = sheet([side; 2], [cells + 1; 2], material);
    let top = sheet.rest[0][1];
    let mut stream = Stream::new(1, Purpose::Evaluation, 0);
    let (sin, cos) = 30f64.to_radians().sin_cos();
    let mut start = laid(&sheet, |[x, y]| {
        let along = y - top;
        let share = if along > 0.0 { 0.05 } else { 0.0 };
        let noise = [0; 3].map(|_| share * WIDTH * stream.normal());
        [
            x + noise[0],
            along * sin + noise[1],
            -along * cos + noise[2],
        ]
    });
    start.fixed.insert_range(0..cells + 1);
    // What a weft stretches under its own weight is below 1e-6 of its length.
    let expected = sheet.rest.iter().map(|[x, y]| [*x, 0.0, top - y]).collect();
    let clock = Clock::new(SECONDS, FRAME, setting.x);
    let physics = PhysicsConfig {
        bending: Bending::Yarns,
        ..physics(setting, DAMPING)
    };
    Trial::new(sheet, &physics, None, start, clock, to(expected))
}

/// x: substeps, y: bending stiffness [N m]. A strip is clamped level by its first two rows,
/// and held against the heavy elastica.
pub(super) fn bending(setting: &Setting) -> Result<Trial, Refusal> {
    let strip = rigid(strip(WIDTH, LENGTH, EDGES, Material::interglas_92125()));
    let edge = LENGTH / EDGES as f64;
    let first = strip.rest[0][1];
    let mut start = laid(&strip, |[x, y]| [x, y - first, 0.0]);
    start.fixed.insert_range(0..4);
    // Curvature begins half an edge from the second row, and so the free length.
    let free = LENGTH - 0.5 * edge;
    let shape = truth::elastica(AREAL_MASS * GRAVITY * free.powi(3) / setting.y);
    let at = |v: usize| {
        let s = (v / 2) as f64 * edge - 0.5 * edge;
        let [reach, drop] = truth::along(&shape, (s / free).max(0.0));
        let y = if v < 2 {
            0.0
        } else {
            0.5 * edge + free * reach
        };
        [strip.rest[v][0], y, -free * drop]
    };
    let expected = (0..strip.vertex_count()).map(at).collect();
    let physics = PhysicsConfig {
        bending: Bending::Yarns,
        bending_stiffness: BendingStiffness::NewtonMetre(setting.y),
        ..physics(setting, DAMPING)
    };
    let clock = Clock::new(1.5 * SECONDS, FRAME, setting.x);
    Trial::new(strip, &physics, None, start, clock, to(expected))
}

/// x: substeps, y: frame [s]. A strip of 370 mm hangs by both ends, 300 mm apart, and starts
/// as a sine. (Swung out of its plane it can come to rest twisted, 2 % off: the strip is a
/// row of stiff triangles.)
pub(super) fn catenary(setting: &Setting) -> Result<Trial, Refusal> {
    let (span, length, edges) = (0.30, 0.37, 32);
    let strip = strip(WIDTH, length, edges, Material::interglas_92125());
    let half = 0.5 * size(&strip);
    let sag = truth::catenary(span, length, half)[1];
    let mut start = laid(&strip, |[x, y]| {
        let down = sag * (std::f64::consts::FRAC_PI_2 * y / half).cos();
        [x, span / length * y, -down]
    });
    // The ends themselves stay where the strip is held.
    start.fixed.insert_range(0..2);
    start.fixed.insert_range(2 * edges..2 * edges + 2);
    let expected = strip.rest.iter().map(|&[x, y]| {
        let [along, up] = truth::catenary(span, length, y);
        [x, along, up - sag]
    });
    let expected = expected.collect();
    let clock = Clock::new(3.0, setting.y, setting.x);
    let physics = physics(setting, 12.0);
    Trial::new(strip, &physics, None, start, clock, to(expected))
}
