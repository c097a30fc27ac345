use std::path::PathBuf;

use nalgebra::{IsometryMatrix3, Rotation3};
use serde::{Deserialize, Serialize};

use super::shapes::Shape;
use crate::file::ValueError;
use crate::math::Vec3;

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
    #[serde(alias = "stl")]
    Mesh(MeshSource),
}

/// A mesh from an STL or PLY file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshSource {
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
    /// Distances are interpolated at this spacing everywhere. Not given: at 4 mm, or as fine as a
    /// large tool allows, and exact wherever that errs too much near the surface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spacing_mm: Option<f64>,
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
            spacing_mm: None,
            margin_mm: 40.0,
        }
    }
}

fn millimetre() -> f64 {
    1e-3
}

/// Coarsest spacing and widest margin of the distance grid: coarser than a tool, a grid does
/// not see it.
const MAX_MM: f64 = 1000.0;

impl ToolConfig {
    /// Checks what can be checked without building the tool.
    ///
    /// # Errors
    /// Names the first key whose value makes no sense.
    pub fn check(&self) -> Result<(), ValueError> {
        for (key, found) in [
            ("grid.spacing_mm", self.grid.spacing_mm),
            ("grid.margin_mm", Some(self.grid.margin_mm)),
        ] {
            let Some(found) = found else { continue };
            let is_valid = found > 0.0 && found <= MAX_MM;
            ValueError::unless(is_valid, key, found, "a positive number up to 1000 mm")?;
        }
        for (key, values) in [
            ("pose.translation_mm", self.pose.translation_mm),
            ("pose.rotation_deg", self.pose.rotation_deg),
        ] {
            for found in values {
                ValueError::unless(found.abs() <= 1e5, key, found, "numbers within +-100000")?;
            }
        }
        match self.source {
            Source::Mesh(MeshSource { scale, .. }) => {
                let is_valid = scale > 0.0 && scale.is_finite();
                ValueError::unless(is_valid, "source.mesh.scale", scale, "a positive number")
            }
            // Whether a shape makes a body is known when it has made one, which takes no time.
            Source::Shape(ref shape) => match shape.mesh() {
                Ok(_) => Ok(()),
                Err(error) => Err(error.within("source.shape")),
            },
        }
    }
}

impl Pose {
    /// Moves a point of the tool [m] to its place, seen from `origin` [m].
    pub(super) fn apply(&self, x: &Vec3, origin: &Vec3) -> Vec3 {
        let pose = self.isometry();
        // First of all, so that what is computed does not depend on how far away that is.
        pose.rotation * x + (pose.translation.vector - origin)
    }

    /// From the frame of the tool's file, or of its formula, to the scene's [m].
    pub fn isometry(&self) -> IsometryMatrix3<f64> {
        let [roll, pitch, yaw] = self.rotation_deg.map(f64::to_radians);
        let translation = Vec3::from(self.translation_mm) * 1e-3;
        let rotation = Rotation3::from_euler_angles(roll, pitch, yaw);
        IsometryMatrix3::from_parts(translation.into(), rotation)
    }
}
