//! Rigid tools: parametric shapes, meshes from files, and the distance to them.
//!
//! Contact asks for the distance to the tool many million times a second. So the exact
//! distance ([`Surface`]) is sampled once on a grid ([`DistanceGrid`]), and the solver
//! interpolates. Both see the mesh as the boundary of a solid; an open mesh becomes one by
//! extending its border downwards.

mod accuracy;
mod grid;
mod patch;
mod shapes;
mod surface;

use std::path::PathBuf;

use nalgebra::Rotation3;
use serde::{Deserialize, Serialize};

pub use accuracy::{ErrorSummary, GridError};
pub use grid::DistanceGrid;
pub use shapes::{Cylinder, DoubleDome, Hemisphere, Incline, Plate, Rib, Shape};
pub use surface::{Surface, SurfacePoint};

use crate::math::Vec3;
use crate::mesh::{ReadStlError, TriMesh, read_stl};

/// Where the tool comes from, where it stands, and how finely its distance is sampled.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ToolConfig {
    pub source: Source,
    pub pose: Pose,
    pub grid: GridConfig,
}

/// A shape from a formula, or a mesh from a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    Shape(Shape),
    Stl(StlSource),
}

/// A mesh from an STL file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StlSource {
    /// Taken as it is: whoever reads the config resolves it against the config's folder.
    pub path: PathBuf,
    /// Metres per unit of the file. The default takes the file to be in millimetres.
    #[serde(default = "millimetre")]
    pub scale: f64,
}

/// Position and direction of the tool: turned about x, then y, then z (fixed axes), then
/// moved.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Pose {
    pub translation_mm: [f64; 3],
    /// Roll about x, pitch about y, yaw about z.
    pub rotation_deg: [f64; 3],
}

/// Extent and spacing of the distance grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GridConfig {
    pub spacing_mm: f64,
    /// Width of the band round the tool's bounding box that the grid covers too.
    pub margin_mm: f64,
}

impl Default for Source {
    fn default() -> Self {
        Self::Shape(Shape::default())
    }
}

impl Default for GridConfig {
    fn default() -> Self {
        Self {
            spacing_mm: 4.0,
            margin_mm: 40.0,
        }
    }
}

fn millimetre() -> f64 {
    1e-3
}

/// A rigid tool at its place, with everything that contact and export ask of it.
pub struct Tool {
    /// Facing outwards (upwards if open).
    pub mesh: TriMesh,
    /// Exact distance and nearest point; slow.
    pub surface: Surface,
    /// Interpolated distance; fast.
    pub grid: DistanceGrid,
    /// The mesh as given faced inwards (downwards if open) and was turned over.
    pub flipped: bool,
    /// Facets without area that were dropped from the file.
    pub dropped_facet_count: usize,
}

/// A tool that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ToolError {
    #[error("invalid tool")]
    Config(#[from] ConfigError),
    #[error("cannot read the tool")]
    Read(#[from] ReadStlError),
    #[error("the tool has no facets")]
    Empty,
    #[error(
        "the facets of the tool disagree on which side is out: {edge_count} edges are used \
         more often in one direction than in the other; repair the mesh"
    )]
    Misoriented { edge_count: usize },
    #[error(
        "a grid of {} x {} x {} nodes at spacing {spacing_mm} mm is too large, expected at most \
         {limit} nodes; increase grid.spacing_mm",
        dims[0], dims[1], dims[2]
    )]
    GridTooLarge {
        dims: [f64; 3],
        spacing_mm: f64,
        limit: usize,
    },
}

/// A key of the tool's configuration with a value that makes no sense.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key} is {found}, expected {expected}")]
pub struct ConfigError {
    pub key: String,
    pub found: String,
    pub expected: String,
}

impl ConfigError {
    fn new(key: &str, found: impl ToString, expected: impl Into<String>) -> Self {
        Self {
            key: key.to_string(),
            found: found.to_string(),
            expected: expected.into(),
        }
    }
}

impl ToolConfig {
    /// Checks what can be checked without building the tool.
    ///
    /// # Errors
    /// Names the first key whose value makes no sense.
    pub fn validate(&self) -> Result<(), ConfigError> {
        for (key, found) in [
            ("grid.spacing_mm", self.grid.spacing_mm),
            ("grid.margin_mm", self.grid.margin_mm),
        ] {
            if !(found > 0.0 && found.is_finite()) {
                return Err(ConfigError::new(key, found, "a positive number"));
            }
        }
        for (key, values) in [
            ("pose.translation_mm", self.pose.translation_mm),
            ("pose.rotation_deg", self.pose.rotation_deg),
        ] {
            if let Some(found) = values.iter().find(|v| !v.is_finite()) {
                return Err(ConfigError::new(key, found, "finite numbers"));
            }
        }
        match &self.source {
            Source::Stl(stl) if !(stl.scale > 0.0 && stl.scale.is_finite()) => Err(
                ConfigError::new("source.stl.scale", stl.scale, "a positive number"),
            ),
            _ => Ok(()),
        }
    }
}

impl Pose {
    /// Moves a point of the tool [m] to its place.
    fn apply(&self, x: &Vec3) -> Vec3 {
        let [roll, pitch, yaw] = self.rotation_deg.map(f64::to_radians);
        Rotation3::from_euler_angles(roll, pitch, yaw) * x + Vec3::from(self.translation_mm) * 1e-3
    }
}

impl Tool {
    /// Reads or makes the mesh, puts it into place and samples its distance.
    ///
    /// # Errors
    /// Values that make no sense, unreadable files, inconsistent meshes, too fine grids.
    pub fn new(config: &ToolConfig) -> Result<Self, ToolError> {
        config.validate()?;
        let (mut mesh, dropped_facet_count) = match &config.source {
            Source::Shape(shape) => (shape.mesh()?, 0),
            Source::Stl(stl) => {
                let stl = read_stl(&stl.path, stl.scale)?;
                (stl.mesh, stl.dropped_facet_count)
            }
        };
        for vertex in &mut mesh.vertices {
            *vertex = config.pose.apply(vertex);
        }
        let mut tool = Self::from_mesh(mesh, &config.grid)?;
        tool.dropped_facet_count = dropped_facet_count;
        Ok(tool)
    }

    /// Makes a tool of a mesh [m] that is already in place. A mesh that faces inwards, or
    /// downwards if it is open, is turned over.
    ///
    /// # Errors
    /// As for [`Tool::new`].
    pub fn from_mesh(mut mesh: TriMesh, grid: &GridConfig) -> Result<Self, ToolError> {
        let flipped = if surface::is_open(&mesh) {
            mesh.area_vector().z < 0.0
        } else {
            mesh.signed_volume() < 0.0
        };
        if flipped {
            mesh.flip();
        }
        let surface = Surface::new(&mesh)?;
        let (low, high) = mesh.bounds();
        let margin = Vec3::repeat(grid.margin_mm * 1e-3);
        let grid = DistanceGrid::new(
            &surface,
            low - margin,
            high + margin,
            grid.spacing_mm * 1e-3,
        )?;
        Ok(Self {
            mesh,
            surface,
            grid,
            flipped,
            dropped_facet_count: 0,
        })
    }
}
