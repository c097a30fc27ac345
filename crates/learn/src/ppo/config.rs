use drape_cloth::file::ValueError;
use serde::{Deserialize, Serialize};

/// How the policy is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PpoConfig {
    /// Step size of Adam.
    pub learning_rate: f64,
    /// Adam's guard against division by 0.
    pub adam_epsilon: f64,
    /// Discount of a step.
    pub gamma: f32,
    /// Decay of the advantage estimate: 0 trusts the value, 1 the rewards seen.
    pub gae_lambda: f32,
    /// Steps of each task in a rollout.
    pub rollout_steps: usize,
    /// Samples of an update at most; a batch is split evenly.
    pub minibatch_size: usize,
    /// Passes over a rollout.
    pub epochs: usize,
    /// How far the probability of an action may move from the rollout's, as a ratio.
    pub clip_range: f32,
    pub policy_coefficient: f32,
    pub value_coefficient: f32,
    pub entropy_coefficient: f32,
    /// Divide the entropy of a state by ln(valid actions), so that all states weigh alike.
    pub normalise_entropy: bool,
    pub advantage_norm: AdvantageNorm,
    /// What returns are compared with.
    pub baseline: Baseline,
    /// Least deviation that advantages are divided by.
    pub advantage_floor: f32,
    /// Limit of the gradient's norm over all parameters; none: no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_grad_norm: Option<f32>,
    /// Divide rewards by the return of a perfect episode.
    pub scale_rewards: bool,
    /// Imitate the best episodes seen; none: do not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub imitation: Option<ImitationConfig>,
}

/// Over which samples advantages get mean 0 and deviation 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AdvantageNorm {
    None,
    Minibatch,
    Batch,
}

/// What tells a good return from a bad one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Baseline {
    /// The value of the observation, as the network has learned it.
    Value,
    /// The mean return of the episodes of the same scene that have ended in the rollout, for whole episodes
    /// without discount: where rewards come at the end alone, there are too few to learn a value from. What
    /// has not ended teaches nothing. After Kool et al. 2019.
    Group,
}

/// Imitation of the best episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImitationConfig {
    /// How many episodes are kept.
    pub episodes: usize,
    /// Samples from them in each minibatch, on top of its own.
    pub samples: usize,
    /// Weight of the cross-entropy.
    pub coefficient: f32,
    /// Updates of so many samples that only imitate what has been shown, before the first rollout.
    #[serde(default)]
    pub pretraining: usize,
    /// Draws them in all symmetries of the image: for fabrics whose warp and weft are alike, and a `unet`, as other
    /// networks see nothing of the terrain that turns with it.
    #[serde(default)]
    pub symmetries: bool,
}

impl PpoConfig {
    /// The paper's Table 1; the rest as in its framework, Maze 0.2.
    pub fn paper() -> Self {
        Self {
            learning_rate: 2.5e-4,
            adam_epsilon: 1e-8,
            gamma: 0.999,
            gae_lambda: 1.0,
            rollout_steps: 100,
            minibatch_size: 400,
            epochs: 4,
            clip_range: 0.2,
            policy_coefficient: 1.0,
            value_coefficient: 0.5,
            entropy_coefficient: 2.5e-4,
            normalise_entropy: false,
            advantage_norm: AdvantageNorm::Minibatch,
            baseline: Baseline::Value,
            advantage_floor: 1e-8,
            max_grad_norm: None,
            scale_rewards: false,
            imitation: None,
        }
    }

    /// Made to learn much in little CPU time: rewards of order 1, no discount, one
    /// normalisation for the whole batch, and the best episodes imitated.
    pub fn compact() -> Self {
        Self {
            learning_rate: 2e-3,
            adam_epsilon: 1e-5,
            gamma: 1.0,
            gae_lambda: 0.98,
            entropy_coefficient: 2e-3,
            normalise_entropy: true,
            advantage_norm: AdvantageNorm::Batch,
            advantage_floor: 1e-3,
            max_grad_norm: Some(0.5),
            scale_rewards: true,
            imitation: Some(ImitationConfig {
                episodes: 4,
                samples: 128,
                coefficient: 0.3,
                pretraining: 0,
                symmetries: false,
            }),
            ..Self::paper()
        }
    }

    /// Refuses so many processes that one would have no part in a minibatch of rollouts of `tasks`.
    pub fn check_processes(&self, processes: usize, tasks: usize) -> Result<(), ValueError> {
        let samples = tasks * self.rollout_steps;
        let least = samples / samples.div_ceil(self.minibatch_size);
        let imitated = self.imitation.as_ref();
        let imitated = imitated.map(|imitation| ("imitation.samples", imitation.samples));
        for (key, found) in [("minibatch_size", least)].into_iter().chain(imitated) {
            let expected = format!("at least {processes}, one sample a process");
            ValueError::unless(found >= processes, key, found, expected)?;
        }
        Ok(())
    }

    /// Checks every value against its range.
    pub fn validate(&self) -> Result<(), ValueError> {
        // In single precision neither 0 nor infinite.
        let positive = |key: &str, x: f64| {
            let is_valid = (1e-37..=1e37).contains(&x);
            let expected = "a number from 1e-37 to 1e37";
            ValueError::unless(is_valid, key, format!("{x:?}"), expected)
        };
        let weight = |key: &str, x: f32| {
            let is_valid = x.is_finite() && x >= 0.0;
            ValueError::unless(is_valid, key, x, "a finite number, 0 or above")
        };
        let share = |key: &str, x: f32| {
            ValueError::unless((0.0..=1.0).contains(&x), key, x, "a number from 0 to 1")
        };
        let count = |key: &str, n: usize| ValueError::unless(n >= 1, key, n, "1 or more");
        // Greater ones only exhaust memory or time.
        let few = |key: &str, n: usize| {
            let expected = "a number from 1 to 4096";
            ValueError::unless((1..=4096).contains(&n), key, n, expected)
        };
        positive("learning_rate", self.learning_rate)?;
        positive("adam_epsilon", self.adam_epsilon)?;
        share("gamma", self.gamma)?;
        share("gae_lambda", self.gae_lambda)?;
        count("rollout_steps", self.rollout_steps)?;
        count("minibatch_size", self.minibatch_size)?;
        few("epochs", self.epochs)?;
        positive("clip_range", self.clip_range.into())?;
        weight("policy_coefficient", self.policy_coefficient)?;
        weight("value_coefficient", self.value_coefficient)?;
        weight("entropy_coefficient", self.entropy_coefficient)?;
        positive("advantage_floor", self.advantage_floor.into())?;
        if let Some(norm) = self.max_grad_norm {
            positive("max_grad_norm", norm.into())?;
        }
        if let Some(imitation) = &self.imitation {
            few("imitation.episodes", imitation.episodes)?;
            few("imitation.samples", imitation.samples)?;
            weight("imitation.coefficient", imitation.coefficient)?;
            let (found, expected) = (imitation.pretraining, "a number from 0 to 1048576");
            ValueError::unless(found <= 1 << 20, "imitation.pretraining", found, expected)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_valid_and_survive_toml() {
        for config in [PpoConfig::paper(), PpoConfig::compact()] {
            config.validate().unwrap();
            let text = toml::to_string(&config).unwrap();
            assert_eq!(toml::from_str::<PpoConfig>(&text).unwrap(), config);
        }
    }

    #[test]
    fn values_out_of_range_are_named() {
        let error = |change: fn(&mut PpoConfig)| {
            let mut config = PpoConfig::compact();
            change(&mut config);
            config.validate().unwrap_err().to_string()
        };
        assert_eq!(
            error(|c| c.gamma = 1.5),
            "`gamma` is 1.5, expected a number from 0 to 1"
        );
        assert_eq!(
            error(|c| c.learning_rate = f64::NAN),
            "`learning_rate` is NaN, expected a number from 1e-37 to 1e37"
        );
        assert!(error(|c| c.learning_rate = 1e39).starts_with("`learning_rate` is 1e39"));
        assert!(error(|c| c.adam_epsilon = 1e-300).starts_with("`adam_epsilon` is 1e-300"));
        assert_eq!(
            error(|c| c.epochs = 0),
            "`epochs` is 0, expected a number from 1 to 4096"
        );
        // What no memory holds.
        assert_eq!(
            error(|c| c.imitation.as_mut().unwrap().samples = usize::MAX),
            "`imitation.samples` is 18446744073709551615, expected a number from 1 to 4096"
        );
        assert_eq!(
            error(|c| c.imitation.as_mut().unwrap().coefficient = -1.0),
            "`imitation.coefficient` is -1, expected a finite number, 0 or above"
        );
        assert_eq!(
            error(|c| c.imitation.as_mut().unwrap().pretraining = 1 << 21),
            "`imitation.pretraining` is 2097152, expected a number from 0 to 1048576"
        );
        let unknown = toml::from_str::<PpoConfig>("gama = 1.0").unwrap_err();
        assert!(unknown.to_string().contains("gama"), "{unknown}");
    }
}
