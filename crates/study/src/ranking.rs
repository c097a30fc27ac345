//! Ranges and middles of values.

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
