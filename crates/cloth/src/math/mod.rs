//! Vectors, SIMD lanes and seeded random streams: what every other module counts with.

mod asin;
pub mod bits;
mod lanes;
mod statistics;
mod stream;

pub(crate) use asin::{P as ASIN_P, Q as ASIN_Q, asin};
#[cfg(target_arch = "x86_64")]
pub use lanes::{F32x8, F32x16, F64x4, F64x8};
pub use lanes::{Isa, Kernel, Lanes, Portable, Real, Tables, Vec3x};
pub(crate) use lanes::{WIDEST, polynomial};
pub use statistics::mean_and_deviation;
pub use stream::{Purpose, Stream};

/// A point or direction in space [m], f64.
pub type Vec3 = nalgebra::Vector3<f64>;

/// The vector as parry has it.
pub(crate) fn to_parry(v: &Vec3) -> parry3d_f64::math::Vector {
    parry3d_f64::math::Vector::new(v.x, v.y, v.z)
}

/// A vector of parry's.
pub(crate) fn from_parry(v: parry3d_f64::math::Vector) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}
