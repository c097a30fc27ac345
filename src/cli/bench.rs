use super::Failure;
use super::study::Measure;
use drape_study::bench::Bench;

pub type Args = Measure<Bench>;

/// Runs `drape bench`.
pub fn run(args: Args) -> Result<(), Failure> {
    args.run(None)
}
