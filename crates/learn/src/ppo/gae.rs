/// What follows a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// The next step of the same episode, or the end of the rollout.
    Step,
    /// Nothing: the episode was over.
    Terminated,
    /// The episode was cut off at an observation of this value.
    Truncated { value: f32 },
}

/// Generalised advantage estimates (Schulman et al. 2016, eq. 16).
///
/// `rewards`, `values`, `next` and the result are `[step, task]`; `last_values` `[task]` are
/// those of the observations after the last step. With V' the value of what follows,
/// δ = r + γ V' - V and A = δ + γ λ A'. V' is 0 after a termination and the value of the last
/// observation after a truncation; A' is 0 after both and after the rollout.
pub fn gae(
    rewards: &[f32],
    values: &[f32],
    next: &[Next],
    last_values: &[f32],
    gamma: f32,
    gae_lambda: f32,
) -> Vec<f32> {
    let count = last_values.len();
    let mut advantages = vec![0.0; rewards.len()];
    for i in (0..rewards.len()).rev() {
        let after = (i + count < rewards.len()).then_some(i + count);
        let (value, advantage) = match next[i] {
            Next::Terminated => (0.0, 0.0),
            Next::Truncated { value } => (value, 0.0),
            Next::Step => match after {
                Some(j) => (values[j], advantages[j]),
                None => (last_values[i % count], 0.0),
            },
        };
        let delta = rewards[i] + gamma * value - values[i];
        advantages[i] = delta + gamma * gae_lambda * advantage;
    }
    advantages
}

#[cfg(test)]
mod tests {
    use super::*;
    use Next::{Step, Terminated, Truncated};

    /// γ = 1/2 and λ = 1/2: every number below is exact in f32.
    fn halves(rewards: &[f32], values: &[f32], next: &[Next], last: &[f32]) -> Vec<f32> {
        gae(rewards, values, next, last, 0.5, 0.5)
    }

    #[test]
    fn rollout_cut_in_an_episode_bootstraps_from_the_last_value() {
        // δ = [1 + 2 - 1, 2 + 4 - 4] = [2, 2]; A = [2 + 2/4, 2].
        let a = halves(&[1.0, 2.0], &[1.0, 4.0], &[Step, Step], &[8.0]);
        assert_eq!(a, [2.5, 2.0]);
    }

    #[test]
    fn termination_on_the_last_step_counts_its_reward_and_no_value() {
        // δ = [0 + 2 - 1, 10 - 4] = [1, 6]; A = [1 + 6/4, 6].
        let a = halves(&[0.0, 10.0], &[1.0, 4.0], &[Step, Terminated], &[8.0]);
        assert_eq!(a, [2.5, 6.0]);
    }

    #[test]
    fn termination_in_the_middle_cuts_value_and_trace() {
        // δ = [3 - 1, 2 + 4 - 4] = [2, 2]; the second episode does not reach the first.
        let a = halves(&[3.0, 2.0], &[1.0, 4.0], &[Terminated, Step], &[8.0]);
        assert_eq!(a, [2.0, 2.0]);
    }

    #[test]
    fn truncation_bootstraps_from_its_own_observation_and_cuts_the_trace() {
        // δ = [3 + 6/2 - 1, 2 + 4 - 4] = [5, 2].
        let next = [Truncated { value: 6.0 }, Step];
        let a = halves(&[3.0, 2.0], &[1.0, 4.0], &next, &[8.0]);
        assert_eq!(a, [5.0, 2.0]);
    }

    #[test]
    fn tasks_do_not_mix() {
        let next = [Step, Terminated, Step, Step];
        let a = halves(
            &[1.0, 3.0, 2.0, 2.0],
            &[1.0, 1.0, 4.0, 4.0],
            &next,
            &[8.0, 8.0],
        );
        assert_eq!(a, [2.5, 2.0, 2.0, 2.0]);
    }

    #[test]
    fn lambda_one_gives_the_return_minus_the_value() {
        let a = gae(
            &[0.0, 0.0, 1.0],
            &[0.3, -2.0, 5.0],
            &[Step, Step, Terminated],
            &[7.0],
            1.0,
            1.0,
        );
        for (a, v) in a.iter().zip([0.3, -2.0, 5.0]) {
            assert!((a - (1.0 - v)).abs() < 1e-6);
        }
    }
}
