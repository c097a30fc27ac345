//! What a training run leaves on disk, and how it goes on from there.
//!
//! A [`RunFolder`] holds the resolved configuration with copies of the files that its scene is
//! read from, the metrics (as JSON lines and for TensorBoard), the [`Checkpoint`]s and the best
//! action sequence seen. Files that are replaced are written atomically; files that grow are cut
//! back on a resume to the length the checkpoint knew, so that an interruption leaves no trace in
//! them.

mod best;
mod changes;
mod checkpoint;
mod config;
mod demonstrations;
mod events;
mod folder;
mod log;
mod metrics;
mod robot;
mod rollout;
mod scenes;
mod search;
mod training;
mod turns;
mod weights;

pub use best::{BestPaths, BestSequence};
pub use changes::changed;
pub use checkpoint::Checkpoint;
pub use config::{RunConfig, TrainingPreset};
pub use demonstrations::Demonstrations;
pub use folder::{Input, Proved, RunError, RunFolder, RunInfo, dated_folder, digest};
pub use metrics::{curve, read_metrics};
pub use robot::{ReachMap, cell, path_points};
pub use rollout::{
    EpisodeSummary, PlayedEpisode, RolloutError, Rules, parallel_episodes, play, random_episodes,
    replay,
};
pub use scenes::{FamilyMember, SceneRange};
pub use search::{Budget, KNOWN, search_by_moves};
pub use training::{Preparation, Scenes, Training};
pub use turns::{Parameter, ScanFile, Turn, kept_presses};
pub use weights::Weights;
