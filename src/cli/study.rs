mod episodes;
mod stability;
mod tradeoff;

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
    Tradeoff(tradeoff::Args),
}

/// Runs `drape study`.
pub fn run(args: Args) -> Result<(), Failure> {
    match args.study {
        Study::Episodes(args) => episodes::run(args),
        Study::Stability(args) => stability::run(args),
        Study::Tradeoff(args) => tradeoff::run(args),
    }
}
