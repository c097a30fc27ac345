//! Most probable parameters of a model that is a simulation, and how far they may be off.
//!
//! Gauss-Newton with finite differences (Nocedal and Wright, "Numerical Optimization", chapter 10) on Huber's loss,
//! with a normal prior. Three things make a plain covariance too small, and widen it here: residuals of neighbours
//! are alike, which clusters tell (Liang and Zeger 1986), differences of chaotic simulations look like derivatives, and the
//! observed state is one draw of that chaos.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::specimens::NORMAL;

/// Half the distance of finite differences, as of a logarithm: a fifth, above the noise of what folds.
const STEP: f64 = 0.2;

/// Worlds at the same place, each pushed in another direction; with the one that is not pushed they tell the chaos.
const PUSHED: usize = 7;

/// Bend of Huber's loss in deviations, and the mean square of its derivative for normal errors.
const BEND: f64 = 1.345;
const BENT_SQUARE: f64 = 0.7102;

/// Deviations below this are those of no scanner [m].
const LEAST_DEVIATION: f64 = 1e-5;

/// Longest step of a parameter, of a logarithm, and the farthest that it goes.
const LONGEST: f64 = 1.0;
const FARTHEST: f64 = 4.6;

/// Where it ends: steps of a fifth of the deviation, so many evaluations, or so many steps in vain.
const SMALL_STEP: f64 = 0.2;
/// Most evaluations of all worlds.
pub const EVALUATIONS: usize = 12;
const HALVINGS: usize = 4;

/// What is to be simulated.
#[derive(Clone, Debug, PartialEq)]
pub struct Query {
    /// Logarithms of the factors.
    pub at: Vec<f64>,
    /// Number of the direction in which it is pushed by a micrometre, if it is.
    pub push: Option<usize>,
}

/// The most probable parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Logarithms of the factors,
    pub at: Vec<f64>,
    /// and their standard deviations, at most those of the prior.
    pub deviation: Vec<f64>,
    /// The data say more of it than the prior.
    pub is_told: Vec<bool>,
    /// Root mean square of what residuals are left, and how many count.
    pub rms: f64,
    pub residuals: usize,
    /// How often all worlds were simulated.
    pub evaluations: usize,
}

impl Estimate {
    /// The interval that holds a parameter's logarithm at 90 %.
    pub fn interval(&self, parameter: usize) -> [f64; 2] {
        let half = NORMAL * self.deviation[parameter];
        [-half, half].map(|by| self.at[parameter] + by)
    }
}

/// What the worlds round one place say.
struct Local {
    at: DVector<f64>,
    /// Mean over the worlds there.
    residual: Vec<f64>,
    scale: f64,
    /// Standing in for the variance of independent residuals.
    variance: f64,
    step: DVector<f64>,
    deviation: Vec<f64>,
}

/// Finds the parameters that explain residuals best. `simulate` gives those of each query [m], one after the other,
/// NaN where a point does not count; `blocks` are numbers of neighbourhoods, one a residual. `prior` has the standard
/// deviation of each parameter about 0.
///
/// # Errors
/// Those of `simulate`.
///
/// # Panics
/// If there are as many residuals in no query as there are blocks.
pub fn estimate<E>(
    prior: &[f64],
    blocks: &[usize],
    mut simulate: impl FnMut(&[Query]) -> Result<Vec<Vec<f64>>, E>,
) -> Result<Estimate, E> {
    let mut evaluations = 0;
    let mut look = |at: &DVector<f64>| {
        evaluations += 1;
        let worlds = simulate(&queries(at))?;
        assert!(worlds.iter().all(|world| world.len() == blocks.len()));
        Ok((local(at, prior, blocks, &worlds), evaluations))
    };
    let start = DVector::zeros(prior.len());
    let (mut best, mut count) = look(&start)?;
    let mut halvings = 0;
    let mut step = best.step.clone();
    while count < EVALUATIONS && halvings < HALVINGS {
        let is_small = |(step, deviation): (&f64, &f64)| step.abs() < SMALL_STEP * deviation;
        if step.iter().zip(&best.deviation).all(is_small) {
            break;
        }
        let next = (&best.at + &step).map(|at| at.clamp(-FARTHEST, FARTHEST));
        let (found, now) = look(&next)?;
        count = now;
        // By the scale there, the loss can be compared.
        if best.loss_of(&found, prior) <= best.loss_of(&best, prior) {
            step = found.step.clone();
            (best, halvings) = (found, 0);
        } else {
            step *= 0.5;
            halvings += 1;
        }
    }
    let counted: Vec<f64> = best
        .residual
        .iter()
        .copied()
        .filter(|r| !r.is_nan())
        .collect();
    let square = counted.iter().map(|r| r * r).sum::<f64>() / counted.len().max(1) as f64;
    let halved = |(deviation, prior): (&f64, &f64)| deviation * deviation <= 0.5 * prior * prior;
    Ok(Estimate {
        is_told: best.deviation.iter().zip(prior).map(halved).collect(),
        at: best.at.iter().copied().collect(),
        deviation: best.deviation,
        rms: square.sqrt(),
        residuals: counted.len(),
        evaluations: count,
    })
}

/// The place itself, its neighbours along each parameter, and its pushes.
fn queries(at: &DVector<f64>) -> Vec<Query> {
    let place = |at: &DVector<f64>, push| Query {
        at: at.iter().copied().collect(),
        push,
    };
    let mut all = vec![place(at, None)];
    all.extend((0..PUSHED).map(|push| place(at, Some(push))));
    for parameter in 0..at.len() {
        for by in [STEP, -STEP] {
            let mut beside = at.clone();
            beside[parameter] += by;
            all.push(place(&beside, None));
        }
    }
    all
}

fn local(at: &DVector<f64>, prior: &[f64], blocks: &[usize], worlds: &[Vec<f64>]) -> Local {
    let (here, beside) = worlds.split_at(1 + PUSHED);
    let same = here.len() as f64;
    let (rows, parameters) = (blocks.len(), prior.len());
    // What is NaN in any world counts in none.
    let counts: Vec<bool> = (0..rows)
        .map(|i| worlds.iter().all(|world| !world[i].is_nan()))
        .collect();
    let mean = |i: usize| here.iter().map(|world| world[i]).sum::<f64>() / same;
    let residual: Vec<f64> = (0..rows)
        .map(|i| if counts[i] { mean(i) } else { f64::NAN })
        .collect();
    let (scale, weights) = huber(&residual);
    let weighted: Vec<f64> = residual
        .iter()
        .zip(&weights)
        .map(|(r, w)| if *w > 0.0 { w * r } else { 0.0 })
        .collect();

    let slope = |i: usize, k: usize| (beside[2 * k][i] - beside[2 * k + 1][i]) / (2.0 * STEP);
    let counted: Vec<usize> = (0..rows).filter(|&i| counts[i]).collect();
    let (mut gradient, mut curvature) = (
        DVector::zeros(parameters),
        DMatrix::zeros(parameters, parameters),
    );
    let count = blocks.iter().max().map_or(0, |last| last + 1);
    let mut pulls = vec![DVector::<f64>::zeros(parameters); count];
    let mut noise = 0.0;
    for &i in &counted {
        let row = DVector::from_fn(parameters, |k, _| slope(i, k));
        curvature += weights[i] * &row * row.transpose();
        pulls[blocks[i]] += weighted[i] * &row;
        gradient += weighted[i] * row;
        let square = here.iter().map(|world| (world[i] - residual[i]).powi(2));
        noise += weights[i] * square.sum::<f64>() / (same - 1.0);
    }
    // Differences of chaos are none of the parameters.
    let noise = noise / (2.0 * STEP * STEP);
    let curvature = semidefinite(curvature - DMatrix::identity(parameters, parameters) * noise);
    let variance = scale * scale * alike(blocks, &weighted);
    let prior_precision = DVector::from_iterator(parameters, prior.iter().map(|p| p.powi(-2)));
    let precision = curvature / variance + DMatrix::from_diagonal(&prior_precision);
    let covariance = precision.try_inverse();
    let covariance = covariance.expect("the prior makes it positive definite");
    let mut step = -&covariance * (&gradient / variance + prior_precision.component_mul(at));
    let longest = step.amax();
    if longest > LONGEST {
        step *= LONGEST / longest;
    }
    // How far neighbourhoods pull apart: the covariance of a sum over clusters.
    let mut apart = DVector::<f64>::zeros(parameters);
    let mean = &gradient / count.max(1) as f64;
    for pull in &pulls {
        let moved = &covariance * (pull - &mean) / variance;
        apart += moved.component_mul(&moved) * (count as f64 / (count as f64 - 1.0).max(1.0));
    }
    // Where each of these states would take the parameters: the observed one is another of them.
    let mut chaos = DVector::<f64>::zeros(parameters);
    for world in here {
        let mut pull = DVector::<f64>::zeros(parameters);
        for &i in &counted {
            let off = weights[i] * (world[i] - residual[i]);
            pull += DVector::from_fn(parameters, |k, _| off * slope(i, k));
        }
        let moved = &covariance * pull / variance;
        chaos += moved.component_mul(&moved) / (same - 1.0) * (1.0 + 1.0 / same);
    }
    let deviation = |k: usize| {
        let plain = covariance[(k, k)].max(apart[k]);
        (plain + chaos[k]).sqrt().min(prior[k])
    };
    Local {
        at: at.clone(),
        scale,
        variance,
        deviation: (0..parameters).map(deviation).collect(),
        residual,
        step,
    }
}

impl Local {
    /// The loss of another place, under the scale of this one; what counts in only one of them counts in neither.
    fn loss_of(&self, other: &Self, prior: &[f64]) -> f64 {
        let bend = BEND * self.scale;
        let both = self.residual.iter().zip(&other.residual);
        let both = both.filter(|(own, _)| !own.is_nan()).map(|(_, r)| r.abs());
        let huber = |r: f64| {
            if r <= bend {
                0.5 * r * r
            } else {
                bend * (r - 0.5 * bend)
            }
        };
        let data: f64 = both.filter(|r| !r.is_nan()).map(huber).sum();
        let off = other
            .at
            .iter()
            .zip(prior)
            .map(|(at, prior)| (at / prior).powi(2));
        data / self.variance + 0.5 * off.sum::<f64>()
    }
}

/// Deviation of residuals and their weights by Huber's second proposal; weights of those that are NaN are 0.
fn huber(residual: &[f64]) -> (f64, Vec<f64>) {
    let counted = || residual.iter().copied().filter(|r| !r.is_nan());
    let count = counted().count().max(1) as f64;
    let bent = |scale: f64| {
        counted()
            .map(|r| r.abs().min(BEND * scale).powi(2))
            .sum::<f64>()
    };
    let mut scale = (counted().map(|r| r * r).sum::<f64>() / count).sqrt();
    scale = scale.max(LEAST_DEVIATION);
    for _ in 0..30 {
        scale = (bent(scale) / (BENT_SQUARE * count))
            .sqrt()
            .max(LEAST_DEVIATION);
    }
    let weight = |&r: &f64| match r.is_nan() {
        true => 0.0,
        false => (BEND * scale / r.abs().max(1e-300)).min(1.0),
    };
    (scale, residual.iter().map(weight).collect())
}

/// How many times as much the sums over blocks vary as they would if residuals were independent; at least 1.
fn alike(blocks: &[usize], weighted: &[f64]) -> f64 {
    let count = blocks.iter().max().map_or(0, |last| last + 1);
    let (mut sums, mut squares) = (vec![0.0; count], 0.0);
    for (&block, r) in blocks.iter().zip(weighted) {
        sums[block] += r;
        squares += r * r;
    }
    let of_sums: f64 = sums.iter().map(|sum| sum * sum).sum();
    match squares > 0.0 {
        true => (of_sums / squares).max(1.0),
        false => 1.0,
    }
}

/// The matrix without what is negative.
fn semidefinite(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let mut eigen = SymmetricEigen::new(matrix);
    eigen.eigenvalues.apply(|value| *value = value.max(0.0));
    eigen.recompose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use drape_cloth::math::{Purpose, Stream};
    use std::convert::Infallible;

    const POINTS: usize = 200;

    fn blocks() -> Vec<usize> {
        (0..POINTS).map(|i| i / 10).collect()
    }

    /// A model of two parameters, and a third that it does not have: an exponential in each. Neighbours err alike,
    /// and pushes change it by `chaos` times one of seven waves.
    fn observed(truth: [f64; 2], noise: [f64; 2], seed: u64, chaos: f64) -> Estimate {
        let wave = |i: usize, push: usize| (0.1 * i as f64 * (push + 1) as f64).sin();
        let model = |at: &[f64], i: usize| {
            let x = i as f64 / POINTS as f64;
            0.1 * x * at[0].exp() + 0.05 * (6.0 * x).sin() * (0.5 * at[1]).exp()
        };
        let mut stream = Stream::new(seed, Purpose::Evaluation, 0);
        let mut patch = 0.0;
        let mut draw = |i: usize| {
            if i.is_multiple_of(10) {
                patch = noise[1] * stream.normal();
            }
            let outlier = if stream.uniform() < 0.02 { 0.05 } else { 0.0 };
            let own = chaos * wave(i, 3 + seed as usize % 4);
            model(&truth, i) + noise[0] * stream.normal() + patch + outlier + own
        };
        let data: Vec<f64> = (0..POINTS).map(&mut draw).collect();
        let simulate = |queries: &[Query]| {
            let one = |query: &Query| {
                let pushed = |i| query.push.map_or(0.0, |push| chaos * wave(i, push));
                let residual = |i: usize| model(&query.at, i) + pushed(i) - data[i];
                (0..POINTS).map(residual).collect()
            };
            Ok::<_, Infallible>(queries.iter().map(one).collect())
        };
        let Ok(found) = estimate(&[0.5; 3], &blocks(), simulate);
        found
    }

    #[test]
    fn parameters_come_back_and_intervals_cover_them() {
        for (noise, chaos) in [([1e-3, 0.0], 0.0), ([1e-3, 1e-3], 0.0), ([1e-3, 0.0], 2e-3)] {
            let mut stream = Stream::new(9, Purpose::Worlds, 0);
            let (mut covered, count) = (0, 100);
            for seed in 0..count {
                let truth = [0.4 * stream.normal(), 0.4 * stream.normal()];
                let found = observed(truth, noise, seed, chaos);
                for (k, truth) in truth.iter().enumerate() {
                    let [low, high] = found.interval(k);
                    covered += usize::from(low <= *truth && *truth <= high);
                    assert!((found.at[k] - truth).abs() < 0.15, "{found:?} {truth}");
                }
                assert_eq!(found.is_told, [true, true, false], "{found:?}");
                assert!((found.deviation[2] - 0.5).abs() < 1e-9, "{found:?}");
            }
            let share = covered as f64 / (2 * count) as f64;
            assert!((0.82..=0.99).contains(&share), "{noise:?} {chaos}: {share}");
        }
    }

    #[test]
    fn noise_of_differences_tells_nothing() {
        // Every world is another draw, whatever the parameters are.
        let mut number = 0;
        let simulate = |queries: &[Query]| {
            let mut one = |_: &Query| {
                number += 1;
                let mut stream = Stream::new(1, Purpose::Evaluation, number);
                (0..POINTS).map(|_| 1e-3 * stream.normal()).collect()
            };
            Ok::<_, Infallible>(queries.iter().map(&mut one).collect())
        };
        let Ok(found) = estimate(&[0.5, 0.3], &blocks(), simulate);
        assert_eq!(found.is_told, [false, false], "{found:?}");
    }

    #[test]
    fn points_that_do_not_count_change_nothing() {
        let simulate = |drop: bool| {
            move |queries: &[Query]| {
                let one = |query: &Query| {
                    let of = |i: usize| match i % 2 == 1 && drop {
                        true => f64::NAN,
                        false => 0.01 * (query.at[0] - 0.2),
                    };
                    (0..POINTS).map(of).collect()
                };
                Ok::<_, Infallible>(queries.iter().map(one).collect::<Vec<Vec<f64>>>())
            }
        };
        let Ok(all) = estimate(&[0.5], &blocks(), simulate(false));
        let Ok(half) = estimate(&[0.5], &blocks(), simulate(true));
        assert_eq!([all.residuals, half.residuals], [POINTS, POINTS / 2]);
        for found in [all, half] {
            assert!((found.at[0] - 0.2).abs() < 1e-3, "{found:?}");
        }
        let Ok(none) = estimate(&[0.5], &[], |queries: &[Query]| {
            Ok::<_, Infallible>(vec![Vec::new(); queries.len()])
        });
        assert_eq!(none.at, [0.0]);
    }
}
