use super::adam::Adam;
use super::agent::{Agent, AgentError};
use super::config::{ImitationConfig, PpoConfig};
use super::imitation::Memory;
use super::rollout;
use super::update::{NotFinite, Streams, UpdateMetrics, update};
use crate::policy::{ActorCritic, ConfigError, DeviceKind, ParameterError, PolicyConfig};
use drape_cloth::math::{Purpose, Stream};
use drape_task::env::{End, Episode, Tasks};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::Instant;

/// A training: tasks, a network that plays them, and all that learning needs.
pub struct Trainer<T: Tasks> {
    config: PpoConfig,
    tasks: T,
    actor_critic: ActorCritic,
    adam: Adam,
    memory: Option<Memory>,
    progress: Progress,
}

/// Counters and random streams: what is small, stored as a whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Progress {
    iteration: u64,
    env_steps: u64,
    /// `[task]`.
    actions: Vec<Stream>,
    update: Streams,
}

/// A finished episode, without its last observation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeRecord {
    /// Number of the task that it was played in.
    pub task: usize,
    pub end: End,
    /// Sum of the rewards in the task's own unit.
    pub total_reward: f32,
    /// How well it was done; none if the simulation diverged.
    pub score: Option<f64>,
    /// All actions taken; replays the episode without a network.
    pub actions: Vec<u32>,
}

/// Wall-clock time of an iteration, by what took it [s].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Seconds {
    pub simulation: f64,
    /// Networks asked, and everything else of the rollout.
    pub inference: f64,
    pub update: f64,
}

/// What one rollout and its update gave.
#[derive(Clone, Debug, PartialEq)]
pub struct Iteration {
    /// Its number, from 1.
    pub number: u64,
    /// Steps of all tasks since the training began.
    pub env_steps: u64,
    pub metrics: UpdateMetrics,
    /// Episodes that ended in this rollout.
    pub episodes: Vec<EpisodeRecord>,
    pub seconds: Seconds,
}

/// A training that cannot begin or go on.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    #[error(transparent)]
    Agent(#[from] AgentError),
    #[error("ppo")]
    Config(#[from] ConfigError),
    /// The update stopped before the step that would have done harm.
    #[error("iteration {iteration} failed: lower the learning rate or limit the gradient norm")]
    NotFinite { iteration: u64, source: NotFinite },
}

/// A saved training that cannot be taken up; the trainer is as before.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    #[error("section `{section}` is missing")]
    Missing { section: &'static str },
    #[error("section `network`")]
    Network(#[from] ParameterError),
    #[error("section `{section}`: {reason}")]
    Section {
        section: &'static str,
        reason: String,
    },
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

impl<T: Tasks> Trainer<T> {
    /// A training of `tasks` from the start. `seed` decides the initial weights, the actions
    /// drawn and the order of samples; `device` where the network is computed.
    pub fn new(
        config: PpoConfig,
        policy: &PolicyConfig,
        tasks: T,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, TrainError> {
        config.validate()?;
        let shape = tasks.shape();
        let weights = Stream::new(seed, Purpose::Weights, 0).bits();
        let device = device.open().map_err(AgentError::from)?;
        let size = [shape.rows, shape.columns];
        let actor_critic =
            ActorCritic::new(policy, size, weights, &device).map_err(AgentError::from)?;
        let count = tasks.count();
        let memory = |c: &ImitationConfig| Memory::new(c.episodes, count);
        Ok(Self {
            adam: Adam::new(&actor_critic.network, config.adam_epsilon),
            memory: config.imitation.as_ref().map(memory),
            progress: Progress {
                iteration: 0,
                env_steps: 0,
                actions: (0..count as u32)
                    .map(|task| Stream::new(seed, Purpose::Actions, task))
                    .collect(),
                update: Streams {
                    shuffle: Stream::new(seed, Purpose::Shuffle, 0),
                    imitation: Stream::new(seed, Purpose::Shuffle, 1),
                },
            },
            config,
            tasks,
            actor_critic,
        })
    }

    /// Plays one rollout and learns from it. After an error the training cannot go on; load
    /// the last checkpoint.
    pub fn iterate(&mut self) -> Result<Iteration, TrainError> {
        let mut seconds = Seconds::default();
        let progress = &mut self.progress;
        let reward_factor = match self.config.scale_rewards {
            true => 1.0 / self.tasks.reward_scale(),
            false => 1.0,
        };
        let rollout = rollout::collect(
            &Agent::of(&self.actor_critic),
            &mut self.tasks,
            &mut progress.actions,
            self.memory.as_mut(),
            self.config.rollout_steps,
            reward_factor,
            &mut seconds,
        );
        progress.iteration += 1;
        progress.env_steps += rollout.actions.len() as u64;

        let start = Instant::now();
        let metrics = update(
            &self.config,
            &mut self.actor_critic,
            &mut self.adam,
            &rollout,
            self.memory.as_ref(),
            &mut progress.update,
        )
        .map_err(|source| TrainError::NotFinite {
            iteration: progress.iteration,
            source,
        })?;
        seconds.update = start.elapsed().as_secs_f64();
        Ok(Iteration {
            number: progress.iteration,
            env_steps: progress.env_steps,
            metrics,
            episodes: rollout.episodes,
            seconds,
        })
    }

    /// The policy as it is now, for evaluation.
    pub fn agent(&self) -> Agent {
        Agent::of(&self.actor_critic)
    }

    /// The tasks being played.
    pub fn tasks(&self) -> &T {
        &self.tasks
    }

    /// Steps of all tasks since the training began.
    pub fn env_steps(&self) -> u64 {
        self.progress.env_steps
    }

    /// Everything needed to go on later exactly from here, by name: parameters, moments,
    /// counters and random streams, the tasks, and the episodes to be imitated.
    pub fn save(&self) -> BTreeMap<String, Vec<u8>> {
        let mut sections = BTreeMap::new();
        let mut insert = |name: &str, bytes| sections.insert(name.to_owned(), bytes);
        insert(NETWORK, self.actor_critic.save());
        insert(ADAM, self.adam.save());
        insert(TASKS, self.tasks.save());
        insert(PROGRESS, encode(&self.progress));
        if let Some(memory) = &self.memory {
            insert(IMITATION, encode(memory));
        }
        sections
    }

    /// Goes back to what [`Trainer::save`] returned, for the same configuration and tasks of
    /// the same kind. Fails, changing nothing, if they are of another training.
    pub fn load(&mut self, sections: &BTreeMap<String, Vec<u8>>) -> Result<(), LoadError> {
        let mut actor_critic = self.actor_critic.clone();
        actor_critic.load(section(sections, NETWORK)?)?;
        let adam = self.adam.loaded(section(sections, ADAM)?);
        let adam = adam.map_err(|reason| LoadError::section(ADAM, reason))?;
        let progress: Progress = decode(sections, PROGRESS)?;
        if progress.actions.len() != self.tasks.count() {
            let (found, expected) = (progress.actions.len(), self.tasks.count());
            let reason = format!("made for {found} tasks, expected {expected}");
            return Err(LoadError::section(PROGRESS, reason));
        }
        let memory = match &self.memory {
            None => None,
            Some(own) => {
                let memory: Memory = decode(sections, IMITATION)?;
                if !memory.fits(own, self.tasks.shape().pixel_count()) {
                    let reason = "made for other tasks or another number of episodes";
                    return Err(LoadError::section(IMITATION, reason));
                }
                Some(memory)
            }
        };
        self.tasks
            .load(section(sections, TASKS)?)
            .map_err(|reason| LoadError::section(TASKS, reason))?;
        self.actor_critic = actor_critic;
        self.adam = adam;
        self.progress = progress;
        self.memory = memory;
        Ok(())
    }
}

const NETWORK: &str = "network";
const ADAM: &str = "adam";
const TASKS: &str = "tasks";
const PROGRESS: &str = "progress";
const IMITATION: &str = "imitation";

impl LoadError {
    fn section(section: &'static str, reason: impl ToString) -> Self {
        let reason = reason.to_string();
        Self::Section { section, reason }
    }
}

fn section<'a>(
    sections: &'a BTreeMap<String, Vec<u8>>,
    name: &'static str,
) -> Result<&'a [u8], LoadError> {
    let bytes = sections.get(name).map(Vec::as_slice);
    bytes.ok_or(LoadError::Missing { section: name })
}

fn encode(value: &impl Serialize) -> Vec<u8> {
    postcard::to_allocvec(value).expect("a training can be written")
}

fn decode<V: for<'de> Deserialize<'de>>(
    sections: &BTreeMap<String, Vec<u8>>,
    name: &'static str,
) -> Result<V, LoadError> {
    postcard::from_bytes(section(sections, name)?).map_err(|e| LoadError::section(name, e))
}
