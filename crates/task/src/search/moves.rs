//! Search over the order itself, in scattered worlds: it is changed as [`Board`] does (2-opt and Or-opt of tours;
//! annealing after Kirkpatrick et al. 1983) and judged beside the order that it was made from, in the same worlds,
//! which are new every round.

use std::ops::Range;
use std::sync::Arc;

use super::board::Board;
use super::judge::{DIVERGED, Job, Judge};
use crate::env::{EpisodeState, Scatter, Task};
use drape_cloth::math::{Purpose, Stream};

/// How orders are searched.
#[derive(Clone, Copy, Debug)]
pub struct Moves {
    /// Orders that are changed side by side. At the end of each generation the worse half goes on from the better.
    pub chains: usize,
    /// Candidates of a chain and a round.
    pub candidates: usize,
    /// How much worse a candidate may be, by a chance of 1 in e, in the beginning and at the end [-].
    pub hot: f64,
    pub cold: f64,
}

impl Default for Moves {
    fn default() -> Self {
        Self {
            chains: 12,
            candidates: 6,
            hot: 6e-3,
            cold: 2e-4,
        }
    }
}

/// Worlds of a round. Candidates are seen in the first, those that are left in the second. Where worlds do not
/// differ one is enough. More steps on few worlds come to better orders than few steps on more.
const STAGES: [Range<usize>; 2] = [0..1, 1..2];
/// Generations of a search at least, and presses of one about. Rates take turns by generation: what is judged by one
/// alone is tuned to its steps, and holds less in the twin.
const GENERATIONS: u64 = 10;
const LONGEST: u64 = 60_000;
/// A search has converged when so many generations in a row have brought its chains no more than this on average.
const IDLE: usize = 4;
const CONVERGED: f64 = 1e-3;
/// What the last round counts in the running mean of a chain.
const RECENT: f64 = 0.3;

/// Where a search is.
#[derive(Clone, Copy, Debug)]
pub struct Searching {
    /// Of all chains together.
    pub rounds: u64,
    /// Presses made since it began.
    pub spent: u64,
    /// What the best chain comes to, as a running mean; none before the first round.
    pub best: Option<f64>,
}

/// What a search has found.
#[derive(Clone, Debug)]
pub struct Found {
    /// Orders, best first, with what they come to in worlds that chose none of them.
    pub orders: Vec<(Vec<u32>, f64)>,
    pub rounds: u64,
    /// Whether it had come to its end before the presses were spent.
    pub has_converged: bool,
}

/// Searches from `starts` on, the best first, for so many presses, or as many more as the round of each chain takes
/// that is then begun. `watch` is told where it is and whether to go on is what it says. Gives the orders of the
/// chains and the first start, each once, the better ones.
///
/// # Panics
/// If there is nothing to start from.
pub fn moves(
    judge: &mut Judge,
    starts: &[Vec<u32>],
    method: Moves,
    presses: u64,
    seed: u64,
    watch: impl FnMut(Searching) -> bool + Send,
) -> Found {
    let stages = match judge.worlds().differ() {
        true => &STAGES[..],
        false => &STAGES[..1],
    };
    let worlds = stages[stages.len() - 1].end;
    let board = Board::new(judge.task());
    let vertices = judge.task().scene.lamina.vertex_count();
    let chain = |k: usize| Chain {
        order: starts[k % starts.len()][..].into(),
        off: vec![1.0; vertices],
        mean: f64::NEG_INFINITY,
        proposals: Vec::new(),
        stream: Stream::new(seed, Purpose::Search, k as u32),
        found: Vec::new(),
        rounds: 0,
        spent: 0,
        open: 0,
        parents: Vec::new(),
        candidates: Vec::new(),
    };
    let mut search = Search {
        stride: board.stride(method.chains * worlds),
        board,
        scatter: judge.worlds().scatter.clone(),
        stages,
        method,
        chains: (0..method.chains).map(chain).collect(),
        heat: method.hot,
        until: 0,
        rounds: 0,
        goes_on: true,
        watch,
    };
    let rates = judge.rates();
    let generations = GENERATIONS.max(presses.div_ceil(LONGEST)) as usize;
    let generations = generations.max(rates.len());
    // What chains have come to at each rate at most, and how many generations have brought no more.
    let (mut best, mut idle) = (vec![f64::NEG_INFINITY; rates.len()], 0);
    for (generation, (rate, share)) in turns(&rates, generations).into_iter().enumerate() {
        search.until = (presses as f64 * share) as u64 / method.chains as u64;
        let done = generation as f64 / (generations - 1) as f64;
        search.heat = method.hot * (method.cold / method.hot).powf(done);
        let open = (0..method.chains).filter(|&k| search.chains[k].spent < search.until);
        let open: Vec<usize> = open.collect();
        if open.is_empty() {
            continue;
        }
        let first = open.into_iter().flat_map(|k| search.begin(k)).collect();
        let worth = |task: &Task, end: &EpisodeState| Some((task.worth(end)?, task.off(end)));
        judge.press_on(rate, first, worth, |key, job, ended| {
            search.hear(key, job, ended.found, ended.states)
        });
        // In the order of the chains, not in that in which rounds have ended.
        let chains = search.chains.iter_mut();
        let found: Vec<f64> = chains.flat_map(|chain| chain.found.drain(..)).collect();
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        search.chains.sort_by(|a, b| b.mean.total_cmp(&a.mean));
        idle = match mean < best[rate] + CONVERGED {
            true => idle + 1,
            false => 0,
        };
        best[rate] = best[rate].max(mean);
        let is_last = generation + 1 == generations;
        if is_last || !search.goes_on || idle >= IDLE {
            break;
        }
        search.select();
    }
    let (goes_on, all) = (search.goes_on, &search.chains);
    let mut orders: Vec<&[u32]> = all.iter().map(|chain| &*chain.order).collect();
    // None is worse than what it began with.
    orders.push(&starts[0]);
    orders.sort();
    orders.dedup();
    let first = search.worlds_of(all.iter().map(|chain| chain.rounds).max().unwrap_or(0), 0);
    let ranked = judge.race(rates.len() - 1, &orders, first..first + 21, 2);
    Found {
        orders: ranked
            .into_iter()
            .map(|(k, worth)| (orders[k].to_vec(), worth))
            .collect(),
        rounds: search.rounds,
        has_converged: idle >= IDLE && goes_on,
    }
}

/// The rate of each generation, the finest last, and the share of all presses that are made when it ends: all take
/// equally long.
fn turns(rates: &[f64], generations: usize) -> Vec<(usize, f64)> {
    let rate = |generation: usize| rates.len() - 1 - (generations - 1 - generation) % rates.len();
    let share = |generation: usize| rates[rate(generation)].recip();
    let (whole, mut made) = ((0..generations).map(share).sum::<f64>(), 0.0);
    let turn = |generation| {
        made += share(generation) / whole;
        (rate(generation), made)
    };
    (0..generations).map(turn).collect()
}

/// Chains that are changed, each in rounds of its own.
struct Search<W> {
    board: Board,
    scatter: Scatter,
    stages: &'static [Range<usize>],
    method: Moves,
    /// Presses between two states that are kept.
    stride: usize,
    chains: Vec<Chain>,
    heat: f64,
    /// Presses of a chain at which its generation ends.
    until: u64,
    /// Of all chains together.
    rounds: u64,
    goes_on: bool,
    watch: W,
}

/// An order that is changed.
struct Chain {
    order: Arc<[u32]>,
    /// How far it has left each vertex off the tool, in the world of its last round.
    off: Vec<f64>,
    /// Running mean of what it is worth, each time in new worlds.
    mean: f64,
    /// What has been good apart, together: candidates of the next round.
    proposals: Vec<Arc<[u32]>>,
    stream: Stream,
    /// What it was worth in each round of this generation.
    found: Vec<f64>,
    rounds: u64,
    spent: u64,
    /// Lists of this round that have not ended yet.
    open: usize,
    /// The order in each world: what it is worth and the states that candidates go on from.
    parents: Vec<Option<(f64, Vec<Arc<EpisodeState>>)>>,
    candidates: Vec<Candidate>,
}

struct Candidate {
    order: Arc<[u32]>,
    /// What it is worth in each world where it has been seen.
    scores: Vec<Option<f64>>,
    /// Stages that it has begun.
    begun: usize,
    /// Whether it is not yet worse than its parent.
    is_left: bool,
}

/// What is pressed: the order of a chain or one of its candidates, in a world of the round.
#[derive(Clone, Copy)]
struct Key {
    chain: usize,
    candidate: Option<usize>,
    world: usize,
}

impl<W: FnMut(Searching) -> bool> Search<W> {
    /// Number of the first world of a round.
    fn worlds_of(&self, round: u64, chain: usize) -> u64 {
        let worlds = self.stages[self.stages.len() - 1].end;
        (round * self.chains.len() as u64 + chain as u64) * worlds as u64
    }

    /// Lets the worse half of the chains go on from the better.
    fn select(&mut self) {
        // No two are ever in the worlds of one round.
        let rounds = self.chains.iter().map(|chain| chain.rounds).max();
        let half = self.chains.len().div_ceil(2);
        for k in 0..self.chains.len() {
            self.chains[k].rounds = rounds.expect("a chain at least");
            if k >= half {
                let (better, worse) = self.chains.split_at_mut(k);
                let better = &better[k - half];
                worse[0].order = better.order.clone();
                worse[0].off = better.off.clone();
                worse[0].proposals = better.proposals.clone();
                worse[0].mean = better.mean;
            }
        }
    }

    /// Begins the next round of a chain.
    fn begin(&mut self, k: usize) -> Vec<(Key, Job)> {
        let worlds = self.stages[self.stages.len() - 1].end;
        let first = self.worlds_of(self.chains[k].rounds, k);
        let chain = &mut self.chains[k];
        let mut orders = std::mem::take(&mut chain.proposals);
        while orders.len() < self.method.candidates {
            let Chain {
                order, off, stream, ..
            } = chain;
            orders.push(self.board.changed(order, off, stream).into());
        }
        let candidate = |order| Candidate {
            order,
            scores: vec![None; worlds],
            begun: 0,
            is_left: true,
        };
        chain.candidates = orders.into_iter().map(candidate).collect();
        chain.parents = (0..worlds).map(|_| None).collect();
        chain.open = worlds;
        let job = |world: usize| {
            let key = Key {
                chain: k,
                candidate: None,
                world,
            };
            let job = Job {
                list: chain.order.clone(),
                world: Some(first + world as u64),
                from: None,
                stride: Some(self.stride),
            };
            (key, job)
        };
        (0..worlds).map(job).collect()
    }

    /// Hears what a list is worth in a world and how far it has left each vertex off the tool, if it has not
    /// diverged; gives what is to be pressed because of it.
    fn hear(
        &mut self,
        key: Key,
        job: &Job,
        found: Option<(f64, Vec<f64>)>,
        states: Vec<Arc<EpisodeState>>,
    ) -> Vec<(Key, Job)> {
        let (worth, off) = found.map_or((DIVERGED, None), |(worth, off)| (worth, Some(off)));
        let k = key.chain;
        let first = self.worlds_of(self.chains[k].rounds, k);
        let chain = &mut self.chains[k];
        chain.open -= 1;
        chain.spent += job.left() as u64;
        match key.candidate {
            None => {
                // Of one world, the same whichever ends first.
                if let Some(off) = off.filter(|_| key.world == 0) {
                    chain.off = off;
                }
                chain.parents[key.world] = Some((worth, states));
            }
            Some(c) => chain.candidates[c].scores[key.world] = Some(worth),
        }
        let mut jobs = Vec::new();
        for (c, candidate) in chain.candidates.iter_mut().enumerate() {
            let worlds = candidate.next(&chain.parents, self.stages, 2.0 * self.heat);
            for world in worlds {
                let key = Key {
                    chain: k,
                    candidate: Some(c),
                    world,
                };
                let (_, states) = chain.parents[world].as_ref().expect("it has ended");
                jobs.push((
                    key,
                    candidate.job(&chain.order, states, first + world as u64),
                ));
            }
        }
        chain.open += jobs.len();
        if chain.open > 0 {
            return jobs;
        }
        self.end(k);
        match self.goes_on && self.chains[k].spent < self.until {
            true => self.begin(k),
            false => Vec::new(),
        }
    }

    /// Ends a round of a chain: the best of its candidates takes its place, if it is better or by chance.
    fn end(&mut self, k: usize) {
        let chain = &mut self.chains[k];
        let worth = |scores: &mut dyn Iterator<Item = Option<f64>>| {
            let scores: Option<Vec<f64>> = scores.collect();
            scores.map(|scores| self.scatter.judge(&scores))
        };
        let parents = &mut chain
            .parents
            .iter()
            .map(|one| one.as_ref().map(|one| one.0));
        let now = worth(parents).expect("it was pressed in all");
        let mut left = Vec::new();
        for candidate in chain.candidates.iter().filter(|one| one.is_left) {
            let new = worth(&mut candidate.scores.iter().copied());
            left.extend(new.map(|new| (new, candidate.order.clone())));
        }
        left.sort_by(|a, b| b.0.total_cmp(&a.0));
        chain.mean = match chain.mean.is_finite() {
            true => chain.mean + RECENT * (now - chain.mean),
            false => now,
        };
        let chance = chain.stream.uniform();
        if let Some((new, order)) = left.first()
            && (*new > now || chance < ((new - now) / self.heat).exp())
        {
            let better = left.iter().filter(|one| one.0 > now);
            let better: Vec<&[u32]> = better.map(|one| &*one.1).collect();
            chain.proposals = together(&chain.order, &better);
            chain.order = order.clone();
        }
        chain.found.push(now);
        chain.rounds += 1;
        self.rounds += 1;
        let all = &self.chains;
        let best = all.iter().map(|chain| chain.mean);
        self.goes_on &= (self.watch)(Searching {
            rounds: self.rounds,
            spent: all.iter().map(|chain| chain.spent).sum(),
            best: best.max_by(f64::total_cmp),
        });
    }
}

impl Candidate {
    /// The worlds in which it is to be seen next; it is dropped where it is worse than its parent on average by more
    /// than `least`.
    fn next<S>(
        &mut self,
        parents: &[Option<(f64, S)>],
        stages: &[Range<usize>],
        least: f64,
    ) -> Range<usize> {
        if !self.is_left {
            return 0..0;
        }
        if self.begun > 0 {
            let seen = 0..stages[self.begun - 1].end;
            let own: Option<f64> = self.scores[seen.clone()].iter().copied().sum();
            let of_parent = parents[seen.clone()].iter().flatten().map(|one| one.0);
            let of_parent: f64 = of_parent.sum();
            match own {
                None => return 0..0,
                Some(own) => self.is_left = own > of_parent - least * seen.len() as f64,
            }
        }
        let next = stages.get(self.begun).filter(|_| self.is_left).cloned();
        let next = next.filter(|worlds| parents[worlds.clone()].iter().all(Option::is_some));
        self.begun += usize::from(next.is_some());
        next.unwrap_or(0..0)
    }

    /// From the last state that it shares with its parent.
    fn job(&self, parent: &[u32], states: &[Arc<EpisodeState>], world: u64) -> Job {
        let same = self.order.iter().zip(parent).take_while(|(a, b)| a == b);
        let same = same.count();
        let mut shared = states.iter().rev();
        Job {
            list: self.order.clone(),
            world: Some(world),
            from: shared.find(|state| state.presses().len() <= same).cloned(),
            stride: None,
        }
    }
}

/// Orders that have more than one of the changes which have been good apart: the first two that touch different
/// presses, and all such.
fn together(parent: &[u32], better: &[&[u32]]) -> Vec<Arc<[u32]>> {
    let mut changes: Vec<(Range<usize>, &[u32])> = Vec::new();
    let mut found: Vec<Arc<[u32]>> = Vec::new();
    for order in better {
        let same = |(a, b): &(&u32, &u32)| a == b;
        let from = parent.iter().zip(*order).take_while(same).count();
        let ends = parent[from..].iter().rev().zip(order[from..].iter().rev());
        let behind = ends.take_while(same).count();
        let (to, new) = (parent.len() - behind, &order[from..order.len() - behind]);
        if changes
            .iter()
            .any(|(range, _)| from <= range.end && range.start <= to)
        {
            continue;
        }
        changes.push((from..to, new));
        if changes.len() > 1 {
            changes.sort_by_key(|(range, _)| range.start);
            let mut all = parent.to_vec();
            for (range, new) in changes.iter().rev() {
                all.splice(range.clone(), new.iter().copied());
            }
            found.truncate(1);
            found.push(all.into());
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generations_take_equally_long_and_the_finest_rate_is_last() {
        let rates = [600.0, 1200.0, 2400.0];
        let turns = turns(&rates, 10);
        let begun = [0.0].into_iter().chain(turns.iter().map(|turn| turn.1));
        let time = |(begun, &(rate, made)): (f64, &(usize, f64))| (made - begun) * rates[rate];
        let times: Vec<f64> = begun.zip(&turns).map(time).collect();
        assert!(
            times
                .iter()
                .all(|time| (time / times[0] - 1.0).abs() < 1e-12)
        );
        assert!((turns[9].1 - 1.0).abs() < 1e-12);
        let order: Vec<usize> = turns.iter().map(|turn| turn.0).collect();
        assert_eq!(order, [2, 0, 1, 2, 0, 1, 2, 0, 1, 2]);
    }
}
