use std::f64::consts::TAU;

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::axes::{Axes, TOLERANCE, angle_about, angle_between, angles_reaching, rotation};
use super::position::Position;
use super::roots::{SAMPLES, angles_at_zero};
use crate::arm::Joints;
use crate::place::Pose;

/// Greatest cosine between axes 4 and 5 of a candidate, which are perpendicular in a solution.
const CANDIDATE: f64 = 0.02;

/// How near to axis 1 a sample lets the way between samples come to it, and when it is on it [m].
const NEAR_AXIS: f64 = 0.05;
const ON_AXIS: f64 = 2e-3;

/// Where a point of a circle is by its angle: a constant and the factors of the cosine and of the sine.
type Circle = [Vector3<f64>; 3];

/// Axes 4 and 5 meet at a right angle, and axis 6 misses that point: the arms of ABB's GoFa family and their likes
/// (Abbes and Poisson, Robotics 2024, 13, 91).
///
/// The angle q6 of the last joint says where axes 4 and 5 meet, hence up to four ways to bring that point there, by the sign
/// of the shoulder and of the elbow, and for each of them the angle between axes 4 and 5. Where it is a right one there is a
/// solution. Its cosine has branches that begin and end, and turns fast near the first axis, so that a search along them
/// misses solutions. The product of the four cosines, freed of its denominators, has neither: it is a trigonometric
/// polynomial in q6 of degree eight, of which all zeros can be found.
#[derive(Clone, Debug)]
pub struct OffsetWrist {
    position: Position,
    centre: Vector3<f64>,
    h4: Vector3<f64>,
    h5: Vector3<f64>,
    h6: Vector3<f64>,
    /// A point of axis 6 [m].
    p6: Vector3<f64>,
    plane: ArmPlane,
}

/// The plane of the upper arm and the forearm, x away from axis 1 and z along it from the height of axis 2.
#[derive(Clone, Debug)]
struct ArmPlane {
    /// Takes the base's frame, turned by q1, to that of the plane; y is along axis 2.
    rows: Matrix3<f64>,
    /// In the base's frame [m].
    origin: Vector3<f64>,
    /// From axis 1 to axis 2 [m].
    offset: f64,
    /// Squares of the lengths of the upper arm and of the way from the elbow to the wrist's centre [m^2].
    upper: f64,
    lower: f64,
    /// Of the angle from that way to axis 4.
    cos_phi: f64,
    sin_phi: f64,
}

impl OffsetWrist {
    pub fn of(axes: &Axes) -> Option<Self> {
        let centre = axes.meeting(3, 4)?;
        let position = Position::of(axes, &centre)?;
        let [h1, h2, _, h4, h5, h6] = axes.direction;
        let [p1, p2, p3, _, _, p6] = axes.point;
        let is_right = [(0, 1), (1, 3), (3, 4)]
            .iter()
            .all(|(i, j)| axes.are_perpendicular(*i, *j));
        let is_flat = h2.dot(&(centre - p1)).abs() < TOLERANCE;
        let rows = Matrix3::from_rows(&[h2.cross(&h1).transpose(), h2.transpose(), h1.transpose()]);
        let (upper, lower) = (rows * (p3 - p2), rows * (centre - p3));
        let [upper, length] = [upper, lower].map(|v| v.x.hypot(v.z));
        let axis = rows * h4;
        (is_right && is_flat && length > TOLERANCE).then(|| Self {
            position,
            centre,
            h4,
            h5,
            h6,
            p6,
            plane: ArmPlane {
                rows,
                origin: p1 + h1 * h1.dot(&(p2 - p1)),
                offset: (rows * (p2 - p1)).x,
                upper: upper.powi(2),
                lower: length.powi(2),
                cos_phi: (lower.x * axis.x + lower.z * axis.z) / length,
                sin_phi: (lower.x * axis.z - lower.z * axis.x) / length,
            },
        })
    }

    /// Calls `each` with all joints that move the last link by `moved` from where it is at zero.
    pub fn solve(&self, moved: &Pose, mut each: impl FnMut(Joints)) {
        let to_plane = self.plane.rows * moved.rotation.matrix();
        let [mut centre, axis] =
            [self.centre - self.p6, self.h5].map(|v| self.circle(&v).map(|v| to_plane * v));
        let p6 = moved.rotation * self.p6 + moved.translation.vector;
        centre[0] += self.plane.rows * (p6 - self.plane.origin);
        let angle = |k: usize| TAU * k as f64 / SAMPLES as f64;
        let samples = std::array::from_fn(|k| {
            self.plane
                .product(&on(&centre, angle(k)), &on(&axis, angle(k)))
        });
        angles_at_zero(&samples, |q6| {
            let link = moved.rotation * rotation(&self.h6, -q6);
            self.position
                .solve(&(link * (self.centre - self.p6) + p6), |first| {
                    if let Some([q4, q5]) = self.wrist(&first, &link) {
                        each([first[0], first[1], first[2], q4, q5, q6]);
                    }
                });
        });
        // Where the centre comes to axis 1, four zeros meet, and rounding takes them far. Any q1 brings it to the axis; two
        // make axes 4 and 5 perpendicular.
        let radius = |k: usize| on(&centre, angle(k % SAMPLES)).xy().norm();
        for k in 1..=SAMPLES {
            if radius(k) > NEAR_AXIS || radius(k) > radius(k - 1) || radius(k) > radius(k + 1) {
                continue;
            }
            let q6 = nearest_to_axis(&centre, angle(k));
            let at = on(&centre, q6);
            if at.xy().norm() > ON_AXIS {
                continue;
            }
            let link = moved.rotation * rotation(&self.h6, -q6);
            let h1 = self.plane.rows.row(2).transpose();
            let on_axis = self.plane.origin + h1 * at.z;
            self.position.solve(&on_axis, |[_, q2, q3]| {
                let forearm = self.position.rotation(&[0.0, q2, q3]) * self.h4;
                let turned = angles_reaching(&-h1, &(link * self.h5), &forearm, 0.0);
                for q1 in turned.into_iter().flatten() {
                    if let Some([q4, q5]) = self.wrist(&[q1, q2, q3], &link) {
                        each([q1, q2, q3, q4, q5, q6]);
                    }
                }
            });
        }
    }

    /// Angles 4 and 5 behind the `first` three that turn link 5 by `link`, if they nearly can.
    fn wrist(&self, first: &[f64; 3], link: &Rotation3<f64>) -> Option<[f64; 2]> {
        let rest = self.position.rotation(first).inverse() * link;
        let axis = rest * self.h5;
        (self.h4.dot(&axis).abs() < CANDIDATE).then(|| {
            let q4 = angle_between(&self.h4, &self.h5, &axis);
            let left = rotation(&self.h4, -q4) * rest;
            [q4, angle_about(&self.h5, left.matrix())]
        })
    }

    /// A vector turned back about axis 6, by the angle.
    fn circle(&self, v: &Vector3<f64>) -> Circle {
        let along = self.h6 * self.h6.dot(v);
        [along, v - along, v.cross(&self.h6)]
    }
}

/// The point of a circle at an angle.
fn on(circle: &Circle, angle: f64) -> Vector3<f64> {
    let (sin, cos) = angle.sin_cos();
    circle[0] + circle[1] * cos + circle[2] * sin
}

/// The angle near `angle` at which a circle is nearest to the z axis, by Newton's method.
fn nearest_to_axis(circle: &Circle, angle: f64) -> f64 {
    let step = |angle: f64| {
        let p = on(circle, angle).xy();
        let slope = on(&[Vector3::zeros(), circle[2], -circle[1]], angle).xy();
        let bend = circle[0].xy() - p;
        angle - p.dot(&slope) / (slope.norm_squared() + p.dot(&bend))
    };
    (0..4).fold(angle, |angle, _| step(angle))
}

impl ArmPlane {
    /// The product of the cosines between axes 4 and 5 of all four branches, where they meet in `centre` [m] and axis 5 is
    /// along `axis`, both in the frame of the plane at q1 = 0, times what makes it a polynomial.
    ///
    /// In the plane of a branch, `centre` is at (rho, zeta) from axis 2 and `axis` along v = (alpha, beta), turned back by
    /// phi. The unit vector from the elbow to `centre` is (rho, zeta) / sqrt(D) turned by an angle of +-psi, D = rho^2 +
    /// zeta^2, 2 l sqrt(D) cos psi = D + l^2 - L^2 with the lengths L, l of the arm. Hence 4 l^2 D times the product over
    /// both signs is (D + l^2 - L^2)^2 v.v - 4 l^2 (rho beta - zeta alpha)^2, and r^2 times that a polynomial, where the
    /// centre is r from axis 1 and alpha has r for a denominator.
    fn product(&self, centre: &Vector3<f64>, axis: &Vector3<f64>) -> f64 {
        let r = centre.x.hypot(centre.y);
        let (zeta, beta_r) = (centre.z, axis.z * r);
        let side = |sign: f64| {
            let alpha_r = sign * (centre.x * axis.x + centre.y * axis.y);
            let rho = sign * r - self.offset;
            let d = rho * rho + zeta * zeta;
            let turned_alpha = alpha_r * self.cos_phi + beta_r * self.sin_phi;
            let turned_beta = beta_r * self.cos_phi - alpha_r * self.sin_phi;
            let v = alpha_r * alpha_r + beta_r * beta_r;
            (d + self.lower - self.upper).powi(2) * v
                - 4.0 * self.lower * (rho * turned_beta - zeta * turned_alpha).powi(2)
        };
        // Both signs give the same where nothing is offset, and a square would have no zero that is simple.
        match self.offset.abs() < TOLERANCE && self.sin_phi.abs() < TOLERANCE {
            true => side(1.0),
            false => side(1.0) * side(-1.0),
        }
    }
}
