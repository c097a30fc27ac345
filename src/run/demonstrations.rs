use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use serde::{Deserialize, Serialize};

use super::best::BestSequence;
use super::folder::{RunFolder, write_json};
use drape_cloth::fabric::Lamina;
use drape_cloth::file::read_json;
use drape_cloth::math::{Purpose, Stream};
use drape_task::env::{Draping, Tasks};
use drape_task::recording::Recording;
use drape_task::search::{Order, choose};

/// Orders of vertices that somebody has pressed, for a learner to imitate before it learns.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Demonstrations(Vec<Vec<u32>>);

impl Demonstrations {
    /// Updates that imitate them where the configuration has none.
    pub const PRETRAINING: usize = 500;

    /// Reads recordings, or sequences as `best_sequence.json` has them, of presses on this blank.
    pub fn read(files: &[PathBuf], lamina: &Lamina) -> Result<Self> {
        let read = |file: &PathBuf| {
            let place = file.display();
            let is_sequence = file.extension().is_some_and(|end| end == "json");
            let (vertices, is_of_blank) = match is_sequence {
                true => {
                    let read: BestSequence = read_json(file, "a sequence")?;
                    let is_alike =
                        [read.grid.rows, read.grid.columns] == [lamina.rows, lamina.columns];
                    (read.vertices, is_alike)
                }
                false => {
                    let read = Recording::read(file)?;
                    (read.vertices(), read.rest == lamina.rest)
                }
            };
            let count = lamina.vertex_count();
            if !is_of_blank || vertices.iter().any(|&v| v as usize >= count) {
                bail!(
                    "{place}: its presses are on another blank than the task's, of {count} vertices"
                );
            }
            if vertices.is_empty() {
                bail!("{place}: nothing has been pressed");
            }
            Ok(vertices)
        };
        Ok(Self(files.iter().map(read).collect::<Result<_>>()?))
    }

    /// Refuses presses that are not on this blank.
    pub(super) fn check(&self, lamina: &Lamina) -> Result<()> {
        let count = lamina.vertex_count();
        let outside = self.0.iter().flatten().find(|&&v| v as usize >= count);
        outside.map_or(Ok(()), |v| {
            bail!("a press is on vertex {v}, expected one below {count}")
        })
    }

    /// Puts others before them.
    pub(super) fn insert(&mut self, others: Self) {
        self.0.splice(0..0, others.0);
    }

    /// The vertices of each, in order.
    pub fn lists(&self) -> &[Vec<u32>] {
        &self.0
    }

    /// Keeps them with a run.
    pub fn keep(&self, folder: &RunFolder) -> Result<()> {
        match self.0.is_empty() {
            true => Ok(()),
            false => write_json(&place(&folder.path), self),
        }
    }

    /// Those that a run keeps.
    pub(super) fn of(folder: &RunFolder) -> Result<Self> {
        let place = place(&folder.path);
        match place.exists() {
            true => Ok(read_json(&place, "demonstrations")?),
            false => Ok(Self::default()),
        }
    }

    /// The next action of one that is allowed in a task, `pressed` of whose presses have been looked at. What is not
    /// allowed is passed over: a person may press as the rules do not.
    pub(super) fn next(
        &self,
        number: usize,
        pressed: &mut usize,
        tasks: &Draping,
        task: usize,
    ) -> Option<u32> {
        let list = self.0.get(number)?;
        while let Some(&vertex) = list.get(*pressed) {
            *pressed += 1;
            let action = tasks.action(vertex);
            let allowed = action.filter(|&action| tasks.observation(task).allows(action));
            if allowed.is_some() {
                return allowed;
            }
        }
        None
    }
}

impl FromIterator<Vec<u32>> for Demonstrations {
    fn from_iter<I: IntoIterator<Item = Vec<u32>>>(orders: I) -> Self {
        Self(orders.into_iter().collect())
    }
}

fn place(run: &Path) -> PathBuf {
    run.join("demonstrations.json")
}

/// What a learner that imitates is shown first by one of the environments on a scene: half of them press
/// outwards from places, the others sweep in all directions.
pub(super) fn beginners_order(tasks: &Draping, alike: &[usize], number: usize) -> u32 {
    let half = alike.len().div_ceil(2);
    let (order, index, count) = match number.checked_sub(half) {
        None => (Order::Outwards, number, half),
        Some(index) => (Order::Sweep, index, alike.len() - half),
    };
    // Neither order is drawn.
    let mut stream = Stream::new(0, Purpose::Evaluation, 0);
    let share = index as f64 / count as f64;
    choose(tasks, alike[number], order, share, &mut stream)
}
