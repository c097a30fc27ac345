use crate::policy::NetworkDeviceError;
use drape_cloth::file::ValueError;

/// An agent that cannot be made, or a training that cannot begin or go on.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    #[error(transparent)]
    Device(#[from] NetworkDeviceError),
    #[error("policy")]
    Policy(#[source] ValueError),
    #[error("ppo")]
    Ppo(#[source] ValueError),
    /// The update stopped before the step that would have done harm.
    #[error("iteration {iteration} failed: lower the learning rate or limit the gradient norm")]
    NotFinite { iteration: u64, source: NotFinite },
}

/// A loss or gradient that is not a finite number; the step was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{quantity} is not finite")]
pub struct NotFinite {
    pub quantity: &'static str,
}
