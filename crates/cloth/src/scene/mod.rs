//! From a scene file to the initial state: the blank is clamped, tilted, falls on to the
//! tool and settles (paper, Section 3.3).
//!
//! Frame: z up, gravity along -z, the tool where its own configuration puts it. The blank
//! starts flat, its centre over `placement.centre_mm`, turned about an axis
//! through its lowest edge by `tilt_deg`.

mod config;
mod fall;
mod scan;
mod summary;

pub use config::{Clamp, Fabric, Fall, Over, Placement, SceneConfig, SceneError};
pub use fall::{Misplacement, Scene};
pub use scan::{Mark, ScanFrame, Unit};
pub use summary::{Summary, wrinkle_count};

#[cfg(test)]
mod tests;
