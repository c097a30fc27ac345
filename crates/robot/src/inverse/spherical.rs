use nalgebra::Vector3;

use super::axes::{Axes, TOLERANCE, angle_about, angle_between, angles_reaching, rotation};
use super::position::Position;
use crate::arm::Joints;
use crate::place::Pose;

/// Axes 4, 5 and 6 meet in a point, which the first three joints bring to its place; the others turn the flange.
#[derive(Clone, Debug)]
pub struct SphericalWrist {
    position: Position,
    centre: Vector3<f64>,
    directions: [Vector3<f64>; 3],
}

impl SphericalWrist {
    pub fn of(axes: &Axes) -> Option<Self> {
        let centre = axes.meeting(3, 4)?;
        let is_spherical = axes.distance(5, &centre) < TOLERANCE && !axes.are_parallel(4, 5);
        let [_, _, _, directions @ ..] = axes.direction;
        Some(Self {
            position: Position::of(axes, &centre).filter(|_| is_spherical)?,
            centre,
            directions,
        })
    }

    /// Calls `each` with all joints that move the last link by `moved` from where it is at zero.
    pub fn solve(&self, moved: &Pose, mut each: impl FnMut(Joints)) {
        let [h4, h5, h6] = &self.directions;
        let centre = moved.rotation * self.centre + moved.translation.vector;
        self.position.solve(&centre, |[q1, q2, q3]| {
            let rest = self.position.rotation(&[q1, q2, q3]).inverse() * moved.rotation;
            let last = rest * h6;
            let bent = angles_reaching(h5, h6, h4, h4.dot(&last));
            for q5 in bent.into_iter().flatten() {
                let turned = rotation(h5, q5);
                let q4 = angle_between(h4, &(turned * h6), &last);
                let left = (rotation(h4, q4) * turned).inverse() * rest;
                each([q1, q2, q3, q4, q5, angle_about(h6, left.matrix())]);
            }
        });
    }
}
