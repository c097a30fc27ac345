use std::path::Path;

use anyhow::{Result, bail};
use serde::{Deserialize, Serialize};

use drape_task::env::{ImageShape, Task};

/// `best_sequence.json`: the best episode ever seen, which can be replayed without the
/// network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BestSequence {
    /// Vertices in the order they were pressed, as the lamina counts them.
    pub vertices: Vec<u32>,
    /// Score of the episode in the task's own steps; where the run has been polished, in those of
    /// its proof.
    pub score: f64,
    /// Rows and columns of the fabric's vertices.
    pub grid: ImageShape,
    /// [`digest`](super::digest) of the configuration in which the sequence was found.
    pub config_digest: String,
    /// The next best episodes, best first: what polish has found before what training has.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<Scored>,
}

/// What an episode pressed, in order, and its score.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scored {
    /// As the lamina counts them.
    pub vertices: Vec<u32>,
    /// As that of [`BestSequence`] [-].
    pub score: f64,
}

impl BestSequence {
    /// The vertices of all of them, best first.
    pub fn all(&self) -> impl Iterator<Item = &Vec<u32>> {
        let others = self.others.iter().map(|other| &other.vertices);
        std::iter::once(&self.vertices).chain(others)
    }

    /// That they are on the grid; `place` is named if not.
    pub(super) fn check_vertices(&self, place: &Path) -> Result<()> {
        let place = place.display();
        let count = self.grid.pixel_count();
        for vertices in self.all() {
            if vertices.is_empty() {
                bail!("{place} has no vertices, expected one or more");
            }
            if let Some(vertex) = vertices.iter().find(|&&v| v as usize >= count) {
                bail!("{place} presses vertex {vertex}, expected one below {count}");
            }
        }
        Ok(())
    }

    /// What is wrong if the sequence was found in another configuration than that of this digest.
    pub fn check_config(&self, expected: &str) -> Result<(), String> {
        let found = &self.config_digest;
        match found == expected {
            true => Ok(()),
            false => Err(format!(
                "found in the configuration with digest {found:.40}, this one has {expected}"
            )),
        }
    }
}

/// The best sequences of a run, best first, each once.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BestPaths(Vec<Scored>);

/// Best episodes that are kept. A score in the task's own steps may not hold in finer physics, and
/// what one policy plays holds or falls together: so there are many, of as many policies.
const MOST: usize = 64;

impl BestPaths {
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
}
