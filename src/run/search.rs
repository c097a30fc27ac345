use std::sync::Arc;
use std::time::Instant;

use anyhow::{Result, bail};

use drape_cloth::scene::Scene;
use drape_proof::orders::sequences;
use drape_task::env::EnvConfig;
use drape_task::search::{Found, Judge, Moves, Order, Searching, inwards, moves};

/// Known lists that a search by moves looks at before it begins.
pub const KNOWN: usize = 16;

/// Share of a search that may be spent on orders inwards, which are many.
const INWARDS: f64 = 0.25;

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

/// The best of what is `known` and of orders that anybody could think of for the task on a scene, changed by moves under a
/// seed; with the presses
/// made in all. `go_on` is told where the search is, and whether to go on is what it says: a search that ends before its
/// moves gives what it would begin with.
pub fn search_by_moves(
    judge: &mut Judge,
    (scene, env, seed): (&Arc<Scene>, &EnvConfig, u64),
    known: Vec<Vec<u32>>,
    budget: Budget,
    mut go_on: impl FnMut(Searching) -> bool + Send,
) -> Result<(Found, u64)> {
    let (began, before) = (Instant::now(), judge.spent());
    let at = |spent| Searching {
        rounds: 0,
        spent,
        best: None,
    };
    let mut is_wanted = go_on(at(0));
    let mut starts = known;
    starts.truncate(KNOWN);
    for (order, count) in [(Order::Outwards, 8), (Order::Sweep, 4), (Order::Random, 4)] {
        starts.extend(sequences(scene, env, order, count, seed)?);
    }
    // Worlds that the search comes to never.
    let racing = (1 << 30)..(1 << 30) + 9;
    starts.extend(inwards(judge, racing.end, KNOWN, |spent| {
        is_wanted = is_wanted && go_on(at(spent));
        is_wanted && budget.share(began, spent) < INWARDS
    }));
    if starts.is_empty() {
        bail!("every order diverges, expected one to begin with: raise `env.substep_rate`");
    }
    let method = Moves::default();
    let lists: Vec<&[u32]> = starts.iter().map(|list| &**list).collect();
    let (raced, at_race) = (judge.spent(), Instant::now());
    let ranked = judge.race(0, &lists, racing, method.chains);
    let spent = judge.spent() - before;
    if !is_wanted {
        let orders = ranked
            .into_iter()
            .map(|(k, worth)| (starts[k].clone(), worth));
        let found = Found {
            orders: orders.collect(),
            rounds: 0,
            has_converged: false,
        };
        return Ok((found, spent));
    }
    let chosen = ranked.iter().take(method.chains);
    let chosen: Vec<Vec<u32>> = chosen.map(|&(k, _)| starts[k].clone()).collect();
    let left = match budget {
        Budget::Presses(presses) => presses.saturating_sub(spent),
        Budget::Until(end) => {
            // As fast as the race was, which was in the coarsest steps.
            let raced = (judge.spent() - raced) as f64 / at_race.elapsed().as_secs_f64();
            let rates = judge.worlds().scatter.rated(env);
            let coarsest = rates[0].stepping().substep_rate;
            let share = |env: &EnvConfig| coarsest / env.stepping().substep_rate;
            // Moves are as long at each of them.
            let slower = rates.len() as f64 / rates.iter().map(share).sum::<f64>();
            let seconds = end.saturating_duration_since(Instant::now()).as_secs_f64();
            (SEARCHING * seconds * raced / slower) as u64
        }
    };
    let watch = |at: Searching| {
        let spent = spent + at.spent;
        let is_over = match budget {
            Budget::Presses(_) => false,
            Budget::Until(_) => budget.share(began, spent) >= SEARCHING,
        };
        go_on(Searching { spent, ..at }) && !is_over
    };
    let found = moves(judge, &chosen, method, left, seed, watch);
    Ok((found, judge.spent() - before))
}
