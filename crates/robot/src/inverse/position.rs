use nalgebra::{Rotation3, Vector3};

use super::axes::{Axes, angle_between, angles_reaching, rotation};

/// The first three joints, of which the second and the third are parallel: where they bring a point.
#[derive(Clone, Debug)]
pub struct Position {
    directions: [Vector3<f64>; 3],
    /// A point of the first axis [m], and from there to the second axis, to the third, and to the point.
    base: Vector3<f64>,
    offset: Vector3<f64>,
    upper: Vector3<f64>,
    lower: Vector3<f64>,
}

impl Position {
    /// None unless the axes are as described.
    pub fn of(axes: &Axes, point: &Vector3<f64>) -> Option<Self> {
        let is_such = axes.are_parallel(1, 2) && !axes.are_parallel(0, 1);
        let [h1, h2, h3, ..] = axes.direction;
        let [p1, p2, p3, ..] = axes.point;
        is_such.then(|| Self {
            directions: [h1, h2, h3],
            base: p1,
            offset: p2 - p1,
            upper: p3 - p2,
            lower: point - p3,
        })
    }

    /// Calls `each` with the angles, four at most, that bring the point to `to`.
    pub fn solve(&self, to: &Vector3<f64>, mut each: impl FnMut([f64; 3])) {
        let [h1, h2, h3] = &self.directions;
        let from_axis = to - self.base;
        let lateral = h2.dot(&(self.offset + self.upper + self.lower));
        let turned = angles_reaching(&-h1, &from_axis, h2, lateral);
        for q1 in turned.into_iter().flatten() {
            let reach = rotation(&-h1, q1) * from_axis - self.offset;
            let squares =
                reach.norm_squared() - self.upper.norm_squared() - self.lower.norm_squared();
            let bent = angles_reaching(h3, &self.lower, &self.upper, squares / 2.0);
            for q3 in bent.into_iter().flatten() {
                let stretched = self.upper + rotation(h3, q3) * self.lower;
                each([q1, angle_between(h2, &stretched, &reach), q3]);
            }
        }
    }

    /// How the angles turn what is behind them.
    pub fn rotation(&self, joints: &[f64; 3]) -> Rotation3<f64> {
        let [h1, h2, h3] = &self.directions;
        let [q1, q2, q3] = *joints;
        rotation(h1, q1) * rotation(h2, q2) * rotation(h3, q3)
    }
}
