//! URScript, the language of Universal Robots' controllers.

use std::fmt::Write as _;

use nalgebra::UnitQuaternion;

use super::text::{ascii, finite, number};
use super::{Program, ProgramError};
use crate::arm::Joints;
use crate::place::Pose;

impl Program<'_> {
    /// The program as a URScript function for each stroke; metres and radians, poses in the robot's base. Force mode
    /// presses along z of the point that was reached last.
    ///
    /// # Errors
    /// If there is no stroke, or a number is not finite.
    pub fn urscript(&self) -> Result<String, ProgramError> {
        self.check()?;
        let mut out = String::new();
        let slowest = self
            .arm
            .joints
            .iter()
            .map(|joint| joint.speed)
            .fold(f64::INFINITY, f64::min);
        let free = number(self.speeds.free * slowest, 5);
        let (rolling, approach) = (
            number(self.speeds.contact, 5),
            number(self.speeds.approach, 5),
        );
        let _ = writeln!(out, "def drape_program():");
        let _ = writeln!(
            out,
            "  # {}: written by drape for a {}",
            ascii(&self.name),
            ascii(&self.arm.name)
        );
        let _ = writeln!(
            out,
            "  # Metres, radians and seconds; poses of contacts are in the robot's base: z into the"
        );
        let _ = writeln!(
            out,
            "  # surface, x along the travel, y along the roller's axis. About {} s.",
            number(self.seconds(), 0)
        );
        let [x, y, z] = self.roller.centre_of_mass.into();
        let _ = writeln!(
            out,
            "  set_payload({}, [{}, {}, {}])",
            number(self.roller.mass, 3),
            number(x, 5),
            number(y, 5),
            number(z, 5)
        );
        let move_j = |joints: &Joints, radius: f64| {
            format!(
                "movej({}, a=1.4, v={free}, r={})",
                list(joints),
                number(radius, 3)
            )
        };
        for (k, stroke) in self.strokes.iter().enumerate() {
            let tool = finite(&self.roller.contact(stroke.tilt), "the roller")?;
            let base = self.stations[stroke.station].tool;
            let _ = writeln!(out, "\n  def stroke_{}():", k + 1);
            let _ = writeln!(out, "    set_tcp({})", pose(&tool));
            let turn_before = self.turn_before(k);
            for (corner, joints) in stroke.transfer.iter().chain([&stroke.approach]).enumerate() {
                if turn_before == Some(corner) {
                    let angle = number(self.stations[stroke.station].angle.to_degrees(), 3);
                    let _ = writeln!(
                        out,
                        "    popup(\"Turn the table to {angle} degrees\", blocking=True)"
                    );
                }
                let _ = writeln!(out, "    {}", move_j(joints, 0.0));
            }
            for (j, contact) in stroke.contacts.iter().enumerate() {
                let at = pose(&finite(&(base * contact.frame), "a contact")?);
                let speed = if j == 0 { &approach } else { &rolling };
                if j == 0 {
                    // While nothing is touched yet.
                    let _ = writeln!(out, "    zero_ftsensor()");
                }
                let _ = writeln!(
                    out,
                    "    movel({at}, a=0.5, v={speed}) # point {}",
                    contact.point
                );
                // At each: the frame in which the force acts stays where it is put.
                let _ = writeln!(
                    out,
                    "    force_mode({at}, [0, 0, 1, 0, 0, 0], [0, 0, {}, 0, 0, 0], 2, [0.1, 0.1, 0.05, 0.17, 0.17, 0.17])",
                    number(self.speeds.force, 3)
                );
            }
            if stroke.contacts.len() == 1 {
                let _ = writeln!(out, "    sleep({})", number(self.speeds.press_s, 3));
            }
            let _ = writeln!(out, "    end_force_mode()");
            let _ = writeln!(
                out,
                "    movel({}, a=0.5, v={approach})",
                list(&stroke.retreat)
            );
            let _ = writeln!(out, "  end");
        }
        let _ = writeln!(out, "\n  {}", move_j(&self.home, 0.0));
        for k in 0..self.strokes.len() {
            let _ = writeln!(out, "  stroke_{}()", k + 1);
        }
        for corner in self.way_home.iter().chain([&self.home]) {
            let _ = writeln!(out, "  {}", move_j(corner, 0.0));
        }
        let _ = writeln!(out, "end\n\ndrape_program()");
        Ok(out)
    }
}

fn list(joints: &Joints) -> String {
    format!("[{}]", joints.map(|q| number(q, 7)).join(", "))
}

/// Place and rotation vector.
fn pose(pose: &Pose) -> String {
    // Half a turn has an axis, too, which the matrix alone does not give.
    let turned = UnitQuaternion::from_rotation_matrix(&pose.rotation).scaled_axis();
    let at = pose.translation.vector;
    let all = [at.x, at.y, at.z, turned.x, turned.y, turned.z].map(|x| number(x, 7));
    format!("p[{}]", all.join(", "))
}
