use nalgebra::Vector3;

use super::axes::{Axes, angle_about, angle_between, angles_reaching, rotation};
use crate::arm::Joints;
use crate::place::Pose;

/// Axes 2, 3 and 4 are parallel, axes 5 and 6 meet: the arms of Universal Robots and their likes.
#[derive(Clone, Debug)]
pub struct ThreeParallel {
    directions: [Vector3<f64>; 6],
    /// A point of the first axis [m], and from there to axis 2, axis 3, axis 4 and to where axes 5 and 6 meet.
    base: Vector3<f64>,
    offset: Vector3<f64>,
    upper: Vector3<f64>,
    lower: Vector3<f64>,
    wrist: Vector3<f64>,
}

impl ThreeParallel {
    pub fn of(axes: &Axes) -> Option<Self> {
        let is_such = axes.are_parallel(1, 2)
            && axes.are_parallel(1, 3)
            && !axes.are_parallel(0, 1)
            && !axes.are_parallel(3, 4);
        let [p1, p2, p3, p4, ..] = axes.point;
        let meeting = axes.meeting(4, 5).filter(|_| is_such)?;
        Some(Self {
            directions: axes.direction,
            base: p1,
            offset: p2 - p1,
            upper: p3 - p2,
            lower: p4 - p3,
            wrist: meeting - p4,
        })
    }

    /// Calls `each` with all joints that move the last link by `moved` from where it is at zero.
    pub fn solve(&self, moved: &Pose, mut each: impl FnMut(Joints)) {
        let [h1, h2, h3, h4, h5, h6] = &self.directions;
        let meeting = self.base + self.offset + self.upper + self.lower + self.wrist;
        let from_axis = moved.rotation * meeting + moved.translation.vector - self.base;
        // The three parallel axes move nothing along themselves, and turn nothing but about themselves.
        let turned = angles_reaching(&-h1, &from_axis, h2, h2.dot(&(meeting - self.base)));
        for q1 in turned.into_iter().flatten() {
            let back = rotation(h1, -q1);
            let rest = back * moved.rotation;
            let bent = angles_reaching(h5, h6, h2, h2.dot(&(rest * h6)));
            for q5 in bent.into_iter().flatten() {
                let bend = rotation(h5, q5);
                let q6 = angle_between(&-h6, &(bend.inverse() * h2), &(rest.inverse() * h2));
                let three = rest * (bend * rotation(h6, q6)).inverse();
                let sum = angle_about(h2, three.matrix());
                let reach = back * from_axis - self.offset - three * self.wrist;
                let squares =
                    reach.norm_squared() - self.upper.norm_squared() - self.lower.norm_squared();
                let elbow = angles_reaching(h3, &self.lower, &self.upper, squares / 2.0);
                for q3 in elbow.into_iter().flatten() {
                    let stretched = self.upper + rotation(h3, q3) * self.lower;
                    let q2 = angle_between(h2, &stretched, &reach);
                    let q4 = (sum - q2 - q3 * h2.dot(h3).signum()) * h2.dot(h4).signum();
                    each([q1, q2, q3, q4, q5, q6]);
                }
            }
        }
    }
}
