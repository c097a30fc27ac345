use nalgebra::{Rotation3, Vector3};
use serde::{Deserialize, Serialize};

use super::place::{Place, Pose, metres, pose};
use super::program::Speeds;
use super::roller::RollerShape;

/// What stands around a tool: a file beside the scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CellConfig {
    /// A robot that is shipped, see [`crate::Arm::names`]; [`CellConfig::ROBOT`] where neither is given,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    /// or a file that describes one: URDF, or TOML as those that are shipped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot_file: Option<String>,
    /// Where its base stands in the scene; beside the tool, on its ground, where none is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base: Option<Place>,
    /// Where the arm begins and ends; found by the planner where none is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub home_deg: Option<[f64; 6]>,
    /// What turns the tool; none where it stands still.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turntable: Option<TurntableConfig>,
    pub roller: RollerConfig,
    /// Table, clamping frame, walls.
    pub obstacles: Vec<BlockConfig>,
    pub motion: MotionConfig,
    pub limits: LimitsConfig,
}

/// A table that turns the tool, and whatever is fixed to it, about the vertical.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TurntableConfig {
    /// A point of its axis in the scene; the middle of the tool's bounding box where none is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_mm: Option<[f64; 2]>,
    /// Between two angles at which it may stand.
    pub step_deg: f64,
}

/// The roller and what holds it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RollerConfig {
    pub width_mm: f64,
    pub diameter_mm: f64,
    /// Its middle in the flange's frame. The roller's axis is y there, once turned about the flange's z.
    pub middle_mm: [f64; 3],
    pub turned_deg: f64,
    /// Of everything at the flange, and where its centre is.
    pub mass_kg: f64,
    pub centre_of_mass_mm: [f64; 3],
    /// Stems and forks: capsules in the flange's frame.
    pub body: Vec<CapsuleConfig>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CapsuleConfig {
    pub from_mm: [f64; 3],
    pub to_mm: [f64; 3],
    pub radius_mm: f64,
}

/// A box that stands in the way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlockConfig {
    /// As reports call it.
    pub name: String,
    /// Its sides.
    pub size_mm: [f64; 3],
    /// Its middle in the scene.
    pub at_mm: [f64; 3],
    #[serde(default)]
    pub rotation_deg: [f64; 3],
    /// Whether the turntable takes it along, as it does with a clamping frame.
    #[serde(default)]
    pub turns: bool,
}

/// How the arm moves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MotionConfig {
    pub contact_mm_s: f64,
    pub approach_mm_s: f64,
    /// Share of the joints' greatest speeds in free ways.
    pub free: f64,
    pub force_n: f64,
    /// How long a single press lasts.
    pub press_s: f64,
    /// How far the roller lifts off along the normal between strokes.
    pub lift_mm: f64,
    /// How long the turntable takes for a turn by one step.
    pub turn_s: f64,
}

/// What a pose must keep to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LimitsConfig {
    /// By how much the arm may lean about the roller's axis.
    pub tilt_deg: f64,
    /// To everything but what the roller presses.
    pub clearance_mm: f64,
    /// Least singular value of the Jacobian, see [`crate::Arm::sigma_min`].
    pub sigma_min: f64,
    /// Free of each joint's limits.
    pub joint_deg: f64,
    /// Deviations under force control, which each pose must allow.
    pub deviation_mm: f64,
    pub deviation_deg: f64,
}

/// The paper's roller, 18 mm wide and 30 mm in diameter (Section 6), on a stem whose fork holds it from both sides.
impl Default for RollerConfig {
    fn default() -> Self {
        let capsule = |from_mm, to_mm, radius_mm| CapsuleConfig {
            from_mm,
            to_mm,
            radius_mm,
        };
        Self {
            width_mm: 18.0,
            diameter_mm: 30.0,
            middle_mm: [0.0, 0.0, 180.0],
            turned_deg: 0.0,
            mass_kg: 0.8,
            centre_of_mass_mm: [0.0, 0.0, 70.0],
            body: vec![
                capsule([0.0, 0.0, 0.0], [0.0, 0.0, 40.0], 30.0),
                capsule([0.0, 0.0, 40.0], [0.0, 0.0, 145.0], 12.0),
                capsule([0.0, -13.0, 155.0], [0.0, -13.0, 178.0], 4.0),
                capsule([0.0, 13.0, 155.0], [0.0, 13.0, 178.0], 4.0),
            ],
        }
    }
}

impl Default for MotionConfig {
    fn default() -> Self {
        Self {
            contact_mm_s: 100.0,
            approach_mm_s: 50.0,
            free: 0.25,
            force_n: 20.0,
            press_s: 0.2,
            lift_mm: 30.0,
            turn_s: 2.0,
        }
    }
}

impl Default for LimitsConfig {
    fn default() -> Self {
        Self {
            tilt_deg: 30.0,
            clearance_mm: 3.0,
            sigma_min: 0.05,
            joint_deg: 2.0,
            deviation_mm: 4.0,
            deviation_deg: 3.0,
        }
    }
}

/// A value of a cell that makes no sense.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{key}` is {found}, expected {expected}")]
pub struct CellError {
    key: String,
    found: String,
    expected: String,
}

impl CellConfig {
    /// The robot of a cell that names none.
    pub const ROBOT: &str = "crb15000-5";

    /// The cell where nobody has described one: that robot wherever it reaches most, and a turntable below the tool.
    pub fn unnamed() -> Self {
        Self {
            robot: Some(Self::ROBOT.into()),
            turntable: Some(TurntableConfig {
                at_mm: None,
                step_deg: 45.0,
            }),
            ..Self::default()
        }
    }

    /// Refuses values that are not finite or out of range.
    pub fn check(&self) -> Result<(), CellError> {
        let fail = |key: &str, found: String, expected: &str| {
            Err(CellError {
                key: key.into(),
                found,
                expected: expected.into(),
            })
        };
        if let (Some(robot), Some(_)) = (&self.robot, &self.robot_file) {
            let found = format!("{robot:?} beside robot_file");
            return fail("robot", found, "one of the two");
        }
        let mut numbers: Vec<(String, f64, [f64; 2])> = Vec::new();
        let mut add = |key: &str, found: &[f64], range| {
            let named = |(k, &x): (usize, &f64)| match found.len() {
                1 => (key.to_string(), x, range),
                _ => (format!("{key}[{k}]"), x, range),
            };
            numbers.extend(found.iter().enumerate().map(named));
        };
        let (far, angle) = ([-1e5, 1e5], [-360.0, 360.0]);
        if let Some(base) = &self.base {
            add("base.at_mm", &base.at_mm, far);
            add("base.rotation_deg", &base.rotation_deg, angle);
        }
        if let Some(home) = &self.home_deg {
            add("home_deg", home, [-720.0, 720.0]);
        }
        if let Some(table) = &self.turntable {
            add("turntable.step_deg", &[table.step_deg], [5.0, 360.0]);
            add("turntable.at_mm", &table.at_mm.unwrap_or_default(), far);
        }
        let roller = &self.roller;
        add("roller.width_mm", &[roller.width_mm], [0.1, 1e3]);
        add("roller.diameter_mm", &[roller.diameter_mm], [0.1, 1e3]);
        add("roller.middle_mm", &roller.middle_mm, [-2e3, 2e3]);
        add("roller.turned_deg", &[roller.turned_deg], angle);
        add("roller.mass_kg", &[roller.mass_kg], [0.01, 100.0]);
        add(
            "roller.centre_of_mass_mm",
            &roller.centre_of_mass_mm,
            [-2e3, 2e3],
        );
        for (k, body) in roller.body.iter().enumerate() {
            add(
                &format!("roller.body[{k}].from_mm"),
                &body.from_mm,
                [-2e3, 2e3],
            );
            add(&format!("roller.body[{k}].to_mm"), &body.to_mm, [-2e3, 2e3]);
            add(
                &format!("roller.body[{k}].radius_mm"),
                &[body.radius_mm],
                [0.1, 1e3],
            );
        }
        for (k, block) in self.obstacles.iter().enumerate() {
            add(
                &format!("obstacles[{k}].size_mm"),
                &block.size_mm,
                [0.1, 1e5],
            );
            add(&format!("obstacles[{k}].at_mm"), &block.at_mm, far);
            add(
                &format!("obstacles[{k}].rotation_deg"),
                &block.rotation_deg,
                angle,
            );
        }
        let motion = &self.motion;
        add("motion.contact_mm_s", &[motion.contact_mm_s], [0.1, 1e4]);
        add("motion.approach_mm_s", &[motion.approach_mm_s], [0.1, 1e4]);
        add("motion.free", &[motion.free], [0.001, 1.0]);
        add("motion.force_n", &[motion.force_n], [0.1, 1e4]);
        add("motion.press_s", &[motion.press_s], [0.0, 3600.0]);
        add("motion.lift_mm", &[motion.lift_mm], [1.0, 1e3]);
        add("motion.turn_s", &[motion.turn_s], [0.0, 3600.0]);
        let limits = &self.limits;
        add("limits.tilt_deg", &[limits.tilt_deg], [0.0, 80.0]);
        add("limits.clearance_mm", &[limits.clearance_mm], [0.0, 1e3]);
        add("limits.sigma_min", &[limits.sigma_min], [0.0, 1.0]);
        add("limits.joint_deg", &[limits.joint_deg], [0.0, 90.0]);
        add("limits.deviation_mm", &[limits.deviation_mm], [0.0, 100.0]);
        add("limits.deviation_deg", &[limits.deviation_deg], [0.0, 45.0]);
        let wrong =
            |(_, found, [min, max]): &&(String, f64, [f64; 2])| !(*min..=*max).contains(found);
        match numbers.iter().find(wrong) {
            Some((key, found, [min, max])) => fail(
                key,
                found.to_string(),
                &format!("a number from {min} to {max}"),
            ),
            None => Ok(()),
        }
    }

    /// Lets the robot's file count from a folder, wherever the cell is kept then.
    ///
    /// # Errors
    /// If there is no folder from which it counts itself.
    pub fn locate(&mut self, folder: &std::path::Path) -> std::io::Result<()> {
        if let Some(file) = &mut self.robot_file {
            let at = std::path::absolute(folder.join(&*file))?;
            *file = at.to_string_lossy().into_owned();
        }
        Ok(())
    }

    /// The angles at which the tool may stand [rad], the first 0.
    pub fn station_angles(&self) -> Vec<f64> {
        let Some(table) = self.turntable else {
            return vec![0.0];
        };
        // To and fro alike: 0, 45, -45, 90, ...
        let step = table.step_deg.to_radians();
        let count = (360.0 / table.step_deg + 1e-9).floor().max(1.0) as usize;
        let angle = |k: usize| match k % 2 {
            0 => -((k / 2) as f64) * step,
            _ => k.div_ceil(2) as f64 * step,
        };
        (0..count).map(|k| angle(k) + 0.0).collect()
    }
}

impl RollerConfig {
    /// As the planner and programs see it.
    pub fn roller(&self) -> RollerShape {
        let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), self.turned_deg.to_radians());
        RollerShape {
            middle: Pose::from_parts(metres(self.middle_mm).into(), turned),
            radius: 0.5e-3 * self.diameter_mm,
            width: 1e-3 * self.width_mm,
            mass: self.mass_kg,
            centre_of_mass: metres(self.centre_of_mass_mm),
        }
    }
}

impl MotionConfig {
    pub fn speeds(&self) -> Speeds {
        Speeds {
            contact: 1e-3 * self.contact_mm_s,
            approach: 1e-3 * self.approach_mm_s,
            free: self.free,
            force: self.force_n,
            press_s: self.press_s,
            turn_s: self.turn_s,
        }
    }
}

impl BlockConfig {
    pub fn pose(&self) -> Pose {
        pose(self.at_mm, self.rotation_deg)
    }
}
