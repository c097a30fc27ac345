//! What a laboratory or a shop has measured, as a material file and the scatter round it.
//!
//! Standard tests ([`Lab`]) become a material by [`calibrate`]; scans of cloth become factors on the laws of a scene's
//! fabric by [`explain`], over the fast solver. Both say how far they may be off.

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

mod columns;
mod curve;
mod estimate;
mod fabric;
mod file;
mod lab;
mod observed;
mod scaled;
mod specimens;

pub use curve::{Sample, fewest, fit};
pub use estimate::{EVALUATIONS, Estimate, Query, estimate};
pub use fabric::{Calibrated, FitError, FittedCurve, calibrate};
pub use file::{scatter_table, write_material};
pub use lab::{Lab, Specimen};
pub use observed::{FACTORS, Factors, ObservedCloth, SimulationError, explain};
pub use scaled::{posterior, prior, scaled};
pub use specimens::{Measured, factor_spread, measured};
