use super::adam::Adam;
use super::agent::{Agent, actor_critic};
use super::config::{ImitationConfig, PpoConfig};
use super::error::TrainError;
use super::imitation::Memory;
use super::rollout::{EpisodeRecord, Seconds, collect};
use super::sections::{NETWORK, SectionError, Sections, decode, encode, read_section};
use super::symmetry::Symmetry;
use super::update::{Learner, Streams, UpdateMetrics, imitate, shown, update};
use crate::policy::{ActorCritic, DeviceKind, PolicyConfig};
use drape_cloth::math::{Purpose, Stream};
use drape_task::cluster::Cluster;
use drape_task::env::{Tasks, Terrain};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// A training: tasks, a network that plays them, and all that learning needs.
pub struct Trainer<T: Tasks> {
    config: PpoConfig,
    cluster: Cluster,
    tasks: T,
    pub(super) actor_critic: ActorCritic,
    adam: Adam,
    memory: Option<Memory>,
    progress: Progress,
}

const KIND: [u8; 8] = *b"progress";

/// Counters and random streams: what is small, stored as a whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Progress {
    /// [`KIND`]: what else is short may read like this.
    kind: [u8; 8],
    iteration: u64,
    env_steps: u64,
    /// `[task]`.
    actions: Vec<Stream>,
    update: Streams,
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
        config.validate().map_err(TrainError::Ppo)?;
        let weights = Stream::new(seed, Purpose::Weights, 0).bits();
        let (count, shape, scenes) = (tasks.count(), tasks.shape(), tasks.terrains().len());
        let mut symmetries = Symmetry::all(shape);
        if !config.imitation.as_ref().is_some_and(|c| c.symmetries) {
            symmetries.truncate(1);
        }
        let terrains = symmetries.iter().flat_map(|symmetry| {
            let terrains = tasks.terrains().into_iter();
            terrains.map(|terrain| symmetry.terrain(terrain))
        });
        let terrains: Vec<Terrain> = terrains.collect();
        let terrains: Vec<&Terrain> = terrains.iter().collect();
        let actor_critic = actor_critic(policy, shape, &terrains, weights, device)?;
        let memory = |c: &ImitationConfig| Memory::new(c.episodes, scenes, count, symmetries);
        Ok(Self {
            adam: Adam::new(&actor_critic.network, config.adam_epsilon),
            memory: config.imitation.as_ref().map(memory),
            progress: Progress {
                kind: KIND,
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
            cluster: Cluster::default(),
            tasks,
            actor_critic,
        })
    }

    /// This training, computed by all processes of a cluster together: each has made it with the same
    /// arguments and calls the same functions of it.
    ///
    /// # Errors
    /// A process would have no part in a minibatch.
    pub fn among(mut self, cluster: &Cluster) -> Result<Self, TrainError> {
        let checked = self
            .config
            .check_processes(cluster.size(), self.tasks.count());
        checked.map_err(TrainError::Ppo)?;
        self.cluster = cluster.clone();
        Ok(self)
    }

    /// Lets every task play one episode of `choose`, which is given the tasks and the number of one
    /// of them, to be imitated if it is among the best. Nothing is played where nothing is
    /// imitated. Gives the episodes.
    pub fn show(&mut self, mut choose: impl FnMut(&T, usize) -> u32) -> Vec<EpisodeRecord> {
        let Some(memory) = &mut self.memory else {
            return Vec::new();
        };
        let start = self.tasks.save();
        let mut shown: Vec<Option<EpisodeRecord>> = vec![None; self.tasks.count()];
        while shown.iter().any(Option::is_none) {
            let tasks = 0..shown.len();
            let actions: Vec<u32> = tasks.map(|task| choose(&self.tasks, task)).collect();
            let seen = self.tasks.observations().clone();
            let outcomes = self.tasks.step(&actions).into_iter();
            for (task, (outcome, action)) in outcomes.zip(actions).enumerate() {
                memory.record(task, &seen, action, outcome.episode.as_ref());
                let record = |episode| EpisodeRecord::new(task, episode);
                shown[task] = shown[task].take().or(outcome.episode.map(record));
            }
        }
        memory.interrupt();
        let restored = self.tasks.load(&start);
        restored.expect("tasks take back what they have saved");
        shown.into_iter().flatten().collect()
    }

    /// Learns what has been shown by imitation alone, if there is anything to be imitated. `go_on` is told
    /// the share that is done and the cross-entropy [nat]; when it says no, this ends.
    pub fn pretrain(&mut self, mut go_on: impl FnMut(f64, f32) -> bool) -> Result<(), TrainError> {
        let (Some(imitation), Some(memory)) = (&self.config.imitation, &self.memory) else {
            return Ok(());
        };
        for step in 0..imitation.pretraining {
            let (seen, actions) =
                memory.draw(imitation.samples, &mut self.progress.update.imitation);
            if actions.is_empty() {
                break;
            }
            let learner = Learner {
                config: &self.config,
                cluster: &self.cluster,
                actor_critic: &mut self.actor_critic,
                adam: &mut self.adam,
            };
            let loss = imitate(learner, &shown(&seen, &actions));
            let loss = loss.map_err(|source| TrainError::NotFinite {
                iteration: 0,
                source,
            })?;
            let share = (step + 1) as f64 / imitation.pretraining as f64;
            if !go_on(share, loss) {
                break;
            }
        }
        // The moments are those of another loss, and of the value there are none.
        self.adam = Adam::new(&self.actor_critic.network, self.config.adam_epsilon);
        Ok(())
    }

    /// Plays one rollout and learns from it. After an error the training cannot go on; load
    /// the last checkpoint.
    pub fn iterate(&mut self) -> Result<Iteration, TrainError> {
        let progress = &mut self.progress;
        let factor = |task| match self.config.scale_rewards {
            true => 1.0 / self.tasks.reward_scale(task),
            false => 1.0,
        };
        let reward_factors: Vec<f32> = (0..self.tasks.count()).map(factor).collect();
        let rollout = collect(
            &Agent::of(&self.actor_critic),
            &self.cluster,
            &mut self.tasks,
            &mut progress.actions,
            self.memory.as_mut(),
            self.config.rollout_steps,
            &reward_factors,
        );
        progress.iteration += 1;
        progress.env_steps += rollout.actions.len() as u64;

        let start = Instant::now();
        let metrics = update(
            Learner {
                config: &self.config,
                cluster: &self.cluster,
                actor_critic: &mut self.actor_critic,
                adam: &mut self.adam,
            },
            &rollout,
            self.memory.as_ref(),
            &mut progress.update,
        )
        .map_err(|source| TrainError::NotFinite {
            iteration: progress.iteration,
            source,
        })?;
        let seconds = Seconds {
            update: start.elapsed().as_secs_f64(),
            ..rollout.seconds
        };
        Ok(Iteration {
            number: progress.iteration,
            env_steps: progress.env_steps,
            metrics,
            episodes: rollout.episodes,
            seconds,
        })
    }

    /// What it learns on.
    pub fn tasks(&self) -> &T {
        &self.tasks
    }

    /// The policy as it is now, for evaluation.
    pub fn agent(&self) -> Agent {
        Agent::of(&self.actor_critic)
    }

    /// Steps of all tasks since the training began.
    pub fn env_steps(&self) -> u64 {
        self.progress.env_steps
    }

    /// Everything needed to go on later exactly from here, by name: parameters, moments,
    /// counters and random streams, the tasks, and the episodes to be imitated.
    pub fn save(&self) -> Sections {
        let sections = [
            (NETWORK, self.actor_critic.save()),
            (ADAM, self.adam.save()),
            (TASKS, self.tasks.save()),
            (PROGRESS, encode(&self.progress)),
        ];
        let memory = self.memory.iter().map(|memory| (IMITATION, memory.save()));
        let named = sections.into_iter().chain(memory);
        named.map(|(name, bytes)| (name.into(), bytes)).collect()
    }

    /// Takes the parameters of another learner's network, as [`Agent::save`] gives them, and nothing else of it.
    ///
    /// # Errors
    /// If they are of another network, changing nothing.
    pub fn load_network(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.actor_critic.load(bytes)
    }

    /// Goes back to what [`Trainer::save`] returned, for the same network and tasks of the same kind. Where there is
    /// another number of them they begin anew, and keep their random streams as far as they had some. Fails,
    /// changing nothing, if they are of another training.
    pub fn load(&mut self, sections: &Sections) -> Result<(), SectionError> {
        let mut actor_critic = self.actor_critic.clone();
        read_section(sections, NETWORK, |bytes| actor_critic.load(bytes))?;
        let adam = read_section(sections, ADAM, |bytes| self.adam.loaded(bytes))?;
        let mut progress = read_section(sections, PROGRESS, |bytes| {
            let progress: Progress = decode(bytes)?;
            match progress.kind == KIND {
                true => Ok(progress),
                false => Err("is no progress of a training".to_string()),
            }
        })?;
        let count = self.tasks.count();
        let is_same = progress.actions.len() == count;
        progress.actions.truncate(count);
        let known = progress.actions.len();
        progress
            .actions
            .extend_from_slice(&self.progress.actions[known..]);
        let pixel_count = self.tasks.shape().pixel_count();
        let fitting = |own: &Memory| {
            read_section(sections, IMITATION, |bytes| own.loaded(bytes, pixel_count))
        };
        let memory = self.memory.as_ref().map(fitting).transpose()?;
        read_section(sections, TASKS, |bytes| match is_same {
            true => self.tasks.load(bytes),
            false => Ok(()),
        })?;
        self.actor_critic = actor_critic;
        self.adam = adam;
        self.progress = progress;
        self.memory = memory;
        Ok(())
    }
}

const ADAM: &str = "adam";
const TASKS: &str = "tasks";
const PROGRESS: &str = "progress";
const IMITATION: &str = "imitation";
