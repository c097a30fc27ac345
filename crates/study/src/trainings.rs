//! The trainings that a study asks for, and what is read of their runs.

use std::path::PathBuf;

/// Which trainings.
#[derive(Clone, Debug, clap::Args)]
pub struct Trainings {
    /// Configurations as `drape train` takes them; the built-in quickstart if none is given
    #[arg(value_name = "CONFIG")]
    pub configs: Vec<PathBuf>,

    /// Trainings of each configuration, with seeds from 1
    #[arg(long, default_value_t = 5, value_name = "K",
          value_parser = clap::value_parser!(u16).range(1..))]
    pub seeds: u16,

    /// Environment steps of each training, instead of the configuration's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1 << 40))]
    pub steps: Option<u64>,

    /// Trainings side by side, which share the cores
    #[arg(long, default_value_t = 1, value_name = "J",
          value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: u16,
}

/// The runs of one configuration.
#[derive(Clone, Debug, Default)]
pub struct Treatment {
    pub name: String,
    pub runs: Vec<LearnedRun>,
}

/// What a run folder tells of its training; what it does not tell is none.
#[derive(Clone, Debug, Default)]
pub struct LearnedRun {
    pub seed: u64,
    /// Scores by environment step [-]: mean of the last episodes, greedy policy, best so far.
    pub mean: LearningCurve,
    pub greedy: LearningCurve,
    pub best: LearningCurve,
    pub explained_variance: LearningCurve,
    /// Score of the proved path [-].
    pub proved: Option<f64>,
    /// Inner vertices of the region that the proved path leaves undraped.
    pub undraped_inner: Option<f64>,
    /// Of simulation, inference and update [s].
    pub seconds: Option<f64>,
}

/// Finite values by environment step.
pub type LearningCurve = Vec<(u64, f64)>;
