use std::f64::consts::TAU;

use nalgebra::{IsometryMatrix3, Matrix6, Rotation3, Vector3, Vector6};

use super::arm::{Arm, Joint, Joints};
use super::place::Pose;

/// Length by which turning is compared with moving [m]: about that of a forearm.
const LENGTH: f64 = 0.5;

/// How far beyond a limit an angle still counts as on it [rad].
const SLACK: f64 = 1e-9;

/// The root of r^7 = r + 1.
const ROOT: f64 = 1.112_775_684_278_706;

impl Arm {
    /// Frames of all links in the base's, the base first.
    pub fn forward(&self, joints: &Joints) -> [Pose; 7] {
        let mut frames = [Pose::identity(); 7];
        for (k, (joint, &angle)) in self.joints.iter().zip(joints).enumerate() {
            let turn = Rotation3::from_axis_angle(&joint.axis, angle);
            let at = frames[k] * joint.origin;
            frames[k + 1] = IsometryMatrix3::from_parts(at.translation, at.rotation * turn);
        }
        frames
    }

    /// The flange in the base's frame.
    pub fn flange_at(&self, joints: &Joints) -> Pose {
        self.forward(joints)[6] * self.flange
    }

    /// How a point at `at` in the base's frame, fixed to the flange, moves with each joint: velocity [m] above, angular
    /// velocity [rad] below, for a radian each; where the frames of the links are known.
    pub(crate) fn jacobian(&self, frames: &[Pose; 7], at: &Vector3<f64>) -> Matrix6<f64> {
        let columns = std::array::from_fn::<_, 6, _>(|k| {
            let frame = &frames[k + 1];
            let axis = frame.rotation * *self.joints[k].axis;
            let v = axis.cross(&(at - frame.translation.vector));
            Vector6::new(v.x, v.y, v.z, axis.x, axis.y, axis.z)
        });
        Matrix6::from_columns(&columns)
    }

    /// Least singular value of the Jacobian of the flange, its moves taken as shares of half a metre: 0 where the arm cannot
    /// move in some direction, about 1 at best.
    pub fn sigma_min(&self, joints: &Joints) -> f64 {
        let frames = self.forward(joints);
        let at = (frames[6] * self.flange).translation.vector;
        let mut jacobian = self.jacobian(&frames, &at);
        jacobian.fixed_view_mut::<3, 6>(0, 0).unscale_mut(LENGTH);
        jacobian.singular_values().min()
    }

    /// The `k`-th of poses that are spread evenly over ranges of the joints [rad], the same for everyone: multiples of the
    /// powers of 1/r, the root of r^7 = r + 1, which fill six dimensions (Roberts 2018).
    pub(crate) fn spread(k: u64, ranges: &[[f64; 2]; 6]) -> Joints {
        std::array::from_fn(|j| {
            let [min, max] = ranges[j];
            let step = ROOT.powi(-(j as i32 + 1));
            min + (max - min) * (0.5 + k as f64 * step).fract()
        })
    }

    /// Whether all joints are within their limits.
    pub fn is_within_limits(&self, joints: &Joints) -> bool {
        let within = |(q, joint): (&f64, &Joint)| (joint.limits[0]..=joint.limits[1]).contains(q);
        joints.iter().zip(&self.joints).all(within)
    }

    /// `joints` turned wholly into the limits, each as near to 0 as can be.
    pub(crate) fn wound(&self, joints: &Joints) -> Option<Joints> {
        let mut wound = *joints;
        for (angle, joint) in wound.iter_mut().zip(&self.joints) {
            let [min, max] = joint.limits;
            let first = *angle - TAU * ((*angle - min + SLACK) / TAU).floor();
            let turns = ((max + SLACK - first) / TAU).floor() as i64;
            let all = (0..=turns).map(|turn| (first + TAU * turn as f64).clamp(min, max));
            *angle = all.min_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        }
        Some(wound)
    }
}
