//! What cloth on a tool is judged by.

mod shear;
mod sheet;
mod surplus;

pub use shear::{Sheared, shear, sheared};
pub use sheet::Measures;
pub use surplus::{crushed, feet, foot, summed_surplus, surplus};
