use super::Failure;
use super::failure::Interrupted;
use super::output::print;
pub use super::training::TrainArgs;
use super::training::{Outcome, text, train};
use crate::cluster::ClusterSession;

/// Runs `drape train`.
pub fn run(args: TrainArgs) -> Result<(), Failure> {
    let session = ClusterSession::start().map_err(Failure::invalid)?;
    let printed = |outcome: Option<Outcome>| {
        let Some(outcome) = outcome else {
            return Ok(None);
        };
        print(&outcome, text)?;
        Ok(outcome.interrupted)
    };
    let result = train(&args, &session).and_then(printed);
    let interrupted = session.end(result, |failure| failure.report().into())?;
    interrupted.map_or(Ok(()), |signal| Err(Interrupted(signal).into()))
}
