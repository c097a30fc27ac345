mod episodes;
mod stability;
mod verify;

use clap::Subcommand;

use super::Failure;

/// Measure the simulator itself
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    study: Study,
}

#[derive(Debug, Subcommand)]
enum Study {
    Episodes(episodes::Args),
    Stability(stability::Args),
    Verify(verify::Args),
}

/// Runs `drape study`.
pub fn run(args: Args) -> Result<(), Failure> {
    match args.study {
        Study::Episodes(args) => episodes::run(args),
        Study::Stability(args) => stability::run(args),
        Study::Verify(args) => verify::run(args),
    }
}
