//! The command line.
//!
//! One file a command, each with its arguments and `run(args) -> Result<(), Failure>`; adding
//! a command is that file and one variant of `Command`. Results go to stdout, as text or,
//! with `--json`, as exactly one JSON object; progress and errors go to stderr.

mod args;
mod arm;
mod baseline;
mod calibrate;
mod compare;
mod devices;
mod eval;
mod explained;
mod export;
mod failure;
mod field;
mod improve;
mod learning;
mod loaded;
mod next_tool;
mod output;
mod picture;
mod plan;
mod planned;
mod proof;
mod result;
mod robot;
mod scanned;
mod scene;
mod searched;
mod setup;
mod shell;
mod signals;
mod stack;
mod study;
mod terminal;
mod tool;
mod train;
mod training;
mod view;

use anyhow::anyhow;
use clap::{CommandFactory, Parser, Subcommand};

use crate::cluster::check_alone;
pub use failure::Failure;
pub use setup::{read_config, set_up_tasks};

/// Finds the order in which a robot presses woven fabric on to a curved tool.
#[derive(Debug, Parser)]
#[command(name = "drape", version, after_help = EXIT_CODES)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,

    /// Print one JSON object instead of text
    #[arg(long, global = true)]
    json: bool,
}

const EXIT_CODES: &str = "Exit codes: 0 done; 1 failed at work (disk full, simulation diverged, ...); \
                          2 wrong usage or configuration; 130 interrupted by Ctrl-C (SIGINT), 143 by SIGTERM, \
                          129 by SIGHUP.";

#[derive(Debug, Subcommand)]
enum Command {
    Train(train::TrainArgs),
    Plan(plan::PlanArgs),
    Stack(stack::StackArgs),
    Baseline(baseline::BaselineArgs),
    Eval(eval::EvalArgs),
    Export(export::ExportArgs),
    Robot(robot::RobotArgs),
    /// List what `--device` can name on this machine
    Devices,
    Tool(tool::ToolArgs),
    Scene(scene::SceneArgs),
    Compare(compare::CompareArgs),
    Calibrate(calibrate::CalibrateArgs),
    Improve(improve::ImproveArgs),
    Study(study::StudyArgs),
    View(view::ViewArgs),
    Bench(study::Measure<drape_study::bench::Bench>),
    Completions(shell::CompletionsArgs),
    Man(shell::ManArgs),
}

impl Cli {
    /// What the command line asks for; ends the program where that is help, or nothing that can be.
    pub fn read() -> Self {
        Self::try_parse().unwrap_or_else(|error| {
            if error.use_stderr() {
                // Not as it prints itself: it quotes what was given.
                let message = error.render().to_string();
                message.trim_end().lines().for_each(terminal::tell);
                std::process::exit(error.exit_code());
            }
            error.exit()
        })
    }

    /// Runs the command that was asked for.
    pub fn run(self) -> Result<(), Failure> {
        signals::survive()?;
        terminal::set_json(self.json);
        // Later it would be a panic that there are too few.
        let threads = rayon::ThreadPoolBuilder::new().build_global();
        threads.map_err(|error| {
            anyhow!("cannot start threads: {error}; ask for fewer by RAYON_NUM_THREADS")
        })?;
        if !matches!(self.command, Command::Train(_) | Command::Devices) {
            check_alone().map_err(Failure::invalid)?;
        }
        if self.json && matches!(self.command, Command::Completions(_) | Command::Man(_)) {
            let wrong = anyhow!("`--json`: what a shell or man reads is no JSON, expected none");
            return Err(Failure::invalid(wrong));
        }
        match self.command {
            Command::Train(args) => train::run(args),
            Command::Plan(args) => plan::run(args),
            Command::Stack(args) => stack::run(args),
            Command::Baseline(args) => baseline::run(args),
            Command::Eval(args) => eval::run(args),
            Command::Export(args) => export::run(args),
            Command::Robot(args) => robot::run(args),
            Command::Devices => devices::run(),
            Command::Tool(args) => tool::run(args),
            Command::Scene(args) => scene::run(args),
            Command::Compare(args) => compare::run(args),
            Command::Calibrate(args) => calibrate::run(args),
            Command::Improve(args) => improve::run(args),
            Command::Study(args) => study::run(args),
            Command::View(args) => view::run(args),
            Command::Bench(study) => study.run(None),
            Command::Completions(args) => shell::complete(&args, Self::command()),
            Command::Man(args) => shell::manual(&args, Self::command()),
        }
    }
}
