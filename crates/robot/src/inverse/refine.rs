use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use crate::arm::{Arm, Joints};
use crate::place::Pose;

/// Steps at most from nearly a solution, and from anywhere.
pub const POLISH: usize = 12;
pub const SEARCH: usize = 60;

/// Error of a solution at most [m and rad].
const ACCURACY: f64 = 1e-10;
/// Error that is rounding [m and rad]: no step makes it less.
const ROUNDING: f64 = 4e-15;

/// Moves `joints` to a solution by at most so many steps of the method of Levenberg and Marquardt, which are those of Newton
/// near one. None if that leads to none.
pub fn refine(arm: &Arm, flange: &Pose, joints: &Joints, steps: usize) -> Option<Joints> {
    let mut joints = *joints;
    let mut frames = arm.forward(&joints);
    let mut e = error(flange, &(frames[6] * arm.flange));
    let mut damping = 1e-2_f64;
    for _ in 0..steps {
        let size = e.norm();
        if size < ROUNDING {
            break;
        }
        let jacobian = arm.jacobian(&frames, &(frames[6] * arm.flange).translation.vector);
        let transposed = jacobian.transpose();
        let mu = damping.min(size * size).max(1e-15);
        let normal = transposed * jacobian + Matrix6::from_diagonal_element(mu);
        let Some(factors) = normal.cholesky() else {
            break;
        };
        let step = factors.solve(&(transposed * e));
        let tried = std::array::from_fn(|i| joints[i] + step[i]);
        let tried_frames = arm.forward(&tried);
        let tried_e = error(flange, &(tried_frames[6] * arm.flange));
        if tried_e.norm() < size {
            (joints, frames, e) = (tried, tried_frames, tried_e);
            damping = (damping / 10.0).max(1e-15);
        } else if size < ACCURACY {
            break;
        } else {
            damping = (mu * 10.0).min(1e3);
        }
    }
    (e.norm() < ACCURACY).then_some(joints)
}

/// What takes the flange from where it is to its pose: the way [m], then the turn about an axis [rad].
fn error(to: &Pose, from: &Pose) -> Vector6<f64> {
    let way = to.translation.vector - from.translation.vector;
    let turn = turn((to.rotation * from.rotation.inverse()).matrix());
    Vector6::new(way.x, way.y, way.z, turn.x, turn.y, turn.z)
}

/// A rotation as an axis times its angle; zero for half a turn, whose axis has two senses.
fn turn(m: &Matrix3<f64>) -> Vector3<f64> {
    let axis = Vector3::new(
        m[(2, 1)] - m[(1, 2)],
        m[(0, 2)] - m[(2, 0)],
        m[(1, 0)] - m[(0, 1)],
    ) / 2.0;
    let sine = axis.norm();
    let angle = sine.atan2((m.trace() - 1.0) / 2.0);
    match sine > 1e-12 {
        true => axis * (angle / sine),
        false => axis,
    }
}
