//! The terms of the loss, as pure functions of tensors `[batch]`.

use burn::tensor::Tensor;

/// Negative clipped surrogate (Schulman et al. 2017, eq. 7): -mean min(ρ A, clip(ρ, 1 ± ε) A)
/// with ρ = exp(`log_prob` - `old_log_prob`) and ε = `clip_range`.
pub fn policy_loss(
    log_prob: Tensor<1>,
    old_log_prob: Tensor<1>,
    advantage: Tensor<1>,
    clip_range: f32,
) -> Tensor<1> {
    let rho = (log_prob - old_log_prob).exp();
    let clipped = rho.clone().clamp(1.0 - clip_range, 1.0 + clip_range);
    -(rho * advantage.clone())
        .min_pair(clipped * advantage)
        .mean()
}

/// ½ mean (R - V)².
pub fn value_loss(value: Tensor<1>, returns: Tensor<1>) -> Tensor<1> {
    (returns - value).square().mean() * 0.5
}

/// Estimate of KL(old ‖ new): mean ρ - 1 - ln ρ, never negative (Schulman 2020, "Approximating
/// KL divergence", k₃).
pub fn approx_kl(log_prob: Tensor<1>, old_log_prob: Tensor<1>) -> Tensor<1> {
    let log_rho = log_prob - old_log_prob;
    (log_rho.clone().exp() - 1.0 - log_rho).mean()
}

/// Share of the samples whose ρ is outside 1 ± `clip_range`.
pub fn clip_fraction(log_prob: Tensor<1>, old_log_prob: Tensor<1>, clip_range: f32) -> Tensor<1> {
    let rho = (log_prob - old_log_prob).exp();
    (rho - 1.0).abs().greater_elem(clip_range).float().mean()
}

/// 1 - var(R - V) / var(R); 0 if all returns are equal.
pub fn explained_variance(values: &[f32], returns: &[f32]) -> f32 {
    let errors: Vec<f32> = returns.iter().zip(values).map(|(r, v)| r - v).collect();
    let total = moments(returns).1;
    if total == 0.0 {
        return 0.0;
    }
    (1.0 - moments(&errors).1 / total) as f32
}

/// (x - mean) / max(deviation, `floor`), of all `numbers`.
pub fn normalised(numbers: &[f32], floor: f32) -> Vec<f32> {
    let (mean, variance) = moments(numbers);
    let deviation = variance.sqrt().max(f64::from(floor));
    let normalise = |&x: &f32| ((f64::from(x) - mean) / deviation) as f32;
    numbers.iter().map(normalise).collect()
}

/// Mean and variance (divided by the count).
fn moments(numbers: &[f32]) -> (f64, f64) {
    let count = numbers.len() as f64;
    let mean = numbers.iter().map(|&x| f64::from(x)).sum::<f64>() / count;
    let square = |&x: &f32| (f64::from(x) - mean).powi(2);
    (mean, numbers.iter().map(square).sum::<f64>() / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    fn tensor<const N: usize>(numbers: [f32; N]) -> Tensor<1> {
        Tensor::from_floats(numbers, &Device::flex().autodiff())
    }

    fn number(tensor: Tensor<1>) -> f32 {
        tensor.into_scalar()
    }

    /// ρ = 1.5, 0.5, 1.5, 0.5 against log-probability 0, and advantages of both signs.
    fn ratios() -> (Tensor<1>, Tensor<1>, Tensor<1>) {
        let log_prob = tensor([1.5f32.ln(), 0.5f32.ln(), 1.5f32.ln(), 0.5f32.ln()]);
        let advantage = tensor([1.0, 1.0, -1.0, -1.0]);
        (log_prob.require_grad(), tensor([0.0; 4]), advantage)
    }

    #[test]
    fn clipped_surrogate_and_its_gradient_by_hand() {
        let (log_prob, old, advantage) = ratios();
        let loss = policy_loss(log_prob.clone(), old, advantage, 0.2);
        // min(1.5, 1.2), min(0.5, 0.8), min(-1.5, -1.2), min(-0.5, -0.8).
        assert!((number(loss.clone()) - -(1.2 + 0.5 - 1.5 - 0.8) / 4.0).abs() < 1e-6);
        // dL/d log π = -ρ A / 4 where not clipped.
        let gradient = log_prob.grad(&loss.backward()).unwrap();
        let gradient: Vec<f32> = gradient.into_data().try_into_vec().unwrap();
        for (found, expected) in gradient.iter().zip([0.0, -0.125, 0.375, 0.0]) {
            assert!((found - expected).abs() < 1e-6, "{gradient:?}");
        }
    }

    #[test]
    fn value_loss_and_its_gradient_by_hand() {
        let value = tensor([1.0, 2.0]).require_grad();
        let loss = value_loss(value.clone(), tensor([2.0, 5.0]));
        assert_eq!(number(loss.clone()), 2.5);
        let gradient = value.grad(&loss.backward()).unwrap();
        assert_eq!(
            gradient.into_data().try_into_vec::<f32>().unwrap(),
            [-0.5, -1.5]
        );
    }

    #[test]
    fn statistics_by_hand() {
        let (log_prob, old, _) = ratios();
        let kl = (0.5 - 1.5f32.ln() + (-0.5) - 0.5f32.ln()) / 2.0;
        assert!((number(approx_kl(log_prob.clone(), old.clone())) - kl).abs() < 1e-6);
        assert_eq!(
            number(clip_fraction(log_prob.clone(), old.clone(), 0.4)),
            1.0
        );
        assert_eq!(number(clip_fraction(log_prob, old, 0.6)), 0.0);
        assert_eq!(explained_variance(&[0.0, 0.0], &[1.0, 3.0]), 0.0);
        assert_eq!(explained_variance(&[1.0, 3.0], &[1.0, 3.0]), 1.0);
        assert_eq!(explained_variance(&[1.0, 2.0], &[3.0, 3.0]), 0.0);
        assert_eq!(normalised(&[1.0, 3.0], 0.0), [-1.0, 1.0]);
        assert_eq!(normalised(&[1.0, 3.0], 4.0), [-0.25, 0.25]);
    }
}
