//! The cloth core: substep XPBD (paper, Algorithm 1) for many environments in lockstep.
//!
//! A [`Model`] is built once from a lamina and the physics that a scene lists. A [`Backend`] is
//! given it, with tool, start and stencil, as a [`World`], and moves N environments of it; [`Cpu`]
//! does so in SIMD lanes over threads. The substep stands in `step`, every stage of it in a file of
//! its own; `storage` says how a stage reaches the lanes.
//!
//! Particles and massless constraints only; heat is not modelled, and layers of cloth hold each
//! other apart only where the scene asks for it. An environment that diverges says so; its
//! neighbours go on.

// `Option::map` would take a closure, which is compiled without the instruction set of the kernel around it.
#![expect(clippy::manual_map)]

mod alone;
mod backend;
mod bend;
mod between;
mod cloth;
mod collision;
mod contact;
mod cpu;
mod curve;
mod device;
mod device_error;
mod edges;
mod fold;
mod frame;
#[cfg(feature = "gpu")]
mod gpu;
mod group;
mod hinge;
mod lanes;
mod law;
mod length;
mod line;
mod lines;
mod locking;
mod membrane;
mod model;
mod observations;
mod parameters;
mod physics;
mod press;
mod scales;
mod shear;
mod state;
mod stencil;
mod step;
mod stepping;
mod storage;
#[cfg(test)]
mod tests;
mod view;

pub use between::Tolerance;

pub use backend::{Backend, Observed, World};
pub use cpu::{Cpu, Precision};
pub use device::Device;
pub use device_error::DeviceError;
#[cfg(feature = "gpu")]
pub use gpu::{Adapter, AdapterKind, Buffer, Gpu, Traffic};
pub use model::Model;
pub use observations::{Column, Number, Observation, Observations};
pub use parameters::{Aim, Own, Parameters};
pub use physics::{Bending, BendingStiffness, PhysicsConfig, SelfCollision, Solver, Tension};
pub use press::{Press, Roller};
pub use state::{ALLOWED, DRAPED, Pressed, Presses, STENCIL, Snapshot, TOUCHED};
pub use stencil::{Stencil, under_stencil};
pub use stepping::{Accuracy, Control, Stepping};
pub use view::{Mask, View};
