use super::agent::Agent;
use super::gae::Next;
use super::imitation::Memory;
use drape_cloth::math::Stream;
use drape_cloth::sim::Observations;
use drape_task::cluster::Cluster;
use drape_task::env::{End, Episode, StepOutcome, Tasks};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// A finished episode of one of the tasks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeRecord {
    /// Number of the task.
    pub task: usize,
    pub end: End,
    /// Sum of the rewards in the task's own unit.
    pub total_reward: f32,
    /// How well it was done; none if the simulation diverged.
    pub score: Option<f64>,
    /// All actions taken; replays the episode without a network.
    pub actions: Vec<u32>,
}

impl EpisodeRecord {
    pub(super) fn new(task: usize, episode: Episode) -> Self {
        Self {
            task,
            end: episode.end,
            total_reward: episode.total_reward,
            score: episode.score,
            actions: episode.actions,
        }
    }
}

/// Wall-clock time of an iteration, by what took it [s].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Seconds {
    pub simulation: f64,
    /// Networks asked, and everything else of the rollout.
    pub inference: f64,
    pub update: f64,
}

/// What happened in some steps of all tasks. Everything is `[step, task]`, flat.
#[derive(Debug, Default)]
pub struct Rollout {
    /// What was seen before each action.
    pub seen: SeenRollout,
    pub actions: Vec<u32>,
    pub log_probs: Vec<f32>,
    pub values: Vec<f32>,
    /// In units of the reward scale, if rewards are scaled.
    pub rewards: Vec<f32>,
    pub next: Vec<Next>,
    /// `[task]`: values of the observations after the last step.
    pub last_values: Vec<f32>,
    /// Episodes that ended, in order.
    pub episodes: Vec<EpisodeRecord>,
    /// `[episode]`: sums of their rewards, scaled like these.
    pub returns: Vec<f32>,
    /// What it has taken.
    pub seconds: Seconds,
}

/// Everything seen in a rollout, in order.
#[derive(Debug, Default)]
pub struct SeenRollout {
    pieces: Vec<Observations>,
    /// `[piece]`: rows before its end.
    ends: Vec<usize>,
}

/// Pixels of a piece on a GPU: 64 MiB, half of what the smallest buffers hold.
const MOST_PIXELS: usize = 1 << 24;

impl SeenRollout {
    /// Of what all tasks saw, step by step. On a GPU in few pieces, so that few operations choose among
    /// them; elsewhere nothing is copied.
    pub fn new(steps: Vec<Observations>) -> Self {
        let pixels = |seen: &Observations| seen.views.len() * seen.pixel_count;
        let most = steps
            .first()
            .map_or(1, |seen| (MOST_PIXELS / pixels(seen)).max(1));
        let is_host = steps.iter().any(|seen| !seen.is_on_device());
        let most = if is_host { 1 } else { most };
        let pieces = steps
            .chunks(most)
            .map(|some| Observations::joined(some.to_vec()));
        let pieces: Vec<Observations> = pieces.collect();
        let ends = pieces.iter().scan(0, |end, piece| {
            *end += piece.views.len();
            Some(*end)
        });
        Self {
            ends: ends.collect(),
            pieces,
        }
    }

    /// The piece that has a sample, and its row there.
    pub fn row(&self, sample: usize) -> (&Observations, usize) {
        let piece = self.ends.partition_point(|&end| end <= sample);
        let before = piece.checked_sub(1).map_or(0, |before| self.ends[before]);
        (&self.pieces[piece], sample - before)
    }
}

/// Plays `step_count` steps of every task, drawing the actions of a task from its own stream,
/// and notes them in `memory`. Rewards are multiplied by the task's factor. Each process of the cluster
/// asks the network about its part of the tasks.
pub fn collect<T: Tasks>(
    agent: &Agent,
    cluster: &Cluster,
    tasks: &mut T,
    streams: &mut [Stream],
    mut memory: Option<&mut Memory>,
    step_count: usize,
    reward_factors: &[f32],
) -> Rollout {
    let network = agent.actor_critic();
    let mut history = Vec::with_capacity(step_count);
    let mut rollout = Rollout::default();
    let start = Instant::now();
    let mut simulation = 0.0;
    for _ in 0..step_count {
        let seen = tasks.observations().clone();
        let drawn: Vec<_> = streams.iter_mut().map(Stream::uniform).collect();
        let choices = cluster.split(drawn.len(), |own| {
            let batch = network.batch(own.clone().map(|task| (&seen, task)));
            network.choose(&batch, &drawn[own])
        });
        let mut actions = Vec::with_capacity(choices.len());
        for (action, log_prob, value) in choices {
            actions.push(action);
            rollout.log_probs.push(log_prob);
            rollout.values.push(value);
        }

        let before = Instant::now();
        let outcomes = tasks.step(&actions);
        simulation += before.elapsed().as_secs_f64();

        if let Some(memory) = &mut memory {
            for (task, outcome) in outcomes.iter().enumerate() {
                memory.record(task, &seen, actions[task], outcome.episode.as_ref());
            }
        }
        let is_truncated = |task: &usize| {
            let episode = &outcomes[*task].episode;
            matches!(episode, Some(episode) if episode.end == End::Truncated)
        };
        let truncated: Vec<usize> = (0..outcomes.len()).filter(is_truncated).collect();
        let mut last_values = network.values_of(tasks.last(), &truncated).into_iter();
        for (task, outcome) in outcomes.into_iter().enumerate() {
            let StepOutcome { reward, episode } = outcome;
            rollout.rewards.push(reward * reward_factors[task]);
            rollout.next.push(match &episode {
                None => Next::Step,
                Some(episode) if episode.end == End::Truncated => Next::Truncated {
                    value: last_values.next().expect("one for each"),
                },
                // What has diverged earns nothing, not even what could have followed.
                Some(_) => Next::Terminated,
            });
            let earned = episode.as_ref().map(|episode| episode.total_reward);
            let scaled = earned.map(|earned| earned * reward_factors[task]);
            rollout.returns.extend(scaled);
            let record = |episode| EpisodeRecord::new(task, episode);
            rollout.episodes.extend(episode.map(record));
        }
        history.push(seen);
        rollout.actions.extend(actions);
    }
    rollout.seen = SeenRollout::new(history);
    let seen = tasks.observations();
    rollout.last_values = cluster.split(tasks.count(), |own| {
        network.values(&network.batch(own.map(|task| (seen, task))))
    });
    rollout.seconds = Seconds {
        simulation,
        inference: start.elapsed().as_secs_f64() - simulation,
        update: 0.0,
    };
    rollout
}
