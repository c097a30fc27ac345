//! Parses the command line, runs the command and says why it failed, if it did.

use std::process::ExitCode;

use clap::Parser;
use drape::cli::Cli;

fn main() -> ExitCode {
    match Cli::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
