mod stability;

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
    Stability(stability::Args),
}

/// Runs `drape study`.
pub fn run(args: Args) -> Result<(), Failure> {
    match args.study {
        Study::Stability(args) => stability::run(args),
    }
}
