//! All poses of an arm that bring its flange somewhere.
//!
//! Where the second and third axes are parallel and across the first, a point that later joints leave where it is fixes
//! the first three in closed form, four ways. What follows depends on the wrist. Where axes 4, 5 and 6 meet in a point it
//! is that point, and two ways to turn remain. Where only 4 and 5 meet, as in arms that carry people's hands, the point is
//! known once joint 6 is: its roots are searched along that one angle (Abbes and Poisson 2024). Where axis 4 is parallel
//! to 2 and 3 instead, axes 5 and 6 meet, and all is closed. Any other arm is left to Levenberg and Marquardt.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix6, Point3, Rotation3, Unit, UnitQuaternion, Vector3, Vector6};

use super::arm::{Arm, Joints};
use super::place::Pose;
use plane::{BRANCHES, Plane, angle};
use roots::{bisect, edge, lowest};

mod plane;
mod roots;

/// Solves an arm.
#[derive(Clone, Debug)]
pub struct Solver {
    arm: Arm,
    wrist: Wrist,
    /// None for a wrist of no kind that is known.
    plane: Option<Plane>,
    /// Frames of the links at angles 0, and in the base the point that the wrist turns about: where axes 4 and 5 meet, or 5
    /// and 6 where 4 is parallel to those before it.
    rest: [Pose; 7],
    point: Point3<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wrist {
    /// All three axes meet.
    Spherical,
    /// The first two meet.
    Offset,
    /// Axis 4 is parallel to those before it, 5 and 6 meet.
    Parallel,
    Other,
}

/// Places [m] and directions alike to this are the same.
const SAME: f64 = 1e-7;
/// Angles of joint 6 at which a root is looked for.
const SAMPLES: usize = 96;
/// Two solutions nearer than this are one [rad].
const DISTINCT: f64 = 1e-6;
/// Steps of Levenberg and Marquardt at most, and what they come to [m and rad].
const STEPS: usize = 40;
const SOLVED: f64 = 1e-11;
/// Change of a joint at most when a pose is followed [rad].
const FOLLOWED: f64 = 0.6;

impl Solver {
    /// Looks at how the axes of an arm lie.
    pub fn new(arm: &Arm) -> Self {
        let frames = arm.forward(&[0.0; 6]);
        let axis = |k: usize| frames[k].rotation * arm.joints[k - 1].axis.into_inner();
        let at = |k: usize| frames[k].translation.vector;
        let parallel = |a: usize, b: usize| axis(a).cross(&axis(b)).norm() < SAME;
        let meet = |a: usize, b: usize| meeting((at(a), axis(a)), (at(b), axis(b)));
        let is_planar = parallel(2, 3) && axis(1).dot(&axis(2)).abs() < SAME;
        let spherical = meet(4, 5).filter(|p| (p - at(6)).cross(&axis(6)).norm() < SAME);
        let is_across = |a: usize, b: usize| !parallel(a, b);
        let (wrist, point) = match (is_planar, spherical, meet(4, 5), meet(5, 6)) {
            (true, Some(point), _, _) if is_across(4, 5) && is_across(5, 6) => {
                (Wrist::Spherical, Some(point))
            }
            (true, _, _, Some(point))
                if parallel(3, 4) && is_across(5, 6) && axis(4).dot(&axis(5)).abs() < SAME =>
            {
                (Wrist::Parallel, Some(point))
            }
            (true, _, Some(point), _) if is_across(4, 5) => (Wrist::Offset, Some(point)),
            _ => (Wrist::Other, None),
        };
        let plane = point.map(|point| {
            // Of the chain of two links, its end: the wrist, or axis 4 where that is parallel.
            let end = match wrist {
                Wrist::Parallel => at(4),
                _ => point,
            };
            let (z, y) = (axis(1), axis(2));
            let turned = Rotation3::from_basis_unchecked(&[y.cross(&z), y, z]);
            let frame = Pose::from_parts(at(1).into(), turned);
            let flat = |p: Vector3<f64>| {
                let p = (frame.inverse() * Point3::from(p)).coords;
                [p.x, p.z]
            };
            let (shoulder, elbow, end) = (flat(at(2)), flat(at(3)), flat(end));
            let [upper, lower] =
                [[shoulder, elbow], [elbow, end]].map(|[a, b]| [b[0] - a[0], b[1] - a[1]]);
            Plane {
                frame,
                sign: axis(2).dot(&axis(3)).signum(),
                shoulder,
                lengths: [upper, lower].map(|[x, z]| x.hypot(z)),
                angles: [upper, lower].map(angle),
                lower: lower.map(|x| x / lower[0].hypot(lower[1])),
                beside: (frame.inverse() * Point3::from(point)).y,
                axis_4: frame.rotation.inverse() * axis(4),
            }
        });
        Self {
            arm: arm.clone(),
            wrist,
            plane,
            rest: frames,
            point: point.unwrap_or_default().into(),
        }
    }

    /// Axis `k`, counted from 1, at angles 0 in the base.
    fn axis(&self, k: usize) -> Vector3<f64> {
        self.rest[k].rotation * self.arm.joints[k - 1].axis.into_inner()
    }

    /// All poses within the limits that bring the flange there, each joint as near to 0 as turns allow.
    pub fn solve(&self, flange: &Pose) -> Vec<Joints> {
        let link = flange * self.arm.flange.inverse();
        let found = match (self.wrist, &self.plane) {
            (Wrist::Spherical, Some(plane)) => self.spherical(plane, &link),
            (Wrist::Offset, Some(plane)) => self.offset(plane, &link),
            (Wrist::Parallel, Some(plane)) => self.parallel(plane, &link),
            _ => Vec::new(),
        };
        let mut solutions: Vec<Joints> = Vec::new();
        for joints in found {
            if let Some(joints) = self.refine(flange, joints, 8) {
                self.keep(&mut solutions, joints);
            }
        }
        if self.wrist == Wrist::Other {
            for start in self.starts() {
                if let Some(joints) = self.refine(flange, start, STEPS) {
                    self.keep(&mut solutions, joints);
                }
            }
        }
        solutions.sort_by(|a, b| a.partial_cmp(b).expect("angles are finite"));
        solutions
    }

    /// The pose that brings the flange there, coming from one nearby.
    pub fn follow(&self, flange: &Pose, from: &Joints) -> Option<Joints> {
        let joints = self.newton(flange, *from, STEPS)?;
        let is_near = joints
            .iter()
            .zip(from)
            .all(|(a, b)| (a - b).abs() < FOLLOWED);
        (is_near && self.arm.is_within_limits(&joints)).then_some(joints)
    }

    fn keep(&self, solutions: &mut Vec<Joints>, joints: Joints) {
        let mut joints = joints.map(|q| q - TAU * (q / TAU).round());
        // As near to 0 as the limits have it.
        for (q, joint) in joints.iter_mut().zip(&self.arm.joints) {
            let [min, max] = joint.limits;
            let turned = [0.0, TAU, -TAU].map(|turn| *q + turn);
            match turned.into_iter().find(|q| (min..=max).contains(q)) {
                Some(angle) => *q = angle,
                None => return,
            }
        }
        let apart = |other: &Joints| {
            let angle = |(a, b): (&f64, &f64)| {
                let d = (a - b).abs() % TAU;
                d.min(TAU - d)
            };
            joints.iter().zip(other).map(angle).fold(0.0, f64::max)
        };
        if solutions.iter().all(|other| apart(other) > DISTINCT) {
            solutions.push(joints);
        }
    }

    /// What a closed form has found, to the last digits; none if it was none.
    fn refine(&self, flange: &Pose, joints: Joints, steps: usize) -> Option<Joints> {
        joints
            .iter()
            .all(|q| q.is_finite())
            .then(|| self.newton(flange, joints, steps))?
    }

    /// Levenberg and Marquardt from a pose on.
    fn newton(&self, flange: &Pose, mut joints: Joints, steps: usize) -> Option<Joints> {
        let miss = |joints: &Joints| {
            let at = self.arm.flange_at(joints);
            let turned = rotation_vector(&(flange.rotation * at.rotation.inverse()));
            let moved = flange.translation.vector - at.translation.vector;
            (
                Vector6::new(moved.x, moved.y, moved.z, turned.x, turned.y, turned.z),
                at,
            )
        };
        let (mut error, mut at) = miss(&joints);
        let mut damping: f64 = 0.0;
        for _ in 0..steps {
            if error.norm() < SOLVED {
                break;
            }
            let jacobian = self.arm.jacobian(&joints, &at.translation.vector);
            let mut is_better = false;
            for _ in 0..8 {
                // Undamped without squares, which lose half of the digits.
                let step = match damping {
                    0.0 => jacobian.lu().solve(&error),
                    _ => {
                        let square =
                            jacobian.transpose() * jacobian + Matrix6::identity() * damping;
                        square
                            .cholesky()
                            .map(|factor| factor.solve(&(jacobian.transpose() * error)))
                    }
                };
                // No farther than linear.
                let step = step.filter(|step| step.iter().all(|x| x.is_finite()));
                let next = step.map(|step| step * (0.5 / step.amax()).min(1.0));
                let next = next.map(|step| std::array::from_fn(|j| joints[j] + step[j]));
                let next = next.map(|next: Joints| (next, miss(&next)));
                match next {
                    Some((next, (next_error, next_at))) if next_error.norm() < error.norm() => {
                        (joints, error, at) = (next, next_error, next_at);
                        damping = if damping < 1e-8 { 0.0 } else { 0.1 * damping };
                        is_better = true;
                        break;
                    }
                    _ => damping = (10.0 * damping).max(1e-8),
                }
            }
            if !is_better {
                break;
            }
        }
        // Near a singularity digits are lost.
        (error.norm() < 1e-9).then_some(joints)
    }

    /// Poses from which any arm is tried.
    fn starts(&self) -> impl Iterator<Item = Joints> {
        let joints = self.arm.joints.each_ref();
        let ranges = joints.map(|joint| joint.limits.map(|limit| limit.clamp(-PI, PI)));
        (0..48).map(move |k| Arm::spread(k, &ranges))
    }

    /// Rotation of link 3 in the base for its first joints, before joint 4.
    fn before_wrist(&self, arm: [f64; 3]) -> Rotation3<f64> {
        let mut turned = Rotation3::identity();
        for (joint, angle) in self.arm.joints.iter().zip(arm) {
            turned =
                turned * joint.origin.rotation * Rotation3::from_axis_angle(&joint.axis, angle);
        }
        turned * self.arm.joints[3].origin.rotation
    }

    fn spherical(&self, plane: &Plane, link: &Pose) -> Vec<Joints> {
        let [_, _, _, four, five, six] = &self.arm.joints;
        // On axis 6, and so where it is whatever that joint does.
        let point = (link * self.rest[6].inverse() * self.point).coords;
        let mut all = Vec::new();
        for arm in plane.reach(&point) {
            let before = self.before_wrist(arm);
            // Joint 5 brings axis 6 to its angle with axis 4, joint 4 turns it there.
            let to = before.inverse() * (link.rotation * six.axis.into_inner());
            let from = |q5: f64| {
                let turned = five.origin.rotation * Rotation3::from_axis_angle(&five.axis, q5);
                turned * (six.origin.rotation * six.axis.into_inner())
            };
            for q5 in angles_of(&from, &four.axis, to.dot(&four.axis)) {
                let q4 = angle_about(&four.axis, &from(q5), &to);
                let turned =
                    before * Rotation3::from_axis_angle(&four.axis, q4) * five.origin.rotation;
                let turned =
                    turned * Rotation3::from_axis_angle(&five.axis, q5) * six.origin.rotation;
                let q6 = turn_about(&six.axis, &(turned.inverse() * link.rotation));
                all.push([arm[0], arm[1], arm[2], q4, q5, q6]);
            }
        }
        all
    }

    fn offset(&self, plane: &Plane, link: &Pose) -> Vec<Joints> {
        let [.., four, five, six] = &self.arm.joints;
        // Of link 5: the point and axis 5.
        let point = self.rest[5].inverse() * self.point;
        let between = self.axis(4).dot(&self.axis(5));
        let link_5 = |q6: f64| {
            let turned = Rotation3::from_axis_angle(&six.axis, -q6);
            link * Pose::from_parts(nalgebra::Translation3::identity(), turned)
                * six.origin.inverse()
        };
        let into_plane = plane.frame.inverse();
        // Where the point and axis 5 are in the plane's frame.
        let at = |q6: f64| {
            let frame = into_plane * link_5(q6);
            (frame * point, frame.rotation * five.axis.into_inner())
        };
        // What is missing from the angle between axes 4 and 5, in one of four branches.
        let missing = |q6: f64, branch: usize| {
            let (point, axis) = at(q6);
            plane
                .axis_4(&point.coords, branch)
                .map_or(f64::NAN, |axis_4| axis_4.dot(&axis) - between)
        };
        let step = TAU / SAMPLES as f64;
        let sample = |k: usize| {
            let (point, axis) = at(k as f64 * step);
            [0, 1, 2, 3].map(|branch| {
                let axis_4 = plane.axis_4(&point.coords, branch);
                axis_4.map_or(f64::NAN, |axis_4| axis_4.dot(&axis) - between)
            })
        };
        let samples: Vec<[f64; 4]> = (0..SAMPLES).map(sample).collect();
        let mut all = Vec::new();
        let mut add = |q6: f64, branch: usize| {
            let to = link_5(q6);
            let Some(arm) = plane.branches(&(to * point).coords)[branch] else {
                return;
            };
            let to = self.before_wrist(arm).inverse() * to.rotation;
            let axis_5 = five.origin.rotation * five.axis.into_inner();
            let q4 = angle_about(&four.axis, &axis_5, &(to * five.axis.into_inner()));
            let turned = Rotation3::from_axis_angle(&four.axis, q4) * five.origin.rotation;
            let q5 = turn_about(&five.axis, &(turned.inverse() * to));
            all.push([arm[0], arm[1], arm[2], q4, q5, q6]);
        };
        let sampled = |k: usize, branch: usize| samples[k % SAMPLES][branch];
        for branch in 0..BRANCHES {
            let at = |k: usize| sampled(k, branch);
            for k in 0..SAMPLES {
                let [before, here, next] = [at(k + SAMPLES - 1), at(k), at(k + 1)];
                let q6 = k as f64 * step;
                let value = |q6: f64| missing(q6, branch);
                if here * next <= 0.0 {
                    add(bisect(value, [q6, q6 + step], here), branch);
                } else if here.is_nan() != next.is_nan() {
                    // A branch begins or ends between: a root may lie beside its end.
                    let known = if here.is_nan() {
                        [q6 + step, q6]
                    } else {
                        [q6, q6 + step]
                    };
                    let (end, last) = edge(value, known);
                    let first = value(known[0]);
                    if first * last <= 0.0 {
                        add(bisect(value, [known[0], end], first), branch);
                    } else {
                        let ends = [known[0].min(end), known[0].max(end)];
                        let (low, least) = lowest(value, ends, first.signum());
                        if least * first < 0.0 {
                            add(bisect(value, [known[0], low], first), branch);
                            add(bisect(value, [low, end], least), branch);
                        } else if least.abs() < 1e-2 {
                            add(low, branch);
                            add(end, branch);
                        }
                    }
                } else if (here.abs() < before.abs() || before.is_nan()) && here.abs() <= next.abs()
                {
                    // Nearest to 0 here: perhaps it touches it, or passes twice.
                    let (low, least) = lowest(value, [q6 - step, q6 + step], here.signum());
                    if least * here.signum() < 0.0 {
                        add(bisect(value, [q6 - step, low], before), branch);
                        add(bisect(value, [low, q6 + step], least), branch);
                    } else if least.abs() < 1e-4 {
                        add(low, branch);
                    }
                }
            }
        }
        all
    }

    fn parallel(&self, plane: &Plane, link: &Pose) -> Vec<Joints> {
        let [_, _, _, four, five, six] = &self.arm.joints;
        let point = (link * self.rest[6].inverse() * self.point).coords;
        let axis_6 = link.rotation * six.axis.into_inner();
        let mut all = Vec::new();
        for (q1, _) in plane.turns(&point).into_iter().flatten() {
            let one = &self.arm.joints[0];
            let first = one.origin.rotation * Rotation3::from_axis_angle(&one.axis, q1);
            // In which 2, 3 and 4 turn as one about an axis that stays.
            let axis_2 =
                first * (self.arm.joints[1].origin.rotation * self.arm.joints[1].axis.into_inner());
            let sense = self.axis(2).dot(&self.axis(4)).signum();
            // Axis 6 against axis 4 is joint 5's.
            let from = |q5: f64| {
                let turned = five.origin.rotation * Rotation3::from_axis_angle(&five.axis, q5);
                turned * (six.origin.rotation * six.axis.into_inner())
            };
            for q5 in angles_of(&from, &four.axis, sense * axis_6.dot(&axis_2)) {
                // What 2, 3 and 4 have turned together: axis 6 goes where it shall; where it lies along them, anywhere.
                let straight = first * self.rest_of(1);
                let here = straight * from(q5);
                let total = angle_about(&Unit::new_normalize(axis_2), &here, &axis_6);
                let turned =
                    Rotation3::from_axis_angle(&Unit::new_normalize(axis_2), total) * straight;
                let turned = turned
                    * five.origin.rotation
                    * Rotation3::from_axis_angle(&five.axis, q5)
                    * six.origin.rotation;
                let q6 = turn_about(&six.axis, &(turned.inverse() * link.rotation));
                // Where axis 4 then is: back from joint 6.
                let five_frame = link * (six.origin * about(&six.axis, q6)).inverse();
                let four_frame = five_frame * (five.origin * about(&five.axis, q5)).inverse();
                let end = four_frame.translation.vector;
                for arm in plane.fold(&end, q1).into_iter().flatten() {
                    let [_, q2, q3] = arm;
                    let q4 = sense * (total - q2 - plane.sign * q3);
                    all.push([q1, q2, q3, q4, q5, q6]);
                }
            }
        }
        all
    }

    /// Rotation from behind joint `from` to before joint 5 at angles 0.
    fn rest_of(&self, from: usize) -> Rotation3<f64> {
        let joints = &self.arm.joints[from..4];
        joints.iter().fold(Rotation3::identity(), |turned, joint| {
            turned * joint.origin.rotation
        })
    }
}

fn about(axis: &Unit<Vector3<f64>>, angle: f64) -> Pose {
    Pose::from_parts(
        nalgebra::Translation3::identity(),
        Rotation3::from_axis_angle(axis, angle),
    )
}

/// By which `from` has to turn about an axis to point where `to` does, seen along it.
fn angle_about(axis: &Unit<Vector3<f64>>, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
    let flat = |v: &Vector3<f64>| v - axis.into_inner() * v.dot(axis);
    let (from, to) = (flat(from), flat(to));
    if from.norm().min(to.norm()) < 1e-9 {
        return 0.0;
    }
    axis.dot(&from.cross(&to)).atan2(from.dot(&to))
}

/// The angle of a rotation about an axis.
fn turn_about(axis: &Unit<Vector3<f64>>, turned: &Rotation3<f64>) -> f64 {
    let across = Unit::new_normalize(Vector3::ith(axis.iamin(), 1.0).cross(axis));
    angle_about(axis, &across, &(turned * across.into_inner()))
}

/// Both angles at which a vector that turns about an axis has a given component along another: `a cos q + b sin q + c`.
fn angles_of(
    turned: &impl Fn(f64) -> Vector3<f64>,
    along: &Unit<Vector3<f64>>,
    component: f64,
) -> [f64; 2] {
    let [here, quarter, half] = [0.0, 0.5 * PI, PI].map(|q| turned(q).dot(along));
    let (c, a) = (0.5 * (here + half), 0.5 * (here - half));
    let b = quarter - c;
    let cos = ((component - c) / a.hypot(b)).clamp(-1.0, 1.0);
    let middle = b.atan2(a);
    [middle + cos.acos(), middle - cos.acos()]
}

/// Axis times angle; to the last digit where that is small, which the trace would lose.
fn rotation_vector(turned: &Rotation3<f64>) -> Vector3<f64> {
    let m = turned.matrix();
    let sine = 0.5
        * Vector3::new(
            m[(2, 1)] - m[(1, 2)],
            m[(0, 2)] - m[(2, 0)],
            m[(1, 0)] - m[(0, 1)],
        );
    match sine.norm() {
        small if small < 0.1 && m.trace() > 2.0 => sine * (1.0 + small * small / 6.0),
        _ => UnitQuaternion::from_rotation_matrix(turned).scaled_axis(),
    }
}

/// Where two lines meet, if they do.
fn meeting(
    (a, u): (Vector3<f64>, Vector3<f64>),
    (b, v): (Vector3<f64>, Vector3<f64>),
) -> Option<Vector3<f64>> {
    let normal = u.cross(&v);
    let square = normal.norm_squared();
    if square < SAME {
        return None;
    }
    let way = b - a;
    let meet = a + u * (way.cross(&v).dot(&normal) / square);
    (way.dot(&normal).abs() / square.sqrt() < SAME).then_some(meet)
}
