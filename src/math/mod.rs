//! Vectors and seeded random streams: what every other module counts with.

mod stream;

pub use stream::{Purpose, Stream};

/// A point or direction in space [m], f64. The solver's own lanes live in [`crate::sim`].
pub type Vec3 = nalgebra::Vector3<f64>;
