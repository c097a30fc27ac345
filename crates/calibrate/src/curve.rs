//! Few straight lines through many noisy points.

use nalgebra::{Matrix3, Vector3};

/// A point of a measured curve C: `value` = C(`at`) + `half` C(`at` / 2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    pub at: f64,
    pub half: f64,
    pub value: f64,
}

impl Sample {
    /// A point on the curve itself.
    pub fn new(at: f64, value: f64) -> Self {
        let half = 0.0;
        Self { at, half, value }
    }
}

/// Most slopes of a curve.
const MOST: usize = 3;

/// Noise that is there at the beginning of a curve, too, as a share of its greatest value.
const FLOOR: f64 = 0.02;

/// Least slope, as a share of the mean one: laws have to grow.
const LEAST: f64 = 1e-3;

/// Places that are tried for a kink before it is refined.
const PLACES: usize = 40;

/// A further slope has to explain more than this share of the values, squared.
const EXACT: f64 = 1e-6;

/// The curve of up to `most` slopes, at most three, that explains samples best for its number of slopes (Schwarz's
/// criterion).
pub fn fewest(samples: &[Sample], most: usize) -> Vec<[f64; 2]> {
    let weights = weights(samples, |sample| sample.value);
    let count = samples.len() as f64;
    let score = |curve: &Vec<[f64; 2]>| {
        let loss = loss(samples, &weights, curve) / count;
        let parameters = 2.0 * (curve.len() - 1) as f64 - 1.0;
        count * loss.max(EXACT).ln() + parameters * count.ln()
    };
    let fits = (1..=most).map(|slopes| fit(samples, slopes));
    let scored = fits.map(|curve| (score(&curve), curve));
    let best = scored.min_by(|a, b| a.0.total_cmp(&b.0));
    best.expect("one slope at least").1
}

/// The growing curve of so many slopes, one to three, that is nearest to samples, as points from [0, 0] to the greatest
/// strain among them. Noise is taken to be in proportion to the value, beside a fiftieth of the greatest.
///
/// # Panics
/// If no sample has a strain and a value above 0.
pub fn fit(samples: &[Sample], slopes: usize) -> Vec<[f64; 2]> {
    let first = nearest(samples, &weights(samples, |sample| sample.value), slopes);
    // By what was measured, what is low by chance would count more.
    let weights = weights(samples, |sample| predicted(&first, sample));
    nearest(samples, &weights, slopes)
}

/// What a curve, or its last slope beyond it, says of a sample.
pub(crate) fn predicted(curve: &[[f64; 2]], sample: &Sample) -> f64 {
    value(curve, sample.at) + sample.half * value(curve, 0.5 * sample.at)
}

pub(crate) fn value(curve: &[[f64; 2]], strain: f64) -> f64 {
    let last = curve.len() - 2;
    let inner = curve[1..=last].iter().position(|p| strain < p[0]);
    let [p, q] = [0, 1].map(|k| curve[inner.unwrap_or(last) + k]);
    p[1] + (strain - p[0]) * (q[1] - p[1]) / (q[0] - p[0])
}

/// One over the variance that a sample has by its true value.
pub(crate) fn weights(samples: &[Sample], of: impl Fn(&Sample) -> f64) -> Vec<f64> {
    let greatest = samples.iter().map(|s| s.value).fold(0.0, f64::max);
    let weight = |sample| 1.0 / (of(sample).powi(2) + (FLOOR * greatest).powi(2));
    samples.iter().map(weight).collect()
}

/// How far samples lie off a curve, as a share of what they are, root mean square.
pub(crate) fn misfit(samples: &[Sample], curve: &[[f64; 2]]) -> f64 {
    let square =
        |of: &dyn Fn(&Sample) -> f64| -> f64 { samples.iter().map(|s| of(s).powi(2)).sum() };
    (square(&|s| s.value - predicted(curve, s)) / square(&|s| s.value)).sqrt()
}

fn loss(samples: &[Sample], weights: &[f64], curve: &[[f64; 2]]) -> f64 {
    let square = |(s, w): (&Sample, &f64)| w * (s.value - predicted(curve, s)).powi(2);
    samples.iter().zip(weights).map(square).sum()
}

/// [`fit`] under given weights: kinks on a grid, then refined one by one.
fn nearest(samples: &[Sample], weights: &[f64], slopes: usize) -> Vec<[f64; 2]> {
    let end = samples.iter().map(|s| s.at).fold(0.0, f64::max);
    assert!(end > 0.0 && (1..=MOST).contains(&slopes));
    let step = end / (PLACES + 1) as f64;
    let between = |kinks: &[f64]| with_kinks(samples, weights, kinks, end);
    let places = 1..=PLACES;
    let at = |place: usize| place as f64 * step;
    let grid: Vec<Vec<f64>> = match slopes {
        1 => vec![Vec::new()],
        2 => places.map(|k| vec![at(k)]).collect(),
        _ => places
            .flat_map(|k| (k + 1..=PLACES).map(move |l| vec![at(k), at(l)]))
            .collect(),
    };
    let tried = grid.into_iter().map(|kinks| (between(&kinks), kinks));
    let best = tried.min_by(|a, b| a.0.0.total_cmp(&b.0.0));
    let (mut best, mut kinks) = best.expect("one at least");
    let mut step = 0.5 * step;
    for _ in 0..16 {
        for k in 0..kinks.len() {
            for by in [-step, step] {
                let mut other = kinks.clone();
                other[k] += by;
                let apart = |low: f64, high: f64| high - low > 1e-3 * end;
                let low = if k == 0 { 0.0 } else { other[k - 1] };
                let high = other.get(k + 1).copied().unwrap_or(end);
                if apart(low, other[k]) && apart(other[k], high) {
                    let found = between(&other);
                    if found.0 < best.0 {
                        (best, kinks) = (found, other);
                    }
                }
            }
        }
        step *= 0.5;
    }
    best.1
}

/// The curve with kinks at given strains, and its loss: least squares in the slopes, none of which is below the least.
/// There are at most three, so that all choices of those that are at it are tried.
fn with_kinks(
    samples: &[Sample],
    weights: &[f64],
    kinks: &[f64],
    end: f64,
) -> (f64, Vec<[f64; 2]>) {
    let knots: Vec<f64> = [&[0.0], kinks, &[end]].concat();
    let count = knots.len() - 1;
    let run = |strain: f64, k: usize| (strain - knots[k]).clamp(0.0, knots[k + 1] - knots[k]);
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    let (mut values, mut square) = ([0.0; 2], 0.0);
    for (sample, &w) in samples.iter().zip(weights) {
        let row = Vector3::from_fn(|k, _| match k < count {
            true => run(sample.at, k) + sample.half * run(0.5 * sample.at, k),
            false => 0.0,
        });
        normal += w * row * row.transpose();
        right += w * sample.value * row;
        square += w * sample.value * sample.value;
        values[0] += w * sample.value;
        values[1] += w * (row.x + row.y + row.z);
    }
    let least = LEAST * values[0] / values[1];
    let choices = (0..1 << count).filter_map(|held: usize| {
        // Held slopes are the least, and so are those that there are not, which nothing asks for.
        let is_held = |k: usize| k >= count || held >> k & 1 == 1;
        let (mut matrix, mut side) = (normal, right);
        for k in (0..MOST).filter(|&k| is_held(k)) {
            side -= matrix.column(k) * least;
            matrix.fill_column(k, 0.0);
            matrix.fill_row(k, 0.0);
            (matrix[(k, k)], side[k]) = (1.0, least);
        }
        let slopes = matrix.lu().solve(&side)?;
        let grows = (0..count).all(|k| slopes[k] >= least * (1.0 - 1e-9));
        let mut curve = vec![[0.0; 2]];
        for k in 0..count {
            let [_, stress] = curve[k];
            curve.push([knots[k + 1], stress + slopes[k] * (knots[k + 1] - knots[k])]);
        }
        let known = slopes.map_with_location(|k, _, slope| if k < count { slope } else { 0.0 });
        let loss = square - 2.0 * known.dot(&right) + known.dot(&(normal * known));
        grows.then_some((loss, curve))
    });
    let best = choices.min_by(|a, b| a.0.total_cmp(&b.0));
    best.expect("all slopes at the least are a choice")
}

#[cfg(test)]
mod tests {
    use super::*;
    use drape_cloth::math::{Purpose, Stream};

    /// Points of a curve, with noise in proportion to them.
    fn noisy(curve: &[[f64; 2]], count: usize, noise: f64, seed: u64) -> Vec<Sample> {
        let mut stream = Stream::new(seed, Purpose::Evaluation, 0);
        let end = curve[curve.len() - 1][0];
        let at = |k: usize| end * (k + 1) as f64 / count as f64;
        let mut sample = |k| {
            let noise = 1.0 + noise * stream.normal();
            Sample::new(at(k), noise * value(curve, at(k)))
        };
        (0..count).map(&mut sample).collect()
    }

    #[test]
    fn curves_come_back_from_noisy_points() {
        for curve in [
            vec![[0.0, 0.0], [0.02, 0.12]],
            vec![[0.0, 0.0], [0.005, 3.0], [0.02, 40.0]],
            vec![[0.0, 0.0], [0.3, 0.015], [0.6, 0.06], [0.8, 0.3]],
        ] {
            for seed in 1..4 {
                let samples = noisy(&curve, 200, 0.03, seed);
                let found = fewest(&samples, 3);
                assert!(misfit(&samples, &found) < 0.05);
                assert_eq!(found.len(), curve.len(), "{found:?}");
                for (p, q) in found.iter().zip(&curve).skip(1) {
                    for k in 0..2 {
                        let error = p[k] / q[k] - 1.0;
                        assert!(error.abs() < 0.05, "{found:?}");
                    }
                }
            }
            let found = fit(&noisy(&curve, 200, 0.0, 0), curve.len() - 1);
            for (p, q) in found.iter().zip(&curve) {
                assert!((p[0] - q[0]).abs() < 2e-3 * curve[1][0], "{found:?}");
                assert!((p[1] - q[1]).abs() < 2e-3 * curve[1][1], "{found:?}");
            }
        }
    }

    #[test]
    fn curves_grow_where_points_fall() {
        let falling = [(0.1, 2.0), (0.2, 3.0), (0.3, 2.0), (0.4, 1.0)];
        let falling = falling.map(|(at, value)| Sample::new(at, value));
        for slopes in 1..4 {
            let found = fit(&falling, slopes);
            let grows = |pair: &[[f64; 2]]| pair[0][0] < pair[1][0] && pair[0][1] < pair[1][1];
            assert!(found.windows(2).all(grows), "{found:?}");
            assert!(misfit(&falling, &found) > 0.2);
        }
    }

    #[test]
    fn curve_within_itself_is_found() {
        let curve = [[0.0, 0.0], [0.3, 3.0], [0.6, 12.0]];
        let sample = |k: usize| {
            let half = 0.4;
            let at = 0.01 * (k + 1) as f64;
            let value = predicted(
                &curve,
                &Sample {
                    at,
                    half,
                    value: 0.0,
                },
            );
            Sample { at, half, value }
        };
        let samples: Vec<Sample> = (0..60).map(sample).collect();
        let found = fewest(&samples, 3);
        assert_eq!(found.len(), 3, "{found:?}");
        for (p, q) in found.iter().zip(&curve).skip(1) {
            assert!((p[1] / q[1] - 1.0).abs() < 2e-3, "{found:?}");
        }
    }
}
