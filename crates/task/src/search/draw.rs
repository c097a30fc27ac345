use fixedbitset::FixedBitSet;

use super::arena::Arena;
use crate::env::{Observation, Tasks};
use drape_cloth::math::Stream;

/// How to go on: a logit for each action of each observation, `[observation * pixel]`. Masks are up
/// to the caller.
pub type Policy<'a> = dyn FnMut(&[&Observation]) -> Vec<f32> + 'a;

/// Every action is as likely as any other.
pub fn uniform(seen: &[&Observation]) -> Vec<f32> {
    vec![0.0; seen.iter().map(|seen| seen.distance.len()).sum()]
}

/// Plays episodes whose actions are drawn from `policy`, until the steps are spent.
pub fn drawn(arena: &mut Arena, policy: &mut Policy, seed: u64) {
    let mut streams = arena.streams(seed);
    loop {
        let seen: Vec<&Observation> = (0..streams.len())
            .map(|index| arena.env.observation(index))
            .collect();
        let logits = policy(&seen);
        let rows = logits.chunks_exact(arena.env.shape().pixel_count());
        let draws = rows.zip(&seen).zip(&mut streams);
        let draws = draws.map(|((row, seen), stream)| draw(row, &seen.mask, 1, stream)[0]);
        let actions: Vec<Option<u32>> = draws.map(Some).collect();
        if arena.step(&actions).is_none() {
            return;
        }
    }
}

/// At most `count` different allowed actions, drawn one after the other without putting back: the
/// greatest logits with Gumbel noise.
pub(super) fn draw(
    logits: &[f32],
    mask: &FixedBitSet,
    count: usize,
    stream: &mut Stream,
) -> Vec<u32> {
    let noisy = |action: usize| {
        // Above 0, as the stream's are below 1.
        let noise = -(-(1.0 - stream.uniform()).ln()).ln();
        (f64::from(logits[action]) + noise, action as u32)
    };
    let mut drawn: Vec<(f64, u32)> = mask.ones().map(noisy).collect();
    drawn.sort_by(|a, b| b.0.total_cmp(&a.0));
    drawn.truncate(count);
    drawn.into_iter().map(|(_, action)| action).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use drape_cloth::math::Purpose;

    /// Three allowed actions of probabilities 1/2, 1/3 and 1/6: first draws follow them, second ones
    /// are another of them.
    #[test]
    fn draws_follow_their_probabilities_and_never_repeat() {
        let logits = [3f32.ln(), 9.0, 2f32.ln(), 0.0];
        let mut mask = FixedBitSet::with_capacity(4);
        mask.extend([0, 2, 3]);
        let mut stream = Stream::new(1, Purpose::Search, 0);
        let mut counts = [0.0f64; 4];
        for _ in 0..12_000 {
            let drawn = draw(&logits, &mask, 2, &mut stream);
            assert!(drawn.len() == 2 && drawn[0] != drawn[1]);
            assert!(drawn.iter().all(|&action| mask.contains(action as usize)));
            counts[drawn[0] as usize] += 1.0 / 12_000.0;
        }
        // Four standard errors.
        for (found, expected) in counts.iter().zip([0.5, 0.0, 1.0 / 3.0, 1.0 / 6.0]) {
            assert!((found - expected).abs() < 0.019, "{counts:?}");
        }
        assert_eq!(draw(&logits, &mask, 9, &mut stream).len(), 3);
    }
}
