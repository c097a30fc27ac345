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
    BestSequence, Checkpoint, PlayedEpisode, Proved, Rules, RunConfig, RunFolder, Weights, play,
    replay,
};
use drape_cloth::fabric::Lamina;
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::scene::{Scene, SceneConfig};
use drape_cloth::sim::Observation;
use drape_learn::policy::DeviceKind;
use drape_learn::ppo::{Agent, Sampling};
use drape_task::env::{
    Draping, End, EnvConfig, ImageShape, Played, Task, Tasks, most_environments,
};

/// What is to be played of a run.
#[derive(Clone, Copy)]
pub(super) enum Source<'a> {
    /// What it has proved, or before that its best sequence.
    Path,
    Sequence,
    /// A policy: `best`, `last` or a file.
    Checkpoint(&'a str),
    /// Something else.
    Other,
}

/// A run folder, read and ready to be played.
pub(super) struct Loaded {
    pub folder: RunFolder,
    pub config: RunConfig,
    pub scene: Arc<Scene>,
    /// What episodes are played with: the run's own, unless that was changed.
    pub env: EnvConfig,
    /// Cloth is computed on another device than in training.
    is_elsewhere: bool,
}

impl Loaded {
    /// Reads the configuration of a run and sets up its scene, or `on` another: that of a file with a
    /// focus region, where that is not the run's. Before that falls it is seen whether `source` can be read.
    pub fn open(
        run: &Path,
        source: Source,
        on: Option<(&Path, Option<[f64; 4]>)>,
        device: Option<DeviceKind>,
    ) -> Result<Self, Failure> {
        let (folder, mut config) = open_run(run)?;
        let trained_on = config.env.device;
        config.set_device(device);
        let mut env = config.env.clone();
        let place = folder.config.display();
        if let Source::Checkpoint(name) = source {
            read_checkpoint(&folder, name)?;
        }
        let scene = match on {
            None => {
                if matches!(source, Source::Path | Source::Sequence) {
                    let material = config.scene.read_material().or_invalid_in(&place)?;
                    let lamina = Lamina::new(&config.scene.blank, material);
                    let count = lamina.or_invalid_in(&place)?.vertex_count();
                    let proved = match source {
                        Source::Path => read_proof(&folder, count)?,
                        _ => None,
                    };
                    if proved.is_none() {
                        read_best_sequence(&folder, count)?;
                    }
                }
                let scene = Arc::new(set_up(&config.scene, &place.to_string())?);
                config.equip(&scene).or_invalid_in(place)?;
                env = config.env.clone();
                scene
            }
            Some((file, region)) => {
                env.region_mm = region.or(env.region_mm);
                let other = SceneConfig::read(file).or_invalid()?;
                if let Source::Checkpoint(name) = source {
                    let mut task = config.clone();
                    task.scenes.clear();
                    (task.scene, task.env) = (other.clone(), env.clone());
                    read_weights(run, name, &task)?;
                }
                set_up_member(&other, &env, &file.display().to_string())?
            }
        };
        Ok(Self {
            is_elsewhere: env.device != trained_on,
            folder,
            config,
            scene,
            env,
        })
    }

    /// Plays one episode, greedily by the policy of a checkpoint, `best`, `last` or a file, or the
    /// best sequence without one. Gives the agent too, if there is one.
    pub fn play(
        &self,
        checkpoint: Option<&str>,
    ) -> Result<(PlayedEpisode, Option<Agent>), Failure> {
        let mut draping = Draping::new(self.scene.clone(), &self.env, 1).or_invalid()?;
        let told = episode_progress(&draping);
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
        read_best_sequence(&self.folder, self.scene.lamina.vertex_count())
    }

    /// Plays the path of the run: what it has proved, in the fine steps of a proof, or before that
    /// its best sequence, in the task's own.
    pub fn play_path(&self) -> Result<(PlayedEpisode, Option<Proved>), Failure> {
        let count = self.scene.lamina.vertex_count();
        let Some(proved) = read_proof(&self.folder, count)? else {
            return Ok((self.play(None)?.0, None));
        };
        let place = &self.folder.proof;
        let played = proof::play(
            &proved.path.vertices,
            proof::case(&self.scene, &self.config),
            place,
        )?;
        Ok((played, Some(proved)))
    }

    /// The policy of a checkpoint of this run.
    fn agent(&self, name: &str, draping: &Draping) -> Result<Agent, Failure> {
        load_agent(&self.folder, &self.config, name, draping)
    }
}

/// The best sequences of a run, found in its configuration, for a blank of `count` vertices.
fn read_best_sequence(folder: &RunFolder, count: usize) -> Result<BestSequence, Failure> {
    let place = &folder.best_sequence;
    if !place.exists() {
        let advice = match folder.check_trained() {
            Ok(()) => "resume the run, or train a new one",
            Err(_) => "search again, for more steps",
        };
        return Err(Failure::invalid(anyhow!(
            "{} has no best sequence, as every episode has diverged or none has ended: {advice}",
            folder.path.display()
        )));
    }
    let best = folder.read_best_sequence()?;
    check(folder, &best, count, place)?;
    Ok(best)
}

/// What a run has proved, if it has, likewise.
fn read_proof(folder: &RunFolder, count: usize) -> Result<Option<Proved>, Failure> {
    let proved = folder.read_proof()?;
    if let Some(proved) = &proved {
        check(folder, &proved.path, count, &folder.proof)?;
    }
    Ok(proved)
}

/// Checks that sequences were found in the configuration of a run and press vertices of its blank.
fn check(
    folder: &RunFolder,
    sequence: &BestSequence,
    count: usize,
    place: &Path,
) -> Result<(), Failure> {
    let invalid = |fault| Failure::invalid(anyhow!("{}: {fault}", place.display()));
    let expected = folder.config_digest()?;
    sequence.check_config(&expected).map_err(invalid)?;
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
    let (path, checkpoint) = read_checkpoint(folder, name)?;
    let weights = Weights::of(config, draping.shape(), &checkpoint);
    let agent = weights.and_then(|weights| weights.agent(draping, config.device));
    Ok(agent.with_context(|| path.display().to_string())?)
}

/// The policy of a checkpoint of the run, or of the file, at `from`, for the task of a configuration.
pub(super) fn read_weights(
    from: &Path,
    checkpoint: &str,
    config: &RunConfig,
) -> Result<Weights, Failure> {
    let weights = match from.is_file() {
        true => Weights::read(from).or_invalid()?,
        false if !from.exists() => {
            let shown = from.display();
            return Err(Failure::invalid(anyhow!(
                "there is no run or policy {shown}"
            )));
        }
        false => {
            let (folder, own) = open_run(from)?;
            let (path, checkpoint) = read_checkpoint(&folder, checkpoint)?;
            let weights = Weights::of(&own, shape_of(&own)?, &checkpoint);
            weights.with_context(|| path.display().to_string())?
        }
    };
    let checked = weights.check(shape_of(config)?);
    checked.or_invalid_in(from.display())?;
    Ok(weights)
}

/// Size of the images of a run, before its blank falls.
pub(super) fn shape_of(config: &RunConfig) -> Result<ImageShape, Failure> {
    let members = config.members().or_invalid()?;
    members[0].check(1).or_invalid()
}

/// What an agent presses on a scene, greedily first and then drawn so often, without the episodes that diverge.
pub(super) fn policy_paths(
    agent: &Agent,
    scene: &Arc<Scene>,
    env: &EnvConfig,
    drawn: usize,
    seed: u64,
) -> Result<Vec<Vec<u32>>, Failure> {
    let most = most_environments(scene.lamina.vertex_count());
    let mut stream = Stream::new(seed, Purpose::Evaluation, 0);
    let vertices = |_: &Task, played: Played| {
        let vertices = played.end.presses().iter().map(|&(v, _)| v).collect();
        (played.episode.end != End::Diverged).then_some(vertices)
    };
    let greedy = |draping: &Draping, _| agent.act(&observations(draping), Sampling::Greedy);
    let mut paths = Draping::play_all(scene, env, 1, most, greedy, vertices).or_invalid()?;
    let choose =
        |draping: &Draping, _| agent.act(&observations(draping), Sampling::Drawn(&mut stream));
    paths.extend(Draping::play_all(scene, env, drawn, most, choose, vertices).or_invalid()?);
    Ok(paths.into_iter().flatten().collect())
}

/// What all environments show.
pub(super) fn observations(draping: &Draping) -> Vec<Observation<'_>> {
    (0..draping.count())
        .map(|k| draping.observation(k))
        .collect()
}

/// A checkpoint of a run, and where it is.
pub(super) fn read_checkpoint(
    folder: &RunFolder,
    name: &str,
) -> Result<(PathBuf, Checkpoint), Failure> {
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
    Ok((path, checkpoint))
}
