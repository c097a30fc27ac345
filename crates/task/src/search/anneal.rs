use std::sync::Arc;

use super::arena::Arena;
use super::draw::{Policy, draw};
use crate::env::{Draping, EpisodeState, Tasks};
use drape_cloth::math::Stream;
use drape_cloth::sim::Observation;

/// Local search over sequences: one is cut at a random place and goes on differently from there, and
/// the new one replaces it if it is better, or by the chance of Metropolis.
#[derive(Clone, Copy, Debug)]
pub struct Annealing {
    /// How much worse a score may be, by a chance of 1 in e, in the beginning and at the end [-].
    pub hot: f64,
    pub cold: f64,
    /// Presses that are drawn after a cut, 1 and on average so many more, before the rest follows the
    /// old order again where that is allowed.
    pub drawn: f64,
    /// Whether a chain goes on from that of another, drawn at random, where this one is better.
    pub adopts: bool,
}

impl Default for Annealing {
    fn default() -> Self {
        Self {
            hot: 0.03,
            cold: 0.001,
            drawn: 2.0,
            adopts: false,
        }
    }
}

impl Annealing {
    /// From good sequences on, by the policy that has found them.
    pub fn polish() -> Self {
        Self {
            hot: 0.003,
            cold: 0.0003,
            drawn: 2.0,
            adopts: true,
        }
    }
}

/// Bytes of the states that may be kept to go on from.
const MOST_BYTES: usize = 512 << 20;

/// A sequence that ended, with states on the way: state `k` is that before press `k * stride`.
#[derive(Clone, Default)]
struct Chain {
    actions: Vec<u32>,
    score: Option<f64>,
    states: Vec<Arc<EpisodeState>>,
}

/// What an environment plays: a changed sequence of its chain.
struct Player {
    chain: Chain,
    /// Of what is played, so far.
    states: Vec<Arc<EpisodeState>>,
    /// Presses so far, and how many of them are drawn before it follows `old` again.
    presses: usize,
    drawn_until: usize,
    /// What is left of the sequence it was cut from.
    old: Vec<u32>,
    stream: Stream,
}

impl Player {
    /// The first press of the old order that is allowed, if that is to be followed.
    fn follow(&self, seen: Observation) -> Option<u32> {
        let mut old = self.old.iter().copied();
        let follows = self.presses >= self.drawn_until;
        let next = |action: &u32| seen.allows(*action);
        follows.then(|| old.find(next)).flatten()
    }
}

/// Searches until the steps are spent, with a chain an environment. They begin with the sequences `starts`, of actions, and
/// without one for them with one drawn from `policy`, as what comes after a cut is.
pub fn anneal(
    arena: &mut Arena,
    method: Annealing,
    starts: &[Vec<u32>],
    policy: &mut Policy,
    seed: u64,
) {
    let count = arena.env.count();
    let stride = stride(arena.env, 2 * count);
    let streams = arena.streams(seed).into_iter().enumerate();
    let players = streams.map(|(index, stream)| {
        let old = starts.get(index).cloned().unwrap_or_default();
        Player {
            chain: Chain::default(),
            states: Vec::new(),
            presses: 0,
            drawn_until: 0,
            old,
            stream,
        }
    });
    let mut players: Vec<Player> = players.collect();
    loop {
        let env = &mut *arena.env;
        for (index, player) in players.iter_mut().enumerate() {
            if player.presses == player.states.len() * stride {
                player.states.push(Arc::new(env.episode(index)));
            }
        }
        let seen = |index: usize| env.observation(index);
        let mut actions: Vec<Option<u32>> = (0..count)
            .map(|index| players[index].follow(seen(index)))
            .collect();
        let open: Vec<usize> = (0..count).filter(|&k| actions[k].is_none()).collect();
        let shown: Vec<Observation> = open.iter().map(|&index| seen(index)).collect();
        if !shown.is_empty() {
            let logits = policy(&shown);
            let rows = logits.chunks_exact(env.shape().pixel_count());
            for ((&index, seen), row) in open.iter().zip(shown).zip(rows) {
                let drawn = draw(row, seen, 1, &mut players[index].stream);
                actions[index] = Some(drawn[0]);
            }
        }
        let Some(ended) = arena.step(&actions) else {
            return;
        };
        let heat = method.hot * (method.cold / method.hot).powf(arena.share());
        for (index, episode) in ended.into_iter().enumerate() {
            let player = &mut players[index];
            player.presses += 1;
            let Some(episode) = episode else { continue };
            let chance = player.stream.uniform();
            let is_taken = match (episode.score, player.chain.score) {
                (Some(new), Some(old)) => new >= old || chance < ((new - old) / heat).exp(),
                (new, old) => new.is_some() || old.is_none(),
            };
            if is_taken {
                player.chain = Chain {
                    actions: episode.actions,
                    score: episode.score,
                    states: std::mem::take(&mut player.states),
                };
            }
            if method.adopts {
                let other = player.stream.below(count);
                let other = &players[other].chain;
                if other.score > players[index].chain.score {
                    players[index].chain = other.clone();
                }
            }
            let player = &mut players[index];
            cut(player, method.drawn, stride);
            arena
                .env
                .go_on(index, player.states.last().expect("the cut"));
        }
    }
}

/// Lets a player go on from one of the states of its chain.
fn cut(player: &mut Player, drawn: f64, stride: usize) {
    let chain = &player.chain;
    let at = player.stream.below(chain.states.len());
    player.states = chain.states[..=at].to_vec();
    player.presses = at * stride;
    let more = -drawn * (1.0 - player.stream.uniform()).ln();
    player.drawn_until = player.presses.saturating_add(1 + more as usize);
    player.old = chain.actions[player.presses..].to_vec();
}

/// Presses between two states that are kept, so that `count` sequences fit into the memory: about a
/// press for each five vertices, of a hundred bytes each.
fn stride(env: &Draping, count: usize) -> usize {
    let presses = env.tasks()[0].expected_presses();
    let state = 100 * env.scene().lamina.vertex_count();
    (count * presses * state).div_ceil(MOST_BYTES).max(1)
}
