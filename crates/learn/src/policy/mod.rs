//! The agent's networks: from an image of the fabric to a choice among its vertices.
//!
//! [`ActorCritic`] turns observations into one logit a pixel and a value;
//! [`masked`] turns logits and a mask into a categorical distribution. Three networks are
//! offered: the paper's ([`NetworkConfig::Paper`]), one that learns a single task in little CPU time
//! ([`NetworkConfig::Compact`]), and one whose weights belong to no place
//! ([`NetworkConfig::Unet`]). Everything random comes from a seed passed in, computed on the host, so that a network is the same on every device and never depends on burn's
//! process-wide generator.
//!
//! The module knows what is seen, not the task. It knows nothing of recurrence or of continuous
//! actions.

mod batch;
#[cfg(feature = "gpu")]
mod bridge;
mod compact;
mod config;
mod conv;
mod device;
mod features;
mod layer;
pub mod masked;
mod network;
mod paper;
mod parameters;
mod pixels;
mod prediction;
mod stages;
mod unet;

pub(crate) use batch::Batch;
pub use config::{CompactConfig, NetworkConfig, PaperConfig, PolicyConfig, UnetConfig};
pub use device::{DeviceKind, NetworkDeviceError};
pub use network::{ActorCritic, Network};
pub use prediction::Prediction;

/// What other networks can be built of.
pub(crate) mod convolutions {
    pub use super::features::{Layer, StageKind, burn_features, features};
    pub use super::layer::{Conv, Dense, Initializer};
}
