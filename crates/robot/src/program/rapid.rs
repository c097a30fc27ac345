//! RAPID, the language of ABB's controllers: a module that a programmer can read.

use std::fmt::Write as _;

use nalgebra::UnitQuaternion;

use super::text::{angles, ascii, finite, number};
use super::{Program, ProgramError, ProgramStroke};
use crate::arm::Joints;
use crate::place::Pose;

/// Longest name [characters].
const NAME: usize = 32;
/// Of which free ways have their share: about the greatest speed of such an arm's flange [m/s].
const FREE: f64 = 2.2;

impl Program<'_> {
    /// The program as a RAPID module. Strokes are procedures, reached by `MoveAbsJ` and rolled with force control
    /// (`FCPressL`); contacts are in the work object of the turntable's angle, millimetres.
    ///
    /// # Errors
    /// If there is no stroke, or a number is not finite.
    pub fn rapid(&self) -> Result<String, ProgramError> {
        self.check()?;
        let name = name(&self.name);
        let mut out = String::new();
        let _ = writeln!(out, "MODULE {name}");
        for line in self.remarks() {
            let _ = writeln!(out, "  ! {line}");
        }
        let tilts = self.tilts();
        for &tilt in &tilts {
            let tool = finite(&self.roller.contact(tilt), "the roller")?;
            let [x, y, z] = self.roller.centre_of_mass.map(|x| 1e3 * x).into();
            let load = format!(
                "[{},[{},{},{}],[1,0,0,0],0,0,0]",
                number(self.roller.mass, 3),
                number(x, 2),
                number(y, 2),
                number(z, 2)
            );
            let _ = writeln!(
                out,
                "  PERS tooldata {}:=[TRUE,{},{load}];",
                tool_name(tilt),
                pose(&tool)
            );
        }
        for (k, station) in self.stations.iter().enumerate() {
            let tool = finite(&station.tool, "the work object")?;
            let _ = writeln!(
                out,
                "  PERS wobjdata wobj_{}:=[FALSE,TRUE,\"\",{},[[0,0,0],[1,0,0,0]]];",
                k + 1,
                pose(&tool)
            );
        }
        let speed = |name: &str, metres: f64| {
            format!(
                "  CONST speeddata {name}:=[{},500,5000,1000];\n",
                number(1e3 * metres, 3)
            )
        };
        out += &speed("v_contact", self.speeds.contact);
        out += &speed("v_approach", self.speeds.approach);
        out += &speed("v_free", FREE * self.speeds.free);
        let _ = writeln!(
            out,
            "  CONST num press_force:={}; ! N, into the surface",
            number(self.speeds.force, 3)
        );
        let _ = writeln!(out, "  CONST jointtarget home:={};", joints(&self.home));
        for (k, stroke) in self.strokes.iter().enumerate() {
            let number = k + 1;
            for (j, corner) in stroke.transfer.iter().enumerate() {
                let _ = writeln!(
                    out,
                    "  CONST jointtarget s{number}_way_{}:={};",
                    j + 1,
                    joints(corner)
                );
            }
            let _ = writeln!(
                out,
                "  CONST jointtarget s{number}_above:={};",
                joints(&stroke.approach)
            );
            for contact in &stroke.contacts {
                let frame = finite(&contact.frame, "a contact")?;
                let _ = writeln!(
                    out,
                    "  CONST robtarget s{number}_p{}:=[{},{},[9E9,9E9,9E9,9E9,9E9,9E9]];",
                    contact.point,
                    place_and_turn(&frame),
                    configuration(&contact.joints)
                );
            }
            let _ = writeln!(
                out,
                "  CONST jointtarget s{number}_off:={};",
                joints(&stroke.retreat)
            );
        }
        for (k, corner) in self.way_home.iter().enumerate() {
            let _ = writeln!(
                out,
                "  CONST jointtarget way_home_{}:={};",
                k + 1,
                joints(corner)
            );
        }
        self.procedures(&mut out);
        let _ = writeln!(out, "ENDMODULE");
        Ok(out)
    }

    fn procedures(&self, out: &mut String) {
        let _ = writeln!(out, "\n  PROC main()");
        let _ = writeln!(out, "    ConfL\\Off;");
        let _ = writeln!(
            out,
            "    MoveAbsJ home,v_free,fine,{};",
            tool_name(self.tilts()[0])
        );
        let _ = writeln!(out, "    WaitTime\\InPos,0.1;");
        let _ = writeln!(out, "    FCCalib {}.tload;", tool_name(self.tilts()[0]));
        for k in 0..self.strokes.len() {
            let _ = writeln!(out, "    Stroke{};", k + 1);
        }
        for k in 0..self.way_home.len() {
            let _ = writeln!(out, "    MoveAbsJ way_home_{},v_free,z10,tool0;", k + 1);
        }
        let _ = writeln!(out, "    MoveAbsJ home,v_free,fine,tool0;");
        let _ = writeln!(out, "  ENDPROC");
        for (k, stroke) in self.strokes.iter().enumerate() {
            self.procedure(k + 1, stroke, out);
        }
        if (0..self.strokes.len()).any(|k| self.turn_before(k).is_some()) {
            let _ = writeln!(
                out,
                "\n  ! Replace by whatever turns the table; the arm waits at home."
            );
            let _ = writeln!(out, "  PROC TurnTable(num angle)");
            let _ = writeln!(
                out,
                "    TPWrite \"Turn the table to [degrees]:\"\\Num:=angle;"
            );
            let _ = writeln!(out, "    Stop;");
            let _ = writeln!(out, "  ENDPROC");
        }
    }

    fn procedure(&self, number_of: usize, stroke: &ProgramStroke, out: &mut String) {
        let (tool, object) = (
            tool_name(stroke.tilt),
            format!("wobj_{}", stroke.station + 1),
        );
        let least = |of: fn(&super::Contact) -> f64| {
            stroke.contacts.iter().map(of).fold(f64::INFINITY, f64::min)
        };
        let _ = writeln!(
            out,
            "\n  ! {} points, tilt {} degrees, table {} degrees, clearance {} mm, singular value {}",
            stroke.contacts.len(),
            number(stroke.tilt.to_degrees(), 1),
            number(self.stations[stroke.station].angle.to_degrees(), 1),
            number(1e3 * least(|contact| contact.clearance), 1),
            number(least(|contact| contact.sigma_min), 3)
        );
        let _ = writeln!(out, "  PROC Stroke{number_of}()");
        let turn_before = self.turn_before(number_of - 1);
        let turn = |corner: usize, out: &mut String| {
            if turn_before == Some(corner) {
                let angle = number(self.stations[stroke.station].angle.to_degrees(), 3);
                let _ = writeln!(out, "    TurnTable {angle};");
            }
        };
        for k in 0..stroke.transfer.len() {
            turn(k, out);
            // Where the table turns the arm has to stand still.
            let zone = if turn_before == Some(k + 1) {
                "fine"
            } else {
                "z10"
            };
            let _ = writeln!(
                out,
                "    MoveAbsJ s{number_of}_way_{},v_free,{zone},{tool};",
                k + 1
            );
        }
        turn(stroke.transfer.len(), out);
        let _ = writeln!(out, "    MoveAbsJ s{number_of}_above,v_free,fine,{tool};");
        let at = |contact: &super::Contact| format!("s{number_of}_p{}", contact.point);
        let [first, .., last] = &stroke.contacts[..] else {
            let only = at(&stroke.contacts[0]);
            let _ = writeln!(
                out,
                "    FCPress1LStart {only},v_approach\\Fz:=press_force,50\\ForceChange:=100\\PosSupvDist:=20,z1,{tool}\\WObj:={object};"
            );
            let _ = writeln!(out, "    WaitTime {};", number(self.speeds.press_s, 3));
            return self.come_off(number_of, &only, &tool, &object, out);
        };
        let _ = writeln!(
            out,
            "    FCPress1LStart {},v_approach\\Fz:=press_force,50\\ForceChange:=100\\PosSupvDist:=20,z1,{tool}\\WObj:={object};",
            at(first)
        );
        let count = stroke.contacts.len();
        for (k, contact) in stroke.contacts.iter().enumerate().skip(1) {
            let zone = if k + 1 == count { "fine" } else { "z1" };
            let _ = writeln!(
                out,
                "    FCPressL {},v_contact,press_force,{zone},{tool}\\WObj:={object};",
                at(contact)
            );
        }
        self.come_off(number_of, &at(last), &tool, &object, out);
    }

    fn come_off(&self, number_of: usize, from: &str, tool: &str, object: &str, out: &mut String) {
        let _ = writeln!(
            out,
            "    FCPressEnd {from},v_approach,\\DeactOnly,{tool}\\WObj:={object};"
        );
        let _ = writeln!(out, "    MoveAbsJ s{number_of}_off,v_approach,fine,{tool};");
        let _ = writeln!(out, "  ENDPROC");
    }

    /// What a reader has to know first.
    fn remarks(&self) -> Vec<String> {
        let points: usize = self
            .strokes
            .iter()
            .map(|stroke| stroke.contacts.len())
            .sum();
        vec![
            format!("{}: written by drape for a {}", ascii(&self.name), ascii(&self.arm.name)),
            format!(
                "{points} points in {} strokes, about {} s",
                self.strokes.len(),
                number(self.seconds(), 0)
            ),
            "Millimetres and degrees. Robtargets are contacts in the work object, the tool's own frame:".into(),
            "z into the surface, x along the travel, y along the roller's axis, the origin in the".into(),
            "middle of the line of contact. Each tilt of the arm about that axis has its tooldata.".into(),
            "Strokes are reached in joints, so the fourth number of a configuration says nothing.".into(),
            "The force acts along z of the tool, and so leans with it where the arm does.".into(),
        ]
    }

    /// The tilts that are used, rising.
    fn tilts(&self) -> Vec<f64> {
        let mut tilts: Vec<f64> = self.strokes.iter().map(|stroke| stroke.tilt).collect();
        tilts.sort_by(f64::total_cmp);
        tilts.dedup_by_key(|tilt| tool_name(*tilt));
        tilts
    }
}

/// The name of the tool that leans by a tilt [rad], to a tenth of a degree.
fn tool_name(tilt: f64) -> String {
    let tenths = (10.0 * tilt.to_degrees()).round() as i64;
    let sign = if tenths < 0 { "m" } else { "p" };
    match tenths.abs() % 10 {
        0 => format!("roller_{sign}{}", tenths.abs() / 10),
        rest => format!("roller_{sign}{}_{rest}", tenths.abs() / 10),
    }
}

/// A name that RAPID takes, letters, digits and underscores, 32 at most; its beginning keeps it apart from RAPID's words and
/// from the names in the module.
fn name(of: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    "drape_"
        .chars()
        .chain(of.chars().map(plain))
        .take(NAME)
        .collect()
}

/// A pose: place and turn in a list of their own.
fn pose(pose: &Pose) -> String {
    format!("[{}]", place_and_turn(pose))
}

/// `[x,y,z],[q1,q2,q3,q4]`, q1 the real part.
fn place_and_turn(pose: &Pose) -> String {
    let [x, y, z] = pose.translation.vector.map(|x| 1e3 * x).into();
    let q = UnitQuaternion::from_rotation_matrix(&pose.rotation);
    let [i, j, k, w] = q.coords.into();
    // Of two that turn alike the one whose real part is positive.
    let sign = if w < 0.0 { -1.0 } else { 1.0 };
    let place = [x, y, z].map(|x| number(x, 4)).join(",");
    let turned = [w, i, j, k].map(|q| number(sign * q, 8)).join(",");
    format!("[{place}],[{turned}]")
}

fn joints(joints: &Joints) -> String {
    let degrees = angles(joints).map(|q| number(q, 5)).join(",");
    format!("[[{degrees}],[9E9,9E9,9E9,9E9,9E9,9E9]]")
}

/// Quadrants of axes 1, 4 and 6; the fourth number is not looked at without `ConfL\On`.
fn configuration(joints: &Joints) -> String {
    let quadrant = |k: usize| (joints[k].to_degrees() / 90.0).floor();
    format!("[{},{},{},0]", quadrant(0), quadrant(3), quadrant(5))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_that_rapid_takes() {
        for (given, expected) in [
            ("demo", "drape_demo"),
            ("2026-11-26 12:00", "drape_2026_11_26_12_00"),
            ("für Müller", "drape_f_r_M_ller"),
            ("", "drape_"),
        ] {
            assert_eq!(name(given), expected);
        }
        assert_eq!(name(&"x".repeat(200)).len(), NAME);
    }

    #[test]
    fn tools_are_told_apart_by_their_tilt() {
        assert_eq!(tool_name(0.0), "roller_p0");
        assert_eq!(tool_name(-20f64.to_radians()), "roller_m20");
        assert_eq!(tool_name(12.5f64.to_radians()), "roller_p12_5");
    }
}
