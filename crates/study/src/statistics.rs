//! Ranges, middles and ranks of values, and what few runs can tell: Agarwal et al. 2021, "Deep Reinforcement
//! Learning at the Edge of the Statistical Precipice".

use drape_cloth::math::{Purpose, Stream};

/// Mean of the values in the middle: a quarter of them, rounded down, is left out at either end. NaN
/// without any.
pub fn interquartile_mean(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let cut = sorted.len() / 4;
    let middle = &sorted[cut..sorted.len() - cut];
    middle.iter().sum::<f64>() / middle.len() as f64
}

/// Probability that a value of the first group is greater than one of the second: Mann and Whitney's
/// U over the number of pairs. A tie counts half; NaN without pairs.
pub fn probability_of_improvement([first, second]: [&[f64]; 2]) -> f64 {
    let greater = |x: &f64| -> f64 {
        let each = second.iter().map(|y| match x.total_cmp(y) {
            std::cmp::Ordering::Greater => 1.0,
            std::cmp::Ordering::Equal => 0.5,
            std::cmp::Ordering::Less => 0.0,
        });
        each.sum()
    };
    let pairs = (first.len() * second.len()) as f64;
    first.iter().map(greater).sum::<f64>() / pairs
}

/// Draws with replacement that an interval is taken from.
const RESAMPLES: usize = 10_000;

/// 95 % interval of a statistic by the percentile bootstrap, stratified: each group is drawn from
/// anew on its own. NaN where a group is empty.
pub fn bootstrap<const N: usize>(
    groups: [&[f64]; N],
    statistic: impl Fn([&[f64]; N]) -> f64,
) -> [f64; 2] {
    if groups.iter().any(|group| group.is_empty()) {
        return [f64::NAN; 2];
    }
    let mut stream = Stream::new(0, Purpose::Evaluation, 0);
    let mut drawn = groups.map(<[f64]>::to_vec);
    let mut resample = || {
        for (drawn, group) in drawn.iter_mut().zip(groups) {
            drawn.fill_with(|| group[stream.below(group.len())]);
        }
        statistic(drawn.each_ref().map(Vec::as_slice))
    };
    let mut found: Vec<f64> = (0..RESAMPLES).map(|_| resample()).collect();
    found.sort_by(f64::total_cmp);
    [0.025, 0.975].map(|share| quantile(&found, share))
}

/// Between the two nearest of `sorted` values, linearly.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let (low, high) = (
        sorted[place.floor() as usize],
        sorted[place.ceil() as usize],
    );
    low + place.fract() * (high - low)
}

/// Least and greatest value; infinite without any.
pub fn extremes(values: &[f64]) -> [f64; 2] {
    let range = [f64::INFINITY, f64::NEG_INFINITY];
    (values.iter()).fold(range, |[low, high], &x| [low.min(x), high.max(x)])
}

/// The middle value, or the mean of the two in the middle; NaN without any.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |k: usize| sorted.get(k).copied().unwrap_or(f64::NAN);
    match sorted.len() {
        odd if odd % 2 == 1 => at(odd / 2),
        even => 0.5 * (at(even / 2) + at((even / 2).wrapping_sub(1))),
    }
}

/// Spearman's rank correlation of pairs [-]; NaN where either is the same everywhere.
pub fn rank_correlation(a: &[f64], b: &[f64]) -> f64 {
    let [a, b] = [a, b].map(centred_ranks);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    dot(&a, &b) / (dot(&a, &a) * dot(&b, &b)).sqrt()
}

/// Ranks less their mean; equals share theirs.
fn centred_ranks(values: &[f64]) -> Vec<f64> {
    let rank = |x: &f64| {
        let below = values.iter().filter(|y| *y < x).count() as f64;
        let above = values.iter().filter(|y| *y > x).count() as f64;
        0.5 * (below - above)
    };
    values.iter().map(rank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean([values]: [&[f64]; 1]) -> f64 {
        values.iter().sum::<f64>() / values.len() as f64
    }

    #[test]
    fn interquartile_mean_leaves_out_a_quarter_at_either_end() {
        assert_eq!(
            interquartile_mean(&[8.0, 1.0, 7.0, 2.0, 6.0, 3.0, 5.0, 4.0]),
            4.5
        );
        // One of five goes at either end, however far off it is.
        assert_eq!(interquartile_mean(&[-1e9, 1.0, 2.0, 6.0, 1e9]), 3.0);
        // Of three none.
        assert_eq!(interquartile_mean(&[0.0, 0.0, 3.0]), 1.0);
        assert!(interquartile_mean(&[]).is_nan());
    }

    #[test]
    fn improvement_counts_pairs_and_half_of_ties() {
        assert_eq!(probability_of_improvement([&[3.0, 4.0], &[1.0, 2.0]]), 1.0);
        assert_eq!(probability_of_improvement([&[1.0, 2.0], &[3.0, 4.0]]), 0.0);
        assert_eq!(probability_of_improvement([&[2.0], &[2.0]]), 0.5);
        // Greater, equal and less.
        let (x, y): (&[f64], &[f64]) = (&[1.0, 2.0, 3.0, 3.0], &[2.0]);
        assert_eq!(probability_of_improvement([x, y]), 0.625);
        assert_eq!(probability_of_improvement([y, x]), 0.375);
        assert!(probability_of_improvement([x, &[]]).is_nan());
    }

    /// The number of ones in a resample is binomial: of 16 with even chances at most 3 has a
    /// probability of 1.1 %, at most 4 of 3.8 %.
    #[test]
    fn interval_of_a_mean_has_the_quantiles_of_the_binomial_distribution() {
        let mut values = [0.0; 16];
        values[..8].fill(1.0);
        assert_eq!(bootstrap([&values], mean), [0.25, 0.75]);
        assert_eq!(bootstrap([&[0.0, 1.0]], mean), [0.0, 1.0]);
        assert_eq!(bootstrap([&[0.5; 3]], mean), [0.5; 2]);
        assert!(bootstrap([&[]], mean)[0].is_nan());
    }

    #[test]
    fn groups_are_drawn_from_on_their_own() {
        let difference = |[a, b]: [&[f64]; 2]| a[0] - b[0];
        assert_eq!(bootstrap([&[1.0; 4], &[3.0; 2]], difference), [-2.0; 2]);
    }

    #[test]
    fn quantiles_are_interpolated() {
        let sorted = [0.0, 1.0, 3.0];
        assert_eq!(
            [0.0, 0.25, 0.75, 1.0].map(|q| quantile(&sorted, q)),
            [0.0, 0.5, 2.0, 3.0]
        );
    }

    #[test]
    fn ranks_correlate() {
        let found = rank_correlation(&[1.0, 2.0, 3.0, 4.0, 5.0], &[5.0, 6.0, 7.0, 8.0, 70.0]);
        assert!((found - 1.0).abs() < 1e-12);
        let found = rank_correlation(&[1.0, 2.0, 3.0], &[0.3, 0.2, 0.1]);
        assert!((found + 1.0).abs() < 1e-12);
        // With the tie's mean rank of 1.5: -1.5, 0, 1.5 beside -1, -1, 2 in halves.
        let found = rank_correlation(&[1.0, 2.0, 3.0], &[0.0, 0.0, 1.0]);
        assert!((found - 0.75f64.sqrt()).abs() < 1e-12, "{found}");
        assert!(rank_correlation(&[1.0, 2.0], &[1.0, 1.0]).is_nan());
    }
}
