use std::sync::Arc;

use super::config::EnvConfig;
use super::draping::{Draping, EpisodeState};
use super::reward::score;
use super::rules::Task;
use super::task::{Episode, Tasks};
use drape_cloth::file::ValueError;
use drape_cloth::scene::Scene;

/// An episode that was played from its start to its end.
#[derive(Clone, Debug)]
pub struct Played {
    pub episode: Episode,
    pub end: EpisodeState,
}

/// A list of presses that could not be pressed to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the simulation diverged after {presses} presses: positions are no numbers, or the end is beyond \
     `env.max_tension` or `env.max_depth_mm`"
)]
pub struct ReplayDiverged {
    /// Presses until then, the one included in which it happened.
    pub presses: usize,
}

impl Draping {
    /// Plays `count` episodes of a task, `most` at a time, and keeps what `of` makes of each. `choose` is given the
    /// environments and the number of the episode that the first of them plays, and gives their actions.
    ///
    /// # Errors
    /// Those of [`Draping::new`].
    pub fn play_all<T>(
        scene: &Arc<Scene>,
        config: &EnvConfig,
        count: usize,
        most: usize,
        mut choose: impl FnMut(&Self, usize) -> Vec<u32>,
        of: impl Fn(&Task, Played) -> T,
    ) -> Result<Vec<T>, ValueError> {
        let mut all = Vec::with_capacity(count);
        for first in (0..count).step_by(most) {
            let mut draping = Self::new(scene.clone(), config, most.min(count - first))?;
            let played = draping.play(|draping| choose(draping, first));
            all.extend(played.into_iter().map(|one| of(draping.task(0), one)));
        }
        Ok(all)
    }

    /// Plays one episode in every environment, from the start. `choose` gives each an action; who
    /// ends early plays on until all have ended, which counts no more.
    pub fn play(&mut self, mut choose: impl FnMut(&Self) -> Vec<u32>) -> Vec<Played> {
        (0..self.count()).for_each(|index| self.reset(index));
        let mut played = vec![None; self.count()];
        while played.iter().any(Option::is_none) {
            let actions = choose(self);
            for (index, outcome) in self.step(&actions).into_iter().enumerate() {
                if let (Some(episode), None) = (outcome.episode, &played[index]) {
                    let end = self.finished(index).expect("it has ended").clone();
                    played[index] = Some(Played { episode, end });
                }
            }
        }
        played.into_iter().flatten().collect()
    }

    /// Presses list `k` of vertices in environment `k`, each from the start, all at once in the
    /// SIMD lanes. Every press is made, whatever the masks allow; a list ends early only where
    /// its simulation diverges, which the result tells.
    ///
    /// `observe` is called with the environments, the index of one of them and the number of its
    /// presses so far: at its start and after each of its presses. Where a list is over, time
    /// passes until all are.
    ///
    /// # Panics
    /// If there is not one list an environment.
    pub fn replay(
        &mut self,
        lists: &[&[u32]],
        mut observe: impl FnMut(&Self, usize, usize),
    ) -> Vec<Result<(), ReplayDiverged>> {
        assert_eq!(lists.len(), self.count(), "one list an environment");
        for index in 0..lists.len() {
            self.reset(index);
            observe(self, index, 0);
        }
        let mut ends = vec![Ok(()); lists.len()];
        let longest = lists.iter().map(|list| list.len()).max().unwrap_or(0);
        for press in 0..longest {
            let next = |(list, end): (&&[u32], &Result<_, _>)| {
                list.get(press).copied().filter(|_| end.is_ok())
            };
            let vertices: Vec<Option<u32>> = lists.iter().zip(&ends).map(next).collect();
            let finite = self.press(&vertices);
            let presses = press + 1;
            for (index, vertex) in vertices.iter().enumerate() {
                let is_last = presses == lists[index].len();
                let can_be = finite[index] && (!is_last || self.is_believable(index));
                match (vertex, can_be) {
                    (None, _) => {}
                    (Some(_), true) => observe(self, index, presses),
                    (Some(_), false) => ends[index] = Err(ReplayDiverged { presses }),
                }
            }
        }
        ends
    }
}

impl Task {
    /// What presses that have ended so are worth: their score less their cost; none if the end is beyond
    /// belief.
    pub fn worth(&self, end: &EpisodeState) -> Option<f64> {
        let (cloth, points) = (end.cloth(), self.points(end.presses()));
        let measures = self.measures(cloth);
        let score = || score(self.initial, self.left(&measures));
        let is_believable = self.is_believable(&measures);
        is_believable.then(|| score() - self.cost(&points, cloth))
    }

    /// How far an episode has left each vertex off the tool [m], what is within 0.2 mm not counted.
    pub fn off(&self, end: &EpisodeState) -> Vec<f64> {
        let at = &end.cloth().position;
        let of = |p: &[f64; 3]| (self.scene.tool.distance(*p).0 - 2e-4).max(0.0);
        at.iter().map(of).collect()
    }
}
