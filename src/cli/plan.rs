use std::path::PathBuf;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::Failure;
use super::failure::{Interrupted, OrInvalid};
use super::loaded::{policy_paths, read_weights};
use super::output::print;
use super::proof;
use super::searched::{NewRun, Searched};
use super::setup::read_config;
use super::signals::stop_on_signal;
use super::terminal::{Told, tell};
use crate::run::{BestPaths, Budget, KNOWN, RunConfig, Weights};
use drape_learn::policy::DeviceKind;
use drape_proof::Row;
use drape_task::env::{Draping, EnvConfig};

/// Find a path for a task in seconds, without training on it
///
/// A search by moves begins with simple orders, and with what a trained policy plays (`--from`), and the best is proved.
/// Leaves a run folder as `train` does, without metrics and checkpoints. Ctrl-C, SIGTERM and SIGHUP stop it,
/// with the exit code 130, 143 or 129.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape plan task.toml --seconds 20
  drape plan task.toml --from runs/domes --name a
  drape plan task.toml --steps 100000 --json")]
pub struct PlanArgs {
    /// Configuration file, as for `train`; the built-in quickstart if not given
    config: Option<PathBuf>,

    /// Policy that plays the task first, of a run or a file of `drape export --format policy`; its network has to be a
    /// `unet`, or to have learned on images of this size
    #[arg(long, value_name = "RUN|FILE")]
    from: Option<PathBuf>,

    /// Checkpoint of that run: best, last or a file
    #[arg(long, value_name = "NAME", default_value = "last", requires = "from")]
    checkpoint: String,

    /// Seconds of policy and search together; falls, proof and pictures come on top, and what is begun is ended. What
    /// is found depends on the machine
    #[arg(long, value_name = "S", default_value_t = 20, conflicts_with = "steps",
          value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    seconds: u32,

    /// Presses of the search instead, which come to the same bits each time; some thousand more choose among what it finds
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=RunConfig::MAX_STEPS))]
    steps: Option<u64>,

    /// Seed of all random streams, instead of the configuration's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(..=RunConfig::MAX_SEED))]
    seed: Option<u64>,

    /// Where networks and cloth are computed: flex (the CPU), gpu or gpu:N
    #[arg(long, value_name = "DEVICE")]
    device: Option<DeviceKind>,

    #[command(flatten)]
    new: NewRun,
}

/// Paths of a policy that are drawn, beside the greedy one.
const DRAWN: usize = KNOWN - 1;

/// What `--json` prints.
#[derive(Serialize)]
struct Outcome {
    run: Told,
    /// Not interrupted.
    complete: bool,
    /// Paths that the policy has played to their end.
    policy_paths: usize,
    /// Presses of the search, its races included, whether it had come to its end before, and the time of policy and search.
    env_steps: u64,
    converged: bool,
    seconds: f64,
    /// What the best path is worth in the worlds that it was found in.
    best_score: Option<f64>,
    proof: Vec<Row>,
}

/// Runs `drape plan`.
pub fn run(args: PlanArgs) -> Result<(), Failure> {
    let (mut config, place) = read_config(args.config.as_deref())?;
    config.seed = args.seed.unwrap_or(config.seed);
    // What moves find keeps to no mask, as what is polished does not.
    config.polish = args.steps.unwrap_or(config.polish.max(1));
    config.set_device(args.device);
    config.device.open().or_invalid_in(&place)?;
    let from = args.from.as_deref();
    let weights = from.map(|from| read_weights(from, &args.checkpoint, &config));
    let weights = weights.transpose()?;
    let asked = stop_on_signal()?;
    let run = Searched::begin(config, place, &args.new, "plan".into(), weights.as_ref())?;
    let worlds = run.worlds()?;
    let began = Instant::now();
    let budget = match args.steps {
        Some(steps) => Budget::Presses(steps),
        None => Budget::Until(began + Duration::from_secs(args.seconds.into())),
    };
    let known = match &weights {
        Some(weights) => played(weights, &run)?,
        None => Vec::new(),
    };
    let policy_paths = known.len();
    let (found, env_steps) = run.by_moves(&worlds, known, budget)?;
    let seconds = began.elapsed().as_secs_f64();
    if found.rounds == 0 && asked().is_none() {
        let lacked = match budget {
            Budget::Presses(_) => "presses",
            Budget::Until(_) => "time",
        };
        tell(format_args!(
            "warning: the search had no {lacked} left for a single move: give it more"
        ));
    }
    let best = BestPaths::judged(found.orders);
    let sequence = run.keep(&best)?;
    let interrupted = asked();
    let mut rows = Vec::new();
    match sequence.filter(|_| interrupted.is_none()) {
        Some(sequence) => {
            rows = run.prove(sequence)?;
        }
        None if best.score().is_none() => tell("interrupted before anything was found"),
        None => tell(format_args!(
            "interrupted; prove what is found with: drape eval {} --sequence --prove",
            run.folder.path.display()
        )),
    }
    let outcome = Outcome {
        run: (&run.folder.path).into(),
        complete: interrupted.is_none(),
        policy_paths,
        env_steps,
        converged: found.has_converged,
        seconds,
        best_score: best.score(),
        proof: rows,
    };
    print(&outcome, text)?;
    interrupted.map_or(Ok(()), |signal| Err(Interrupted(signal).into()))
}

/// What a policy plays on the task of a run.
fn played(weights: &Weights, run: &Searched) -> Result<Vec<Vec<u32>>, Failure> {
    let (scene, config) = (&run.scene, &run.config);
    let env = EnvConfig {
        mask: weights.mask,
        ..config.env.clone()
    };
    let draping = Draping::new(scene.clone(), &env, 1).or_invalid_in(&run.place)?;
    let agent = weights.agent(&draping, config.device)?;
    policy_paths(&agent, scene, &env, DRAWN, config.seed)
}

fn text(outcome: &Outcome) -> String {
    let run = outcome.run.display();
    let end = match outcome.converged {
        true => ", whose end brought no more",
        false => "",
    };
    let policy = match outcome.policy_paths {
        0 => String::new(),
        count => format!("{count} paths of a policy, "),
    };
    let begin = format!(
        "{run}: {policy}{} presses of search{end}, in {:.1} s",
        outcome.env_steps, outcome.seconds
    );
    match outcome.complete {
        true => format!(
            "{begin}\n{}\nnext: drape robot {run}",
            proof::text(&outcome.proof)
        ),
        false => begin,
    }
}
