//! A few specimens stand for all fabric there is.

use drape_cloth::math::mean_and_deviation;

/// Quantiles of Student's distribution that 90 % are between, by degrees of freedom from 1 on.
const STUDENT: [f64; 30] = [
    6.314, 2.920, 2.353, 2.132, 2.015, 1.943, 1.895, 1.860, 1.833, 1.812, 1.796, 1.782, 1.771,
    1.761, 1.753, 1.746, 1.740, 1.734, 1.729, 1.725, 1.721, 1.717, 1.714, 1.711, 1.708, 1.706,
    1.703, 1.701, 1.699, 1.697,
];

/// The quantile of the normal distribution that takes their place beyond.
pub(crate) const NORMAL: f64 = 1.645;

/// A quantity as specimens give it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Geometric mean: factors scatter round it by the standard deviation of their logarithm.
    pub value: f64,
    /// Interval that holds the true mean at 90 %; none of one specimen.
    pub interval: Option<[f64; 2]>,
    pub specimens: usize,
}

/// What specimens say of a quantity > 0; none if there are none.
pub fn measured(values: &[f64]) -> Option<Measured> {
    let count = values.len();
    let logarithms: Vec<f64> = values.iter().map(|value| value.ln()).collect();
    let [mean, deviation] = mean_and_deviation(&logarithms);
    let student = |freedom: usize| STUDENT.get(freedom - 1).copied().unwrap_or(NORMAL);
    let half = || student(count - 1) * deviation / (count as f64).sqrt();
    let interval = || [-1.0, 1.0].map(|sign| (mean + sign * half()).exp());
    (count > 0).then(|| Measured {
        value: mean.exp(),
        interval: (count > 1).then(interval),
        specimens: count,
    })
}

/// Standard deviation of the logarithm within groups of specimens, each about its own mean; none if no group has two.
pub fn factor_spread<'a>(groups: impl IntoIterator<Item = &'a [f64]>) -> Option<f64> {
    let (mut squares, mut freedom) = (0.0, 0);
    for values in groups.into_iter().filter(|values| values.len() > 1) {
        let logarithms: Vec<f64> = values.iter().map(|value| value.ln()).collect();
        let [_, deviation] = mean_and_deviation(&logarithms);
        let degrees = values.len() - 1;
        squares += degrees as f64 * deviation * deviation;
        freedom += degrees;
    }
    (freedom > 0).then(|| (squares / freedom as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use drape_cloth::math::{Purpose, Stream};

    #[test]
    fn one_specimen_has_no_interval_and_no_spread() {
        let one = measured(&[0.3]).unwrap();
        assert!((one.value - 0.3).abs() < 1e-15);
        assert_eq!((one.interval, one.specimens), (None, 1));
        assert_eq!(factor_spread([&[0.3][..], &[0.2]]), None);
        assert_eq!(measured(&[]), None);
        let two = [1.0, 4.0];
        assert!((measured(&two).unwrap().value - 2.0).abs() < 1e-15);
        let deviation = 4f64.ln() / 2f64.sqrt();
        assert!((factor_spread([&two[..]]).unwrap() - deviation).abs() < 1e-15);
    }

    #[test]
    fn intervals_cover_the_truth_nine_times_in_ten() {
        let mut stream = Stream::new(3, Purpose::Evaluation, 0);
        let covers = |_: &usize| {
            let values: Vec<f64> = (0..5).map(|_| (0.2 * stream.normal()).exp()).collect();
            let [low, high] = measured(&values).unwrap().interval.unwrap();
            low <= 1.0 && 1.0 <= high
        };
        let share = (0..4000).filter(covers).count() as f64 / 4000.0;
        // Four standard errors.
        assert!((share - 0.9).abs() < 0.02, "{share}");
    }
}
