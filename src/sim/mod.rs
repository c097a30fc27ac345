//! The cloth core: substep XPBD (paper, Algorithm 1) for many environments in lockstep.
//!
//! A [`Model`] is built once from a lamina and the physics that a scene lists; a [`Batch`]
//! carries the moving state of a group of environments, one SIMD lane each, and steps it.
//! Particles and massless constraints only; heat is not modelled, and layers of cloth hold
//! each other apart only where the scene asks for it. A lane that diverges turns non-finite and says so; its neighbours go on.

mod constraints;
mod cpu;
mod line;
mod membrane;
mod model;
mod physics;
mod preset;
mod self_contact;
mod state;
mod substep;

pub use cpu::Cpu;
pub use model::Model;
pub use physics::{Bending, BendingStiffness, Compression, PhysicsConfig, PhysicsError, Solver};
pub use preset::Preset;
pub use self_contact::SelfCollision;
pub use state::{Batch, Control, Press, Snapshot};

#[cfg(target_arch = "x86_64")]
use crate::math::{F32x8, F32x16};
use crate::math::{Isa, Portable};

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

/// One environment by itself, f32, with the same bits as in any lane of a [`batch`].
pub fn alone(model: &Model) -> Box<dyn Batch> {
    Box::new(Cpu::<f32>::new(model))
}
