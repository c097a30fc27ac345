//! A run folder that commands play from.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, anyhow};

use super::Failure;
use super::failure::OrInvalid;
use super::proof;
use super::result::{episode_progress, rollout_failure};
use super::setup::{set_up, set_up_member};
use crate::run::{
    BestSequence, Checkpoint, OtherConfig, PlayedEpisode, Proved, Rules, RunConfig, RunFolder,
    play, replay,
};
use drape_cloth::scene::{Scene, SceneConfig};
use drape_learn::policy::{DeviceKind, NetworkConfig};
use drape_learn::ppo::{Agent, NETWORK, Sampling, read_section};
use drape_task::env::{Draping, EnvConfig, Tasks};

/// A run folder, read and ready to be played.
pub(super) struct Loaded {
    pub folder: RunFolder,
    pub config: RunConfig,
    pub scene: Arc<Scene>,
    /// What episodes are played with: the run's own, unless that was changed.
    pub env: EnvConfig,
    /// Cloth is computed on another device than in training.
    is_elsewhere: bool,
    /// Nobody is told how far work is.
    pub json: bool,
}

impl Loaded {
    /// Reads the configuration of a run and sets up its scene.
    pub fn open(run: &Path, device: Option<DeviceKind>, json: bool) -> Result<Self, Failure> {
        let (folder, config) = Self::read(run)?;
        let place = folder.config.display().to_string();
        let scene = Arc::new(set_up(&config.scene, &place, json)?);
        Ok(Self::with(folder, config, device, scene, json))
    }

    /// The same on the scene of a file instead of the run's own.
    pub fn open_on(
        (file, region): (&Path, Option<[f64; 4]>),
        run: &Path,
        device: Option<DeviceKind>,
        json: bool,
    ) -> Result<Self, Failure> {
        let (folder, config) = Self::read(run)?;
        if !matches!(config.policy.network, NetworkConfig::Unet(_)) {
            let place = folder.config.display();
            return Err(Failure::invalid(anyhow!(
                "{place}: `policy.network` plays on the run's own scene only, expected `unet`"
            )));
        }
        let mut env = config.env.clone();
        env.region_mm = region.or(env.region_mm);
        env.device = device.map_or(env.device, DeviceKind::of_cloth);
        let other = SceneConfig::read(file).or_invalid()?;
        let place = file.display().to_string();
        let scene = set_up_member((&other, &env), &place, json)?;
        Ok(Self {
            env,
            ..Self::with(folder, config, device, scene, json)
        })
    }

    fn read(run: &Path) -> Result<(RunFolder, RunConfig), Failure> {
        let folder = RunFolder::open(run).or_invalid()?;
        let config = RunConfig::read(&folder.config).or_invalid()?;
        Ok((folder, config))
    }

    fn with(
        folder: RunFolder,
        mut config: RunConfig,
        device: Option<DeviceKind>,
        scene: Arc<Scene>,
        json: bool,
    ) -> Self {
        let trained_on = config.env.device;
        config.set_device(device);
        Self {
            folder,
            is_elsewhere: config.env.device != trained_on,
            env: config.env.clone(),
            config,
            scene,
            json,
        }
    }

    /// Plays one episode, greedily by the policy of a checkpoint, `best`, `last` or a file, or the
    /// best sequence without one. Gives the agent too, if there is one.
    pub fn play(
        &self,
        checkpoint: Option<&str>,
    ) -> Result<(PlayedEpisode, Option<Agent>), Failure> {
        let mut draping = Draping::new(self.scene.clone(), &self.env, 1).or_invalid()?;
        let told = episode_progress(&draping, self.json);
        let (played, agent, place) = match checkpoint {
            None => {
                let best = self.best_sequence()?;
                // In other steps than it was found in, or rounded otherwise, the masks would differ too.
                let is_same = self.env == self.config.env && !self.is_elsewhere;
                let rules = match is_same && self.config.polish == 0 {
                    true => Rules::Episode,
                    false => Rules::Robot,
                };
                let played = replay(&mut draping, &best.vertices, rules, told);
                (played, None, self.folder.best_sequence.clone())
            }
            Some(name) => {
                let agent = self.agent(name, &draping)?;
                let choose =
                    |draping: &Draping| agent.act(&[draping.observation(0)], Sampling::Greedy)[0];
                let played = play(&mut draping, choose, told);
                (played, Some(agent), self.checkpoint_path(name))
            }
        };
        let played = played.map_err(|error| rollout_failure(error, &place))?;
        Ok((played, agent))
    }

    /// The best sequences of the run, found in its configuration.
    pub fn best_sequence(&self) -> Result<BestSequence, Failure> {
        let place = &self.folder.best_sequence;
        if !place.exists() {
            return Err(Failure::invalid(anyhow!(
                "{} has no best sequence, as every episode has diverged or none has ended: resume \
                 the run, or train a new one",
                self.folder.path.display()
            )));
        }
        let best = self.folder.read_best_sequence()?;
        self.check(&best, place)?;
        Ok(best)
    }

    /// Plays the path of the run: what it has proved, in the fine steps of a proof, or before that
    /// its best sequence, in the task's own.
    pub fn play_path(&self) -> Result<(PlayedEpisode, Option<Proved>), Failure> {
        let proof = self.proof()?;
        let played = match &proof {
            Some(proved) => {
                let place = &self.folder.proof;
                proof::play(proved, &self.scene, &self.env, place, self.json)?
            }
            None => self.play(None)?.0,
        };
        Ok((played, proof))
    }

    /// What has been proved of the run, if anything, in its configuration.
    fn proof(&self) -> Result<Option<Proved>, Failure> {
        let proved = self.folder.read_proof()?;
        if let Some(proved) = &proved {
            self.check(&proved.path, &self.folder.proof)?;
        }
        Ok(proved)
    }

    /// Checks that sequences were found in this configuration and press vertices of its blank.
    fn check(&self, sequence: &BestSequence, place: &Path) -> Result<(), Failure> {
        let invalid = |fault| Failure::invalid(anyhow!("{}: {fault}", place.display()));
        let text = self.folder.config_text()?;
        sequence.check_config(&text).map_err(invalid)?;
        let count = self.scene.lamina.vertex_count();
        let others = sequence.others.iter().map(|other| &other.vertices);
        for vertices in std::iter::once(&sequence.vertices).chain(others) {
            if let Some(v) = vertices.iter().find(|&&v| v as usize >= count) {
                return Err(invalid(format!(
                    "presses vertex {v}, expected one below {count}"
                )));
            }
            let found = vertices.len();
            if found > count {
                return Err(invalid(format!(
                    "has {found} presses, expected at most {count}"
                )));
            }
        }
        Ok(())
    }

    fn checkpoint_path(&self, name: &str) -> PathBuf {
        match name {
            "best" => self.folder.best_checkpoint.clone(),
            "last" => self.folder.last_checkpoint.clone(),
            file => file.into(),
        }
    }

    /// The policy of a checkpoint of this run.
    fn agent(&self, name: &str, draping: &Draping) -> Result<Agent, Failure> {
        self.folder.check_trained().map_err(Failure::of_run)?;
        let path = self.checkpoint_path(name);
        let given = !matches!(name, "best" | "last");
        if given && !path.exists() {
            let error = anyhow!("there is no checkpoint {}", path.display());
            return Err(Failure::invalid(error));
        }
        if name == "best" && !path.exists() && self.folder.last_checkpoint.exists() {
            return Err(Failure::invalid(anyhow!(
                "{} has no best checkpoint yet, as no greedy episode has been played: use \
                 --checkpoint last, or resume the run",
                self.folder.path.display()
            )));
        }
        let config = &self.config;
        let checkpoint = Checkpoint::of_run(&path, &self.folder).map_err(|error| {
            let is_input = error.is::<OtherConfig>();
            Failure::new(error, is_input)
        })?;
        let mut agent = Agent::new(
            &config.policy,
            (draping.shape(), &draping.terrains()),
            config.seed,
            config.device,
        )
        .or_invalid()?;
        read_section(&checkpoint.sections, NETWORK, |bytes| agent.load(bytes))
            .with_context(|| path.display().to_string())?;
        Ok(agent)
    }
}
