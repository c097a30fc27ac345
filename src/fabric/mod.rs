//! The lamina: rest shape, masses, yarns and material law of a woven blank.
//!
//! A rectangular blank is cut into cells of two right triangles each, all diagonals in the
//! same direction, as in the paper's mesh. Its edges along x are warp yarns, along y weft
//! yarns; the diagonals carry shear. How any of this is solved is not known here.

mod colors;
mod lamina;
mod material;

pub use colors::color;
pub use lamina::{BlankConfig, BlankError, Diagonal, Hinge, Lamina, MassModel, Yarn};
pub use material::{ArealMass, Curve, Family, Material, MaterialError, ShearLaw, YarnLaw};
