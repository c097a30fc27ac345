use std::sync::Arc;
use std::time::Instant;

use anyhow::{Result, bail};

use super::best::BestPaths;
use super::config::RunConfig;
use drape_cloth::scene::Scene;
use drape_proof::orders::sequences;
use drape_task::env::{Draping, Episode};
use drape_task::search::{
    Arena, CrossEntropy, Found, Judge, Moves, Order, Searching, cross_entropy, moves,
};

/// Known lists that a search by moves looks at before it begins.
pub const KNOWN: usize = 16;

/// Where nothing is known, the cross-entropy method comes first: moves alone stay with the kind of path that they begin
/// with. It has so many presses, but neither less nor more than these shares of all.
const DRAWN: u64 = 60_000;
const DRAWN_SHARES: [f64; 2] = [0.25, 0.75];

/// Share of its time after which a search chooses among what it has found.
const SEARCHING: f64 = 0.85;

/// How long a search goes on.
#[derive(Clone, Copy, Debug)]
pub enum Budget {
    /// So many presses, which come to the same on every machine of a kind.
    Presses(u64),
    /// Until then, with as many as the machine makes.
    Until(Instant),
}

impl Budget {
    /// The share that is spent, of a search that began then.
    pub fn share(self, began: Instant, spent: u64) -> f64 {
        match self {
            Self::Presses(presses) => (spent as f64 / presses.max(1) as f64).min(1.0),
            Self::Until(end) => {
                let all = end.saturating_duration_since(began).as_secs_f64();
                (began.elapsed().as_secs_f64() / all.max(1e-9)).min(1.0)
            }
        }
    }
}

/// The best of `known` lists, or else of what the cross-entropy method finds in the world of the scene, and of orders that
/// anybody could think of, changed by moves; with the presses made in all. `go_on` is told where the search is, and whether
/// to go on is what it says: a search that ends before its moves gives what the cross-entropy method has found, with scores
/// of the world of the scene.
pub fn search_by_moves(
    judge: &mut Judge,
    scene: &Arc<Scene>,
    config: &RunConfig,
    known: Vec<Vec<u32>>,
    budget: Budget,
    mut go_on: impl FnMut(Searching) -> bool + Send,
) -> Result<(Found, u64)> {
    let (began, at_first) = (Instant::now(), judge.spent());
    let is_within = |share: f64| match budget {
        Budget::Presses(_) => true,
        Budget::Until(_) => budget.share(began, 0) < share,
    };
    let at = |spent| Searching {
        rounds: 0,
        spent,
        best: None,
    };
    let (mut starts, mut drawn) = (known, 0);
    let mut is_wanted = go_on(at(drawn));
    if starts.is_empty() {
        let mut best = BestPaths::default();
        let mut watch = |spent, ended: &[Episode]| {
            for episode in ended {
                best.remember(episode.score, &episode.actions, judge.task());
            }
            drawn = spent;
            let [least, most] = DRAWN_SHARES;
            is_wanted = go_on(at(spent));
            is_wanted && (is_within(least) || spent < DRAWN && is_within(most))
        };
        let mut draping = Draping::new(scene.clone(), &config.env, config.environments)?;
        let most = match budget {
            Budget::Presses(presses) => {
                let [least, most] = DRAWN_SHARES.map(|share| (share * presses as f64) as u64);
                DRAWN.clamp(least, most)
            }
            Budget::Until(_) => u64::MAX,
        };
        let mut arena = Arena::new(&mut draping, most, &mut watch);
        let method = CrossEntropy::alike(config.search_alike);
        cross_entropy(&mut arena, method, config.seed);
        if !is_wanted {
            let found = Found {
                orders: best.into_judged(),
                rounds: 0,
                has_converged: false,
            };
            return Ok((found, drawn));
        }
        starts.extend(best.lists().cloned());
    }
    starts.truncate(KNOWN);
    for (order, count) in [(Order::Outwards, 8), (Order::Sweep, 4), (Order::Random, 4)] {
        starts.extend(sequences(scene, &config.env, order, count, config.seed)?);
    }
    if starts.is_empty() {
        bail!("every order diverges, expected one to begin with: raise `env.substep_rate`");
    }
    let method = Moves::default();
    let lists: Vec<&[u32]> = starts.iter().map(|list| &**list).collect();
    let (before, racing) = (judge.spent(), Instant::now());
    // Numbers that the search comes to never.
    let ranked = judge.race(0, &lists, 1 << 30..(1 << 30) + 9, method.chains);
    let chosen = ranked.iter().take(method.chains);
    let chosen: Vec<Vec<u32>> = chosen.map(|&(k, _)| starts[k].clone()).collect();
    let spent = drawn + judge.spent() - before;
    let left = match budget {
        Budget::Presses(presses) => presses.saturating_sub(spent),
        Budget::Until(end) => {
            // As fast as the race was, which was in the coarsest steps.
            let raced = (judge.spent() - before) as f64 / racing.elapsed().as_secs_f64();
            let rates = config.scatter.rated(&config.env);
            let rates: Vec<f64> = rates
                .iter()
                .map(|env| env.stepping().substep_rate)
                .collect();
            let slower = rates.iter().sum::<f64>() / (rates.len() as f64 * rates[0]);
            let seconds = end.saturating_duration_since(Instant::now()).as_secs_f64();
            (SEARCHING * seconds * raced / slower) as u64
        }
    };
    let watch = |at: Searching| {
        let spent = spent + at.spent;
        go_on(Searching { spent, ..at }) && is_within(SEARCHING)
    };
    let found = moves(judge, &chosen, method, left, config.seed, watch);
    Ok((found, drawn + judge.spent() - at_first))
}
