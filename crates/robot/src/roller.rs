use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Vector3};

use super::place::Pose;

/// The roller at the end of an arm: a cylinder that turns about the y axis of its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RollerShape {
    /// The frame of its middle in the flange's; z leads away from the flange, y along its axis.
    pub middle: Pose,
    /// [m]
    pub radius: f64,
    /// Along its axis [m].
    pub width: f64,
    /// Of everything at the flange [kg], and where the centre of that mass is in the flange's frame [m].
    pub mass: f64,
    pub centre_of_mass: Vector3<f64>,
}

impl RollerShape {
    /// The frame of the contact in the flange's, where the arm leans by `tilt` [rad] about the roller's axis: z into the
    /// surface, y along the axis, the origin in the middle of the line of contact. A cylinder touches alike at any tilt.
    pub fn contact(&self, tilt: f64) -> Pose {
        let turned = Rotation3::from_axis_angle(&Vector3::y_axis(), tilt);
        let down = IsometryMatrix3::from_parts(
            Translation3::new(0.0, 0.0, self.radius),
            Rotation3::identity(),
        );
        self.middle * IsometryMatrix3::from_parts(Translation3::identity(), turned) * down
    }
}
