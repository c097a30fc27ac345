use serde::Serialize;

/// Key figures of a quantity over an area, in the unit of the quantity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Distances {
    pub mean: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// 95 % of the area have at most this magnitude.
    pub p95: f64,
    pub min: f64,
    pub max: f64,
}

impl Distances {
    /// Of pairs of value and weight >= 0; none if there is nothing, or nothing with weight.
    pub fn new(values: impl IntoIterator<Item = (f64, f64)>) -> Option<Self> {
        let mut values: Vec<(f64, f64)> = values.into_iter().collect();
        let total: f64 = values.iter().map(|v| v.1).sum();
        if values.is_empty() || total.is_nan() || total <= 0.0 {
            return None;
        }
        let sum = |f: fn(f64) -> f64| values.iter().map(|&(x, w)| w * f(x)).sum::<f64>() / total;
        let (mean, rms) = (sum(|x| x), sum(|x| x * x).sqrt());
        let end = |of: fn(f64, f64) -> f64| values.iter().map(|v| v.0).reduce(of).unwrap_or(mean);
        let (min, max) = (end(f64::min), end(f64::max));
        values.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        let mut weight = 0.0;
        let reached = values.iter().find(|v| {
            weight += v.1;
            weight >= 0.95 * total
        });
        // Rounding of the sum may keep the last one from getting there.
        let p95 = reached.or(values.last()).map_or(0.0, |v| v.0.abs());
        Some(Self {
            mean,
            rms,
            p95,
            min,
            max,
        })
    }
}
