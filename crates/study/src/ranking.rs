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
