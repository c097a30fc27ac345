use super::terrain::Terrain;
use drape_cloth::sim::{Observation, Observations};
use serde::{Deserialize, Serialize};

/// Rows and columns of the observation image. Action `row * columns + column` is the pixel
/// of that vertex; one without a vertex is never allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ImageShape {
    pub rows: usize,
    pub columns: usize,
}

impl ImageShape {
    /// Number of pixels, and so of actions.
    pub fn pixel_count(self) -> usize {
        self.rows * self.columns
    }
}

/// Why an episode ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum End {
    /// The task is over: nothing is worth anything afterwards.
    Terminated,
    /// Cut off by the step limit: the value of the last observation counts.
    Truncated,
    /// The simulation diverged: positions are no numbers, or the end is beyond belief. Nothing
    /// counts that could have followed.
    Diverged,
}

impl End {
    /// Cut off, for whatever reason: the task was not over.
    pub fn is_truncation(self) -> bool {
        self != Self::Terminated
    }
}

/// A finished episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    pub end: End,
    /// Actions taken, in order.
    pub actions: Vec<u32>,
    /// Sum of the rewards, undiscounted, in the task's own unit: what learning is driven by.
    pub total_reward: f32,
    /// How well it was done, 1 at best, whatever was earned: what episodes are compared by. None
    /// if the simulation diverged.
    pub score: Option<f64>,
}

/// What one step of one task gave.
#[derive(Clone, Debug, PartialEq)]
pub struct StepOutcome {
    /// Reward of this step, in the task's own unit.
    pub reward: f32,
    /// Set when this step ended an episode; the task has then been reset already.
    pub episode: Option<Episode>,
}

/// N independent tasks of the same shape, stepped together; each resets on its own.
pub trait Tasks {
    /// Size of the observation image.
    fn shape(&self) -> ImageShape;

    /// Number of tasks.
    fn count(&self) -> usize;

    /// Return of a perfect episode of task `index`, in the unit of the rewards: learners divide by it.
    fn reward_scale(&self, index: usize) -> f32;

    /// What never changes of what tasks show, a scene each.
    fn terrains(&self) -> Vec<&Terrain>;

    /// What all tasks show now, one a row; their views are numbers of terrains.
    fn observations(&self) -> &Observations;

    /// What all tasks showed after the step just taken, before any was reset.
    ///
    /// # Panics
    /// If none has been taken.
    fn last(&self) -> &Observations;

    /// What task `index` shows now.
    fn observation(&self, index: usize) -> Observation<'_> {
        self.observations().row(index)
    }

    /// Takes one action in every task. `actions[i]` must be allowed by the mask of task `i`.
    fn step(&mut self, actions: &[u32]) -> Vec<StepOutcome>;

    /// Everything needed to go on later exactly from here.
    fn save(&self) -> Vec<u8>;

    /// Goes back to what [`Tasks::save`] returned. Fails with a reason if `bytes` are not
    /// from tasks of the same kind, number and shape; nothing is changed then.
    fn load(&mut self, bytes: &[u8]) -> Result<(), String>;
}
