use std::sync::Arc;

use anyhow::Result;

use super::best::BestPaths;
use super::config::RunConfig;
use drape_cloth::scene::Scene;
use drape_proof::orders::sequences;
use drape_task::env::{Draping, Episode};
use drape_task::search::{
    Arena, CrossEntropy, Found, Judge, Moves, Order, Searching, cross_entropy, moves,
};

/// Lists that a search by moves looks at before it begins.
const KNOWN: usize = 16;

/// Where nothing is known, one press in so many is one of the cross-entropy method: moves alone stay with the kind of path
/// that they begin with.
const DRAWN: u64 = 4;

/// The best of `known` lists, or else of what the cross-entropy method finds in the world of the scene, and of orders that
/// anybody could think of, changed by moves; so many presses in all. `go_on` is told where the search is, and whether to
/// go on is what it says.
pub fn search_by_moves(
    judge: &mut Judge,
    scene: &Arc<Scene>,
    config: &RunConfig,
    known: Vec<Vec<u32>>,
    presses: u64,
    mut go_on: impl FnMut(Searching) -> bool + Send,
) -> Result<Found> {
    let at = |spent| Searching {
        rounds: 0,
        spent,
        best: None,
    };
    let (mut starts, mut drawn) = (known, 0);
    go_on(at(drawn));
    if starts.is_empty() {
        let mut best = BestPaths::default();
        let mut watch = |spent, ended: &[Episode]| {
            for episode in ended {
                best.remember(episode.score, &episode.actions, judge.task());
            }
            drawn = spent;
            go_on(at(spent))
        };
        let mut draping = Draping::new(scene.clone(), &config.env, config.environments)?;
        let mut arena = Arena::new(&mut draping, presses / DRAWN, &mut watch);
        let method = CrossEntropy::alike(config.search_alike);
        cross_entropy(&mut arena, method, config.seed);
        starts.extend(best.lists().cloned());
    }
    starts.truncate(KNOWN);
    for (order, count) in [(Order::Outwards, 8), (Order::Sweep, 4), (Order::Random, 4)] {
        starts.extend(sequences(scene, &config.env, order, count, config.seed)?);
    }
    let method = Moves::default();
    let lists: Vec<&[u32]> = starts.iter().map(|list| &**list).collect();
    let before = judge.spent();
    // Numbers that the search comes to never.
    let ranked = judge.race(0, &lists, 1 << 30..(1 << 30) + 9, method.chains);
    let chosen = ranked.iter().take(method.chains);
    let chosen: Vec<Vec<u32>> = chosen.map(|&(k, _)| starts[k].clone()).collect();
    let spent = drawn + judge.spent() - before;
    let left = presses.saturating_sub(spent);
    let watch = |at: Searching| {
        let spent = spent + at.spent;
        go_on(Searching { spent, ..at })
    };
    Ok(moves(judge, &chosen, method, left, config.seed, watch))
}
