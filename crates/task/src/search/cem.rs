use super::arena::Arena;
use super::family::{Ranks, first, outwards, sweeps};
use crate::env::{Draping, ImageShape, Tasks};
use drape_cloth::math::{Stream, mean_and_deviation};

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
    /// How far vertices are drawn alike: the standard deviation of the bell that draws are blurred with, as a
    /// share of the image's longer side. Where it is above 0 orders outwards and sweeps are played first.
    pub alike: f64,
}

impl Default for CrossEntropy {
    fn default() -> Self {
        Self {
            episodes: 64,
            elites: 8,
            rate: 0.7,
            least: 0.02,
            alike: 0.0,
        }
    }
}

impl CrossEntropy {
    /// The default, with vertices drawn alike so far.
    pub fn alike(alike: f64) -> Self {
        Self {
            alike,
            ..Self::default()
        }
    }
}

/// Searches until the steps are spent. Episodes that a refit overtakes count in the next.
pub fn cross_entropy(arena: &mut Arena, method: CrossEntropy, seed: u64) {
    let mut streams = arena.streams(seed);
    let shape = arena.env.shape();
    let bell = Bell::new(method.alike * shape.columns.max(shape.rows) as f64);
    // Of ranks, the negative of priorities.
    let mut fit = vec![[0.0, 1.0]; shape.pixel_count()];
    let draw = |fit: &[[f64; 2]], stream: &mut Stream| -> Ranks {
        let noise = fit.iter().map(|_| stream.normal()).collect();
        let noise = bell.blur(noise, shape);
        let drawn = fit.iter().zip(noise).map(|([mean, d], x)| mean + d * x);
        drawn.collect()
    };
    let count = if method.alike > 0.0 { streams.len() } else { 0 };
    let mut known = beginners(arena.env).take(count);
    let mut own: Vec<Ranks> = streams
        .iter_mut()
        .map(|stream| known.next().unwrap_or_else(|| draw(&fit, stream)))
        .collect();
    drop(known);
    let mut played: Vec<(f64, Ranks)> = Vec::new();
    loop {
        let ranks = own.iter().enumerate();
        let next = |(index, ranks): (usize, &Ranks)| {
            Some(first(arena.env.observation(index), |pixel| ranks[pixel]))
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

fn refit(fit: &mut [[f64; 2]], elites: &[(f64, Ranks)], method: CrossEntropy) {
    for (k, fit) in fit.iter_mut().enumerate() {
        let values: Vec<f64> = elites.iter().map(|(_, ranks)| ranks[k]).collect();
        let found = mean_and_deviation(&values);
        for (old, new) in fit.iter_mut().zip(found) {
            *old += method.rate * (new - *old);
        }
        fit[1] = fit[1].max(method.least);
    }
}

/// Orders outwards and sweeps in turns, of mean 0 and deviation 1.
fn beginners(env: &Draping) -> impl Iterator<Item = Ranks> + use<> {
    let orders = outwards(env).zip(sweeps(env));
    orders
        .flat_map(|(outwards, sweep)| [outwards, sweep])
        .map(|mut ranks| {
            let [mean, deviation] = mean_and_deviation(&ranks);
            for rank in &mut ranks {
                *rank = (*rank - mean) / deviation.max(f64::MIN_POSITIVE);
            }
            ranks
        })
}

/// The weights of a Gaussian bell, from its middle on.
struct Bell(Vec<f64>);

impl Bell {
    /// Of a standard deviation [pixel].
    fn new(deviation: f64) -> Self {
        // Without any it is its middle alone.
        let reach = 0..=(3.0 * deviation) as usize;
        let deviation = deviation.max(f64::MIN_POSITIVE);
        Self(
            reach
                .map(|k| (-0.5 * (k as f64 / deviation).powi(2)).exp())
                .collect(),
        )
    }

    /// Blurs independent noise of deviation 1 along rows and columns, which leaves it that deviation, also at
    /// the border.
    fn blur(&self, noise: Vec<f64>, shape: ImageShape) -> Vec<f64> {
        let along = |from: &[f64], place: &dyn Fn(usize) -> [usize; 3]| -> Vec<f64> {
            let blurred = (0..from.len()).map(|pixel| {
                let [at, count, stride] = place(pixel);
                let (mut sum, mut square) = (0.0, 0.0);
                let near = at.saturating_sub(self.0.len() - 1)..(at + self.0.len()).min(count);
                for other in near {
                    let weight = self.0[at.abs_diff(other)];
                    sum += weight * from[pixel + other * stride - at * stride];
                    square += weight * weight;
                }
                sum / square.sqrt()
            });
            blurred.collect()
        };
        let ImageShape { rows, columns } = shape;
        let rowwise = along(&noise, &|pixel| [pixel % columns, columns, 1]);
        along(&rowwise, &|pixel| [pixel / columns, rows, columns])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Over many draws every pixel has mean 0 and deviation 1, at the border too; neighbours are nearly
    /// alike, and those six deviations apart are not.
    #[test]
    fn blurred_noise_is_as_strong_as_before() {
        let shape = ImageShape {
            rows: 9,
            columns: 13,
        };
        let bell = Bell::new(2.0);
        let mut stream = Stream::new(1, drape_cloth::math::Purpose::Search, 0);
        let draws: Vec<Vec<f64>> = (0..4000)
            .map(|_| bell.blur((0..117).map(|_| stream.normal()).collect(), shape))
            .collect();
        let product = |a: usize, b: usize| {
            draws.iter().map(|x| x[a] * x[b]).sum::<f64>() / draws.len() as f64
        };
        for pixel in [0, 6, 12, 4 * 13, 4 * 13 + 6, 116] {
            assert!((product(pixel, pixel) - 1.0).abs() < 0.1, "{pixel}");
        }
        let middle = 4 * 13 + 6;
        // exp(-1 / (4 * 4)) for one pixel, where no border cuts the bell.
        assert!((product(middle, middle + 1) - 0.94).abs() < 0.05);
        assert!(product(0, 12).abs() < 0.1);
    }
}
