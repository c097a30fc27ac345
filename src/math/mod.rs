//! Vectors, SIMD lanes and seeded random streams: what every other module counts with.

mod lanes;
mod stream;

pub use lanes::{Isa, Kernel, Lanes, Portable, Real, Vec3x};
#[cfg(target_arch = "x86_64")]
pub use lanes::{F32x8, F32x16};
pub use stream::{Purpose, Stream};

/// A point or direction in space [m], f64.
pub type Vec3 = nalgebra::Vector3<f64>;
