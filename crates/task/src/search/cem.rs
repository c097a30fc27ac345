use super::arena::Arena;
use super::family::first;
use crate::env::Tasks;
use drape_cloth::math::Stream;

/// The cross-entropy method over a normally distributed priority of each vertex: an episode presses
/// the allowed one of the highest.
#[derive(Clone, Copy, Debug)]
pub struct CrossEntropy {
    /// Episodes that a refit waits for, and the best of them that it fits.
    pub episodes: usize,
    pub elites: usize,
    /// How far mean and deviation go to those of the elites, 0 to 1.
    pub rate: f64,
    /// Least deviation; it is 1 in the beginning.
    pub least: f64,
}

impl Default for CrossEntropy {
    fn default() -> Self {
        Self {
            episodes: 64,
            elites: 8,
            rate: 0.7,
            least: 0.02,
        }
    }
}

/// Searches until the steps are spent. Episodes that a refit overtakes count in the next.
pub fn cross_entropy(arena: &mut Arena, method: CrossEntropy, seed: u64) {
    let mut streams = arena.streams(seed);
    // Of ranks, the negative of priorities.
    let mut fit = vec![[0.0, 1.0]; arena.env.shape().pixel_count()];
    let draw = |fit: &[[f64; 2]], stream: &mut Stream| -> Vec<f64> {
        let drawn = fit.iter().map(|[mean, d]| mean + d * stream.normal());
        drawn.collect()
    };
    let mut own: Vec<Vec<f64>> = streams.iter_mut().map(|s| draw(&fit, s)).collect();
    let mut played: Vec<(f64, Vec<f64>)> = Vec::new();
    loop {
        let ranks = own.iter().enumerate();
        let next = |(index, ranks): (usize, &Vec<f64>)| {
            Some(first(&arena.env.observation(index).mask, |pixel| {
                ranks[pixel]
            }))
        };
        let actions: Vec<Option<u32>> = ranks.map(next).collect();
        let Some(ended) = arena.step(&actions) else {
            return;
        };
        for (index, episode) in ended.into_iter().enumerate() {
            let Some(episode) = episode else { continue };
            let next = draw(&fit, &mut streams[index]);
            let ranks = std::mem::replace(&mut own[index], next);
            played.extend(episode.score.map(|score| (score, ranks)));
        }
        if played.len() >= method.episodes {
            played.sort_by(|a, b| b.0.total_cmp(&a.0));
            played.truncate(method.elites);
            refit(&mut fit, &played, method);
            played.clear();
        }
    }
}

fn refit(fit: &mut [[f64; 2]], elites: &[(f64, Vec<f64>)], method: CrossEntropy) {
    for (k, fit) in fit.iter_mut().enumerate() {
        let values: Vec<f64> = elites.iter().map(|(_, ranks)| ranks[k]).collect();
        let found = drape_cloth::math::mean_and_deviation(&values);
        for (old, new) in fit.iter_mut().zip(found) {
            *old += method.rate * (new - *old);
        }
        fit[1] = fit[1].max(method.least);
    }
}
