//! How far one surface lies from another, and how smooth it is by itself.
//!
//! Surfaces are open triangle meshes with an upper side, in the same frame. Everything is measured
//! at vertices and weighed with their share of the area, so that it does not depend on where a
//! mesh is fine.

mod contour;
mod distances;
mod sheet;
mod wrinkles;

pub use contour::{Contour, ContourDeviation, Holes};
pub use distances::Distances;
pub use sheet::{Foot, Sheet, SheetError};
pub use wrinkles::{WrinkleFilter, Wrinkles, wrinkles};

#[cfg(test)]
mod tests;
