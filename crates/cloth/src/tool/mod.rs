//! Rigid tools: parametric shapes, meshes from files, and the distance to them.
//!
//! Contact asks for the distance many million times a second, so the exact one ([`Surface`]) is
//! sampled once on a grid ([`DistanceGrid`]), and the solver interpolates.

mod accuracy;
mod config;
mod error;
mod grid;
mod lanes;
mod patch;
mod shapes;
mod sharp;
mod solid;
mod solidity;
mod surface;

pub use accuracy::{GridError, Thinnest};
pub use config::{GridConfig, MeshSource, Pose, Source, ToolConfig};
pub use error::ToolError;
pub use grid::DistanceGrid;
pub(crate) use lanes::{Atlas, Tools};
pub use shapes::{Cylinder, DoubleDome, Hemisphere, Incline, Plate, Rib, Shape};
pub use solid::Tool;
pub use surface::{Surface, SurfacePoint};
