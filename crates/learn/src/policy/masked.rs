//! The categorical distribution over the allowed actions.

use burn::tensor::{Bool, Int, Tensor, TensorData, activation};

/// Logit of an action that is not allowed. Its probability is exactly 0 in f32, and unlike
/// with -inf the gradients stay numbers.
pub const FILL: f32 = -1.0e9;

/// Log-probabilities `[batch, action]` from `logits`; `invalid` actions get about [`FILL`].
/// Each row must have a valid action.
pub fn log_softmax(logits: Tensor<2>, invalid: Tensor<2, Bool>) -> Tensor<2> {
    activation::log_softmax(logits.mask_fill(invalid, FILL), 1)
}

/// Log-probability `[batch]` of the actions taken `[batch]`.
pub fn log_prob(log_probs: Tensor<2>, actions: Tensor<1, Int>) -> Tensor<1> {
    log_probs.gather(1, actions.unsqueeze_dim(1)).squeeze_dim(1)
}

/// Entropy `[batch]` in nat: -Σ p log p over the valid actions.
pub fn entropy(log_probs: Tensor<2>, invalid: Tensor<2, Bool>) -> Tensor<1> {
    // Zeros before exp, not after: exp of the fill underflows, which costs 20 times the time.
    let log_probs = log_probs.mask_fill(invalid, 0.0);
    -(log_probs.clone().exp() * log_probs)
        .sum_dim(1)
        .squeeze_dim(1)
}

/// Draws an action from one row of log-probabilities. `uniform` is in [0, 1). Only `allowed` actions
/// are ever returned, whatever the rounding.
///
/// # Panics
///
/// If none is allowed.
pub fn draw(
    log_probs: &[f32],
    mut allowed: impl Iterator<Item = u32> + Clone,
    uniform: f64,
) -> u32 {
    let probability = |i: u32| f64::from(log_probs[i as usize]).exp();
    // The probabilities add up to 1 only nearly: scale by their sum.
    let total: f64 = allowed.clone().map(probability).sum();
    let mut rest = uniform * total;
    let mut last = None;
    for i in allowed.clone() {
        let p = probability(i);
        if p > 0.0 {
            last = Some(i);
            if rest < p {
                break;
            }
            rest -= p;
        }
    }
    // No probability above 0 means that the logits were not numbers; the update reports that.
    let action = last.or_else(|| allowed.next());
    action.expect("an observation allows an action")
}

/// That for each row of log-probabilities `[row, action]`, where they are. Rows that allow nothing give
/// the number of actions.
pub fn draw_rows(
    log_probs: Tensor<2>,
    invalid: Tensor<2, Bool>,
    uniform: &[f64],
) -> Tensor<1, Int> {
    let [rows, count] = log_probs.dims();
    let device = log_probs.device();
    // Below 1 in single precision too: then the last sum is above every threshold.
    let below = |&uniform: &f64| (uniform as f32).min(1.0 - f32::EPSILON);
    let uniform: Vec<f32> = uniform.iter().map(below).collect();
    let uniform = Tensor::<2>::from_data(TensorData::new(uniform, [rows, 1]), &device);
    let probability = log_probs.exp().mask_fill(invalid.clone(), 0.0);
    let sums = sums(probability.clone());
    let threshold = sums.clone().narrow(1, count - 1, 1) * uniform;
    let action = Tensor::<1, Int>::arange(0..count as i64, &device).unsqueeze::<2>();
    let action = action.repeat_dim(0, rows);
    // Whatever the rounding of sums, only what has a probability is drawn.
    let never = probability.lower_equal_elem(0.0);
    let before = sums.lower_equal(threshold.expand([rows, count]));
    let smallest =
        |of: Tensor<2, Int>, but: Tensor<2, Bool>| of.mask_fill(but, count as i64).min_dim(1);
    let first = smallest(action.clone(), before.bool_or(never.clone()));
    let last = action.clone().mask_fill(never, -1).max_dim(1);
    let lowest = smallest(action, invalid);
    let found = first
        .clone()
        .mask_where(first.equal_elem(count as i64), last);
    let found = found.clone().mask_where(found.lower_elem(0), lowest);
    found.squeeze_dim(1)
}

/// Sums of each row up to each place. In blocks, since devices sum every place up by itself.
fn sums(rows: Tensor<2>) -> Tensor<2> {
    const BLOCK: usize = 64;
    let [count, width] = rows.dims();
    let blocks = width.div_ceil(BLOCK);
    let rows = rows.pad((0, blocks * BLOCK - width, 0, 0), 0.0);
    let within = rows.reshape([count, blocks, BLOCK]).cumsum(2);
    let block = within.clone().narrow(2, BLOCK - 1, 1);
    let before = block.clone().cumsum(1) - block;
    let all: Tensor<2> = (within + before).reshape([count, blocks * BLOCK]);
    all.narrow(1, 0, width)
}

/// The most probable of the `allowed` actions; the lowest index of equals.
///
/// # Panics
///
/// If none is allowed.
pub fn most_probable(log_probs: &[f32], allowed: impl Iterator<Item = u32>) -> u32 {
    let better = |best: u32, i: u32| match log_probs[i as usize] > log_probs[best as usize] {
        true => i,
        false => best,
    };
    let best = allowed.reduce(better);
    best.expect("an observation allows an action")
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    fn tensor<const D: usize>(data: impl Into<TensorData>) -> Tensor<D> {
        Tensor::from_data(data, &Device::flex().autodiff())
    }

    fn invalid(data: impl Into<TensorData>) -> Tensor<2, Bool> {
        Tensor::from_data(data, &Device::flex().autodiff())
    }

    #[test]
    fn entropy_and_log_probabilities_by_hand() {
        // Row 0: probabilities 3/4 and 1/4 among two valid actions. Row 1: one valid action.
        let logits = tensor::<2>([[3f32.ln(), 9.0, 0.0], [5.0, 1.0, -2.0]]);
        let invalid = invalid([[false, true, false], [true, true, false]]);
        let log_probs = log_softmax(logits, invalid.clone());
        let entropy: Vec<f32> = entropy(log_probs.clone(), invalid)
            .into_data()
            .try_into_vec()
            .unwrap();
        let by_hand = -(0.75 * 0.75f32.ln() + 0.25 * 0.25f32.ln());
        assert!((entropy[0] - by_hand).abs() < 1e-6 && entropy[1] == 0.0);
        let actions = Tensor::from_data([2, 2], &Device::flex().autodiff());
        let taken: Vec<f32> = log_prob(log_probs, actions)
            .into_data()
            .try_into_vec()
            .unwrap();
        assert!((taken[0] - 0.25f32.ln()).abs() < 1e-6 && taken[1] == 0.0);
    }

    #[test]
    fn entropy_gradient_by_hand_and_zero_where_masked() {
        // dH/dz_i = -p_i (log p_i + H), and 0 for a masked action.
        let logits = tensor::<2>([[3f32.ln(), 9.0, 0.0]]).require_grad();
        let invalid = invalid([[false, true, false]]);
        let log_probs = log_softmax(logits.clone(), invalid.clone());
        let gradients = entropy(log_probs, invalid).sum().backward();
        let gradient = logits.grad(&gradients).unwrap();
        let gradient: Vec<f32> = gradient.into_data().try_into_vec().unwrap();
        let h = -(0.75 * 0.75f32.ln() + 0.25 * 0.25f32.ln());
        let by_hand = [-0.75 * (0.75f32.ln() + h), 0.0, -0.25 * (0.25f32.ln() + h)];
        for (found, expected) in gradient.iter().zip(by_hand) {
            assert!((found - expected).abs() < 1e-6, "{gradient:?} {by_hand:?}");
        }
    }

    #[test]
    fn drawing_follows_the_probabilities_and_never_leaves_the_mask() {
        let log_probs = [0.25f32.ln(), FILL, 0.75f32.ln(), FILL];
        let allowed = || [0, 2].into_iter();
        assert_eq!(draw(&log_probs, allowed(), 0.0), 0);
        assert_eq!(draw(&log_probs, allowed(), 0.249), 0);
        assert_eq!(draw(&log_probs, allowed(), 0.251), 2);
        assert_eq!(draw(&log_probs, allowed(), 1.0 - f64::EPSILON), 2);
        // Actions of probability 0 are not drawn while another has some; if none has, the
        // mask still holds.
        assert_eq!(draw(&[f32::NAN; 4], allowed(), 0.5), 0);
        let certain = [0.0, FILL, -200.0, FILL];
        assert_eq!(draw(&certain, allowed(), 1.0 - f64::EPSILON), 0);
    }

    #[test]
    fn greedy_takes_the_lowest_index_of_the_best_allowed() {
        let log_probs = [0.0, -1.0, -1.0, -3.0];
        assert_eq!(most_probable(&log_probs, [1, 2, 3].into_iter()), 1);
        assert_eq!(most_probable(&log_probs, [3].into_iter()), 3);
    }

    #[test]
    fn unmasked_draws_match_their_frequencies() {
        let log_probs = [0.5f32.ln(), 0.3f32.ln(), 0.2f32.ln()];
        let mut counts = [0; 3];
        for i in 0..1000 {
            counts[draw(&log_probs, 0..3, (f64::from(i) + 0.5) / 1000.0) as usize] += 1;
        }
        assert_eq!(counts, [500, 300, 200]);
    }
}
