//! The finite-element digital twin: the same lamina by another method, slow and in f64.
//!
//! Triangles of constant strain with the law of a woven fabric, bending along yarns, lumped masses
//! and explicit central differences, as the paper's Section 2 has it in Abaqus/Explicit. With the
//! fast solver it shares material, mesh and what lies under the stencil, and no code of the solve:
//! where both agree, neither is wrong by itself. The cloth does not touch itself, and has no
//! thickness but in its stiffness. `docs/TWIN.md` has equations and figures.

mod bending;
mod config;
mod contact;
mod energy;
mod frequency;
mod law;
mod membrane;
mod pack;
mod press;
mod relax;
mod state;
mod step;

pub use config::TwinConfig;
pub use energy::Energies;
pub use press::{Hold, PressConfig};
pub use state::Twin;
pub use step::Diverged;
