use super::adam::{Adam, global_norm};
use super::config::{AdvantageNorm, Baseline, PpoConfig};
use super::error::NotFinite;
use super::gae::{Next, gae};
use super::imitation::Memory;
use super::loss;
use super::rollout::Rollout;
use super::shared;
use crate::policy::{ActorCritic, Batch, masked};
use burn::optim::{GradientsAccumulator, GradientsParams};
use burn::tensor::{Bool, Device, Int, Tensor, TensorData};
use drape_cloth::math::Stream;
use drape_cloth::sim::Observations;
use drape_task::cluster::Cluster;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// What an update did: means over its minibatches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct UpdateMetrics {
    pub policy_loss: f32,
    pub value_loss: f32,
    /// In nat, or as a share of ln(valid actions) if entropies are normalised.
    pub entropy: f32,
    /// Cross-entropy of the imitated actions [nat]; 0 without imitation.
    pub imitation_loss: f32,
    /// KL divergence from the policy of the rollout [nat].
    pub approx_kl: f32,
    pub clip_fraction: f32,
    /// Of the gradient over all parameters, before it is limited.
    pub gradient_norm: f32,
    /// Share of the returns' variance that the values explained before the update.
    pub explained_variance: f32,
}

impl UpdateMetrics {
    /// `of` each number of both.
    fn each(self, other: Self, of: impl Fn(f32, f32) -> f32) -> Self {
        Self {
            policy_loss: of(self.policy_loss, other.policy_loss),
            value_loss: of(self.value_loss, other.value_loss),
            entropy: of(self.entropy, other.entropy),
            imitation_loss: of(self.imitation_loss, other.imitation_loss),
            approx_kl: of(self.approx_kl, other.approx_kl),
            clip_fraction: of(self.clip_fraction, other.clip_fraction),
            gradient_norm: of(self.gradient_norm, other.gradient_norm),
            explained_variance: of(self.explained_variance, other.explained_variance),
        }
    }
}

/// Random streams of updates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Streams {
    /// Orders the samples.
    pub shuffle: Stream,
    /// Chooses among the moves that are to be imitated.
    pub imitation: Stream,
}

/// What an update changes, and by what rules. Each process of the cluster takes its part of every minibatch.
pub struct Learner<'a> {
    pub config: &'a PpoConfig,
    pub cluster: &'a Cluster,
    pub actor_critic: &'a mut ActorCritic,
    pub adam: &'a mut Adam,
}

/// Improves the learner on `rollout` for some epochs and says how it went.
///
/// Each epoch takes every sample once, in a new random order, in minibatches of nearly equal
/// size. Stops at the first loss or gradient that is not finite, before it does harm.
pub fn update(
    mut learner: Learner,
    rollout: &Rollout,
    memory: Option<&Memory>,
    streams: &mut Streams,
) -> Result<UpdateMetrics, NotFinite> {
    let config = learner.config;
    let (rewards, values) = (&rollout.rewards, &rollout.values);
    let (next, last_values) = (&rollout.next, &rollout.last_values);
    let (gamma, lambda) = (config.gamma, config.gae_lambda);
    let mut advantages = gae(rewards, values, next, last_values, gamma, lambda);
    let returns: Vec<f32> = advantages.iter().zip(values).map(|(a, v)| a + v).collect();
    if config.baseline == Baseline::Group {
        advantages = group_advantages(rollout);
    }
    if config.advantage_norm == AdvantageNorm::Batch {
        advantages = loss::normalised(&advantages, config.advantage_floor);
    }

    let mut order: Vec<usize> = (0..rewards.len()).collect();
    let pieces = order.len().div_ceil(config.minibatch_size);
    let mut sum = UpdateMetrics::default();
    for _ in 0..config.epochs {
        streams.shuffle.shuffle(&mut order);
        for piece in 0..pieces {
            let indices = &order[piece * order.len() / pieces..(piece + 1) * order.len() / pieces];
            let drawn = match (&config.imitation, memory) {
                (Some(c), Some(memory)) => {
                    let drawn = memory.draw(c.samples, &mut streams.imitation);
                    Some((drawn, c.coefficient))
                }
                _ => None,
            };
            let (imitated, weight) = match &drawn {
                Some(((seen, actions), weight)) => (shown(seen, actions), *weight),
                None => (Vec::new(), 0.0),
            };
            let minibatch = Minibatch::new(config, rollout, &advantages, &returns, indices);
            let found = descend(&mut learner, &minibatch, &imitated, weight)?;
            sum = sum.each(found, |sum, own| sum + own);
        }
    }
    let steps = (config.epochs * pieces) as f32;
    Ok(UpdateMetrics {
        explained_variance: loss::explained_variance(values, &returns),
        ..sum.each(sum, |sum, _| sum / steps)
    })
}

/// For each sample the return of its episode, less the mean of all that have ended on its scene in the
/// rollout; 0 where the episode has not.
fn group_advantages(rollout: &Rollout) -> Vec<f32> {
    let (next, returns) = (&rollout.next, &rollout.returns);
    let ends = (0..next.len()).filter(|&sample| next[sample] != Next::Step);
    let ends: Vec<usize> = ends.collect();
    let scene = |sample: usize| {
        let (seen, row) = rollout.seen.row(sample);
        usize::from(seen.views[row])
    };
    let scene_count = ends.iter().map(|&end| scene(end) + 1).max().unwrap_or(0);
    let mut groups = vec![(0.0, 0.0); scene_count];
    for (&end, &gained) in ends.iter().zip(returns) {
        let (sum, count) = &mut groups[scene(end)];
        (*sum, *count) = (*sum + gained, *count + 1.0);
    }
    let task_count = rollout.last_values.len();
    let mut advantages = vec![0.0; next.len()];
    for (&end, &gained) in ends.iter().zip(returns) {
        let (sum, count) = groups[scene(end)];
        let mut sample = end;
        loop {
            advantages[sample] = gained - sum / count;
            match sample.checked_sub(task_count) {
                Some(before) if next[before] == Next::Step => sample = before,
                _ => break,
            }
        }
    }
    advantages
}

/// A row of what was seen.
type Seen<'a> = (&'a Observations, usize);
/// A move that is to be imitated: such a row, and the action.
pub type Shown<'a> = (&'a Observations, usize, u32);

/// Each row of what was seen, with its action.
pub fn shown<'a>(seen: &'a Observations, actions: &[u32]) -> Vec<Shown<'a>> {
    let actions = actions.iter().enumerate();
    actions.map(|(row, &action)| (seen, row, action)).collect()
}

/// Takes a step towards moves that are to be imitated, one at least, and nothing else. Gives the cross-entropy before it
/// [nat].
pub fn imitate(mut learner: Learner, moves: &[Shown]) -> Result<f32, NotFinite> {
    Ok(descend(&mut learner, &Minibatch::default(), moves, 1.0)?.imitation_loss)
}

/// Samples of one gradient step.
#[derive(Default)]
struct Minibatch<'a> {
    seen: Vec<Seen<'a>>,
    actions: Vec<u32>,
    log_probs: Vec<f32>,
    advantages: Vec<f32>,
    returns: Vec<f32>,
}

impl<'a> Minibatch<'a> {
    fn new(
        config: &PpoConfig,
        rollout: &'a Rollout,
        advantages: &[f32],
        returns: &[f32],
        indices: &[usize],
    ) -> Self {
        let pick = |numbers: &[f32]| indices.iter().map(|&i| numbers[i]).collect::<Vec<_>>();
        let mut advantages = pick(advantages);
        if config.advantage_norm == AdvantageNorm::Minibatch {
            advantages = loss::normalised(&advantages, config.advantage_floor);
        }
        Self {
            seen: indices.iter().map(|&i| rollout.seen.row(i)).collect(),
            actions: indices.iter().map(|&i| rollout.actions[i]).collect(),
            log_probs: pick(&rollout.log_probs),
            advantages,
            returns: pick(returns),
        }
    }

    /// Some of the samples, as many as `own`.
    fn part(&self, own: Range<usize>) -> Self {
        let cut = |numbers: &[f32]| numbers[own.clone()].to_vec();
        Self {
            seen: self.seen[own.clone()].to_vec(),
            actions: self.actions[own.clone()].to_vec(),
            log_probs: cut(&self.log_probs),
            advantages: cut(&self.advantages),
            returns: cut(&self.returns),
        }
    }
}

/// What one thread takes the gradient of: samples of a minibatch, moves to be imitated, and which share they
/// are of all.
struct Part<'a> {
    samples: Minibatch<'a>,
    imitated: &'a [Shown<'a>],
    shares: [f32; 2],
}

/// Parts of a minibatch of which threads take gradients side by side: as many on any number of threads, so
/// that sums have the same bits. They are of whole lanes, as convolutions take images. One part fills a GPU.
const PARTS: usize = 8;
const LANES: usize = 16;

/// Takes one step against the gradient of the loss of a minibatch and of some moves to be imitated,
/// c₁ policy + c₂ value - c₃ entropy + `weight` imitation, over all processes and limited to the largest norm
/// allowed. Says nothing of the explained variance.
fn descend(
    learner: &mut Learner,
    minibatch: &Minibatch,
    imitated: &[Shown],
    weight: f32,
) -> Result<UpdateMetrics, NotFinite> {
    let Learner {
        config, cluster, ..
    } = learner;
    let actor_critic = &*learner.actor_critic;
    let part_count = if actor_critic.encodes_there { 1 } else { PARTS };
    let part = |k: usize| {
        let own = |count: usize| {
            let own = cluster.share(count);
            let end = |k: usize| {
                let even = k * own.len() / part_count;
                let whole = (even + LANES / 2) / LANES * LANES;
                own.start
                    + if k < part_count {
                        whole.min(own.len())
                    } else {
                        even
                    }
            };
            end(k)..end(k + 1)
        };
        let share = |own: usize, all: usize| own as f32 / all.max(1) as f32;
        let samples = minibatch.part(own(minibatch.actions.len()));
        let imitated_part = &imitated[own(imitated.len())];
        let shares = [
            share(samples.actions.len(), minibatch.actions.len()),
            share(imitated_part.len(), imitated.len()),
        ];
        (
            match part_count {
                1 => actor_critic.clone(),
                _ => actor_critic.fork(),
            },
            Part {
                samples,
                imitated: imitated_part,
                shares,
            },
        )
    };
    let parts: Vec<_> = (0..part_count).map(part).collect();
    let found = (parts.into_par_iter())
        .map(|(actor_critic, part)| evaluate(config, &actor_critic, &part, weight));
    let found: Vec<_> = found.collect();

    let network = &actor_critic.network;
    let mut gradients = GradientsAccumulator::new();
    let mut terms = [0.0; 6];
    for (of_part, own) in found {
        gradients.accumulate(network, of_part);
        for (sum, own) in terms.iter_mut().zip(own) {
            *sum += own;
        }
    }
    let mut gradients = gradients.grads();
    shared::sum(cluster, network, &mut gradients, &mut terms);
    let found = UpdateMetrics {
        policy_loss: terms[0],
        value_loss: terms[1],
        entropy: terms[2],
        imitation_loss: terms[3],
        approx_kl: terms[4],
        clip_fraction: terms[5],
        gradient_norm: global_norm(network, &gradients),
        ..UpdateMetrics::default()
    };
    let norm = found.gradient_norm;
    for (quantity, number) in [
        ("policy loss", found.policy_loss),
        ("value loss", found.value_loss),
        ("entropy", found.entropy),
        ("imitation loss", found.imitation_loss),
        ("gradient norm", norm),
    ] {
        if !number.is_finite() {
            return Err(NotFinite { quantity });
        }
    }
    let scale = match config.max_grad_norm {
        Some(limit) if norm > limit => limit / norm,
        _ => 1.0,
    };
    let network = network.clone();
    let adam = &mut *learner.adam;
    learner.actor_critic.network =
        adam.step(network, gradients, scale.into(), config.learning_rate);
    Ok(found)
}

/// What a part adds to the gradient and to the terms of the loss.
fn evaluate(
    config: &PpoConfig,
    actor_critic: &ActorCritic,
    part: &Part,
    weight: f32,
) -> (GradientsParams, Vec<f32>) {
    let Part {
        samples,
        imitated,
        shares: [share, imitated_share],
    } = part;
    let device = actor_critic.device();
    let (own, others) = (samples.actions.len(), imitated.len());
    if own + others == 0 {
        return (GradientsParams::new(), vec![0.0; 6]);
    }
    // One pass through the network for both kinds of samples.
    let rows = samples.seen.iter().copied();
    let rows = rows.chain(imitated.iter().map(|&(seen, row, _)| (seen, row)));
    let batch = actor_critic.batch(rows);
    let actions = samples.actions.iter().copied();
    let actions = actions.chain(imitated.iter().map(|&(_, _, action)| action));

    let (prediction, invalid) = actor_critic.predict(&batch);
    let log_probs = masked::log_softmax(prediction.logits, invalid.clone());
    let log_prob = masked::log_prob(log_probs.clone(), int_tensor(actions, &device));
    let mut total = Tensor::zeros([1], &device);
    let mut terms = vec![total.clone(); 6];
    if own > 0 {
        let new = log_prob.clone().narrow(0, 0, own);
        let old = tensor(&samples.log_probs, &device);
        let advantage = tensor(&samples.advantages, &device);
        let returns = tensor(&samples.returns, &device);
        let weights = entropy_weights(config, &batch, &invalid, own);
        let policy = loss::policy_loss(new.clone(), old.clone(), advantage, config.clip_range);
        let value = loss::value_loss(prediction.value.clone().narrow(0, 0, own), returns);
        let entropy = masked::entropy(log_probs.narrow(0, 0, own), invalid.narrow(0, 0, own));
        let entropy = (entropy * weights).mean();
        total = policy.clone() * (config.policy_coefficient * share)
            + value.clone() * (config.value_coefficient * share)
            - entropy.clone() * (config.entropy_coefficient * share);
        let kl = loss::approx_kl(new.clone(), old.clone());
        let clipped = loss::clip_fraction(new, old, config.clip_range);
        for (k, term) in [(0, policy), (1, value), (2, entropy), (4, kl), (5, clipped)] {
            terms[k] = term * *share;
        }
    }
    if own == 0 {
        // burn forgets only what a backward pass has come to: without it the graphs of all values would be kept, and
        // looked through at every update.
        total = total + prediction.value.clone().sum() * 0.0;
    }
    if others > 0 {
        let imitation = -log_prob.narrow(0, own, others).mean() * *imitated_share;
        total = total + imitation.clone() * weight;
        terms[3] = imitation;
    }
    // All terms in one transfer.
    let terms = Tensor::cat(terms, 0).into_data().try_into_vec();
    let gradients = GradientsParams::from_grads(total.backward(), &actor_critic.network);
    (gradients, terms.expect("terms are f32"))
}

/// Weight of each of the first `count` states' entropy: 1, or 1 / ln(valid actions) if normalised. A state
/// with one valid action has none.
fn entropy_weights(
    config: &PpoConfig,
    batch: &Batch,
    invalid: &Tensor<2, Bool>,
    count: usize,
) -> Tensor<1> {
    let device = &invalid.device();
    if !config.normalise_entropy {
        return Tensor::ones([count], device);
    }
    match batch {
        Batch::Host(rows) => {
            let weights = rows[..count]
                .iter()
                .map(|seen| match seen.allowed().count() {
                    1 => 0.0,
                    count => 1.0 / (count as f32).ln(),
                });
            tensor(&weights.collect::<Vec<_>>(), device)
        }
        Batch::Device(_) => {
            let valid = invalid.clone().narrow(0, 0, count).bool_not();
            let valid: Tensor<1> = valid.float().sum_dim(1).squeeze_dim(1);
            let single = valid.clone().lower_equal_elem(1.0);
            // ln(2) is never looked at.
            let valid = valid.mask_fill(single.clone(), 2.0);
            valid.log().recip().mask_fill(single, 0.0)
        }
    }
}

fn tensor(numbers: &[f32], device: &Device) -> Tensor<1> {
    Tensor::from_data(TensorData::new(numbers.to_vec(), [numbers.len()]), device)
}

fn int_tensor(numbers: impl Iterator<Item = u32>, device: &Device) -> Tensor<1, Int> {
    let numbers: Vec<i32> = numbers.map(|x| x as i32).collect();
    let shape = [numbers.len()];
    Tensor::from_data(TensorData::new(numbers, shape), device)
}

#[cfg(test)]
mod tests {
    use super::super::rollout::SeenRollout;
    use super::*;

    /// Two tasks on scene 0, one on scene 1, three steps: an episode has the same advantage from its first
    /// step on, whatever it has earned when, and what has not ended has none.
    #[test]
    fn groups_are_the_episodes_of_a_scene() {
        let seen = |views: [u16; 3]| Observations::new(views.to_vec(), vec![0.0; 3], vec![0; 3]);
        let (on, end) = (Next::Step, Next::Terminated);
        let cut = Next::Truncated { value: 9.0 };
        let rollout = Rollout {
            seen: SeenRollout::new(vec![seen([0, 0, 1]); 3]),
            next: vec![end, on, on, on, on, end, on, cut, on],
            returns: vec![3.0, 7.0, 5.0],
            last_values: vec![0.0; 3],
            ..Rollout::default()
        };
        let expected = [-1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0];
        assert_eq!(group_advantages(&rollout), expected);
    }
}
