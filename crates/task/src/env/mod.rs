//! The draping task as a Markov decision process, N of them at once (paper, Section 4).
//!
//! An action is a vertex: the stencil presses there and lifts. The episode ends when every
//! vertex of the focus region has been under the stencil. What is earned is a [`Reward`]. [`Tasks`] is all that a learner knows of this.

mod config;
mod costs;
mod draping;
mod family;
mod judge;
#[cfg(feature = "gpu")]
mod look;
mod objective;
mod replay;
mod reward;
mod rules;
mod task;
mod terrain;
mod views;

pub use config::{EnvConfig, Region};
pub use costs::Costs;
pub use draping::{Branch, Draping, MOST_MIB, check_memory};
pub use family::Family;
#[cfg(feature = "gpu")]
pub use look::Sight;
pub use objective::{Goal, Objective};
pub use replay::{Played, ReplayDiverged};
pub use reward::{Reward, Taken, Term, score};
pub use task::{
    ALLOWED, DRAPED, End, Episode, ImageShape, Observation, StepOutcome, TOUCHED, Tasks,
};
pub use terrain::Terrain;
