use fixedbitset::FixedBitSet;
use serde::{Deserialize, Serialize};

use super::model::Model;
use super::stepping::Control;
use crate::tool::Tool;

/// The moving state of one environment. f64, so that it holds the bits of any backend.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// [m]
    pub position: Vec<[f64; 3]>,
    /// [m/s]. A fixed vertex moves with the velocity it has, whatever pulls at it.
    pub velocity: Vec<[f64; 3]>,
    /// Vertices that no force moves: clamped or draped.
    #[serde(with = "crate::math::bits")]
    pub fixed: FixedBitSet,
    /// Force density, force / length, of every yarn edge [N/m], yarn by yarn as in the lamina, > 0 in
    /// tension: what the solve along yarns starts from. Missing ones are 0; without that solve all
    /// are missing.
    pub force_density: Vec<f64>,
    /// Sides on which layers of the cloth lie to each other, ascending, as self-collision
    /// remembers them; empty without it.
    pub sides: Vec<u64>,
}

impl Snapshot {
    /// Root mean square speed of all vertices [m/s].
    pub fn v_rms(&self) -> f64 {
        let sum: f64 = self.velocity.iter().flatten().map(|v| v * v).sum();
        (sum / self.velocity.len() as f64).sqrt()
    }

    /// Positions, velocities and force densities are numbers.
    pub fn is_finite(&self) -> bool {
        let all = self.position.iter().chain(&self.velocity);
        all.flatten()
            .chain(&self.force_density)
            .all(|x| x.is_finite())
    }
}

/// A stencil that comes down on some vertices of one lane during a control step.
///
/// It is a plate over the tool whose height falls evenly from `height` to 0 over the first
/// `descent` substeps and stays there; no vertex of the list may be above it.
#[derive(Clone, Debug, PartialEq)]
pub struct Press {
    pub lane: usize,
    pub vertices: Vec<u32>,
    /// Height over the tool at the start [m].
    pub height: f64,
    /// Substeps until the plate is down, > 0.
    pub descent: usize,
}

/// A group of environments of the same model which move in lockstep, one lane each.
pub trait Batch: Send {
    /// Number of environments.
    fn lanes(&self) -> usize;

    /// Sets the state of one lane.
    fn load(&mut self, lane: usize, snapshot: &Snapshot);

    /// The state of one lane, exactly.
    fn snapshot(&self, lane: usize) -> Snapshot;

    /// Position of a vertex [m].
    fn position(&self, lane: usize, vertex: u32) -> [f64; 3];

    /// Puts a vertex `at` a place [m].
    fn place(&mut self, lane: usize, vertex: u32, at: [f64; 3]);

    /// Stops a vertex where it is, for good.
    fn fix(&mut self, lane: usize, vertex: u32);

    /// Moves all lanes by one control step, with at most one press a lane.
    fn step(&mut self, model: &Model, tool: &Tool, control: &Control, presses: &[Press]);

    /// Whether every position of a lane is a number within 100 m of the origin, lane by lane.
    fn sound(&self) -> Vec<bool>;

    /// Distance of some vertices to the tool [m], negative inside, [vertex][lane]. A lane's are
    /// the same bits in any company.
    fn distances(&self, tool: &Tool, vertices: &[u32]) -> Vec<f64>;
}
