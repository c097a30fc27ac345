use super::arena::Arena;
use super::draw::{Policy, draw};
use crate::env::{Draping, EpisodeState, Tasks};
use drape_cloth::math::Stream;
use drape_cloth::sim::{Observation, Observations};

/// Episodes grown press by press, the best prefixes kept by the score of the cloth after each: greedy
/// with a width of 1, else a beam.
#[derive(Clone, Copy, Debug)]
pub struct Lookahead {
    /// Episodes, or beams, at once: among them the environments are shared out.
    pub groups: usize,
    /// Prefixes that a group keeps.
    pub width: usize,
}

impl Lookahead {
    /// One prefix of each of a few episodes.
    pub fn greedy() -> Self {
        Self {
            groups: 4,
            width: 1,
        }
    }

    /// One beam of all environments.
    pub fn beam() -> Self {
        Self {
            groups: 1,
            width: 8,
        }
    }
}

/// A prefix of an episode, and what is seen after it.
#[derive(Clone)]
struct Prefix {
    episode: EpisodeState,
    seen: Observations,
}

impl Prefix {
    fn new(env: &Draping, index: usize) -> Self {
        Self {
            episode: env.episode(index),
            seen: Observations::gather([(env.observations(), index)].into_iter()),
        }
    }
}

/// Searches until the steps are spent. From each prefix of a group as many different presses are
/// tried as it has environments for, drawn from `policy`; the best of all are gone on with, but
/// for those that have ended. A group without any begins anew.
pub fn lookahead(arena: &mut Arena, method: Lookahead, policy: &mut Policy, seed: u64) {
    let count = arena.env.count();
    let groups = method.groups.clamp(1, count);
    let own = count / groups;
    let width = method.width.clamp(1, own);
    let mut streams: Vec<Stream> = arena.streams(seed);
    let start = Prefix::new(arena.env, 0);
    let mut beams: Vec<Vec<Prefix>> = vec![vec![start.clone()]; groups];
    loop {
        let seen = beams.iter().flatten().map(|prefix| prefix.seen.row(0));
        let logits = policy(&seen.collect::<Vec<Observation>>());
        let mut rows = logits.chunks_exact(arena.env.shape().pixel_count());
        let mut actions = vec![None; count];
        for (group, beam) in beams.iter().enumerate() {
            let mut free = group * own..(group + 1) * own;
            for (k, prefix) in beam.iter().enumerate() {
                let share = free.len().div_ceil(beam.len() - k);
                let row = rows.next().expect("a row a prefix");
                for action in draw(row, prefix.seen.row(0), share, &mut streams[group]) {
                    let index = free.next().expect("a share of what is free");
                    arena.env.go_on(index, &prefix.episode);
                    actions[index] = Some(action);
                }
            }
        }
        let Some(ended) = arena.step(&actions) else {
            return;
        };
        let scores = arena.env.scores();
        for (group, beam) in beams.iter_mut().enumerate() {
            let members = group * own..(group + 1) * own;
            let tried = members.filter(|&index| actions[index].is_some());
            let scored = tried.filter_map(|index| match &ended[index] {
                Some(episode) => Some((episode.score?, index)),
                None => Some((scores[index], index)),
            });
            let mut scored: Vec<(f64, usize)> = scored.collect();
            scored.sort_by(|a, b| b.0.total_cmp(&a.0));
            scored.truncate(width);
            let alive = scored.iter().filter(|(_, index)| ended[*index].is_none());
            *beam = alive
                .map(|&(_, index)| Prefix::new(arena.env, index))
                .collect();
            if beam.is_empty() {
                beam.push(start.clone());
            }
        }
    }
}
