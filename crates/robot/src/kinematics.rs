use nalgebra::{IsometryMatrix3, Matrix6, Rotation3, Translation3, Vector3};

use super::arm::{Arm, Joint, Joints};
use super::place::Pose;

/// Length by which turning is compared with moving [m]: about that of a forearm.
const LENGTH: f64 = 0.5;

/// The root of r^7 = r + 1.
const ROOT: f64 = 1.112_775_684_278_706;

impl Joint {
    /// What the joint does to its own frame at an angle.
    fn turn(&self, angle: f64) -> Pose {
        let turned = Rotation3::from_axis_angle(&self.axis, angle);
        self.origin * IsometryMatrix3::from_parts(Translation3::identity(), turned)
    }
}

impl Arm {
    /// Frames of all links in the base's, the base first.
    pub fn forward(&self, joints: &Joints) -> [Pose; 7] {
        let mut frames = [Pose::identity(); 7];
        for (k, (joint, &angle)) in self.joints.iter().zip(joints).enumerate() {
            frames[k + 1] = frames[k] * joint.turn(angle);
        }
        frames
    }

    /// The flange in the base's frame.
    pub fn flange_at(&self, joints: &Joints) -> Pose {
        self.forward(joints)[6] * self.flange
    }

    /// How a point at `at` in the base's frame, fixed to the flange, moves with each joint: velocity [m] above, angular
    /// velocity [rad] below, for a radian each.
    pub fn jacobian(&self, joints: &Joints, at: &Vector3<f64>) -> Matrix6<f64> {
        let frames = self.forward(joints);
        let mut jacobian = Matrix6::zeros();
        for (k, joint) in self.joints.iter().enumerate() {
            let frame = frames[k + 1];
            let axis = frame.rotation * joint.axis.into_inner();
            let arm = at - frame.translation.vector;
            jacobian
                .fixed_view_mut::<3, 1>(0, k)
                .copy_from(&axis.cross(&arm));
            jacobian.fixed_view_mut::<3, 1>(3, k).copy_from(&axis);
        }
        jacobian
    }

    /// Least singular value of the Jacobian of the flange, its moves taken as shares of half a metre: 0 where the arm cannot
    /// move in some direction, about 1 at best.
    pub fn sigma_min(&self, joints: &Joints) -> f64 {
        let at = self.flange_at(joints).translation.vector;
        let mut jacobian = self.jacobian(joints, &at);
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
}
