use nalgebra::Vector3;

use crate::place::Pose;

/// Ways in which joints 1 to 3 bring a point somewhere: in front or behind, folded one way or the other.
pub(super) const BRANCHES: usize = 4;

/// The plane in which joints 2 and 3 move a point, turned by joint 1 about the base's first axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    /// The frame of the first axis: its z is the axis, y that of joints 2 and 3.
    pub frame: Pose,
    /// -1 where joint 3 turns about the negative y.
    pub sign: f64,
    /// Of joints 2 and 3 across y, in x and z.
    pub shoulder: [f64; 2],
    /// Lengths of both links, and how they point at angles 0.
    pub lengths: [f64; 2],
    pub angles: [f64; 2],
    /// The second as a unit vector.
    pub lower: [f64; 2],
    /// How far beyond the plane through the first axis the point is, along y.
    pub beside: f64,
    /// Axis 4 at angles 0, in this frame.
    pub axis_4: Vector3<f64>,
}

impl Plane {
    /// Angles of joint 1 that bring a point into the plane, and how far out it then is; in front or behind.
    pub fn turns(&self, point: &Vector3<f64>) -> [Option<(f64, [f64; 2])>; 2] {
        let p = (self.frame.inverse() * nalgebra::Point3::from(*point)).coords;
        let square = p.x * p.x + p.y * p.y - self.beside * self.beside;
        if square < 0.0 {
            return [None; 2];
        }
        let out = square.sqrt();
        [out, -out].map(|out| {
            let q1 = p.y.atan2(p.x) - self.beside.atan2(out);
            Some((q1, [out, p.z]))
        })
    }

    /// Joints 2 and 3 that bring the end of the chain to a point, both ways to fold, for an angle of joint 1.
    pub fn fold(&self, point: &Vector3<f64>, q1: f64) -> [Option<[f64; 3]>; 2] {
        let p = (self.frame.inverse() * nalgebra::Point3::from(*point)).coords;
        let (sin, cos) = q1.sin_cos();
        self.fold_flat([cos * p.x + sin * p.y, p.z], q1)
    }

    fn fold_flat(&self, [x, z]: [f64; 2], q1: f64) -> [Option<[f64; 3]>; 2] {
        let to = [x - self.shoulder[0], z - self.shoulder[1]];
        let [a, b] = self.lengths;
        let cos = (to[0] * to[0] + to[1] * to[1] - a * a - b * b) / (2.0 * a * b);
        // Stretched out by rounding.
        if cos.is_nan() || cos.abs() > 1.0 + 1e-9 {
            return [None; 2];
        }
        let bend = cos.clamp(-1.0, 1.0).acos();
        [bend, -bend].map(|bend| {
            let upper = angle(to) - (b * bend.sin()).atan2(a + b * bend.cos());
            let q2 = upper - self.angles[0];
            let q3 = bend - (self.angles[1] - self.angles[0]);
            Some([q1, q2, self.sign * q3])
        })
    }

    /// Joints 1 to 3 that bring the wrist to a point, none where it is out of reach: in front or behind, folded one way or
    /// the other.
    pub fn branches(&self, point: &Vector3<f64>) -> [Option<[f64; 3]>; 4] {
        let [front, behind] = self.turns(point).map(|turn| match turn {
            Some((q1, flat)) => self.fold_flat(flat, q1),
            None => [None; 2],
        });
        [front[0], front[1], behind[0], behind[1]]
    }

    /// Axis 4 in this frame where a branch, counted as in [`Plane::branches`], has the wrist at a point of this frame:
    /// without angles, as roots are searched with it.
    pub fn axis_4(&self, p: &Vector3<f64>, branch: usize) -> Option<Vector3<f64>> {
        let radius = p.x * p.x + p.y * p.y;
        let square = radius - self.beside * self.beside;
        if square < 0.0 {
            return None;
        }
        let out = if branch < 2 {
            square.sqrt()
        } else {
            -square.sqrt()
        };
        let [x, z] = [out - self.shoulder[0], p.z - self.shoulder[1]];
        let [a, b] = self.lengths;
        let far = x * x + z * z;
        let cos = (far + a * a - b * b) / (2.0 * a * far.sqrt());
        if cos.is_nan() || cos.abs() > 1.0 {
            return None;
        }
        let sin = (1.0 - cos * cos).sqrt() * if branch & 1 == 0 { 1.0 } else { -1.0 };
        // The upper link is turned back from the way to the wrist, towards -x where that leads along z.
        let scale = a / far.sqrt();
        let upper = [scale * (cos * x - sin * z), scale * (cos * z + sin * x)];
        let lower = [(x - upper[0]) / b, (z - upper[1]) / b];
        // By which it is turned from where it points at angles 0.
        let (c, s) = (
            lower[0] * self.lower[0] + lower[1] * self.lower[1],
            lower[0] * self.lower[1] - lower[1] * self.lower[0],
        );
        let [ax, ay, az] = self.axis_4.into();
        let (ax, az) = (c * ax + s * az, c * az - s * ax);
        let (c, s) = (
            (out * p.x + self.beside * p.y) / radius,
            (out * p.y - self.beside * p.x) / radius,
        );
        Some(Vector3::new(c * ax - s * ay, s * ax + c * ay, az))
    }

    pub fn reach(&self, point: &Vector3<f64>) -> impl Iterator<Item = [f64; 3]> {
        self.branches(point).into_iter().flatten()
    }
}

/// Direction in the plane, as joints about y count it: from x towards -z.
pub(super) fn angle([x, z]: [f64; 2]) -> f64 {
    (-z).atan2(x)
}
