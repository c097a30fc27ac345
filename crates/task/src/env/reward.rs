//! What a step earns and what an episode is worth.
//!
//! The *reward* is what learning is driven by: a sum of terms, each step. The *score* is what an
//! episode is judged by, whatever it has earned: the share of the region's distance to the tool
//! that it has removed.

use super::config::EnvConfig;
use super::task::End;

/// A step that has been taken, as the terms of the reward see it.
pub struct Taken<'a> {
    /// The task's configuration.
    pub config: &'a EnvConfig,
    /// Why the episode ended with this step, if it did.
    pub end: Option<End>,
    /// Steps of the episode so far, this one included.
    pub steps: usize,
    /// Summed distance of the region to the tool at the start [m].
    pub initial_distance: f64,
    pub(super) distance: &'a dyn Fn() -> f64,
}

impl Taken<'_> {
    /// Summed distance of the region to the tool after the step [m]; computed when asked for.
    pub fn distance(&self) -> f64 {
        (self.distance)()
    }
}

/// One term of the reward, in the unit of a distance [m].
pub type Term = fn(&Taken) -> f64;

/// The terms of the reward. A step in which the simulation diverges earns nothing.
#[derive(Clone, Debug)]
pub struct Reward(Vec<Term>);

impl Default for Reward {
    fn default() -> Self {
        Self(vec![removed_in_the_end])
    }
}

impl Reward {
    /// The same with one more term.
    pub fn with(mut self, term: Term) -> Self {
        self.0.push(term);
        self
    }

    /// What a step earns [m].
    pub(super) fn of(&self, step: &Taken) -> f32 {
        match step.end {
            Some(End::Diverged) => 0.0,
            _ => self.0.iter().map(|term| term(step)).sum::<f64>() as f32,
        }
    }
}

/// The distance that an episode has removed, when it is over.
fn removed_in_the_end(step: &Taken) -> f64 {
    match step.end {
        Some(End::Terminated) => step.initial_distance - step.distance(),
        _ => 0.0,
    }
}

/// The share of the region's distance to the tool that is removed, at most 1; below 0 where there
/// is more than at the start.
pub fn score(initial_distance: f64, distance: f64) -> f64 {
    1.0 - distance / initial_distance
}
