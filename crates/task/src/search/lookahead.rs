use super::arena::Arena;
use super::draw::{Policy, draw};
use crate::env::{Branch, Observation, Tasks};
use drape_cloth::math::Stream;

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

/// Prefixes of a group that go on.
type Beam = Vec<Branch>;

/// Searches until the steps are spent. From each prefix of a group as many different presses are
/// tried as it has environments for, drawn from `policy`; the best of all are gone on with, but
/// for those that have ended. A group without any begins anew.
pub fn lookahead(arena: &mut Arena, method: Lookahead, policy: &mut Policy, seed: u64) {
    let count = arena.env.count();
    let groups = method.groups.clamp(1, count);
    let own = count / groups;
    let width = method.width.clamp(1, own);
    let mut streams: Vec<Stream> = arena.streams(seed);
    let start = arena.env.branch(0);
    let mut beams: Vec<Beam> = vec![vec![start.clone()]; groups];
    loop {
        let prefixes: Vec<&Branch> = beams.iter().flatten().collect();
        let seen: Vec<&Observation> = prefixes.iter().map(|branch| branch.observation()).collect();
        let logits = policy(&seen);
        let mut rows = logits.chunks_exact(arena.env.shape().pixel_count());
        let mut actions = vec![None; count];
        for (group, beam) in beams.iter().enumerate() {
            let mut free = group * own..(group + 1) * own;
            for (k, prefix) in beam.iter().enumerate() {
                let share = free.len().div_ceil(beam.len() - k);
                let row = rows.next().expect("a row a prefix");
                let mask = &prefix.observation().mask;
                for action in draw(row, mask, share, &mut streams[group]) {
                    let index = free.next().expect("a share of what is free");
                    arena.env.go_on(index, prefix);
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
            *beam = alive.map(|&(_, index)| arena.env.branch(index)).collect();
            if beam.is_empty() {
                beam.push(start.clone());
            }
        }
    }
}
