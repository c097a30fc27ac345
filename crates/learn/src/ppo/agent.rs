use super::error::TrainError;
use crate::policy::{ActorCritic, Batch, DeviceKind, PolicyConfig, masked};
use drape_cloth::math::Stream;
use drape_cloth::sim::Observation;
use drape_task::env::{ImageShape, Terrain};

/// How an action is chosen.
#[derive(Debug)]
pub enum Sampling<'a> {
    /// The most probable action; the lowest index of equals.
    Greedy,
    /// Drawn from the policy, one number of the stream an observation.
    Drawn(&'a mut Stream),
}

/// A network with initial weights, able to learn.
pub(super) fn actor_critic(
    config: &PolicyConfig,
    shape: ImageShape,
    terrains: &[&Terrain],
    seed: u64,
    device: DeviceKind,
) -> Result<ActorCritic, TrainError> {
    let made = ActorCritic::new(config, shape, terrains, seed, &device.open()?);
    let mut actor_critic = made.map_err(TrainError::Policy)?;
    actor_critic.encodes_there = device.encodes_there();
    Ok(actor_critic)
}

/// A policy to be evaluated; it does not learn.
#[derive(Clone, Debug)]
pub struct Agent(ActorCritic);

impl Agent {
    /// An agent whose initial weights come from `seed`.
    pub fn new(
        config: &PolicyConfig,
        shape: ImageShape,
        terrains: &[&Terrain],
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, TrainError> {
        actor_critic(config, shape, terrains, seed, device).map(|made| Self::of(&made))
    }

    /// The agent that `actor_critic` is now.
    pub(super) fn of(actor_critic: &ActorCritic) -> Self {
        Self(actor_critic.valid())
    }

    /// One action an observation, always allowed by its mask.
    pub fn act(&self, observations: &[Observation], mut sampling: Sampling) -> Vec<u32> {
        let (log_probs, _) = self.evaluate(observations);
        let rows = log_probs.chunks_exact(self.0.pixel_count());
        let choose = |(observation, row): (&Observation, &[f32])| match &mut sampling {
            Sampling::Greedy => masked::most_probable(row, observation.allowed()),
            Sampling::Drawn(stream) => masked::draw(row, observation.allowed(), stream.uniform()),
        };
        observations.iter().zip(rows).map(choose).collect()
    }

    /// The probability of every action of an observation; 0 for those that its mask does not allow.
    pub fn probabilities(&self, observation: Observation) -> Vec<f32> {
        let (log_probs, _) = self.evaluate(&[observation]);
        log_probs.iter().map(|log_prob| log_prob.exp()).collect()
    }

    /// Expected return of each observation, as a share of the reward scale if the training
    /// scaled its rewards. Masks may be empty.
    pub fn value(&self, observations: &[Observation]) -> Vec<f32> {
        self.0.values(&Batch::Host(observations.to_vec()))
    }

    /// What it is asked with.
    pub(super) fn actor_critic(&self) -> &ActorCritic {
        &self.0
    }

    /// Log-probabilities `[observation * pixel]` and values `[observation]`.
    pub(super) fn evaluate(&self, observations: &[Observation]) -> (Vec<f32>, Vec<f32>) {
        self.0.evaluate(observations)
    }

    /// The parameters: section `network` of a checkpoint.
    pub fn save(&self) -> Vec<u8> {
        self.0.save()
    }

    /// Takes saved parameters; fails with a reason, changing nothing, if they are of another
    /// network.
    pub fn load(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.0.load(bytes)
    }
}
