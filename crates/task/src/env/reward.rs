//! What a step earns and what an episode is worth.
//!
//! The *reward* is what learning is driven by: a sum of terms, each step. The *score* is what an
//! episode is judged by, whatever it has earned: the share of the objective that it has removed.

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
    /// The objective at the start [m].
    pub initial: f64,
    pub(super) left: &'a dyn Fn() -> f64,
}

impl Taken<'_> {
    /// The objective after the step [m]; computed when asked for.
    pub fn left(&self) -> f64 {
        (self.left)()
    }
}

/// One term of the reward, in the unit of the objective [m].
pub type Term = fn(&Taken) -> f64;

/// The terms of the reward.
#[derive(Clone, Debug)]
pub struct Reward(Vec<Term>);

impl Default for Reward {
    fn default() -> Self {
        Self(vec![removed_in_the_end])
    }
}

impl Reward {
    /// This reward with one more term.
    pub fn with(mut self, term: Term) -> Self {
        self.0.push(term);
        self
    }

    /// What a step earns [m].
    pub(super) fn of(&self, step: &Taken) -> f32 {
        self.0.iter().map(|term| term(step)).sum::<f64>() as f32
    }
}

/// What an episode has removed of the objective, when it is over.
fn removed_in_the_end(step: &Taken) -> f64 {
    match step.end {
        Some(End::Terminated) => step.initial - step.left(),
        _ => 0.0,
    }
}

/// The share of the objective that is removed, at most 1; below 0 where there is more than at the start.
pub fn score(initial: f64, left: f64) -> f64 {
    1.0 - left / initial
}
