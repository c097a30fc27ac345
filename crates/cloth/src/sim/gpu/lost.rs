use std::any::Any;

use super::adapter::Adapter;

/// A device that has stopped computing: it was unplugged or reset, or has no memory left. What it held
/// is gone, so everything that waits for it unwinds with this.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name} has stopped computing: {reason}")]
pub struct Lost {
    name: String,
    reason: String,
}

impl Lost {
    /// Unwinds without the message of a panic, which would take it for a fault of the program's.
    pub(super) fn unwind(adapter: &Adapter, error: impl std::fmt::Display) -> ! {
        let lost = Self {
            name: adapter.name(),
            reason: error.to_string().replace('\n', " "),
        };
        if cfg!(debug_assertions) {
            eprintln!("{lost}");
        }
        std::panic::resume_unwind(Box::new(lost))
    }

    /// What has been caught, if it was that.
    pub fn caught(caught: &(dyn Any + Send)) -> Option<&Self> {
        caught.downcast_ref()
    }
}
