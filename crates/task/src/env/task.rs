use super::terrain::Terrain;
pub use drape_cloth::sim::{DRAPED, TOUCHED};
use fixedbitset::FixedBitSet;
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

/// What the agent sees of one task, and what it may do next (paper, Sections 4.1.1 and
/// 4.2.1). All fields have one entry a pixel, row by row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Observation {
    /// Which of [`Tasks::terrains`] the vertices lie on.
    pub scene: u16,
    /// Vertex is fixed to the tool.
    #[serde(with = "drape_cloth::math::bits")]
    pub draped: FixedBitSet,
    /// Distance to the tool [m].
    pub distance: Vec<f32>,
    /// Vertex has been under the stencil.
    #[serde(with = "drape_cloth::math::bits")]
    pub touched: FixedBitSet,
    /// Actions allowed in this state; never empty.
    #[serde(with = "drape_cloth::math::bits")]
    pub mask: FixedBitSet,
}

/// Bits of [`Observation::marks`] beside those of the cloth: the action is allowed.
pub const ALLOWED: u32 = 8;

impl Observation {
    /// What is draped, touched and allowed, a number a pixel: [`DRAPED`], [`TOUCHED`], [`ALLOWED`].
    pub fn marks(&self) -> Vec<u32> {
        let mut marks = vec![0; self.distance.len()];
        for (set, bit) in [
            (&self.draped, DRAPED),
            (&self.touched, TOUCHED),
            (&self.mask, ALLOWED),
        ] {
            set.ones().for_each(|pixel| marks[pixel] |= bit);
        }
        marks
    }

    /// The observation of distances [m] and [`Observation::marks`].
    pub fn of_marks(scene: u16, distance: Vec<f32>, marks: &[u32]) -> Self {
        let with = |bit: u32| {
            let mut set = FixedBitSet::with_capacity(marks.len());
            set.extend((0..marks.len()).filter(|&pixel| marks[pixel] & bit != 0));
            set
        };
        Self {
            scene,
            draped: with(DRAPED),
            touched: with(TOUCHED),
            mask: with(ALLOWED),
            distance,
        }
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

    /// What task `index` shows now.
    fn observation(&self, index: usize) -> &Observation;

    /// What task `index` showed when the step just taken ended its episode, before the reset.
    ///
    /// # Panics
    /// If it has ended none.
    fn last(&self, index: usize) -> &Observation;

    /// What all tasks show, and what they showed after the step just taken before any was reset, one pair a
    /// scene, where this is on a GPU.
    #[cfg(feature = "gpu")]
    fn sights(&self) -> Option<Vec<[super::look::Sight; 2]>> {
        None
    }

    /// Takes one action in every task. `actions[i]` must be allowed by the mask of task `i`.
    fn step(&mut self, actions: &[u32]) -> Vec<StepOutcome>;

    /// Everything needed to go on later exactly from here.
    fn save(&self) -> Vec<u8>;

    /// Goes back to what [`Tasks::save`] returned. Fails with a reason if `bytes` are not
    /// from tasks of the same kind, number and shape; nothing is changed then.
    fn load(&mut self, bytes: &[u8]) -> Result<(), String>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn observation_survives_its_bytes_and_damaged_bits_are_refused() {
        let set = |count: usize, ones: &[usize]| {
            let mut set = FixedBitSet::with_capacity(count);
            set.extend(ones.iter().copied());
            set
        };
        let observation = Observation {
            scene: 0,
            draped: set(70, &[0, 63, 64, 69]),
            distance: vec![0.5],
            touched: set(64, &[63]),
            mask: set(0, &[]),
        };
        let bytes = postcard::to_allocvec(&observation).unwrap();
        assert_eq!(
            postcard::from_bytes::<Observation>(&bytes).unwrap(),
            observation
        );
        // Too few words, then a bit beyond the length.
        for damaged in [(70usize, vec![0u64]), (1, vec![2])] {
            let mut bytes = postcard::to_allocvec(&damaged).unwrap();
            bytes.extend([0; 16]);
            assert!(postcard::from_bytes::<Observation>(&bytes).is_err());
        }
    }
}
