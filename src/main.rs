//! Parses the command line, runs the command and says why it failed, if it did.

use std::process::ExitCode;

use clap::Parser;
use drape::cli::Cli;

fn main() -> ExitCode {
    // A file that grows beyond a limit of the system's is an error like a full disk, not the end.
    #[cfg(unix)]
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Default::default());
    match Cli::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
