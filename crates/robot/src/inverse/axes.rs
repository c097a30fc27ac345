use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

use crate::arm::Arm;

/// How far axes may miss a pattern and still be solved by it [rad and m], more than calibration moves them.
pub const TOLERANCE: f64 = 0.01;

/// How far a point may miss where it should be turned to and still be tried [m, or its square].
const MISS: f64 = 1e-3;

/// The axes of an arm's joints at angle zero, in the base's frame.
#[derive(Clone, Debug)]
pub struct Axes {
    pub direction: [Vector3<f64>; 6],
    /// A point of each [m].
    pub point: [Vector3<f64>; 6],
}

impl Axes {
    pub fn of(arm: &Arm) -> Self {
        let frames = arm.forward(&[0.0; 6]);
        Self {
            direction: std::array::from_fn(|i| frames[i + 1].rotation * *arm.joints[i].axis),
            point: std::array::from_fn(|i| frames[i + 1].translation.vector),
        }
    }

    /// Whether two axes are parallel. Axes count from 0.
    pub fn are_parallel(&self, i: usize, j: usize) -> bool {
        self.direction[i].cross(&self.direction[j]).norm() < TOLERANCE
    }

    pub fn are_perpendicular(&self, i: usize, j: usize) -> bool {
        self.direction[i].dot(&self.direction[j]).abs() < TOLERANCE
    }

    /// Where two axes meet, which are not parallel.
    pub fn meeting(&self, i: usize, j: usize) -> Option<Vector3<f64>> {
        let (a, b) = (self.direction[i], self.direction[j]);
        let normal = a.cross(&b);
        let between = self.point[j] - self.point[i];
        let sine = normal.norm();
        if sine < TOLERANCE || between.dot(&normal).abs() > TOLERANCE * sine {
            return None;
        }
        let along = between.cross(&b).dot(&normal) / sine.powi(2);
        Some(self.point[i] + a * along)
    }

    /// Distance of a point from an axis [m].
    pub fn distance(&self, i: usize, point: &Vector3<f64>) -> f64 {
        (point - self.point[i]).cross(&self.direction[i]).norm()
    }
}

pub fn rotation(axis: &Vector3<f64>, angle: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Unit::new_unchecked(*axis), angle)
}

/// The angle about `axis` that turns `from` towards `to`.
pub fn angle_between(axis: &Vector3<f64>, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
    let sine = axis.dot(&from.cross(to));
    let cosine = from.dot(to) - axis.dot(from) * axis.dot(to);
    sine.atan2(cosine)
}

/// The angle of a rotation about `axis`.
pub fn angle_about(axis: &Vector3<f64>, rotation: &Matrix3<f64>) -> f64 {
    let m = rotation;
    let v = Vector3::new(
        m[(2, 1)] - m[(1, 2)],
        m[(0, 2)] - m[(2, 0)],
        m[(1, 0)] - m[(0, 1)],
    );
    axis.dot(&v).atan2(m.trace() - 1.0)
}

/// The two angles about `axis` that bring `point` to where its part along `direction` is `length`. None if it stays far from
/// there. If it misses by a hair, as rounding and the axes of a calibrated arm make it, two angles as far from where it is
/// nearest as if it went beyond by that hair: exactly there an arm is singular, and no step would lead away.
pub fn angles_reaching(
    axis: &Vector3<f64>,
    point: &Vector3<f64>,
    direction: &Vector3<f64>,
    length: f64,
) -> Option<[f64; 2]> {
    let along = axis.dot(point);
    let a = direction.dot(&(point - axis * along));
    let b = direction.dot(&axis.cross(point));
    let c = length - direction.dot(axis) * along;
    let r = a.hypot(b);
    if c.abs() > r + MISS || c.is_nan() {
        return None;
    }
    let middle = b.atan2(a);
    let side = (r * r - c * c).abs().sqrt().atan2(c);
    Some([middle + side, middle - side])
}
