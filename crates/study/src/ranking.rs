//! Ranges, and how far two judgements of the same things agree: ranks, and what following the wrong
//! one costs.

use drape_cloth::math::{Purpose, Stream};

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

/// Rank of every value, 1 for the least; equal values share the mean of their ranks.
pub fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    let mut next = 0;
    for tied in order.chunk_by(|&a, &b| values[a] == values[b]) {
        let mean = next as f64 + 0.5 * (tied.len() + 1) as f64;
        for &index in tied {
            ranks[index] = mean;
        }
        next += tied.len();
    }
    ranks
}

/// Spearman's rank correlation, -1 to 1: Pearson's of the ranks, which is right with ties too.
/// None where one side is all the same, or there are fewer than two.
pub fn spearman(pairs: &[[f64; 2]]) -> Option<f64> {
    // Ranks are multiples of a half around a known mean: sums are exact.
    let mean = 0.5 * (pairs.len() as f64 + 1.0);
    let side = |k: usize| pairs.iter().map(|pair| pair[k]).collect::<Vec<_>>();
    let [a, b] = [0, 1].map(|k| ranks(&side(k)));
    let sum = |a: &[f64], b: &[f64]| -> f64 {
        let pairs = a.iter().zip(b);
        pairs.map(|(a, b)| (a - mean) * (b - mean)).sum()
    };
    let size = (sum(&a, &a) * sum(&b, &b)).sqrt();
    (size > 0.0).then(|| sum(&a, &b) / size)
}

/// What it costs on average to take of two pairs the one whose first number is less, where the
/// second is what counts. A tie costs half of the difference. None without two.
pub fn pair_loss(pairs: &[[f64; 2]]) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for (i, [judged, truth]) in pairs.iter().enumerate() {
        for [other_judged, other_truth] in &pairs[..i] {
            let wrong = match (judged - other_judged) * (truth - other_truth) {
                agree if agree > 0.0 => 0.0,
                agree if agree < 0.0 => 1.0,
                _ => 0.5,
            };
            sum += wrong * (truth - other_truth).abs();
            count += 1;
        }
    }
    (count > 0).then(|| sum / f64::from(count))
}

/// The middle 90 % of a `statistic` over resamples of `count` things, each drawn with replacement
/// (Efron's bootstrap, percentiles): how far the choice of the things lets it swing. The same
/// resamples in every call. None where the statistic is not there for most of them.
pub fn interval(count: usize, statistic: impl Fn(&[usize]) -> Option<f64>) -> Option<[f64; 2]> {
    const RESAMPLES: usize = 1000;
    if count == 0 {
        return None;
    }
    let mut stream = Stream::new(1, Purpose::Evaluation, 200);
    let mut drawn = vec![0; count];
    let mut found = Vec::new();
    for _ in 0..RESAMPLES {
        drawn.fill_with(|| stream.below(count));
        found.extend(statistic(&drawn));
    }
    found.sort_by(f64::total_cmp);
    let at = |share: f64| found[(share * (found.len() - 1) as f64).round() as usize];
    (2 * found.len() > RESAMPLES).then(|| [at(0.05), at(0.95)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(a: &[f64], b: &[f64]) -> Vec<[f64; 2]> {
        a.iter().zip(b).map(|(a, b)| [*a, *b]).collect()
    }

    #[test]
    fn ties_share_their_ranks() {
        assert_eq!(ranks(&[3.0, 1.0, 3.0, 2.0, 3.0]), [4.0, 1.0, 4.0, 2.0, 4.0]);
        assert_eq!(ranks(&[]), [0.0; 0]);
    }

    /// Hand-worked: ranks of a are 1, 2.5, 2.5, 4 and of b 1, 3, 2, 4. About their mean the
    /// products sum to 4.5, the squares to 4.5 and 5: 4.5 / sqrt(22.5) = sqrt(0.9).
    #[test]
    fn spearman_with_ties_is_the_hand_worked_value() {
        let found = spearman(&pairs(&[10.0, 20.0, 20.0, 30.0], &[1.0, 7.0, 5.0, 100.0])).unwrap();
        assert!((found - 0.9f64.sqrt()).abs() < 1e-15, "{found}");
    }

    /// Without ties, 1 - 6 sum d^2 / (n (n^2 - 1)), whatever grows evenly or not.
    #[test]
    fn spearman_without_ties_is_the_formula_of_differences() {
        let a = [5.0, 1.0, 4.0, 2.0, 3.0];
        let b = [0.5, 0.1, 0.2, 0.4, 9.0];
        // Ranks 5 1 4 2 3 and 4 1 2 3 5: d^2 = 1 0 4 1 4.
        let expected = 1.0 - 6.0 * 10.0 / (5.0 * 24.0);
        assert!((spearman(&pairs(&a, &b)).unwrap() - expected).abs() < 1e-15);
        assert_eq!(spearman(&pairs(&a, &a.map(|x| x.exp()))), Some(1.0));
        assert_eq!(spearman(&pairs(&a, &a.map(|x| -x))), Some(-1.0));
        assert_eq!(spearman(&pairs(&a, &[1.0; 5])), None);
        assert_eq!(spearman(&pairs(&[1.0], &[1.0])), None);
    }

    /// The mean of 400 numbers drawn from 0 and 1 alike swings by 1.645 / (2 sqrt(400)) to either
    /// side.
    #[test]
    fn intervals_of_a_mean_are_the_normal_ones() {
        let mean = |drawn: &[usize]| {
            let ones = drawn.iter().filter(|&&index| index % 2 == 1).count();
            Some(ones as f64 / 400.0)
        };
        let [low, high] = interval(400, mean).unwrap();
        assert!(
            (low - 0.4589).abs() < 5e-3 && (high - 0.5411).abs() < 5e-3,
            "{low} {high}"
        );
        assert_eq!(interval(3, |_| None), None);
        assert_eq!(interval(1, |drawn| Some(drawn[0] as f64)), Some([0.0, 0.0]));
    }

    #[test]
    fn wrong_choices_cost_what_they_leave_behind() {
        let truth = [1.0, 2.0, 4.0];
        assert_eq!(pair_loss(&pairs(&truth, &truth)), Some(0.0));
        // Every choice is wrong: 1, 3 and 2 on average.
        assert_eq!(pair_loss(&pairs(&[3.0, 2.0, 1.0], &truth)), Some(2.0));
        assert_eq!(pair_loss(&pairs(&[0.0; 3], &truth)), Some(1.0));
        assert_eq!(pair_loss(&pairs(&[1.0], &[1.0])), None);
    }
}
