use std::sync::Arc;

use crate::policy::{Seen, Shown};
use drape_cloth::math::Stream;
use drape_task::env::{End, Episode, Observation};
use serde::{Deserialize, Serialize};

/// An observation and the action taken there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Move {
    pub observation: Observation,
    pub action: u32,
}

/// A move of an episode that is going on: on the host, or a row of what was seen on a device.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(into = "Move", from = "Move")]
pub enum Held {
    Host(Move),
    Device {
        shown: Arc<Shown>,
        row: usize,
        action: u32,
    },
}

impl Held {
    /// What a task saw and did.
    pub fn of(seen: &Seen, task: usize, action: u32) -> Self {
        match seen {
            Seen::Host(observations) => Self::Host(Move {
                observation: observations[task].clone(),
                action,
            }),
            Seen::Device(shown) => Self::Device {
                shown: shown.clone(),
                row: task,
                action,
            },
        }
    }

    fn scene(&self) -> usize {
        usize::from(match self {
            Self::Host(step) => step.observation.scene,
            Self::Device { shown, row, .. } => shown.scenes()[*row],
        })
    }
}

impl From<Move> for Held {
    fn from(step: Move) -> Self {
        Self::Host(step)
    }
}

impl From<Held> for Move {
    fn from(held: Held) -> Self {
        on_host(vec![held]).swap_remove(0)
    }
}

/// Moves on the host, fetched together.
fn on_host(held: Vec<Held>) -> Vec<Move> {
    let rows = held.iter().filter_map(|held| match held {
        Held::Host(_) => None,
        Held::Device { shown, row, .. } => Some(shown.select(&[*row])),
    });
    let rows: Vec<Shown> = rows.collect();
    let fetched = match rows.is_empty() {
        true => Vec::new(),
        false => Shown::cat(rows).fetch(),
    };
    let mut fetched = fetched.into_iter();
    let moves = held.into_iter().map(|held| match held {
        Held::Host(step) => step,
        Held::Device { action, .. } => Move {
            observation: fetched.next().expect("as many as rows"),
            action,
        },
    });
    moves.collect()
}

/// The best episodes ever finished, to be imitated, and those still going on.
///
/// After self-imitation learning (Oh et al. 2018), which weights each sample by how much its
/// return exceeds the value; here being among the best is the weight. Episodes that were cut
/// off are not kept.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Memory {
    capacity: usize,
    /// `[scene]`: best first; the older of equals first.
    best: Vec<Vec<Kept>>,
    /// `[task]`: the moves of the episode going on.
    open: Vec<Vec<Held>>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Kept {
    score: f64,
    moves: Vec<Move>,
}

impl Memory {
    /// Room for the `capacity` best episodes of each scene of `task_count` tasks.
    pub fn new(capacity: usize, scene_count: usize, task_count: usize) -> Self {
        Self {
            capacity,
            best: vec![Vec::new(); scene_count],
            open: vec![Vec::new(); task_count],
        }
    }

    /// Notes what `task` did and, if that ended its episode, keeps it if it is among the best.
    pub fn record(&mut self, task: usize, step: Held, episode: Option<&Episode>) {
        let scene = step.scene();
        self.open[task].push(step);
        let Some(episode) = episode else { return };
        let moves = std::mem::take(&mut self.open[task]);
        let Some(score) = episode.score.filter(|score| score.is_finite()) else {
            return;
        };
        let best = &mut self.best[scene];
        let rank = best.partition_point(|k| k.score >= score);
        let same = |k: &Kept| k.moves.iter().map(|m| &m.action).eq(&episode.actions);
        let known = best.iter().any(same);
        if episode.end == End::Terminated && rank < self.capacity && !known {
            best.truncate(self.capacity - 1);
            let moves = on_host(moves);
            best.insert(rank, Kept { score, moves });
        }
    }

    /// The same with all moves on the host.
    pub fn on_host(&self) -> Self {
        let open = self
            .open
            .iter()
            .map(|moves| on_host(moves.clone()).into_iter().map(Held::Host).collect());
        Self {
            open: open.collect(),
            capacity: self.capacity,
            best: self.best.clone(),
        }
    }

    /// Forgets the episodes that are going on.
    pub fn interrupt(&mut self) {
        self.open.iter_mut().for_each(Vec::clear);
    }

    /// `count` moves of the best episodes, each uniformly among all; none if there are none.
    pub fn draw(&self, count: usize, stream: &mut Stream) -> Vec<&Move> {
        let moves: Vec<&Move> = self.kept().flat_map(|k| &k.moves).collect();
        if moves.is_empty() {
            return Vec::new();
        }
        (0..count)
            .map(|_| moves[stream.below(moves.len())])
            .collect()
    }

    fn kept(&self) -> impl Iterator<Item = &Kept> {
        self.best.iter().flatten()
    }

    /// Whether this memory, read from a file, can replace `other`: as much room, and only
    /// possible moves on images of `pixel_count` pixels.
    pub fn fits(&self, other: &Self, pixel_count: usize) -> bool {
        let fits = |m: &Move| {
            let seen = &m.observation;
            let sets = [&seen.draped, &seen.touched, &seen.mask];
            sets.iter().all(|set| set.len() == pixel_count)
                && seen.distance.len() == pixel_count
                && seen.mask.contains(m.action as usize)
                && usize::from(seen.scene) < self.best.len()
        };
        let open = self.open.iter().flatten().filter_map(|held| match held {
            Held::Host(step) => Some(step),
            Held::Device { .. } => None,
        });
        let mut moves = self.kept().flat_map(|k| &k.moves).chain(open);
        self.capacity == other.capacity
            && self.open.len() == other.open.len()
            && self.best.len() == other.best.len()
            && self.best.iter().all(|best| best.len() <= self.capacity)
            && moves.all(fits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drape_cloth::math::Purpose;

    fn play(memory: &mut Memory, actions: &[u32], score: f64, end: End) {
        let observation = Observation {
            scene: 0,
            draped: Default::default(),
            distance: vec![],
            touched: Default::default(),
            mask: Default::default(),
        };
        let episode = Episode {
            end,
            actions: actions.to_vec(),
            // What is earned does not matter.
            total_reward: actions.len() as f32,
            score: Some(score),
        };
        for (i, &action) in actions.iter().enumerate() {
            let step = Move {
                observation: observation.clone(),
                action,
            };
            let last = i + 1 == actions.len();
            memory.record(0, step.into(), last.then_some(&episode));
        }
    }

    #[test]
    fn keeps_the_best_different_terminated_episodes() {
        let mut memory = Memory::new(2, 1, 1);
        play(&mut memory, &[1, 2], 1.0, End::Terminated);
        play(&mut memory, &[1, 2], 1.0, End::Terminated);
        play(&mut memory, &[3], 0.5, End::Terminated);
        play(&mut memory, &[4], 9.0, End::Truncated);
        play(&mut memory, &[5], f64::NAN, End::Terminated);
        play(&mut memory, &[6], 0.7, End::Terminated);
        play(&mut memory, &[7], 0.1, End::Terminated);
        let scores: Vec<f64> = memory.kept().map(|k| k.score).collect();
        assert_eq!(scores, [1.0, 0.7]);
        let mut stream = Stream::new(0, Purpose::Shuffle, 0);
        let mut drawn: Vec<u32> = memory
            .draw(50, &mut stream)
            .iter()
            .map(|m| m.action)
            .collect();
        drawn.sort_unstable();
        drawn.dedup();
        assert_eq!(drawn, [1, 2, 6]);
    }
}
