//! A simulation with a known answer, and how it ends.

use crate::cloth::Piece;
use drape_cloth::fabric::Lamina;
use drape_cloth::math::Vec3;
use drape_cloth::sim::{Backend, Bending, Control, Cpu, PhysicsConfig};
use drape_cloth::sim::{Precision, Snapshot, Solver};

/// Largest error that counts as converged: one per cent of the sheet's size.
pub const THRESHOLD: f64 = 0.01;

/// Frame where no other is asked for [s].
pub const FRAME: f64 = 1.0 / 60.0;

/// How a cell ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    Converged,
    Wrong,
    Diverged,
    Refused,
    NonFinite,
    Panicked,
}

impl Outcome {
    /// All, with their names in tables.
    pub const ALL: [(Self, &'static str); 6] = [
        (Self::Converged, "converged"),
        (Self::Wrong, "wrong"),
        (Self::Diverged, "diverged"),
        (Self::Refused, "refused"),
        (Self::NonFinite, "non_finite"),
        (Self::Panicked, "panicked"),
    ];

    /// As in tables.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }
}

/// What a cell sets: its place in the sweep, and what follows from it.
pub struct Knobs {
    /// Values along the two axes.
    pub x: f64,
    pub y: f64,
    pub solver: Solver,
    /// Duration of a frame [s] and substeps in it: those of an axis, or else the usual.
    pub frame: f64,
    pub substeps: usize,
}

impl Knobs {
    /// Whole frames of at least `seconds`.
    pub fn frames(&self, seconds: f64) -> usize {
        (seconds / self.frame - 1e-9).ceil().max(1.0) as usize
    }
}

/// A trial, unless it cannot be simulated at all: the error is what a user would be told.
pub type Tried = Result<Trial, Box<dyn std::error::Error + Send + Sync>>;

/// Error of a final state over the size of the sheet [-].
type Judge = dyn Fn(&Lamina, &Snapshot) -> f64;

/// A simulation with a known answer.
pub struct Trial {
    piece: Piece,
    /// At least so long [s].
    seconds: f64,
    judge: Box<Judge>,
}

impl Trial {
    /// Checks the physics as every command does.
    pub fn new(
        piece: Piece,
        seconds: f64,
        judge: impl Fn(&Lamina, &Snapshot) -> f64 + 'static,
    ) -> Tried {
        piece.physics.check()?;
        Ok(Self {
            piece,
            seconds,
            judge: Box::new(judge),
        })
    }

    /// Simulates and judges: the outcome, and the error if it came to that.
    pub fn run(&self, knobs: &Knobs, precision: Precision) -> (Outcome, Option<f64>) {
        let piece = &self.piece;
        let mut cloth = Cpu::new(&piece.world(knobs.solver), 1, precision);
        cloth.load(0, &piece.start);
        let control = Control::new(knobs.frame, knobs.substeps, 5);
        let mut state = piece.start.clone();
        for _ in 0..knobs.frames(self.seconds) {
            cloth.step(&control, &[]);
            if !cloth.finite()[0] {
                return (Outcome::Diverged, None);
            }
            state = cloth.snapshot(0);
            if !state.is_finite() {
                return (Outcome::NonFinite, None);
            }
        }
        let error = (self.judge)(&piece.lamina, &state);
        match error <= THRESHOLD {
            true => (Outcome::Converged, Some(error)),
            false => (Outcome::Wrong, Some(error)),
        }
    }
}

/// The default physics with one damping [1/s].
pub fn damped(damping: f64, bending: Bending) -> PhysicsConfig {
    PhysicsConfig {
        bending,
        damping,
        ..PhysicsConfig::default()
    }
}

/// Speeds of all vertices [m/s].
pub fn speeds(state: &Snapshot) -> impl Iterator<Item = f64> {
    state.velocity.iter().map(|v| Vec3::from(*v).norm())
}

/// Longest side of the flat blank [m].
pub fn size(lamina: &Lamina) -> f64 {
    let [x, y] = lamina.rest[0];
    2.0 * x.abs().max(y.abs())
}

/// Mean distance of the vertices from `expected` over the size of the sheet.
pub fn mean_error(lamina: &Lamina, state: &Snapshot, expected: &[[f64; 3]]) -> f64 {
    let apart = |(a, b): (&[f64; 3], &[f64; 3])| (Vec3::from(*a) - Vec3::from(*b)).norm();
    let sum: f64 = state.position.iter().zip(expected).map(apart).sum();
    sum / expected.len() as f64 / size(lamina)
}
