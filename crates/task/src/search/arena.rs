use crate::env::{Draping, Episode, Tasks};
use drape_cloth::math::{Purpose, Stream};

/// Environments to search in, and how many of their steps may be spent.
pub struct Arena<'a> {
    pub(super) env: &'a mut Draping,
    steps: u64,
    spent: u64,
    watch: &'a mut dyn FnMut(u64, &[Episode]) -> bool,
}

impl<'a> Arena<'a> {
    /// `steps` in `env`, where every environment is put back to its start. `watch` is told after
    /// each step of all of them how many are spent and what episodes have ended, and whether to go
    /// on is what it says.
    pub fn new(
        env: &'a mut Draping,
        steps: u64,
        watch: &'a mut dyn FnMut(u64, &[Episode]) -> bool,
    ) -> Self {
        (0..env.count()).for_each(|index| env.reset(index));
        Self {
            env,
            steps,
            spent: 0,
            watch,
        }
    }

    /// A random stream an environment.
    pub(super) fn streams(&self, seed: u64) -> Vec<Stream> {
        let stream = |index| Stream::new(seed, Purpose::Search, index as u32);
        (0..self.env.count()).map(stream).collect()
    }

    /// Takes an action in every environment; the steps of one that has none count, but not what it
    /// does. Gives the episodes that have ended, or none when the search is over.
    pub(super) fn step(&mut self, actions: &[Option<u32>]) -> Option<Vec<Option<Episode>>> {
        let count = self.env.count() as u64;
        if self.spent + count > self.steps {
            return None;
        }
        let idle = |index| {
            let mut allowed = self.env.observation(index).allowed();
            allowed.next().expect("something is allowed")
        };
        let all = actions.iter().enumerate();
        let taken: Vec<u32> = all.map(|(k, a)| a.unwrap_or_else(|| idle(k))).collect();
        let outcomes = self.env.step(&taken).into_iter().zip(actions);
        let ended = outcomes.map(|(outcome, action)| outcome.episode.filter(|_| action.is_some()));
        let ended: Vec<Option<Episode>> = ended.collect();
        self.spent += count;
        let told: Vec<Episode> = ended.iter().flatten().cloned().collect();
        (self.watch)(self.spent, &told).then_some(ended)
    }
}
