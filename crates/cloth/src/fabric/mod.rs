//! The lamina: rest shape, masses, yarns and material law of a woven blank.
//!
//! A blank is cut into cells along its yarns, of two right triangles each, all diagonals in
//! the same direction, as in the paper's mesh. The sides of cells are yarns, the diagonals carry
//! shear. Where the outline does not follow the yarns, border vertices move on to it, and
//! triangles there become membranes: the same law without yarns along their sides.

mod blank;
mod colors;
mod cut;
mod grid;
mod lamina;
mod material;
mod membrane;
mod outline;
mod state;

pub use blank::{BlankConfig, BlankError, CutFault, MassModel};
pub(crate) use colors::color;
pub use lamina::{Hinge, Lamina, Yarn};
pub use material::{ArealMass, Curve, Family, Material, ShearLaw, ShearLocking, YarnLaw};
pub use membrane::Membrane;
pub use outline::Outline;
pub use state::{Drape, Tangents};
