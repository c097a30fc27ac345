//! The cloth core: substep XPBD (paper, Algorithm 1) for many environments in lockstep.
//!
//! A [`Model`] is built once from a lamina and the physics that a scene lists; a [`Batch`]
//! carries the moving state of a group of environments, one SIMD lane each, and steps it.
//! Particles and massless constraints only; heat is not modelled, and layers of cloth hold
//! each other apart only where the scene asks for it. A lane that diverges turns non-finite and says so; its neighbours go on.

mod alone;
mod constraints;
mod cpu;
mod fold;
mod line;
mod membrane;
mod model;
mod physics;
mod self_contact;
mod state;
mod stepping;
mod substep;
mod trellis;

pub use alone::Alone;
pub use cpu::Cpu;
pub use model::Model;
pub use physics::{
    Bending, BendingStiffness, Compression, PhysicsConfig, PhysicsError, Solver, Tension,
};
pub use self_contact::SelfCollision;
pub use state::{Batch, Press, Snapshot};
pub use stepping::{Accuracy, Control, Stepping};

#[cfg(target_arch = "x86_64")]
use crate::math::{F32x8, F32x16, F64x4, F64x8};
use crate::math::{Isa, Lanes, Portable};

/// A group of environments for an instruction set, f32. Lanes start at rest in the origin;
/// [`Batch::load`] each before the first step.
pub fn batch(model: &Model, isa: Isa) -> Box<dyn Batch> {
    match isa {
        Isa::Portable => Box::new(Cpu::<Portable>::new(model)),
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => Box::new(Cpu::<F32x8>::new(model)),
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => Box::new(Cpu::<F32x16>::new(model)),
    }
}

/// One environment by itself, f32, with the same bits as in any lane of a [`batch`]. Its lines are
/// solved side by side in the lanes, see [`Alone`]; by Gauss-Seidel, or where layers of the cloth
/// touch each other, it is computed in one lane. It must be stepped with `model`, or one that
/// differs in damping, friction, gravity or the air alone.
pub fn alone(model: &Model, isa: Isa) -> Box<dyn Batch> {
    match isa {
        Isa::Portable => folded::<Portable>(model),
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => folded::<F32x8>(model),
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => folded::<F32x16>(model),
    }
}

/// One environment by itself, f64, with the same bits on every instruction set.
pub fn alone_f64(model: &Model, isa: Isa) -> Box<dyn Batch> {
    match isa {
        Isa::Portable => Box::new(Cpu::<f64>::new(model)),
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => folded::<F64x4>(model),
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => folded::<F64x8>(model),
    }
}

/// With its lines side by side where that can be.
fn folded<V: Lanes>(model: &Model) -> Box<dyn Batch> {
    match Alone::<V>::new(model) {
        Some(alone) => Box::new(alone),
        None => Box::new(Cpu::<V::Scalar>::new(model)),
    }
}
