use drape_cloth::math::Stream;
use drape_cloth::sim::Observations;
use drape_task::env::{End, Episode};
use serde::{Deserialize, Serialize};

use super::sections::{decode, encode};
use super::symmetry::{Symmetry, turned};

/// Observations, one a row, and the action taken at each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Moves {
    seen: Observations,
    actions: Vec<u32>,
}

/// A move of an episode that is going on: a row of what was seen of all tasks.
#[derive(Clone, Debug)]
struct Move {
    seen: Observations,
    row: usize,
    action: u32,
}

impl Moves {
    fn new(moves: &[Move]) -> Self {
        Self {
            seen: Observations::gather(moves.iter().map(|m| (&m.seen, m.row))),
            actions: moves.iter().map(|m| m.action).collect(),
        }
    }

    /// Each by itself.
    fn apart(self) -> Vec<Move> {
        let actions = self.actions.into_iter().enumerate();
        let apart = actions.map(|(row, action)| Move {
            seen: self.seen.clone(),
            row,
            action,
        });
        apart.collect()
    }

    /// Whether they are possible on images of `pixel_count` pixels with so many views.
    fn fit(&self, pixel_count: usize, views: usize) -> bool {
        let rows = self.seen.rows().zip(&self.actions);
        self.actions.len() == self.seen.views.len()
            && (self.actions.is_empty() || self.seen.pixel_count == pixel_count)
            && { rows }.all(|(seen, &action)| seen.allows(action) && usize::from(seen.view) < views)
    }
}

/// The best episodes ever finished, to be imitated, and those still going on.
///
/// After self-imitation learning (Oh et al. 2018), which weights each sample by how much its
/// return exceeds the value; here being among the best is the weight. Episodes that were cut
/// off are not kept.
#[derive(Clone, Debug)]
pub struct Memory {
    capacity: usize,
    /// `[scene]`: best first; the older of equals first.
    best: Vec<Vec<Kept>>,
    /// `[task]`: the moves of the episode going on.
    open: Vec<Vec<Move>>,
    /// In which moves are drawn: the identity at least.
    symmetries: Vec<Symmetry>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Kept {
    score: f64,
    moves: Moves,
}

/// A memory in a checkpoint.
#[derive(Serialize, Deserialize)]
struct Saved {
    best: Vec<Vec<Kept>>,
    open: Vec<Moves>,
}

impl Memory {
    /// Room for the `capacity` best episodes of each scene of `task_count` tasks, which are shown in these symmetries.
    pub fn new(
        capacity: usize,
        scene_count: usize,
        task_count: usize,
        symmetries: Vec<Symmetry>,
    ) -> Self {
        Self {
            capacity,
            best: vec![Vec::new(); scene_count],
            open: vec![Vec::new(); task_count],
            symmetries,
        }
    }

    /// Notes what `task` saw, as a row of what all saw, and did and, if that ended its episode, keeps it if
    /// it is among the best.
    pub fn record(
        &mut self,
        task: usize,
        seen: &Observations,
        action: u32,
        episode: Option<&Episode>,
    ) {
        self.open[task].push(Move {
            seen: seen.clone(),
            row: task,
            action,
        });
        let Some(episode) = episode else { return };
        let moves = std::mem::take(&mut self.open[task]);
        let Some(score) = episode.score.filter(|score| score.is_finite()) else {
            return;
        };
        let best = &mut self.best[usize::from(seen.views[task])];
        let rank = best.partition_point(|k| k.score >= score);
        let known = best.iter().any(|k| k.moves.actions == episode.actions);
        if episode.end == End::Terminated && rank < self.capacity && !known {
            best.truncate(self.capacity - 1);
            let moves = Moves::new(&moves);
            best.insert(rank, Kept { score, moves });
        }
    }

    /// Forgets the episodes that are going on.
    pub fn interrupt(&mut self) {
        self.open.iter_mut().for_each(Vec::clear);
    }

    /// `count` moves of the best episodes, each uniformly among all and in one of the symmetries: observations, one a row, and
    /// actions; none if there are none.
    pub fn draw(&self, count: usize, stream: &mut Stream) -> (Observations, Vec<u32>) {
        let moves = self.best.iter().flatten().flat_map(|Kept { moves, .. }| {
            let actions = moves.actions.iter().enumerate();
            actions.map(|(row, &action)| (&moves.seen, row, action))
        });
        let moves: Vec<_> = moves.collect();
        let count = if moves.is_empty() { 0 } else { count };
        let drawn = (0..count).map(|_| moves[stream.below(moves.len())]);
        let drawn: Vec<_> = drawn
            .map(|(seen, row, action)| (seen.row(row), action))
            .collect();
        let ways = self.symmetries.len();
        let ways: Vec<usize> = match ways {
            1 => vec![0; count],
            _ => (0..count).map(|_| stream.below(ways)).collect(),
        };
        turned(&drawn, &self.symmetries, &ways, self.best.len())
    }

    /// All of it as bytes.
    pub fn save(&self) -> Vec<u8> {
        encode(&Saved {
            best: self.best.clone(),
            open: self.open.iter().map(|moves| Moves::new(moves)).collect(),
        })
    }

    /// The memory that [`Memory::save`] wrote, of as much room as this and with possible moves on images of
    /// `pixel_count` pixels only; or why it is none. Episodes that were going on in another number of tasks are
    /// forgotten.
    pub fn loaded(&self, bytes: &[u8], pixel_count: usize) -> Result<Self, String> {
        let Saved { best, open } = decode(bytes)?;
        let views = self.best.len();
        let kept = best.iter().flatten().map(|kept| &kept.moves);
        let fits = best.len() == views && best.iter().all(|best| best.len() <= self.capacity) && {
            kept.chain(&open)
        }
        .all(|moves| moves.fit(pixel_count, views));
        match fits {
            true => Ok(Self {
                capacity: self.capacity,
                best,
                symmetries: self.symmetries.clone(),
                open: match open.len() == self.open.len() {
                    true => open.into_iter().map(Moves::apart).collect(),
                    false => vec![Vec::new(); self.open.len()],
                },
            }),
            false => Err("is of other tasks or another number of episodes".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drape_cloth::math::Purpose;
    use drape_cloth::sim::ALLOWED;
    use drape_task::env::ImageShape;

    /// Room for two episodes.
    fn memory(scenes: usize, tasks: usize) -> Memory {
        let shape = ImageShape {
            rows: 2,
            columns: 4,
        };
        Memory::new(2, scenes, tasks, vec![Symmetry::all(shape)[0]])
    }

    fn play(memory: &mut Memory, actions: &[u32], score: f64, end: End) {
        let seen = Observations::new(vec![0], vec![0.0; 8], vec![ALLOWED; 8]);
        let episode = Episode {
            end,
            actions: actions.to_vec(),
            // What is earned does not matter.
            total_reward: actions.len() as f32,
            score: Some(score),
        };
        for (i, &action) in actions.iter().enumerate() {
            let last = i + 1 == actions.len();
            memory.record(0, &seen, action, last.then_some(&episode));
        }
    }

    #[test]
    fn keeps_the_best_different_terminated_episodes() {
        let mut memory = self::memory(1, 1);
        play(&mut memory, &[1, 2], 1.0, End::Terminated);
        play(&mut memory, &[1, 2], 1.0, End::Terminated);
        play(&mut memory, &[3], 0.5, End::Terminated);
        play(&mut memory, &[4], 9.0, End::Truncated);
        play(&mut memory, &[5], f64::NAN, End::Terminated);
        play(&mut memory, &[6], 0.7, End::Terminated);
        play(&mut memory, &[7], 0.1, End::Terminated);
        let scores: Vec<f64> = memory.best[0].iter().map(|k| k.score).collect();
        assert_eq!(scores, [1.0, 0.7]);
        let mut stream = Stream::new(0, Purpose::Shuffle, 0);
        let (_, mut drawn) = memory.draw(50, &mut stream);
        drawn.sort_unstable();
        drawn.dedup();
        assert_eq!(drawn, [1, 2, 6]);
        memory.record(
            0,
            &Observations::new(vec![0], vec![0.0; 8], vec![ALLOWED; 8]),
            3,
            None,
        );
        let again = self::memory(1, 1).loaded(&memory.save(), 8).unwrap();
        assert_eq!(again.save(), memory.save());
        let more = self::memory(1, 2).loaded(&memory.save(), 8).unwrap();
        assert_eq!((more.open.len(), &more.best), (2, &memory.best));
        assert!(self::memory(2, 1).loaded(&memory.save(), 8).is_err());
        assert!(self::memory(1, 1).loaded(&memory.save(), 9).is_err());
    }
}
