use serde::{Deserialize, Serialize};

use super::folder::{BestSequence, Scored};
use drape_task::env::{ImageShape, Task};

/// The best sequences of a run, best first, each once.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Best(Vec<Scored>);

/// Best episodes that are kept. A score in the task's own steps may not hold in finer physics, and
/// what one policy plays holds or falls together: so there are many, of as many policies.
const MOST: usize = 64;

impl Best {
    /// Lists that have been judged, best first.
    pub fn judged(orders: Vec<(Vec<u32>, f64)>) -> Self {
        let scored = |(vertices, score)| Scored { vertices, score };
        Self(orders.into_iter().map(scored).collect())
    }

    /// The vertices of all.
    pub fn lists(&self) -> impl Iterator<Item = &Vec<u32>> {
        self.0.iter().map(|best| &best.vertices)
    }

    /// Score of the best; none before the first.
    pub fn score(&self) -> Option<f64> {
        self.0.first().map(|best| best.score)
    }

    /// Keeps the sequence of an episode, which has no score if it diverged, if it is among the best so
    /// far; whether it is.
    ///
    /// # Panics
    /// If an action has no vertex.
    pub fn remember(&mut self, score: Option<f64>, actions: &[u32], task: &Task) -> bool {
        let Some(score) = score else { return false };
        // Behind those that were as good before.
        let place = self.0.partition_point(|other| other.score >= score);
        if place >= MOST {
            return false;
        }
        let vertices = actions.iter().map(|&action| task.vertex(action));
        let vertices: Option<Vec<u32>> = vertices.collect();
        let vertices = vertices.expect("allowed actions have a vertex");
        if self.0.iter().any(|other| other.vertices == vertices) {
            return false;
        }
        self.0.insert(place, Scored { vertices, score });
        self.0.truncate(MOST);
        true
    }

    /// The better half of these, then of `others` those that are not among them.
    pub fn before(mut self, others: &Self) -> Self {
        self.0.truncate(MOST / 2);
        for other in &others.0 {
            let is_new = self.0.iter().all(|own| own.vertices != other.vertices);
            if is_new && self.0.len() < MOST {
                self.0.push(other.clone());
            }
        }
        self
    }

    /// What is written of them, for a blank of `grid` and a configuration; none without any.
    pub fn sequence(&self, task: &Task, config_digest: String) -> Option<BestSequence> {
        let (best, others) = self.0.split_first()?;
        let lamina = &task.scene.lamina;
        Some(BestSequence {
            vertices: best.vertices.clone(),
            score: best.score,
            grid: ImageShape {
                rows: lamina.rows,
                columns: lamina.columns,
            },
            config_digest,
            others: others.to_vec(),
        })
    }

    /// All of them, as actions.
    pub fn actions(&self, task: &Task) -> Vec<Vec<u32>> {
        let action = |&vertex: &u32| task.action(vertex);
        let actions = |best: &Scored| best.vertices.iter().filter_map(action).collect();
        self.0.iter().map(actions).collect()
    }
}
