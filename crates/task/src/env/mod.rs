//! The draping task as a Markov decision process, N of them at once (paper, Section 4).
//!
//! An action is a vertex: the stencil presses there and lifts. The episode ends when every
//! vertex of the focus region has been under the stencil; only then is there a reward, the
//! distance to the tool that has been removed. [`Tasks`] is all that a learner knows of this.

mod config;
mod draping;
mod replay;
mod rules;
mod stencil;
mod task;

pub use config::{EnvConfig, EnvError, Precision, Region};
pub use draping::{Draping, Finished};
pub use replay::Diverged;
pub use task::{End, Episode, Observation, Outcome, Shape, Tasks};
