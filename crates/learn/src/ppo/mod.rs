//! Proximal policy optimisation (Schulman et al. 2017) of masked discrete actions.
//!
//! One [`Trainer::iterate`] is: a rollout of all tasks (`rollout`), advantages ([`gae()`]), and
//! some epochs of updates on them (`update`, with the pure losses of `loss`). Optionally
//! the best episodes ever seen are imitated as well (`imitation`). A trainer saves and
//! restores itself exactly: a resumed training gives the same bits as one never interrupted.

mod adam;
mod agent;
mod config;
mod error;
mod gae;
mod imitation;
mod loss;
mod rollout;
mod sections;
mod shared;
mod symmetry;
#[cfg(test)]
mod tests;
mod trainer;
mod update;

pub(crate) use adam::Adam;
pub use agent::{Agent, Sampling};
pub use config::{AdvantageNorm, Baseline, ImitationConfig, PpoConfig};
pub use error::{NotFinite, TrainError};
pub use gae::{Next, gae};
pub use rollout::{EpisodeRecord, Seconds};
pub use sections::{NETWORK, SectionError, Sections, decode, encode, read_section};
pub use trainer::{Iteration, Trainer};
pub use update::UpdateMetrics;
