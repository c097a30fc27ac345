//! The draping task as a Markov decision process, N of them at once (paper, Section 4).
//!
//! An action is a vertex: the stencil presses there and lifts. The episode ends when every
//! vertex of the focus region has been under the stencil. What is earned is a [`Reward`]. [`Tasks`] is all that a learner knows of this.

mod config;
mod costs;
mod draping;
mod group;
mod memory;
mod objective;
mod replay;
mod reward;
mod rules;
mod scatter;
mod task;
mod terrain;

pub use config::{EnvConfig, Region};
pub use costs::Costs;
pub use draping::{Draping, EpisodeState, Member};
pub use memory::{MOST_MIB, check_memory, most_environments};
pub use objective::{Goal, Objective};
pub use replay::{Played, ReplayDiverged};
pub use reward::{Reward, Taken, Term, score};
pub use rules::Task;
pub use scatter::{Quantity, Scatter, ScatteredWorld, Spread, Worlds, mean_and_worst_quarter};
pub use task::{End, Episode, ImageShape, StepOutcome, Tasks};
pub use terrain::Terrain;
