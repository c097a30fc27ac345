use std::ffi::c_int;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Instant, SystemTime};

use anyhow::{Context as _, anyhow};
use serde::Serialize;
use toml::Table;

use super::Failure;
use super::args::accuracy;
use super::failure::OrInvalid;
use super::loaded::read_weights;
use super::output::{Progress, percent};
use super::proof;
use super::result::{self, EpisodeStatistics};
use super::setup::{read_config, set_up_over_tool, set_up_run, set_up_scenes};
use super::signals::{is_checkpoint_wanted, stop_on_signal};
use super::terminal::{Told, hush, note, tell};
use crate::cluster::ClusterSession;
use crate::run::{
    Demonstrations, Preparation, RunConfig, RunFolder, RunInfo, Training, Weights, changed,
};
use drape_cloth::file::{ValueError, parse_toml, read_text};
use drape_cloth::sim::Accuracy;
use drape_learn::policy::DeviceKind;
use drape_proof::Row;
use drape_task::env::End;

/// Iterations between two checkpoints.
const CHECKPOINT_INTERVAL: u64 = 10;

/// Train a draping policy
///
/// Ctrl-C, SIGTERM and SIGHUP stop it after the iteration, with the exit code 130, 143 or 129; after one, SIGUSR1 and
/// SIGUSR2 write a checkpoint.
#[derive(Debug, Default, clap::Args)]
#[command(after_help = "Examples:
  drape train task.toml --name a
  drape train task.toml --from runs/domes
  drape train task.toml --demonstrate presses-1.drape presses-2.drape
  drape train --resume runs/a
  drape train --resume runs/a --steps 400000 --set ppo.learning_rate=5e-4 --set environments=64")]
pub struct TrainArgs {
    /// Configuration file; the built-in quickstart if not given
    #[arg(conflicts_with = "resume")]
    pub(super) config: Option<PathBuf>,

    /// Name of the run; date and minute (UTC) if not given
    #[arg(long, value_name = "NAME", conflicts_with = "resume")]
    pub(super) name: Option<String>,

    /// Seed of all random streams, instead of the configuration's
    #[arg(long, value_parser = clap::value_parser!(u64).range(..=RunConfig::MAX_SEED),
          conflicts_with = "resume")]
    seed: Option<u64>,

    /// Environment steps of the whole training, instead of the configuration's; more of them go on with a run that
    /// is complete
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=RunConfig::MAX_STEPS))]
    steps: Option<u64>,

    /// Environment steps of search after the training, by moves of the order from its best paths on,
    /// instead of the configuration's
    #[arg(long, value_parser = clap::value_parser!(u64).range(..=RunConfig::MAX_STEPS))]
    polish: Option<u64>,

    /// Go on with a run that was interrupted, or that is to take more steps
    #[arg(long, value_name = "DIR")]
    pub(super) resume: Option<PathBuf>,

    /// Changes a key of the run that is gone on with, in TOML; one that may not change lists those that may
    #[arg(long, value_name = "KEY=VALUE", requires = "resume")]
    set: Vec<String>,

    /// Policy to learn on from, of a run or a file of `drape export --format policy`, with its network
    #[arg(long, value_name = "RUN|FILE", conflicts_with = "resume")]
    from: Option<PathBuf>,

    /// Checkpoint of that run: best, last or a file
    #[arg(long, value_name = "NAME", default_value = "last", requires = "from")]
    checkpoint: String,

    /// Imitate presses before learning, and keep them as rivals: recordings, or sequences as `best_sequence.json` has
    /// them, made by hand in `drape view` or by other runs on this blank. Presses that the task does not allow are passed
    /// over
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with = "resume")]
    demonstrate: Vec<PathBuf>,

    /// Where networks and cloth are computed: flex (the CPU), gpu or gpu:N
    #[arg(long, value_name = "DEVICE")]
    pub(super) device: Option<DeviceKind>,

    /// How finely episodes are stepped, fast, balanced or accurate, instead of the configuration's
    /// `env.accuracy`, `env.substep_rate` and `env.contact_rate`
    #[arg(long, value_parser = accuracy, value_name = "NAME", conflicts_with = "resume")]
    accuracy: Option<Accuracy>,

    /// Folder that holds the runs
    #[arg(
        long,
        value_name = "DIR",
        default_value = "runs",
        conflicts_with = "resume"
    )]
    pub(super) runs: PathBuf,
}

/// What `--json` prints.
#[derive(Serialize)]
pub(super) struct Outcome {
    run: Told,
    complete: bool,
    env_steps: u64,
    /// Of learning, without what comes before it and after.
    seconds: f64,
    env_steps_per_second: f64,
    /// Share of the time in simulation, inference, update and evaluation.
    simulation_share: f64,
    inference_share: f64,
    update_share: f64,
    mean_score: Option<f64>,
    best_score: Option<f64>,
    random_mean_score: f64,
    random_deviation: f64,
    /// Episodes since the command began in which the simulation diverged.
    diverged_episodes: usize,
    /// The best paths in finer steps, beside other orders; empty before the end.
    proof: Vec<Row>,
    /// The signal that has stopped it before its end.
    #[serde(skip)]
    pub interrupted: Option<c_int>,
}

/// Trains, or goes on with a training. Gives what the first process has to print.
pub(super) fn train(
    args: &TrainArgs,
    session: &ClusterSession,
) -> Result<Option<Outcome>, Failure> {
    let cluster = &session.cluster;
    if !cluster.is_first() {
        hush();
    }
    let mut training = begin(args, session)?;
    let is_asked = args.steps.is_some() || args.polish.is_some();
    if training.is_complete() && training.folder.proof.exists() && !is_asked {
        note("no steps are left: --steps and --polish take a training further");
    }
    let asked = stop_on_signal()?;
    // All processes stop together, so all ask.
    let asked = || cluster.gather(asked()).into_iter().flatten().next();
    let stop = || asked().is_some();
    let baseline = match cluster.is_first() {
        true => Some(result::baseline(&training)?),
        false => None,
    };
    let random = baseline.as_ref().map_or(0.0, |random| random.mean_score);

    prepare(&mut training, &stop)?;

    let progress = Progress::of_steps(training.env_steps(), training.config.steps);
    let start = Instant::now();
    let first = training.env_steps();
    let mut seconds = [0.0; 3];
    let mut diverged_episodes = 0;
    while !training.is_complete() && !stop() {
        let report = training.advance()?;
        let [mean, best] = [report.mean_score, report.best_score].map(percent);
        let random = percent(Some(random));
        let brought = format!("score: mean {mean}, best {best} (random {random})");
        progress.step(training.env_steps(), brought);
        let ends = report.iteration.episodes.iter().map(|episode| episode.end);
        diverged_episodes += ends.filter(|&end| end == End::Diverged).count();
        let spent = &report.iteration.seconds;
        let spent = [spent.simulation, spent.inference, spent.update];
        seconds = std::array::from_fn(|k| seconds[k] + spent[k]);
        let is_wanted = cluster.any(is_checkpoint_wanted());
        if is_wanted || report.iteration.number.is_multiple_of(CHECKPOINT_INTERVAL) {
            training.checkpoint()?;
        }
        if is_wanted && cluster.is_first() {
            let steps = training.env_steps();
            tell(format_args!("checkpoint written after {steps} steps"));
        }
    }
    training.checkpoint()?;
    drop(progress);
    let elapsed = start.elapsed().as_secs_f64();
    if training.is_complete() && training.config.polish > 0 && !stop() {
        polish(&mut training, &stop)?;
    }
    // Who has asked to stop need not wait for a proof: resuming makes it.
    let interrupted = asked();
    let complete = training.is_complete() && interrupted.is_none();
    let Some(baseline) = baseline else {
        return Ok(None);
    };
    let proof = match complete {
        true => finish(&training, &baseline)?,
        false => Vec::new(),
    };

    let taken = (training.env_steps() - first) as f64;
    Ok(Some(Outcome {
        run: (&training.folder.path).into(),
        complete,
        env_steps: training.env_steps(),
        seconds: elapsed,
        env_steps_per_second: taken / elapsed,
        simulation_share: seconds[0] / elapsed,
        inference_share: seconds[1] / elapsed,
        update_share: seconds[2] / elapsed,
        mean_score: training.mean_score(),
        best_score: training.best_score(),
        random_mean_score: baseline.mean_score,
        random_deviation: baseline.deviation,
        diverged_episodes,
        proof,
        interrupted,
    }))
}

/// A new run, or the one to be resumed.
fn begin(args: &TrainArgs, session: &ClusterSession) -> Result<Training, Failure> {
    let cluster = &session.cluster;
    // What conflicts with `--resume` would let clap pass this.
    if args.resume.is_none() && !args.set.is_empty() {
        return Err(Failure::invalid(anyhow!(
            "`--set` changes a run that is gone on with, expected --resume"
        )));
    }
    let resumed = args.resume.as_deref().map(RunFolder::open);
    let resumed = resumed.transpose().or_invalid()?;
    if let Some(folder) = &resumed {
        folder.check_trained()?;
    }
    let file = resumed.as_ref().map(|folder| &*folder.config);
    let mut new = None;
    if let Some(file) = file {
        let given = [("steps", args.steps), ("polish", args.polish)];
        let given = given.map(|(key, value)| value.map(|value| format!("{key} = {value}")));
        let changes: Vec<String> = given
            .into_iter()
            .flatten()
            .chain(args.set.clone())
            .collect();
        let text = read_text(file).or_invalid()?;
        parse_toml::<Table>(&text, file).or_invalid()?;
        new = changed(&text, &changes).or_invalid_in(file.display())?;
    }
    let (mut config, place) = match (&new, file) {
        (Some(text), Some(file)) => {
            let config = RunConfig::parse(text, file).or_invalid()?;
            (config, file.display().to_string())
        }
        _ => read_config(file.or(args.config.as_deref()))?,
    };
    config.seed = args.seed.unwrap_or(config.seed);
    config.steps = args.steps.unwrap_or(config.steps);
    config.polish = args.polish.unwrap_or(config.polish);
    config.set_device(args.device);
    config.shift_device(session.local_rank);
    let checked = config.check_processes(cluster.size());
    checked.or_invalid_in(&place)?;
    if let Some(accuracy) = args.accuracy {
        config.env.set_accuracy(accuracy);
    }
    let from = args.from.as_deref();
    let weights = from.map(|from| read_weights(from, &args.checkpoint, &config));
    let weights = weights.transpose()?;
    if let Some(weights) = &weights {
        config.policy = weights.policy.clone();
    }
    let count = args.demonstrate.len();
    if count > 0 {
        let most = config.members().or_invalid_in(&place)?[0].environments;
        let Some(imitation) = config.ppo.imitation.as_mut().filter(|_| count <= most) else {
            return Err(Failure::invalid(anyhow!(
                "{place}: {count} demonstrations, expected `ppo.imitation`, and at most `environments` of them, {most}"
            )));
        };
        if imitation.pretraining == 0 {
            imitation.pretraining = Demonstrations::PRETRAINING;
        }
    }
    // All that can be wrong with the configuration shows before the folder is made.
    config.device.open().or_invalid_in(&place)?;
    if let Some(folder) = resumed {
        let has_policy = folder.read_info().is_some_and(|info| info.policy.is_some());
        if has_policy && !folder.last_checkpoint.exists() {
            let shown = folder.path.display();
            return Err(Failure::invalid(anyhow!(
                "{shown} began from a policy and ended before its first checkpoint: begin another with --from"
            )));
        }
        let taken = Training::taken(&folder)?;
        let mut checked = config.clone();
        if let Some(taken) = taken {
            // Of whole rollouts, the last of which may have taken more than it had to.
            let rollout = (config.environments * config.ppo.rollout_steps) as u64;
            let expected = format!("at least {taken}, which are taken");
            let is_left = config.steps.next_multiple_of(rollout) >= taken || new.is_none();
            ValueError::unless(is_left, "steps", config.steps, expected).or_invalid_in(&place)?;
            // It has been done.
            checked.search = 0;
        }
        checked.check_before_fall().or_invalid_in(&place)?;
        let scene = Arc::new(set_up_over_tool(&config.scene, &place)?);
        config.equip(&scene).or_invalid_in(&place)?;
        let scenes = set_up_scenes(&config, scene, &place)?;
        let mut training = Training::resume(config, scenes, folder, cluster)?;
        new.map_or(Ok(()), |text| training.reconfigure(&text))?;
        return Ok(training);
    }
    if cluster.is_first() {
        RunFolder::check_free(&args.runs, args.name.as_deref(), None)?;
    }
    let (scene, (kept, inputs)) = set_up_run(&config, &place)?;
    config.equip(&scene).or_invalid_in(&place)?;
    let shown = Demonstrations::read(&args.demonstrate, &scene.lamina).or_invalid()?;
    let scenes = set_up_scenes(&config, scene, &place)?;

    let info = RunInfo {
        policy: weights.as_ref().map(Weights::digest),
        ..RunInfo::new(config.seed, SystemTime::now())
    };
    let create = || {
        let folder = RunFolder::create(&args.runs, args.name.as_deref(), &kept, &inputs, &info)?;
        shown.keep(&folder).map(|()| folder)
    };
    let made = cluster.is_first().then(create).transpose()?;
    // The first has made it, where all can see it.
    let path = cluster.gather(made.map(|folder| folder.path));
    let path = path.into_iter().flatten().next();
    let folder = RunFolder::open(&path.expect("the first has made it"))?;
    note(format_args!("writing {}", folder.path.display()));
    Ok(Training::new(
        config,
        scenes,
        folder,
        cluster,
        weights.as_ref(),
    )?)
}

/// What comes before the first rollout.
fn prepare(training: &mut Training, stop: &(dyn Fn() -> bool + Sync)) -> Result<(), Failure> {
    let (mut bar, place) = (("", None), training.folder.config.display().to_string());
    let prepared = training.prepare(|doing, share| {
        let (title, told) = match doing {
            Preparation::Searching { best } => ("searching", format!("best {}", percent(best))),
            Preparation::Imitating { loss } => ("imitating", format!("{loss:.3} nat off")),
        };
        if bar.0 != title {
            bar = (title, Some(Progress::new(title)));
        }
        let progress = bar.1.as_ref().expect("it has been started");
        progress.tell(share, &told);
        !stop()
    });
    Ok(prepared.context(place)?)
}

/// Searches on from the best paths of a training that is complete.
fn polish(training: &mut Training, stop: &(dyn Fn() -> bool + Sync)) -> Result<(), Failure> {
    note("polishing the best paths");
    let all = training.config.polish as f64;
    let progress = Progress::new("polishing");
    training.polish(|at| {
        progress.searching(at.spent as f64 / all, at);
        !stop()
    })?;
    Ok(())
}

/// Draws the curve of a training that is complete and proves its best paths. Gives the proof.
fn finish(training: &Training, baseline: &EpisodeStatistics) -> Result<Vec<Row>, Failure> {
    let (folder, config) = (&training.folder, &training.config);
    result::reward_curve(folder, baseline)?;
    if training.best_score().is_none() {
        tell(
            "warning: every episode has diverged or none has ended, so there is no best sequence to \
             draw: raise `steps` or `env.substep_rate`",
        );
        return Ok(Vec::new());
    }
    note("proving the best paths");
    let best = training.best_sequence()?;
    let method = proof::by_solver(config);
    proof::proved(folder, training.scene(), config, best, method)
}

pub(super) fn text(outcome: &Outcome) -> String {
    let run = outcome.run.display();
    let share = |share: f64| 100.0 * share;
    let diverged = match outcome.diverged_episodes {
        0 => String::new(),
        count => format!("episodes cut off because they diverged: {count}\n"),
    };
    let next = match (outcome.complete, outcome.best_score) {
        (true, Some(_)) => format!("{}\nnext: drape eval {run}", proof::text(&outcome.proof)),
        (true, None) => "no best sequence".into(),
        (false, _) => format!("interrupted; go on with: drape train --resume {run}"),
    };
    format!(
        "{run}: {} environment steps in {:.0} s, {:.0} a second\n\
         time: simulation {:.0} %, inference {:.0} %, update {:.0} %\n\
         score in one world: last episodes {}, random {:.2} +- {:.2} %\n\
         best sequence: {}; of a polish: over scattered worlds, less its costs\n{diverged}{next}",
        outcome.env_steps,
        outcome.seconds,
        outcome.env_steps_per_second,
        share(outcome.simulation_share),
        share(outcome.inference_share),
        share(outcome.update_share),
        percent(outcome.mean_score),
        share(outcome.random_mean_score),
        share(outcome.random_deviation),
        percent(outcome.best_score),
    )
}
