use std::sync::Arc;

use super::{Figures, Outcome, Precision, THRESHOLD};
use drape_cloth::fabric::Lamina;
use drape_cloth::math::Isa;
use drape_cloth::sim::{Batch, Control, Model, PhysicsConfig, Snapshot, Solver, alone, alone_f64};
use drape_cloth::tool::Tool;

/// Place of a cell in its sweep.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setting {
    /// Values along the two axes.
    pub x: f64,
    pub y: f64,
    pub solver: Solver,
}

/// Why a cell cannot be simulated at all: what a user would be told.
pub(super) type Refusal = Box<dyn std::error::Error + Send + Sync>;

/// Error of a final state over the size of the sheet [-].
pub(super) type Judge = Box<dyn Fn(&Lamina, &Snapshot) -> f64>;

/// A simulation with a known answer.
pub(super) struct Trial {
    pub lamina: Lamina,
    pub model: Model,
    pub tool: Arc<Tool>,
    pub start: Snapshot,
    pub clock: Clock,
    pub judge: Judge,
}

/// How long a trial lasts and how finely it is stepped.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    /// Duration of a frame [s].
    pub frame: f64,
    /// Substeps in it.
    pub substeps: usize,
    pub frames: usize,
}

impl Clock {
    /// At least `seconds`, in whole frames.
    pub fn new(seconds: f64, frame: f64, substeps: f64) -> Self {
        Self {
            frame,
            substeps: substeps as usize,
            frames: (seconds / frame - 1e-9).ceil().max(1.0) as usize,
        }
    }

    /// Simulated time [s].
    pub fn seconds(&self) -> f64 {
        self.frame * self.frames as f64
    }
}

impl Trial {
    /// Checks the physics as every command does, and lists its passes.
    pub fn new(
        lamina: Lamina,
        physics: &PhysicsConfig,
        tool: Arc<Tool>,
        start: Snapshot,
        clock: Clock,
        judge: Judge,
    ) -> Result<Self, Refusal> {
        physics.check()?;
        Ok(Self {
            model: Model::new(&lamina, physics),
            lamina,
            tool,
            start,
            clock,
            judge,
        })
    }

    /// Simulates and judges.
    pub fn run(&self, precision: Precision) -> (Outcome, Figures) {
        let mut batch: Box<dyn Batch> = match precision {
            Precision::F64 => alone_f64(&self.model, Isa::best()),
            Precision::F32 => alone(&self.model, Isa::best()),
        };
        batch.load(0, &self.start);
        let control = Control {
            dt: self.clock.frame,
            substeps: self.clock.substeps,
            contact_interval: 5,
        };
        let mut figures = Figures {
            speed_max: 0.0,
            ..Figures::NONE
        };
        let mut state = self.start.clone();
        for frame in 1..=self.clock.frames {
            batch.step(&self.model, &self.tool, &control, &[]);
            figures.simulated_s = frame as f64 * self.clock.frame;
            figures.substeps += control.substeps;
            if !batch.sound()[0] {
                return (Outcome::Diverged, figures);
            }
            state = batch.snapshot(0);
            if !state.is_finite() {
                return (Outcome::NonFinite, figures);
            }
            figures.speed_end = speed(&state);
            figures.speed_max = figures.speed_end.max(figures.speed_max);
        }
        self.measure(&state, &mut figures);
        let outcome = if figures.error <= THRESHOLD {
            Outcome::Converged
        } else {
            Outcome::Wrong
        };
        (outcome, figures)
    }

    fn measure(&self, state: &Snapshot, figures: &mut Figures) {
        let strain = self.lamina.yarn_strain(&state.position).into_iter();
        let mut strain: Vec<f64> = strain.map(f64::abs).collect();
        strain.sort_by(f64::total_cmp);
        let last = strain.len() - 1;
        figures.strain_p95 = strain[(0.95 * last as f64).round() as usize];
        figures.strain_max = strain[last];
        let depth = |&x: &[f64; 3]| -self.tool.distance(x).0;
        let deepest = state.position.iter().map(depth).fold(0.0, f64::max);
        figures.penetration_mm = 1e3 * deepest;
        figures.error = (self.judge)(&self.lamina, state);
    }
}

/// Largest speed of a vertex [m/s].
fn speed(state: &Snapshot) -> f64 {
    let squares = state.velocity.iter().map(|v| v.iter().map(|v| v * v).sum());
    squares.fold(0.0, f64::max).sqrt()
}
