//! Joints over time, as ROS's `trajectory_msgs/JointTrajectory` has them, and points with joints as JSON and CSV.

use std::fmt::Write as _;

use nalgebra::UnitQuaternion;
use serde::Serialize;

use super::text::{angles, ascii, number};
use super::{Contact, Program, ProgramError, ProgramStroke};

/// A point of the path as it is pressed: SI, in the frames that [`Document`] names.
#[derive(Serialize)]
struct Row {
    point: usize,
    stroke: usize,
    kind: &'static str,
    station_angle: f64,
    tilt: f64,
    position: [f64; 3],
    /// x, y, z, w.
    quaternion: [f64; 4],
    joints: [f64; 6],
    sigma_min: f64,
    clearance: f64,
}

#[derive(Serialize)]
struct Document<'a> {
    format: &'static str,
    units: &'static str,
    frame: &'static str,
    robot: &'a str,
    /// Of the whole program [s].
    seconds: f64,
    force: f64,
    home: [f64; 6],
    points: Vec<Row>,
}

impl Program<'_> {
    /// Joints over time as YAML [rad, rad/s, s]; all times rise, no joint is faster than it can be.
    ///
    /// # Errors
    /// If there is no stroke, or a number is not finite.
    pub fn trajectory(&self) -> Result<String, ProgramError> {
        self.check()?;
        let moments = self.moments();
        let mut out = format!(
            "# {}: written by drape for a {}\njoint_names: [joint_1, joint_2, joint_3, joint_4, joint_5, joint_6]\npoints:\n",
            ascii(&self.name),
            ascii(&self.arm.name)
        );
        for (k, moment) in moments.iter().enumerate() {
            let list = |all: [f64; 6]| all.map(|x| number(x, 7)).join(", ");
            // That of the way to it; it stops where the program does.
            let velocities = match k {
                0 => [0.0; 6],
                _ if k + 1 == moments.len() => [0.0; 6],
                _ => {
                    let last = &moments[k - 1];
                    let dt = moment.at - last.at;
                    std::array::from_fn(|j| (moment.joints[j] - last.joints[j]) / dt)
                }
            };
            let nanoseconds = (1e9 * moment.at).round() as u64;
            let _ = write!(
                out,
                "  - positions: [{}]\n    velocities: [{}]\n    time_from_start: {{sec: {}, nanosec: {}}}\n",
                list(moment.joints),
                list(velocities),
                nanoseconds / 1_000_000_000,
                nanoseconds % 1_000_000_000
            );
        }
        Ok(out)
    }

    /// Points in order with the joints that press them, as one JSON object.
    ///
    /// # Errors
    /// If there is no stroke, or a number is not finite.
    pub fn points_json(&self) -> Result<String, ProgramError> {
        self.check()?;
        let document = Document {
            format: "drape robot points 1",
            units: "metres, radians, newtons, seconds",
            frame: "the tool's own: z into the surface, x along the travel, y along the roller's axis, the origin in the \
                    middle of the line of contact; the tool turned by station_angle about the table's axis",
            robot: &self.arm.name,
            seconds: self.seconds(),
            force: self.speeds.force,
            home: self.home,
            points: self.rows(),
        };
        Ok(serde_json::to_string_pretty(&document).expect("numbers are finite") + "\n")
    }

    /// As CSV in millimetres and degrees, the quaternion's real part first.
    ///
    /// # Errors
    /// If there is no stroke, or a number is not finite.
    pub fn points_csv(&self) -> Result<String, ProgramError> {
        self.check()?;
        let mut out = format!(
            "# drape robot points 1: {}; mm, degrees; the tool's own frame, z into the surface, x along the travel\n\
             point,stroke,kind,station_deg,tilt_deg,x,y,z,q1,q2,q3,q4,j1,j2,j3,j4,j5,j6,sigma_min,clearance_mm\n",
            ascii(&self.arm.name)
        );
        for row in self.rows() {
            let [i, j, k, w] = row.quaternion;
            let numbers =
                [row.station_angle.to_degrees(), row.tilt.to_degrees()].map(|x| number(x, 3));
            let place = row.position.map(|x| number(1e3 * x, 4));
            let turned = [w, i, j, k].map(|q| number(q, 8));
            let joints = angles(&row.joints).map(|q| number(q, 5));
            let rest = [number(row.sigma_min, 5), number(1e3 * row.clearance, 3)];
            let all = [&numbers[..], &place, &turned, &joints, &rest]
                .concat()
                .join(",");
            let _ = writeln!(out, "{},{},{},{all}", row.point, row.stroke, row.kind);
        }
        Ok(out)
    }

    fn rows(&self) -> Vec<Row> {
        let row = |(k, stroke): (usize, &ProgramStroke), contact: &Contact| Row {
            point: contact.point,
            stroke: k,
            kind: if stroke.contacts.len() == 1 {
                "press"
            } else {
                "stroke"
            },
            station_angle: self.stations[stroke.station].angle,
            tilt: stroke.tilt,
            position: contact.frame.translation.vector.into(),
            quaternion: UnitQuaternion::from_rotation_matrix(&contact.frame.rotation)
                .coords
                .into(),
            joints: contact.joints,
            sigma_min: contact.sigma_min,
            clearance: contact.clearance,
        };
        let strokes = self.strokes.iter().enumerate();
        let rows = strokes.flat_map(|(k, stroke)| {
            stroke
                .contacts
                .iter()
                .map(move |contact| row((k, stroke), contact))
        });
        rows.collect()
    }
}
