//! Search over the order itself, in scattered worlds: pieces and whole strokes are reversed or put
//! elsewhere, single presses shifted, dropped, put in (2-opt and Or-opt of tours; annealing after Kirkpatrick
//! et al. 1983), beside the order that it was made from and in the same worlds, which are new every round.

use std::ops::Range;
use std::sync::Arc;

use super::judge::{DIVERGED, Job, Judge};
use crate::env::{EpisodeState, Task};
use drape_cloth::math::{Purpose, Stream};

/// How orders are searched.
#[derive(Clone, Copy, Debug)]
pub struct Moves {
    /// Orders that are changed side by side in the beginning; at each third of the search the worse half is
    /// given up.
    pub chains: usize,
    /// Candidates of a round, shared by the chains.
    pub candidates: usize,
    /// How much worse a candidate may be, by a chance of 1 in e, in the beginning and at the end [-].
    pub hot: f64,
    pub cold: f64,
}

impl Default for Moves {
    fn default() -> Self {
        Self {
            chains: 8,
            candidates: 48,
            hot: 6e-3,
            cold: 2e-4,
        }
    }
}

/// Worlds of a round. Candidates are seen in the first, those that are left in the second, and so on.
/// Where worlds do not differ one is enough.
const STAGES: [Range<usize>; 3] = [0..1, 1..2, 2..4];
/// A search has converged when so many rounds in a row have brought its best chain no more than this.
const CONVERGED: (u64, f64) = (60, 1e-3);
/// Bytes of the states that may be kept of a round.
const MOST_BYTES: usize = 512 << 20;

/// Where a search is.
#[derive(Clone, Copy, Debug)]
pub struct Searching {
    pub round: u64,
    /// Presses made since it began.
    pub spent: u64,
    /// What the best chain has come to, on average since it changed.
    pub best: f64,
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

/// An order that is changed.
#[derive(Clone)]
struct Chain {
    order: Vec<u32>,
    /// What it was worth in the rounds since it changed, summed, and their number.
    sum: f64,
    rounds: f64,
}

impl Chain {
    fn mean(&self) -> f64 {
        self.sum / self.rounds.max(1.0)
    }
}

/// Searches from `starts` on for so many presses. `watch` is told where it is and whether to go on is what it
/// says. Gives the orders of the chains that are left and those they began with, each once, the better ones.
///
/// # Panics
/// If there is nothing to start from.
pub fn moves(
    judge: &mut Judge,
    starts: &[Vec<u32>],
    method: Moves,
    presses: u64,
    seed: u64,
    mut watch: impl FnMut(Searching) -> bool,
) -> Found {
    let (board, mut stream) = (
        Board::new(judge.task()),
        Stream::new(seed, Purpose::Search, 0),
    );
    let stages = match judge.worlds().differ() {
        true => &STAGES[..],
        false => &STAGES[..1],
    };
    let count_of_worlds = stages[stages.len() - 1].end;
    let stride = board.stride(method.chains * count_of_worlds);
    let chain = |k: usize| Chain {
        order: starts[k % starts.len()].clone(),
        sum: 0.0,
        rounds: 0.0,
    };
    let mut chains: Vec<Chain> = (0..method.chains).map(chain).collect();
    let before = judge.spent();
    let (mut round, mut at_best, mut goes_on) = (0, (0, f64::NEG_INFINITY), true);
    let has_converged = loop {
        let spent = judge.spent() - before;
        if spent >= presses || !goes_on {
            break false;
        }
        let share = spent as f64 / presses as f64;
        let count = (method.chains >> (3.0 * share) as usize).max(1);
        if count < chains.len() {
            chains.sort_by(|a, b| b.mean().total_cmp(&a.mean()));
            chains.truncate(count);
        }
        let each = (method.candidates / chains.len()).max(1);
        let first = round * count_of_worlds as u64;
        let worlds: Vec<u64> = (first..first + count_of_worlds as u64).collect();
        let heat = method.hot * (method.cold / method.hot).powf(share);
        let parents = press_parents(judge, &chains, &worlds, stride);
        let mut changed: Vec<Vec<u32>> = Vec::new();
        for chain in &chains {
            changed.extend((0..each).map(|_| board.changed(&chain.order, &mut stream)));
        }
        let seen: Vec<(&[u32], &Parent)> = (changed.iter().enumerate())
            .map(|(c, order)| (&**order, &parents[c / each]))
            .collect();
        let scores = press_candidates(judge, &seen, &worlds, stages, 2.0 * heat);
        let worth = |scores: &[f64]| judge.worlds().scatter.judge(scores);
        for (k, (chain, parent)) in chains.iter_mut().zip(&parents).enumerate() {
            let mut now = worth(&parent.scores);
            chain.sum += now;
            chain.rounds += 1.0;
            for c in k * each..(k + 1) * each {
                let Some(scores) = &scores[c] else { continue };
                let (new, chance) = (worth(scores), stream.uniform());
                if new > now || chance < ((new - now) / heat).exp() {
                    now = new;
                    *chain = Chain {
                        order: changed[c].clone(),
                        sum: new,
                        rounds: 1.0,
                    };
                }
            }
        }
        round += 1;
        let mean = |k: &usize| chains[*k].mean();
        let by_mean = |a: &usize, b: &usize| mean(a).total_cmp(&mean(b));
        let best = (0..chains.len()).max_by(by_mean).expect("a chain at least");
        let best = chains[best].mean();
        let (rounds, more) = CONVERGED;
        if best > at_best.1 + more {
            at_best = (round, best);
        } else if round - at_best.0 >= rounds {
            break true;
        }
        goes_on = watch(Searching {
            round,
            spent: judge.spent() - before,
            best,
        });
    };
    // None is worse than what it began with.
    let begun = starts.iter().take(method.chains).cloned();
    let mut orders: Vec<Vec<u32>> = chains.into_iter().map(|chain| chain.order).collect();
    orders.extend(begun);
    orders.sort();
    orders.dedup();
    let lists: Vec<&[u32]> = orders.iter().map(|order| &**order).collect();
    let first = round * count_of_worlds as u64;
    let ranked = judge.race(&lists, first..first + 21, 2, |_, _| ());
    Found {
        orders: ranked
            .into_iter()
            .map(|(k, worth)| (orders[k].clone(), worth))
            .collect(),
        rounds: round,
        has_converged,
    }
}

/// An order as it was pressed in the worlds of a round.
struct Parent {
    order: Vec<u32>,
    /// What it is worth in each world, and the states that candidates go on from.
    scores: Vec<f64>,
    states: Vec<Vec<Arc<EpisodeState>>>,
}

/// Presses the orders of chains.
fn press_parents(
    judge: &mut Judge,
    chains: &[Chain],
    worlds: &[u64],
    stride: usize,
) -> Vec<Parent> {
    let jobs = chains.iter().flat_map(|chain| {
        worlds.iter().map(|&world| Job {
            list: &chain.order,
            world: Some(world),
            from: None,
        })
    });
    let jobs: Vec<Job> = jobs.collect();
    let mut ended = judge
        .press(&jobs, Some(stride), Task::worth, |_, _| ())
        .into_iter();
    let parent = |chain: &Chain| {
        let own = ended.by_ref().take(worlds.len());
        let (scores, states) = own
            .map(|one| (one.found.unwrap_or(DIVERGED), one.states))
            .unzip();
        Parent {
            order: chain.order.clone(),
            scores,
            states,
        }
    };
    chains.iter().map(parent).collect()
}

/// Presses candidates, each beside its parent, stage by stage. Who is worse than that on average by more than
/// `least` is seen in no further world. Gives what those that are left are worth in each.
fn press_candidates(
    judge: &mut Judge,
    candidates: &[(&[u32], &Parent)],
    worlds: &[u64],
    stages: &[Range<usize>],
    least: f64,
) -> Vec<Option<Vec<f64>>> {
    // From the last state that it shares with its parent.
    let job = |c: usize, world: usize| {
        let (list, parent) = candidates[c];
        let same = list.iter().zip(&parent.order);
        let same = same.take_while(|(a, b)| a == b).count();
        let mut states = parent.states[world].iter().rev();
        Job {
            list,
            world: Some(worlds[world]),
            from: states.find(|state| state.presses().len() <= same).cloned(),
        }
    };
    let mut scores = vec![Some(Vec::new()); candidates.len()];
    for stage in stages {
        let open: Vec<usize> = (0..scores.len()).filter(|&c| scores[c].is_some()).collect();
        let jobs = open
            .iter()
            .flat_map(|&c| stage.clone().map(move |w| (c, w)));
        let jobs: Vec<Job> = jobs.map(|(c, w)| job(c, w)).collect();
        let ended = judge.press(&jobs, None, Task::worth, |_, _| ());
        let mean = |scores: &[f64]| scores.iter().sum::<f64>() / stage.end as f64;
        for (c, ended) in open.into_iter().zip(ended.chunks(stage.len())) {
            let mut own = scores[c].take().unwrap_or_default();
            own.extend(ended.iter().map(|one| one.found.unwrap_or(DIVERGED)));
            let parent = &candidates[c].1.scores[..stage.end];
            scores[c] = (mean(&own) > mean(parent) - least).then_some(own);
        }
    }
    scores
}

/// Where orders are changed: the flat blank.
struct Board {
    /// Vertices of the region.
    vertices: Vec<u32>,
    rest: Vec<[f64; 2]>,
    /// Vertices beside each, of the region.
    beside: Vec<Vec<u32>>,
    /// Presses nearer than this are of one stroke [m].
    join: f64,
}

impl Board {
    fn new(task: &Task) -> Self {
        let lamina = &task.scene.lamina;
        let vertices: Vec<u32> = task
            .region_vertices()
            .filter(|&v| task.action(v).is_some())
            .collect();
        let mut is_inside = vec![false; lamina.vertex_count()];
        vertices.iter().for_each(|&v| is_inside[v as usize] = true);
        let beside = |v: u32| {
            lamina
                .neighbors(v)
                .filter(|&w| is_inside[w as usize])
                .collect()
        };
        Self {
            beside: (0..lamina.vertex_count() as u32).map(beside).collect(),
            rest: lamina.rest.clone(),
            join: task.config.join_distance(),
            vertices,
        }
    }

    /// Presses between two states that are kept, so that those of so many lists fit into the memory.
    fn stride(&self, lists: usize) -> usize {
        let presses = self.vertices.len().div_ceil(5);
        let state = 150 * self.rest.len();
        (lists * presses * state).div_ceil(MOST_BYTES).max(1)
    }

    fn apart(&self, a: u32, b: u32) -> f64 {
        let [[x0, y0], [x1, y1]] = [a, b].map(|v| self.rest[v as usize]);
        (x1 - x0).hypot(y1 - y0)
    }

    /// Where each stroke begins, and the length of the order.
    fn strokes(&self, order: &[u32]) -> Vec<usize> {
        let is_new = |k: &usize| *k == 0 || self.apart(order[k - 1], order[*k]) > self.join;
        let mut begins: Vec<usize> = (0..order.len()).filter(is_new).collect();
        begins.push(order.len());
        begins
    }

    /// One that differs by one to three moves.
    fn changed(&self, order: &[u32], stream: &mut Stream) -> Vec<u32> {
        let mut new = order.to_vec();
        let count = 1 + [0, 0, 0, 1, 1, 2][stream.below(6)];
        for _ in 0..count {
            self.change(&mut new, stream);
        }
        if new == order {
            self.change(&mut new, stream);
        }
        new
    }

    fn change(&self, order: &mut Vec<u32>, stream: &mut Stream) {
        let n = order.len();
        if n < 4 {
            let vertex = self.vertices[stream.below(self.vertices.len())];
            return order.push(vertex);
        }
        match stream.below(20) {
            // A piece is reversed,
            0..3 => {
                let from = stream.below(n - 1);
                let to = (from + 2 + stream.below(11)).min(n);
                order[from..to].reverse();
            }
            // put elsewhere,
            3..8 => {
                let from = stream.below(n - 3);
                let piece: Vec<u32> = order.drain(from..from + 1 + stream.below(4)).collect();
                self.put(order, piece, stream);
            }
            // a stroke is reversed, or put elsewhere,
            8..11 => {
                let strokes = self.strokes(order);
                let k = stream.below(strokes.len() - 1);
                let own = strokes[k]..strokes[k + 1];
                if stream.below(3) == 0 || own.len() == n {
                    order[own].reverse();
                } else {
                    let piece: Vec<u32> = order.drain(own).collect();
                    self.put(order, piece, stream);
                }
            }
            // a press is shifted,
            11..15 => {
                let k = stream.below(n);
                let beside = &self.beside[order[k] as usize];
                if !beside.is_empty() {
                    order[k] = beside[stream.below(beside.len())];
                }
            }
            // one or two are dropped,
            15..18 => {
                let k = stream.below(n - 1);
                order.drain(k..k + 1 + stream.below(2));
            }
            // one is put in: half way to the next, or anywhere.
            18 => {
                let k = stream.below(n - 1);
                let [a, b] = [order[k], order[k + 1]].map(|v| self.rest[v as usize]);
                let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
                let off = |&v: &u32| {
                    let [x, y] = self.rest[v as usize];
                    (x - middle[0]).hypot(y - middle[1])
                };
                let all = self.vertices.iter().copied();
                let nearest = all.min_by(|a, b| off(a).total_cmp(&off(b)));
                order.insert(k + 1, nearest.expect("a region has vertices"));
            }
            _ => {
                let vertex = self.vertices[stream.below(self.vertices.len())];
                self.put(order, vec![vertex], stream);
            }
        }
    }

    /// Puts a piece, either way round, beside a press that is near to one of its ends, or anywhere.
    fn put(&self, order: &mut Vec<u32>, mut piece: Vec<u32>, stream: &mut Stream) {
        let (first, last) = (piece[0], piece[piece.len() - 1]);
        let place = match stream.below(4) {
            0 => stream.below(order.len() + 1),
            _ => {
                let mut nearest = (f64::INFINITY, 0, false);
                for (k, &v) in order.iter().enumerate() {
                    for (end, is_last) in [(first, false), (last, true)] {
                        let off = self.apart(v, end) + 0.7 * self.join * stream.uniform();
                        if off < nearest.0 {
                            nearest = (off, k, is_last);
                        }
                    }
                }
                let (_, k, is_last) = nearest;
                // Behind it the piece begins with that end, before it it ends so.
                let is_behind = stream.below(2) == 0;
                if is_last == is_behind {
                    piece.reverse();
                }
                k + usize::from(is_behind)
            }
        };
        order.splice(place..place, piece);
    }
}
