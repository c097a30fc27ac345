//! The draping task as a Markov decision process, N of them at once.

mod task;

pub use task::{End, Episode, Observation, Outcome, Shape, Tasks};
