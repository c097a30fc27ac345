//! A run folder that commands play from.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, anyhow};

use super::Failure;
use super::failure::OrInvalid;
use super::proof;
use super::result::{episode_progress, rollout_failure};
use super::setup::{open_run, set_up, set_up_member};
use crate::run::{
    BestSequence, Checkpoint, PlayedEpisode, Proved, Rules, RunConfig, RunFolder, play, replay,
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
    /// Reads the configuration of a run and sets up its scene, or `on` another: that of a file with a
    /// focus region, where that is not the run's.
    pub fn open(
        run: &Path,
        on: Option<(&Path, Option<[f64; 4]>)>,
        device: Option<DeviceKind>,
        json: bool,
    ) -> Result<Self, Failure> {
        let (folder, mut config) = open_run(run)?;
        let trained_on = config.env.device;
        config.set_device(device);
        let mut env = config.env.clone();
        let place = folder.config.display();
        let scene = match on {
            None => {
                let scene = Arc::new(set_up(&config.scene, &place.to_string(), json)?);
                config.equip(&scene).or_invalid_in(place)?;
                env = config.env.clone();
                scene
            }
            Some(_) if !matches!(config.policy.network, NetworkConfig::Unet(_)) => {
                return Err(Failure::invalid(anyhow!(
                    "{place}: `policy.network` plays on the run's own scene only, expected `unet`"
                )));
            }
            Some((file, region)) => {
                env.region_mm = region.or(env.region_mm);
                let other = SceneConfig::read(file).or_invalid()?;
                set_up_member((&other, &env), &file.display().to_string(), json)?
            }
        };
        Ok(Self {
            is_elsewhere: env.device != trained_on,
            folder,
            config,
            scene,
            env,
            json,
        })
    }

    /// Plays one episode, greedily by the policy of a checkpoint, `best`, `last` or a file, or the
    /// best sequence without one. Gives the agent too, if there is one.
    pub fn play(
        &self,
        checkpoint: Option<&str>,
    ) -> Result<(PlayedEpisode, Option<Agent>), Failure> {
        let mut draping = Draping::new(self.scene.clone(), &self.env, 1).or_invalid()?;
        let told = episode_progress(&draping, self.json);
        let Some(name) = checkpoint else {
            let best = self.best_sequence()?;
            // In other steps than it was found in, or rounded otherwise, the masks would differ too.
            let is_same = self.env == self.config.env && !self.is_elsewhere;
            let rules = match is_same && self.config.polish == 0 {
                true => Rules::Episode,
                false => Rules::Robot,
            };
            let played = replay(&mut draping, &best.vertices, rules, told);
            let place = &self.folder.best_sequence;
            return Ok((played.map_err(|error| rollout_failure(error, place))?, None));
        };
        let agent = self.agent(name, &draping)?;
        let choose = |seen: &Draping| agent.act(&[seen.observation(0)], Sampling::Greedy)[0];
        let played = play(&mut draping, choose, told);
        let place = checkpoint_path(&self.folder, name);
        let played = played.map_err(|error| rollout_failure(error, &place))?;
        Ok((played, Some(agent)))
    }

    /// The best sequences of the run, found in its configuration.
    pub fn best_sequence(&self) -> Result<BestSequence, Failure> {
        let place = &self.folder.best_sequence;
        if !place.exists() {
            let advice = match self.folder.check_trained() {
                Ok(()) => "resume the run, or train a new one",
                Err(_) => "search again, for more steps",
            };
            return Err(Failure::invalid(anyhow!(
                "{} has no best sequence, as every episode has diverged or none has ended: {advice}",
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
        let Some(proved) = self.folder.read_proof()? else {
            return Ok((self.play(None)?.0, None));
        };
        let place = &self.folder.proof;
        self.check(&proved.path, place)?;
        let played = proof::play(
            &proved.path.vertices,
            proof::case(&self.scene, &self.config),
            place,
            self.json,
        )?;
        Ok((played, Some(proved)))
    }

    /// Checks that sequences were found in this configuration and press vertices of its blank.
    fn check(&self, sequence: &BestSequence, place: &Path) -> Result<(), Failure> {
        let invalid = |fault| Failure::invalid(anyhow!("{}: {fault}", place.display()));
        let expected = self.folder.config_digest()?;
        sequence.check_config(&expected).map_err(invalid)?;
        let count = self.scene.lamina.vertex_count();
        for vertices in sequence.all() {
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

    /// The policy of a checkpoint of this run.
    fn agent(&self, name: &str, draping: &Draping) -> Result<Agent, Failure> {
        load_agent(&self.folder, &self.config, name, draping)
    }
}

fn checkpoint_path(folder: &RunFolder, name: &str) -> PathBuf {
    match name {
        "best" => folder.best_checkpoint.clone(),
        "last" => folder.last_checkpoint.clone(),
        file => file.into(),
    }
}

/// The policy of a checkpoint of a run, for tasks that look like its own.
pub(super) fn load_agent(
    folder: &RunFolder,
    config: &RunConfig,
    name: &str,
    draping: &Draping,
) -> Result<Agent, Failure> {
    folder.check_trained()?;
    let path = checkpoint_path(folder, name);
    if !matches!(name, "best" | "last") && !path.exists() {
        return Err(Failure::invalid(anyhow!("there is no checkpoint {name}")));
    }
    if name == "best" && !path.exists() && folder.last_checkpoint.exists() {
        return Err(Failure::invalid(anyhow!(
            "{} has no best checkpoint yet, as no greedy episode has been played: use \
             --checkpoint last, or resume the run",
            folder.path.display()
        )));
    }
    let checkpoint = Checkpoint::of_run(&path, folder)?;
    let seen = (draping.shape(), &*draping.terrains());
    let agent = Agent::new(&config.policy, seen, config.seed, config.device);
    let mut agent = agent.or_invalid()?;
    read_section(&checkpoint.sections, NETWORK, |bytes| agent.load(bytes))
        .with_context(|| path.display().to_string())?;
    Ok(agent)
}
