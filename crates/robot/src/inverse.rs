//! Joints that bring the flange to a pose.
//!
//! An [`InverseSolver`] looks at the axes of an arm, not at its name, for a geometry that it can solve in closed form. What that
//! gives is refined on the arm as it is: axes may miss the pattern a little, as calibrated ones do.

mod axes;
mod offset;
mod parallel;
mod position;
mod refine;
mod roots;
mod spherical;

use axes::Axes;
use offset::OffsetWrist;
use parallel::ThreeParallel;
use spherical::SphericalWrist;

use super::arm::{Arm, Joints};
use super::place::Pose;

/// Solutions whose angles all agree to this are one [rad].
const DISTINCT: f64 = 1e-6;
/// Joints from which an arm without a pattern is searched.
const STARTS: u64 = 96;
/// How far an angle may be from where it was to continue a motion [rad].
const NEARBY: f64 = 0.5;

/// Finds all joints for a pose of an arm's flange.
#[derive(Clone, Debug)]
pub struct InverseSolver {
    arm: Arm,
    geometry: Geometry,
}

/// How the axes of an arm lie, in the order in which the patterns are tried.
#[derive(Clone, Debug)]
enum Geometry {
    Spherical(SphericalWrist),
    Parallel(ThreeParallel),
    Offset(Box<OffsetWrist>),
    General,
}

impl InverseSolver {
    /// Prepares for an arm.
    pub fn new(arm: &Arm) -> Self {
        let axes = Axes::of(arm);
        let geometry = None
            .or_else(|| SphericalWrist::of(&axes).map(Geometry::Spherical))
            .or_else(|| ThreeParallel::of(&axes).map(Geometry::Parallel))
            .or_else(|| OffsetWrist::of(&axes).map(|wrist| Geometry::Offset(Box::new(wrist))))
            .unwrap_or(Geometry::General);
        let hulls = Default::default();
        let arm = Arm {
            hulls,
            ..arm.clone()
        };
        Self { arm, geometry }
    }

    /// Joints within the limits that bring the flange to a pose in the base's frame, distinct and in ascending order, the
    /// first joint foremost; none where there are none. Of angles that differ by whole turns it has the one nearest to zero.
    ///
    /// All solutions of an arm whose axes lie in a pattern, but where infinitely many or two of them meet: at a singularity. If
    /// the axes miss the pattern a little, solutions near singularities may be missing, and of an arm without a pattern it has
    /// those that a search from fixed starts finds.
    pub fn solve(&self, flange: &Pose) -> Vec<Joints> {
        let moved = flange * self.arm.flange_at(&[0.0; 6]).inverse();
        let mut found = Found::new(&self.arm, flange);
        match &self.geometry {
            Geometry::Spherical(wrist) => {
                wrist.solve(&moved, |joints| found.keep(&joints, refine::POLISH))
            }
            Geometry::Parallel(axes) => {
                axes.solve(&moved, |joints| found.keep(&joints, refine::POLISH))
            }
            Geometry::Offset(wrist) => {
                wrist.solve(&moved, |joints| found.keep(&joints, refine::POLISH))
            }
            Geometry::General => {
                let limits = self.arm.joints.each_ref().map(|joint| joint.limits);
                for k in 0..STARTS {
                    found.keep(&Arm::spread(k, &limits), refine::SEARCH);
                }
            }
        }
        found.sorted()
    }

    /// The joints near `from` that bring the flange to a pose, where each angle moves by half a radian at most: for the next
    /// pose of a motion. None where the way there is longer or leads out of the limits.
    pub fn follow(&self, flange: &Pose, from: &Joints) -> Option<Joints> {
        let joints = refine::refine(&self.arm, flange, from, refine::SEARCH)?;
        let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= NEARBY;
        let stays = joints.iter().zip(from).all(is_near) && self.arm.is_within_limits(&joints);
        stays.then_some(joints)
    }
}

/// Distinct solutions for a pose.
struct Found<'a> {
    arm: &'a Arm,
    flange: &'a Pose,
    joints: Vec<Joints>,
}

impl<'a> Found<'a> {
    fn new(arm: &'a Arm, flange: &'a Pose) -> Self {
        let joints = Vec::with_capacity(16);
        Self {
            arm,
            flange,
            joints,
        }
    }

    /// Keeps what `joints` lead to in so many steps at most, if anything.
    fn keep(&mut self, joints: &Joints, steps: usize) {
        let joints = refine::refine(self.arm, self.flange, joints, steps);
        let Some(joints) = joints.and_then(|joints| self.arm.wound(&joints)) else {
            return;
        };
        if !self.joints.iter().any(|other| is_same(other, &joints)) {
            self.joints.push(joints);
        }
    }

    fn sorted(mut self) -> Vec<Joints> {
        let order = |a: &Joints, b: &Joints| {
            let angles = a.iter().zip(b).map(|(a, b)| a.total_cmp(b));
            angles.fold(std::cmp::Ordering::Equal, |order, next| order.then(next))
        };
        self.joints.sort_unstable_by(order);
        self.joints
    }
}

/// Whether two solutions are the same but for whole turns and rounding.
fn is_same(a: &Joints, b: &Joints) -> bool {
    let tau = std::f64::consts::TAU;
    let is_same =
        |(a, b): (&f64, &f64)| ((a - b) / tau - ((a - b) / tau).round()).abs() * tau < DISTINCT;
    a.iter().zip(b).all(is_same)
}
