use std::sync::Arc;

use super::{Figures, Outcome, THRESHOLD};
use crate::cloth::NOWHERE;
use drape_cloth::fabric::Lamina;
use drape_cloth::math::Vec3;
use drape_cloth::sim::{
    Backend, Bending, Control, Cpu, Model, PhysicsConfig, Precision, Snapshot, Solver, World,
};
use drape_cloth::tool::Tool;

/// Frame where no other is asked for [s], and its substeps.
pub const FRAME: f64 = 1.0 / 60.0;
pub const SUBSTEPS: f64 = 20.0;

/// Place of a cell in its sweep.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Values along the two axes.
    pub x: f64,
    pub y: f64,
    pub solver: Solver,
}

/// Why a cell cannot be simulated at all: what a user would be told.
pub type Refusal = Box<dyn std::error::Error + Send + Sync>;

/// Error of a final state over the size of the sheet [-].
pub type Judge = Box<dyn Fn(&Lamina, &Snapshot) -> f64>;

/// A simulation with a known answer.
pub struct Trial {
    lamina: Lamina,
    model: Model,
    /// None touches nothing.
    tool: Option<Arc<Tool>>,
    start: Snapshot,
    clock: Clock,
    judge: Judge,
}

/// How long a trial lasts and how finely it is stepped.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Duration of a frame [s].
    frame: f64,
    /// Substeps in it.
    substeps: usize,
    frames: usize,
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
        tool: Option<Arc<Tool>>,
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
        let tool = self.tool.as_ref().unwrap_or(&NOWHERE);
        let world = World::new(self.model.clone(), tool.clone());
        let mut cloth = Cpu::new(&world, 1, precision);
        cloth.load(0, &self.start);
        let control = Control {
            dt: self.clock.frame,
            substeps: self.clock.substeps,
            contact_interval: 5,
        };
        let mut figures = Figures::default();
        let mut state = self.start.clone();
        for frame in 1..=self.clock.frames {
            cloth.step(&control, &[]);
            figures.simulated_s = frame as f64 * self.clock.frame;
            figures.substeps += control.substeps;
            if !cloth.finite()[0] {
                return (Outcome::Diverged, figures);
            }
            state = cloth.snapshot(0);
            if !state.is_finite() {
                return (Outcome::NonFinite, figures);
            }
            let speeds = state.velocity.iter().map(|v| Vec3::from(*v).norm());
            let speed = speeds.fold(0.0, f64::max);
            figures.speed_end = Some(speed);
            figures.speed_max = Some(speed.max(figures.speed_max.unwrap_or(0.0)));
        }
        let mut strain = self.lamina.yarn_strain(&state.position);
        strain.iter_mut().for_each(|strain| *strain = strain.abs());
        strain.sort_by(f64::total_cmp);
        let last = strain.len() - 1;
        figures.strain_p95 = Some(strain[(0.95 * last as f64).round() as usize]);
        figures.strain_max = Some(strain[last]);
        let depth = |&x: &[f64; 3]| -tool.distance(x).0;
        let deepest = state.position.iter().map(depth).fold(0.0, f64::max);
        figures.penetration_mm = Some(1e3 * deepest);
        let error = (self.judge)(&self.lamina, &state);
        figures.error = Some(error);
        match error <= THRESHOLD {
            true => (Outcome::Converged, figures),
            false => (Outcome::Wrong, figures),
        }
    }
}

/// The default physics with one damping [1/s], without bending.
pub fn physics(setting: &Setting, damping: f64) -> PhysicsConfig {
    PhysicsConfig {
        solver: setting.solver,
        bending: Bending::Off,
        damping,
        ..PhysicsConfig::default()
    }
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

/// The larger of two means over the size of the sheet: height off the plane z = 0, and error
/// of the distances between pairs of vertices, which no rigid motion changes.
pub fn flatness_error(lamina: &Lamina, state: &Snapshot) -> f64 {
    let count = lamina.vertex_count();
    let height: f64 = state.position.iter().map(|x| x[2].abs()).sum();
    // All pairs of a small sheet; of a large one, those among some vertices.
    let stride = count.div_ceil(200);
    let chosen: Vec<usize> = (0..count).step_by(stride).collect();
    let (mut sum, mut pairs) = (0.0, 0);
    for (i, &a) in chosen.iter().enumerate() {
        for &b in &chosen[..i] {
            let [p, q] = [a, b].map(|v| Vec3::from(state.position[v]));
            let [r, s] = [a, b].map(|v| lamina.rest[v]);
            let rest = (r[0] - s[0]).hypot(r[1] - s[1]);
            sum += ((p - q).norm() - rest).abs();
            pairs += 1;
        }
    }
    (height / count as f64).max(sum / f64::from(pairs)) / size(lamina)
}
