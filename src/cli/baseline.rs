use std::path::PathBuf;
use std::time::Instant;

use clap::ValueEnum;
use serde::Serialize;

use super::Failure;
use super::failure::{Interrupted, OrInvalid};
use super::output::{Progress, percent, print};
use super::proof;
use super::result::rollout_failure;
use super::searched::{NewRun, Searched};
use super::setup::read_config;
use super::signals::stop_on_signal;
use super::terminal::{Told, tell};
use crate::run::{BestPaths, Budget, Rules, RunConfig, replay};
use drape_proof::Row;
use drape_task::env::{Draping, Episode};
use drape_task::path::PathFigures;
use drape_task::search::{Arena, at_random, in_order, outwards, sweeps};

/// Search the best path of a task without learning: what a trained policy has to beat
///
/// Leaves a run folder as `train` does, without metrics and checkpoints. Ctrl-C, SIGTERM and SIGHUP stop it, with the
/// exit code 130, 143 or 129.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape baseline --policy moves
  drape baseline task.toml --policy sweep --json
  drape baseline task.toml --policy outwards --steps 50000 --name outwards")]
pub struct BaselineArgs {
    /// Configuration file, as for `train`; the built-in quickstart if not given
    config: Option<PathBuf>,

    /// How to search
    #[arg(long, value_enum)]
    policy: Policy,

    /// Most environment steps, simulated ones of all environments, instead of the configuration's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=RunConfig::MAX_STEPS))]
    steps: Option<u64>,

    /// Seed of all random streams, instead of the configuration's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(..=RunConfig::MAX_SEED))]
    seed: Option<u64>,

    #[command(flatten)]
    new: NewRun,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
enum Policy {
    /// Any allowed press
    Random,
    /// Straight sweeps, finer and finer directions
    Sweep,
    /// Outwards from places of finer and finer grids
    Outwards,
    /// Moves of the order, beside what it was, in scattered worlds
    Moves,
}

impl Policy {
    /// Plays episodes; false if it has nothing left to try before the steps are spent.
    fn play(self, arena: &mut Arena, start: &Draping, config: &RunConfig) -> bool {
        let seed = config.seed;
        match self {
            Self::Random => at_random(arena, seed),
            Self::Sweep => return !in_order(arena, sweeps(start)),
            Self::Outwards => return !in_order(arena, outwards(start)),
            Self::Moves => unreachable!("they play no episodes"),
        }
        true
    }

    /// As on the command line.
    fn name(self) -> String {
        let value = self.to_possible_value().expect("no policy is hidden");
        value.get_name().into()
    }
}

/// What `--json` prints.
#[derive(Serialize)]
struct Outcome {
    run: Told,
    policy: Policy,
    /// Not interrupted. It may have run out of orders before the steps were spent.
    complete: bool,
    env_steps: u64,
    seconds: f64,
    #[serde(flatten)]
    found: Found,
    best_score: Option<f64>,
    /// Of the best path, in the task's own steps.
    path: Option<PathFigures>,
    /// The best paths in finer steps, beside other orders.
    proof: Vec<Row>,
    /// All steps, not only all orders.
    #[serde(skip)]
    is_spent: bool,
}

/// Episodes of a search.
#[derive(Default, Serialize)]
struct Found {
    episodes: usize,
    /// Those of them in which the simulation diverged; they have no score.
    diverged: usize,
    mean_score: Option<f64>,
}

impl Found {
    fn count(&mut self, episode: &Episode) {
        self.episodes += 1;
        match episode.score {
            None => self.diverged += 1,
            Some(score) => {
                let mean = self.mean_score.unwrap_or(0.0);
                let scored = (self.episodes - self.diverged) as f64;
                self.mean_score = Some(mean + (score - mean) / scored);
            }
        }
    }
}

/// Runs `drape baseline`.
pub fn run(args: BaselineArgs) -> Result<(), Failure> {
    let (mut config, place) = read_config(args.config.as_deref())?;
    config.seed = args.seed.unwrap_or(config.seed);
    config.steps = args.steps.unwrap_or(config.steps);
    // What moves find keeps to no mask, as what is polished does not.
    config.polish = match args.policy {
        Policy::Moves => config.steps,
        _ => 0,
    };
    let run = Searched::begin(config, place, &args.new, args.policy.name(), None)?;
    let Searched {
        config,
        place,
        scene,
        folder,
        ..
    } = &run;
    let draping = Draping::new(scene.clone(), &config.env, config.environments);
    let mut draping = draping.or_invalid_in(place)?;
    let mut start = Draping::new(scene.clone(), &config.env, 1).or_invalid_in(place)?;

    let asked = stop_on_signal()?;
    let stop = || asked().is_some();
    let began = Instant::now();
    let digest = folder.config_digest()?;
    let (mut best, mut found) = (BestPaths::default(), Found::default());
    let (mut env_steps, mut written) = (0, Ok(()));
    let is_spent = if args.policy == Policy::Moves {
        let (moved, spent) =
            run.by_moves(&run.worlds()?, Vec::new(), Budget::Presses(config.steps))?;
        env_steps = spent;
        best = BestPaths::judged(moved.orders);
        !moved.has_converged
    } else {
        let progress = Progress::of_steps(0, config.steps);
        let mut watch = |spent: u64, ended: &[Episode]| {
            env_steps = spent;
            let before = best.score();
            for episode in ended {
                found.count(episode);
                best.remember(episode.score, &episode.actions, start.task(0));
            }
            if best.score() > before
                && let Some(sequence) = best.sequence(start.task(0), digest.clone())
            {
                written = folder.write_best_sequence(&sequence);
            }
            let [mean, best] = [found.mean_score, best.score()].map(percent);
            progress.step(spent, format!("score: mean {mean}, best {best}"));
            written.is_ok() && !stop()
        };
        let mut arena = Arena::new(&mut draping, config.steps, &mut watch);
        args.policy.play(&mut arena, &start, config)
    };
    written?;
    let seconds = began.elapsed().as_secs_f64();
    let interrupted = asked();
    let was_stopped = interrupted.is_some();

    let (mut path, mut rows) = (None, Vec::new());
    match run.keep(&best)? {
        None => tell(
            "warning: every episode has diverged or none has ended, so there is no best sequence: raise \
             --steps or `env.substep_rate`",
        ),
        Some(sequence) => {
            let played = replay(&mut start, &sequence.vertices, Rules::Robot, |_| ())
                .map_err(|error| rollout_failure(error, &folder.best_sequence))?;
            path = Some(played.summary.path);
            if !was_stopped {
                rows = run.prove(sequence)?;
            }
        }
    }
    let outcome = Outcome {
        run: (&folder.path).into(),
        policy: args.policy,
        complete: !was_stopped,
        env_steps,
        seconds,
        found,
        best_score: best.score(),
        path,
        proof: rows,
        is_spent,
    };
    print(&outcome, text)?;
    interrupted.map_or(Ok(()), |signal| Err(Interrupted(signal).into()))
}

fn text(outcome: &Outcome) -> String {
    let (run, found) = (outcome.run.display(), &outcome.found);
    let end = match outcome.is_spent {
        true => "",
        false => "; it has come to its end",
    };
    let [mean, best] = [found.mean_score, outcome.best_score].map(percent);
    let path = |path: PathFigures| format!("best path: {}\n", path.text());
    let path = outcome.path.map_or(String::new(), path);
    let next = match (outcome.complete, outcome.best_score) {
        (false, Some(_)) => {
            format!("interrupted; prove what is found with: drape eval {run} --sequence --prove")
        }
        (true, Some(_)) => format!("{}\nnext: drape robot {run}", proof::text(&outcome.proof)),
        (_, None) => "no best sequence".into(),
    };
    format!(
        "{run}: {} environment steps in {:.0} s, {} episodes ({} diverged){end}\n\
         score: mean {mean}, best {best}\n{path}{next}",
        outcome.env_steps, outcome.seconds, found.episodes, found.diverged
    )
}
