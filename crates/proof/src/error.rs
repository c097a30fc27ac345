use drape_cloth::file::ValueError;
use drape_cloth::scene::SceneError;

/// Why nothing could be proved or pressed.
#[derive(Debug, thiserror::Error)]
pub enum ProofError {
    /// What was recorded elsewhere.
    #[error("{0}")]
    Invalid(&'static str),
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A value of the task that cannot be; its key is named.
    #[error(transparent)]
    Value(#[from] ValueError),
    #[error("the fast solver diverged on the way")]
    SolverDiverged,
    /// What the twin has come to.
    #[error("the twin's fall")]
    TwinDiverged(#[from] drape_cloth::twin::Diverged),
}

impl ProofError {
    /// Whether the user can mend it.
    pub fn is_input(&self) -> bool {
        match self {
            Self::Invalid(_) | Self::Value(_) => true,
            Self::Scene(error) => !matches!(error, SceneError::Diverged { .. }),
            Self::SolverDiverged | Self::TwinDiverged(_) => false,
        }
    }
}
