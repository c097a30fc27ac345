//! One pose of the arm, or a short straight way, against everything that a cell forbids.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Rotation3, Translation3, Vector3};

use super::arm::{Arm, Joints};
use super::cell::{CellConfig, LimitsConfig, MotionConfig};
use super::inverse::InverseSolver;
use super::obstacles::{Clearance, ObstacleSurface, Obstacles, Touch, frames};
use super::place::Pose;
use super::roller::RollerShape;

/// What a point of a path has to pass, in the order in which it is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Check {
    /// Some pose of the arm, within its joints' limits, puts the roller there.
    Reach,
    /// The joints stay clear of their limits.
    Limits,
    /// The arm is not near a singularity.
    Singularity,
    /// Nothing is hit.
    Collision,
    /// All that holds between this point and the last, too.
    Between,
    /// And where force control lets the roller deviate.
    Deviation,
    /// The arm gets there from where it is.
    Transfer,
}

/// Why a pose will not do.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fault {
    pub check: Check,
    pub detail: String,
}

impl Fault {
    /// This fault, of a contact that is off by so much.
    fn deviated(&self, by: &str) -> Self {
        Self {
            check: Check::Deviation,
            detail: format!("off by {by}: {}", self.detail),
        }
    }
}

impl Clearance {
    /// That two parts come too near, if they do.
    fn fault(&self) -> Option<Fault> {
        let pair = self.pair.as_ref()?;
        Some(Fault {
            check: Check::Collision,
            detail: match self.distance {
                0.0 => format!("{pair} hit each other"),
                near => format!("{pair} come within {:.1} mm", 1e3 * near),
            },
        })
    }
}

/// An arm in a cell, around a tool.
#[derive(Clone)]
pub struct Cell {
    pub arm: Arm,
    pub(crate) solver: InverseSolver,
    pub(crate) obstacles: Obstacles,
    pub(crate) roller: RollerShape,
    pub(crate) limits: LimitsConfig,
    pub(crate) motion: MotionConfig,
    pub(crate) home: Option<Joints>,
    /// The arm's base in the scene.
    pub base: Pose,
    /// The tool's own frame in the scene, where the turntable is at 0.
    tool: Pose,
    /// Angles of the turntable [rad] and what each does to the scene.
    pub(crate) angles: Vec<f64>,
    turns: Vec<Pose>,
    /// Least and greatest corner of the tool in the scene [m].
    bounds: [Vector3<f64>; 2],
}

/// Distances beyond this are all alike [m].
pub(crate) const FAR: f64 = 0.02;
/// Along a straight way nothing is left out that is longer [m] or turns by more [rad].
pub(crate) const STEP: [f64; 2] = [3e-3, 0.06];

impl Cell {
    /// A cell around a tool, whose surface is in the scene and whose own frame `tool_pose` takes there. Where the
    /// configuration names no base, the arm stands beside the tool; see also [`Cell::best_base`].
    pub fn new(arm: Arm, config: &CellConfig, surface: &ObstacleSurface, tool_pose: &Pose) -> Self {
        let infinite = Vector3::repeat(f64::INFINITY);
        let bounds = surface
            .corners
            .iter()
            .fold([infinite, -infinite], |[min, max], p| {
                [min.inf(p), max.sup(p)]
            });
        let middle = 0.5 * (bounds[0] + bounds[1]);
        let axis = config.turntable.and_then(|table| table.at_mm);
        let [x, y] = axis.map_or([middle.x, middle.y], |at| at.map(|x| 1e-3 * x));
        let axis = Translation3::new(x, y, 0.0);
        let angles = config.station_angles();
        let turn = |&angle: &f64| {
            let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
            axis * Pose::from_parts(Translation3::identity(), turned) * axis.inverse()
        };
        let turns = angles.iter().map(turn).collect();
        let beside = Translation3::new(middle.x - 0.55, middle.y, bounds[0].z);
        let base = config
            .base
            .map_or(Pose::from_parts(beside, Rotation3::identity()), |base| {
                base.pose()
            });
        Self {
            solver: InverseSolver::new(&arm),
            obstacles: Obstacles::new(&arm, config, surface),
            arm,
            roller: config.roller.roller(),
            limits: config.limits,
            motion: config.motion,
            home: config.home_deg.map(|home| home.map(f64::to_radians)),
            base,
            tool: *tool_pose,
            angles,
            turns,
            bounds,
        }
    }

    /// What stands in the way of the base, if something does.
    pub fn base_in(&self) -> Option<&str> {
        self.obstacles.base_in(&self.base)
    }

    /// What the arm looks like: triangles of what moves with each of its [`Cell::frames`], in that frame [m].
    pub fn shapes(&self) -> [Vec<[Vector3<f64>; 3]>; 8] {
        self.obstacles.shapes()
    }

    /// Frames of the arm's base, links and flange in the scene.
    pub fn frames(&self, joints: &Joints) -> [Pose; 8] {
        frames(&self.arm, joints, &self.base)
    }

    /// Triangles of what stands around but the tool, in the scene [m]: what stays where it is, and what turns with the
    /// table, at its angle 0.
    pub fn blocks(&self) -> [Vec<[Vector3<f64>; 3]>; 2] {
        self.obstacles.blocks()
    }

    /// What the turntable does to the scene at a station.
    pub fn turn(&self, station: usize) -> &Pose {
        &self.turns[station]
    }

    /// A point of the tool's frame in the scene, at a station.
    pub fn in_scene(&self, point: &Vector3<f64>, station: usize) -> Vector3<f64> {
        (self.turns[station] * self.tool * nalgebra::Point3::from(*point)).coords
    }

    /// The tool's frame in the robot's base.
    pub(crate) fn work_object(&self, station: usize) -> Pose {
        self.base.inverse() * self.turns[station] * self.tool
    }

    /// Where the flange has to be in the base's frame, for a contact in the tool's.
    pub(crate) fn flange(&self, station: usize, contact: &Pose, tilt: f64) -> Pose {
        self.work_object(station) * contact * self.roller.contact(tilt).inverse()
    }

    /// A contact's frame where the roller is lifted off it.
    pub(crate) fn lifted(&self, contact: &Pose) -> Pose {
        contact * Translation3::new(0.0, 0.0, -1e-3 * self.motion.lift_mm)
    }

    /// All poses of the arm for a flange, each joint as near to 0 as it goes.
    pub(crate) fn poses(&self, flange: &Pose) -> Vec<Joints> {
        self.solver.solve(flange)
    }

    /// Holds a pose against limits, singularities and what it might hit, `share` of the distances that are asked for. Gives
    /// the least singular value.
    pub(crate) fn judge(
        &self,
        joints: &Joints,
        station: usize,
        touch: Touch,
        share: f64,
    ) -> Result<f64, Fault> {
        let sigma_min = self.kinematic(joints, share)?;
        // Whatever is farther away than it has to be is not looked at: among many triangles that takes most of the time.
        let least = (share * 1e-3 * self.limits.clearance_mm).max(1e-6);
        let found = self.obstacles.clearance(
            &self.arm,
            &self.base,
            joints,
            &self.turns[station],
            touch,
            least,
        );
        match found.fault() {
            Some(fault) => Err(fault),
            None => Ok(sigma_min),
        }
    }

    /// Whether the roller and what holds it fit on a contact, deviations included, whatever arm holds them there.
    pub(crate) fn fits(&self, contact: &Pose, tilt: f64) -> Result<(), Fault> {
        let holder = |contact: &Pose, least: f64| {
            let flange = self.tool * contact * self.roller.contact(tilt).inverse();
            let found =
                self.obstacles
                    .clearance_of_holder(&flange, &self.turns[0], least.max(1e-6));
            found.fault().map_or(Ok(()), Err)
        };
        holder(contact, 1e-3 * self.limits.clearance_mm)?;
        for (deviation, name) in self.deviations() {
            holder(&(contact * deviation), 0.0).map_err(|fault| fault.deviated(&name))?;
        }
        Ok(())
    }

    /// What force control lets happen to a contact: moves along and turns about its axes, one by one, and what they are
    /// called.
    fn deviations(&self) -> impl Iterator<Item = (Pose, String)> {
        let LimitsConfig {
            deviation_mm: way,
            deviation_deg: angle,
            ..
        } = self.limits;
        (0..12)
            .filter(move |k| if *k < 6 { way > 0.0 } else { angle > 0.0 })
            .map(move |k| {
                let (sign, axis) = ([1.0, -1.0][k % 2], k / 2 % 3);
                let named = ["x", "y", "z"][axis];
                let sense = ["+", "-"][k % 2];
                match k < 6 {
                    true => {
                        let by = Translation3::from(Vector3::ith(axis, sign * 1e-3 * way));
                        let name = format!("{way} mm along {sense}{named}");
                        (Pose::from_parts(by, Rotation3::identity()), name)
                    }
                    false => {
                        let by = Rotation3::new(Vector3::ith(axis, sign * angle.to_radians()));
                        let name = format!("{angle} degrees about {sense}{named}");
                        (Pose::from_parts(Translation3::identity(), by), name)
                    }
                }
            })
    }

    /// How far a pose on a contact is from what it might hit, no farther than [`FAR`] [m].
    pub(crate) fn clearance(&self, joints: &Joints, station: usize) -> f64 {
        let turn = &self.turns[station];
        let found =
            self.obstacles
                .clearance(&self.arm, &self.base, joints, turn, Touch::Pressing, FAR);
        found.distance
    }

    /// The part of [`Cell::judge`] that asks for no shapes: gives the least singular value.
    pub(crate) fn kinematic(&self, joints: &Joints, share: f64) -> Result<f64, Fault> {
        let margin = share * self.limits.joint_deg.to_radians();
        let near = (joints.iter().zip(&self.arm.joints)).position(|(q, joint)| {
            let [min, max] = joint.limits;
            !(min + margin..=max - margin).contains(q)
        });
        if let Some(k) = near {
            let detail = format!(
                "joint {} at {:.0} degrees, near its limit",
                k + 1,
                joints[k].to_degrees()
            );
            let check = Check::Limits;
            return Err(Fault { check, detail });
        }
        let sigma_min = self.arm.sigma_min(joints);
        match sigma_min < share * self.limits.sigma_min {
            true => Err(Fault {
                check: Check::Singularity,
                detail: format!("least singular value {sigma_min:.3}"),
            }),
            false => Ok(sigma_min),
        }
    }

    /// Follows a straight way of the contact from `from`, which is on its beginning; `judged` sees every `step` [m and rad]. Gives the
    /// joints at its end.
    pub(crate) fn follow(
        &self,
        from: &Joints,
        [begin, end]: [&Pose; 2],
        station: usize,
        tilt: f64,
        step: [f64; 2],
        mut judged: impl FnMut(&Joints) -> Result<(), Fault>,
    ) -> Result<Joints, Fault> {
        let steps = steps(begin, end, step);
        let mut joints = *from;
        for k in 1..=steps {
            let contact = match k == steps {
                true => *end,
                false => begin.lerp_slerp(end, k as f64 / steps as f64),
            };
            let flange = self.flange(station, &contact, tilt);
            joints = self.solver.follow(&flange, &joints).ok_or_else(|| Fault {
                check: Check::Between,
                detail: "the arm cannot follow".into(),
            })?;
            if k < steps {
                judged(&joints)?;
            }
        }
        Ok(joints)
    }

    /// Holds a contact against the deviations that force control allows.
    pub(crate) fn deviates(
        &self,
        joints: &Joints,
        contact: &Pose,
        station: usize,
        tilt: f64,
    ) -> Result<(), Fault> {
        for (deviation, name) in self.deviations() {
            let flange = self.flange(station, &(contact * deviation), tilt);
            let there = self.solver.follow(&flange, joints).ok_or_else(|| {
                let detail = "no pose of the arm".into();
                let check = Check::Deviation;
                Fault { check, detail }.deviated(&name)
            })?;
            // Nothing may be hit; margins are for what is planned.
            let judged = self.judge(&there, station, Touch::Pressing, 0.0);
            judged.map_err(|fault| fault.deviated(&name))?;
        }
        Ok(())
    }

    /// Whether the arm goes straight in joints from one pose to another without coming near anything.
    pub(crate) fn is_free(&self, from: &Joints, to: &Joints, station: usize, step: f64) -> bool {
        let far = (0..6).map(|j| (to[j] - from[j]).abs()).fold(0.0, f64::max);
        let count = (far / step).ceil().max(1.0) as usize;
        // From the middle outwards finds most of what is hit early.
        (0..=count).all(|k| {
            let k = match k % 2 {
                0 => count / 2 + k / 2,
                _ => count / 2 - k.div_ceil(2).min(count / 2),
            };
            let share = k.min(count) as f64 / count as f64;
            let q = std::array::from_fn(|j| from[j] + share * (to[j] - from[j]));
            self.is_clear(&q, station)
        })
    }

    /// Whether a pose in free space comes near nothing.
    pub(crate) fn is_clear(&self, joints: &Joints, station: usize) -> bool {
        let least = (1e-3 * self.limits.clearance_mm).max(1e-6);
        let turn = &self.turns[station];
        let found =
            self.obstacles
                .clearance(&self.arm, &self.base, joints, turn, Touch::Free, least);
        found.pair.is_none()
    }

    /// Poses above the middle of the tool, from low to high: where an arm may wait.
    pub(crate) fn waiting_places(&self) -> impl Iterator<Item = Pose> {
        let [min, max] = self.bounds;
        let middle = 0.5 * (min + max);
        let base = self.base;
        // z down, at several turns about it: at some a joint is at its limit.
        let down = |yaw: f64| {
            let over = Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
            Rotation3::from_axis_angle(&Vector3::z_axis(), yaw) * over
        };
        let heights = [0.1, 0.15, 0.2, 0.3, 0.05, 0.4];
        let pulls = [0.0, 0.25, 0.5];
        let yaws = [0.0, 1.0, -1.0, 2.0, -2.0, 3.0].map(|quarter| FRAC_PI_2 * quarter);
        let places = heights.into_iter().flat_map(move |h| pulls.map(|p| (h, p)));
        let places = places.flat_map(move |(h, p)| yaws.map(|yaw| (h, p, yaw)));
        let roller = self.roller.contact(0.0);
        places.map(move |(height, pull, yaw)| {
            let over = Vector3::new(middle.x, middle.y, max.z + height);
            let to_base = base.translation.vector - over;
            let at = over + pull * Vector3::new(to_base.x, to_base.y, 0.0);
            base.inverse() * Pose::from_parts(at.into(), down(yaw)) * roller.inverse()
        })
    }
}

/// Steps no longer than `step` [m and rad] that a straight way is cut into.
fn steps(begin: &Pose, end: &Pose, step: [f64; 2]) -> usize {
    let way = (end.translation.vector - begin.translation.vector).norm();
    let angle = begin.rotation.angle_to(&end.rotation);
    (way / step[0]).max(angle / step[1]).ceil().max(1.0) as usize
}
