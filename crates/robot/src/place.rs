use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Vector3};
use serde::{Deserialize, Serialize};

/// A rigid motion, or the frame that it takes the base to.
pub type Pose = IsometryMatrix3<f64>;

/// A frame in another one, as files have it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Place {
    pub at_mm: [f64; 3],
    /// About x, then y, then z of the scene.
    pub rotation_deg: [f64; 3],
}

impl Place {
    pub fn pose(&self) -> Pose {
        pose(self.at_mm, self.rotation_deg)
    }
}

pub(crate) fn pose(at_mm: [f64; 3], rotation_deg: [f64; 3]) -> Pose {
    let [x, y, z] = rotation_deg.map(f64::to_radians);
    let at = Translation3::from(metres(at_mm));
    Pose::from_parts(at, Rotation3::from_euler_angles(x, y, z))
}

pub(crate) fn metres(mm: [f64; 3]) -> Vector3<f64> {
    1e-3 * Vector3::from(mm)
}
