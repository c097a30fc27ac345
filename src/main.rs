//! Parses the command line, runs the command and says why it failed, if it did.

#![deny(clippy::print_stderr, clippy::print_stdout)]

use std::process::ExitCode;

use drape::cli::Cli;

fn main() -> ExitCode {
    #[cfg(feature = "gpu")]
    end_with_the_gpu();
    match Cli::read().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report().into(),
    }
}

/// A GPU that is lost or out of memory makes whatever uses it panic, on a thread of its driver's first or where
/// something is read: that is no fault of the program's, and ends it with one line. What the driver finds invalid is.
#[cfg(feature = "gpu")]
fn end_with_the_gpu() {
    let told = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let message = panic.payload_as_str().unwrap_or_default();
        // As cubecl, the cloth's backend and burn say it.
        let said = ["wgpu error", "Error while reading data"];
        let is_lost = said.iter().any(|said| message.contains(said));
        if !is_lost || message.to_lowercase().contains("validation") {
            return told(panic);
        }
        let failure = drape::cli::Failure::from(anyhow::anyhow!("the GPU has failed: {message}"));
        std::process::exit(failure.report().into())
    }));
}
