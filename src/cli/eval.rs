use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, anyhow};
use serde::Serialize;

use super::Failure;
use super::failure::OrInvalid;
use super::output::{OutFolder, Progress};
use super::proof;
use super::result::{EpisodeStatistics, Recorder, rollout_failure};
use super::setup::{set_up, set_up_member};
use crate::run::{
    BestSequence, Checkpoint, EpisodeSummary, OtherConfig, PlayedEpisode, Proved, Rules, RunConfig,
    RunFolder, parallel_episodes, play, random_episodes, replay,
};
use drape_cloth::fabric::Drape;
use drape_cloth::file::check_writable;
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::scene::{Scene, SceneConfig};
use drape_cloth::sim::Accuracy;
use drape_learn::policy::{DeviceKind, NetworkConfig};
use drape_learn::ppo::{Agent, NETWORK, Sampling, read_section};
use drape_study::proof::Row;
use drape_study::study::region;
use drape_task::env::{Draping, End, EnvConfig, Tasks};

/// Roll out a trained policy and compare it with the random one
///
/// Writes before.png, after.png, crushed.png, path.png and rollout.gif of the episode it plays,
/// each in place of that of the last `eval`; those of the run itself change by `--prove` only.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape eval runs/a
  drape eval runs/a --sequence --accuracy accurate --out checked
  drape eval runs/a --checkpoint last --sample --json
  drape eval runs/a --prove --twin
  drape eval runs/a --scene other.toml --prove --out elsewhere")]
pub struct EvalArgs {
    /// Run folder
    run: PathBuf,

    /// Which checkpoint to play: best, last, or a file
    #[arg(long, value_name = "best|last|FILE", default_value = "best")]
    checkpoint: String,

    /// Episodes of the random policy, and of the sampled one with --sample
    #[arg(long, value_name = "K", default_value_t = 32,
          value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=4096))]
    episodes: usize,

    /// Also draw actions from the policy, K episodes, instead of its best action only
    #[arg(long, conflicts_with = "sequence")]
    sample: bool,

    /// Replay the best action sequence of the run; needs no checkpoint
    #[arg(long, conflicts_with = "checkpoint")]
    sequence: bool,

    /// Play on this scene instead of the run's own, with the same task: the policy of a `unet` plays
    /// on any. With --prove its greedy path and K drawn ones are proved; the run keeps nothing of it
    #[arg(long, value_name = "FILE", requires = "out", conflicts_with_all = ["sequence", "twin"])]
    scene: Option<PathBuf>,

    /// Focus region on the scene's blank [mm]: least x, least y, greatest x, greatest y; the run's
    /// if not given
    #[arg(long, requires = "scene", value_name = "X,Y,X,Y", value_parser = region,
          allow_hyphen_values = true)]
    region: Option<[f64; 4]>,

    /// Step the episodes as finely as this, fast, balanced or accurate, from the initial state of
    /// the run, instead of as in training. A sequence is pressed as a robot would: all of it,
    /// whatever the masks allow then
    #[arg(long, value_parser = accuracy, value_name = "NAME")]
    accuracy: Option<Accuracy>,

    /// Where networks and cloth are computed: flex or ndarray (the CPU), gpu or gpu:N; as in training
    /// if not given
    #[arg(long, value_name = "DEVICE")]
    device: Option<DeviceKind>,

    /// Also play the best paths of the run at `accurate`, beside K random orders, sweeps and orders
    /// outwards from a place, and keep the best for `export`
    #[arg(long)]
    prove: bool,

    /// Take the best of them and a quarter of the random orders to the finite-element twin, which
    /// has the last word; minutes a path
    #[arg(long, requires = "prove")]
    twin: bool,

    /// Folder for the pictures, created where missing; pictures/eval in the run folder if not
    /// given
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Also write where every vertex of the blank lies after the episode, for `drape compare`
    #[arg(long, value_name = "FILE")]
    state: Option<PathBuf>,

    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

/// A preset of the accuracy by its name.
pub(super) fn accuracy(name: &str) -> Result<Accuracy, String> {
    Accuracy::named(name).ok_or("expected fast, balanced or accurate".into())
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    run: PathBuf,
    /// `best`, `last`, a file, or `sequence`.
    played: String,
    /// What `--accuracy` asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    accuracy: Option<Accuracy>,
    /// The greedy episode, or the replayed one.
    episode: EpisodeSummary,
    /// How many deviations of the random policy's score the episode lies above its mean; none if
    /// that does not deviate.
    deviations_above_random: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sampled: Option<EpisodeStatistics>,
    random: EpisodeStatistics,
    /// What `--prove` has found.
    #[serde(skip_serializing_if = "Option::is_none")]
    proof: Option<Vec<Row>>,
    /// Where the pictures are.
    pictures: PathBuf,
}

/// Runs `drape eval`.
pub fn run(args: EvalArgs) -> Result<(), Failure> {
    let out = args.out.as_deref().map(OutFolder::make).transpose()?;
    args.state.as_deref().map(check_writable).transpose()?;
    let mut loaded = match &args.scene {
        None => Loaded::open(&args.run, args.device, args.json)?,
        Some(scene) => Loaded::open_on((scene, args.region), &args.run, args.device, args.json)?,
    };
    let pictures = match out {
        Some(folder) => folder,
        None => OutFolder::make(&loaded.folder.pictures.join("eval"))?,
    };
    if let Some(accuracy) = args.accuracy {
        loaded.env.set_accuracy(accuracy);
    }
    let (mut best, mut _lock) = (None, None);
    if args.prove && args.scene.is_none() {
        _lock = Some(loaded.folder.lock().map_err(Failure::of_run)?);
        check_writable(&loaded.folder.proof)?;
        best = Some(loaded.best_sequence()?);
    }
    let checkpoint = (!args.sequence).then_some(&*args.checkpoint);
    let (played, agent, recorder, draping) = loaded.play(checkpoint)?;
    let Loaded { env, scene, .. } = &loaded;
    if let Some(file) = &args.state {
        Drape::new(&scene.lamina, &played.end.position).write(file)?;
    }

    let progress = Progress::new("random episodes", args.json);
    let random = random_episodes(scene, env, args.episodes, |share| progress.set(share))?;
    drop(progress);
    let random = EpisodeStatistics::new("random", args.episodes, random)?;
    let sampled = match (&agent, args.sample) {
        (Some(agent), true) => {
            let progress = Progress::new("sampled episodes", args.json);
            let told = |share| progress.set(share);
            Some(sampled(agent, (scene, env), args.episodes, told)?)
        }
        _ => None,
    };
    let mut proof = None;
    if let Some(mut best) = best {
        best.others.truncate(2 * loaded.config.proof_paths - 1);
        // In the run's own steps, whatever the episode was played in.
        let (task, orders) = ((scene, &loaded.config.env), (args.episodes, args.twin));
        proof = Some(proof::proved(&loaded.folder, task, best, orders, args.json)?.0);
    }
    if let (Some(agent), Some(_), true) = (&agent, &args.scene, args.prove) {
        let greedy = played.vertices.clone();
        proof = Some(proved_elsewhere(agent, greedy, &loaded, args.episodes)?);
    }
    let title = checkpoint.map_or("sequence", |_| "policy");
    recorder.write(&pictures.path, &draping, &played, title)?;

    let above = played.summary.score - random.mean_score;
    let report = Report {
        run: args.run.clone(),
        played: checkpoint.unwrap_or("sequence").into(),
        accuracy: args.accuracy,
        deviations_above_random: (random.deviation > 0.0).then(|| above / random.deviation),
        episode: played.summary,
        sampled,
        random,
        proof,
        pictures: pictures.path.clone(),
    };
    if args.json {
        return super::output::print_json(&report);
    }
    super::output::print(&text(&report))
}

/// Proves the `greedy` path of an agent and `count` drawn ones on a scene that the run does not
/// know.
fn proved_elsewhere(
    agent: &Agent,
    greedy: Vec<u32>,
    Loaded {
        scene, env, json, ..
    }: &Loaded,
    count: usize,
) -> Result<Vec<Row>, Failure> {
    let mut draping = Draping::new(scene.clone(), env, count).or_invalid()?;
    let mut stream = Stream::new(0, Purpose::Evaluation, 0);
    let played = draping.play(|draping| {
        let seen: Vec<_> = (0..count).map(|k| draping.observation(k)).collect();
        agent.act(&seen, Sampling::Drawn(&mut stream))
    });
    let mut paths = vec![greedy];
    let ended = played
        .into_iter()
        .filter(|p| p.episode.end != End::Diverged);
    paths.extend(ended.map(|played| played.vertices));
    proof::rows((scene, env), &paths, (count, false), *json)
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
    /// Nobody is told how far work is.
    json: bool,
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
    fn open_on(
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
        let draping = set_up_member((&other, &env), 1, &place, json)?;
        let scene = draping.scene().clone();
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
    /// best sequence without one. Gives the agent too, if there is one, the frames, and the
    /// environment as the episode has left it.
    pub fn play(
        &self,
        checkpoint: Option<&str>,
    ) -> Result<(PlayedEpisode, Option<Agent>, Recorder, Draping), Failure> {
        let mut draping = Draping::new(self.scene.clone(), &self.env, 1).or_invalid()?;
        let mut recorder = Recorder::default();
        let watch = recorder.watch(&draping, self.json);
        let (played, agent, place) = match checkpoint {
            None => {
                let best = self.best_sequence()?;
                // In other steps than it was found in, or rounded otherwise, the masks would differ too.
                let is_same = self.env == self.config.env && !self.is_elsewhere;
                let rules = match is_same && self.config.polish == 0 {
                    true => Rules::Episode,
                    false => Rules::Robot,
                };
                let played = replay(&mut draping, &best.vertices, rules, watch);
                (played, None, self.folder.best_sequence.clone())
            }
            Some(name) => {
                let agent = self.agent(name, &draping)?;
                let choose =
                    |draping: &Draping| agent.act(&[draping.observation(0)], Sampling::Greedy)[0];
                let played = play(&mut draping, choose, watch);
                (played, Some(agent), self.checkpoint_path(name))
            }
        };
        let played = played.map_err(|error| rollout_failure(error, &place))?;
        Ok((played, agent, recorder, draping))
    }

    /// The best sequences of the run, found in its configuration.
    fn best_sequence(&self) -> Result<BestSequence, Failure> {
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
                proof::play(proved, &self.scene, &self.env, place, self.json)?.0
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
        let checkpoint = Checkpoint::of_run(&path, config, &self.folder).map_err(|error| {
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

fn sampled(
    agent: &Agent,
    (scene, env): (&Arc<Scene>, &EnvConfig),
    count: usize,
    progress: impl FnMut(f64),
) -> Result<EpisodeStatistics, Failure> {
    let choose = |draping: &Draping, streams: &mut [_]| -> Vec<u32> {
        let act = |(index, stream)| {
            let observation = draping.observation(index);
            agent.act(&[observation], Sampling::Drawn(stream))[0]
        };
        streams.iter_mut().enumerate().map(act).collect()
    };
    let episodes = parallel_episodes(scene, env, count, choose, progress)?;
    EpisodeStatistics::new("sampled", count, episodes)
}

fn text(report: &Report) -> String {
    let Report {
        episode, random, ..
    } = report;
    let accuracy = report.accuracy.map_or(String::new(), |accuracy| {
        format!(", {} steps", accuracy.name())
    });
    let locked = episode.locked_share.map_or(String::new(), |share| {
        format!(", {:.1} % of the area locked", 100.0 * share)
    });
    let mut lines = vec![
        format!("{}: {}{accuracy}", report.run.display(), report.played),
        format!(
            "  region: {:.4} m of {:.3} m off the tool, {:.2} mm of {:.2} mm surplus a yarn; score \
             {:.2} %",
            episode.region_final_m,
            episode.region_initial_m,
            1e3 * episode.surplus_final_m,
            1e3 * episode.surplus_initial_m,
            100.0 * episode.score
        ),
        format!(
            "  whole sheet: {:.3} m of {:.3} m off the tool, {:.2} mm of {:.2} mm surplus a yarn; \
             through itself in {} places",
            episode.sheet_final_m,
            episode.sheet_initial_m,
            1e3 * episode.sheet_surplus_final_m,
            1e3 * episode.sheet_surplus_initial_m,
            episode.self_intersections
        ),
        format!(
            "  undraped inner vertices {}; {}; {:.2} ms a step",
            episode.undraped_inner,
            episode.path.text(),
            1e3 * episode.seconds / episode.steps as f64
        ),
        format!(
            "  yarn strain p95 {:.2} %, maximum {:.1} %; shear at most {:.0} degrees{locked}; v_rms \
             {:.1} mm/s; {:.2} s",
            100.0 * episode.strain_p95,
            100.0 * episode.strain_max,
            episode.shear_max_deg,
            episode.v_rms_mm_s,
            episode.seconds
        ),
    ];
    if let Some(sampled) = &report.sampled {
        lines.push(format!(
            "sampled policy, {} episodes: score {:.2} +- {:.2} %, best {:.2} %",
            sampled.episodes.len(),
            100.0 * sampled.mean_score,
            100.0 * sampled.deviation,
            100.0 * sampled.best_score
        ));
    }
    lines.push(format!(
        "masked random, {} episodes: {:.4} +- {:.4} m off the tool, {:.2} +- {:.2} mm surplus a yarn; \
         score {:.2} +- {:.2} %, best {:.2} %",
        random.episodes.len(),
        random.mean_region_final_m,
        random.deviation_region_final_m,
        1e3 * random.mean_surplus_final_m,
        1e3 * random.deviation_surplus_final_m,
        100.0 * random.mean_score,
        100.0 * random.deviation,
        100.0 * random.best_score
    ));
    let diverged = random.diverged + report.sampled.as_ref().map_or(0, |s| s.diverged);
    if diverged > 0 {
        lines.push(format!(
            "episodes left out because they diverged: {diverged}"
        ));
    }
    if let Some(deviations) = report.deviations_above_random {
        let side = if deviations < 0.0 { "below" } else { "above" };
        lines.push(format!(
            "the episode lies {:.2} deviations {side} the random mean",
            deviations.abs()
        ));
    }
    if let Some(rows) = &report.proof {
        lines.push(proof::text(rows));
    }
    lines.push(format!("pictures in {}", report.pictures.display()));
    lines.join("\n")
}
