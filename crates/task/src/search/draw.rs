use super::arena::Arena;
use crate::env::Tasks;
use drape_cloth::math::Stream;
use drape_cloth::sim::Observation;

/// How to go on: a logit for each action of each observation, `[observation * pixel]`. Masks are up
/// to the caller.
pub type Policy<'a> = dyn FnMut(&[Observation]) -> Vec<f32> + 'a;

/// Every action is as likely as any other.
pub fn uniform(seen: &[Observation]) -> Vec<f32> {
    vec![0.0; seen.iter().map(|seen| seen.distance.len()).sum()]
}

/// Plays episodes whose actions are drawn from `policy`, until the steps are spent.
pub fn drawn(arena: &mut Arena, policy: &mut Policy, seed: u64) {
    let mut streams = arena.streams(seed);
    loop {
        let seen: Vec<Observation> = (0..streams.len())
            .map(|index| arena.env.observation(index))
            .collect();
        let logits = policy(&seen);
        let rows = logits.chunks_exact(arena.env.shape().pixel_count());
        let draws = rows.zip(&seen).zip(&mut streams);
        let draws = draws.map(|((row, seen), stream)| draw(row, *seen, 1, stream)[0]);
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
    seen: Observation,
    count: usize,
    stream: &mut Stream,
) -> Vec<u32> {
    let noisy = |action: u32| {
        // Above 0, as the stream's are below 1.
        let noise = -(-(1.0 - stream.uniform()).ln()).ln();
        (f64::from(logits[action as usize]) + noise, action)
    };
    let mut drawn: Vec<(f64, u32)> = seen.allowed().map(noisy).collect();
    drawn.sort_by(|a, b| b.0.total_cmp(&a.0));
    drawn.truncate(count);
    drawn.into_iter().map(|(_, action)| action).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use drape_cloth::math::Purpose;
    use drape_cloth::sim::{ALLOWED, Observations};

    /// Three allowed actions of probabilities 1/2, 1/3 and 1/6: first draws follow them, second ones
    /// are another of them.
    #[test]
    fn draws_follow_their_probabilities_and_never_repeat() {
        let logits = [3f32.ln(), 9.0, 2f32.ln(), 0.0];
        let marks = [0, 1, 2, 3].map(|action| if action == 1 { 0 } else { ALLOWED });
        let shown = Observations::new(vec![0], vec![0.0; 4], marks.into());
        let seen = shown.row(0);
        let mut stream = Stream::new(1, Purpose::Search, 0);
        let mut counts = [0.0f64; 4];
        for _ in 0..12_000 {
            let drawn = draw(&logits, seen, 2, &mut stream);
            assert!(drawn.len() == 2 && drawn[0] != drawn[1]);
            assert!(drawn.iter().all(|&action| seen.allows(action)));
            counts[drawn[0] as usize] += 1.0 / 12_000.0;
        }
        // Four standard errors.
        for (found, expected) in counts.iter().zip([0.5, 0.0, 1.0 / 3.0, 1.0 / 6.0]) {
            assert!((found - expected).abs() < 0.019, "{counts:?}");
        }
        assert_eq!(draw(&logits, seen, 9, &mut stream).len(), 3);
    }
}
