mod rapid;
mod text;
mod trajectory;
mod urscript;

use super::arm::{Arm, Joints};
use super::place::Pose;
use super::roller::RollerShape;

/// What a controller is told, in order.
#[derive(Clone, Debug)]
pub struct Program<'a> {
    pub name: String,
    pub arm: &'a Arm,
    pub roller: RollerShape,
    pub speeds: Speeds,
    /// Where the arm begins and ends [rad].
    pub home: Joints,
    /// The angles of the turntable that are used; one where there is none.
    pub stations: Vec<Station>,
    pub strokes: Vec<ProgramStroke>,
    /// Corners of the free way home from the last stroke, both ends left out.
    pub way_home: Vec<Joints>,
}

/// How fast and how hard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speeds {
    /// Of the contact along a stroke [m/s], and of the roller when it comes down and lifts.
    pub contact: f64,
    pub approach: f64,
    /// Share of the joints' greatest speeds in free ways.
    pub free: f64,
    /// With which the roller presses [N].
    pub force: f64,
    /// How long it stays on a point that is pressed without travel [s].
    pub press_s: f64,
    /// How long the turntable takes for a turn [s].
    pub turn_s: f64,
}

/// An angle of the turntable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Station {
    /// [rad]
    pub angle: f64,
    /// The frame in which the program's contacts are, that of the tool, in the robot's base: the work object.
    pub tool: Pose,
}

/// One stroke, or a single press, with the way to it.
#[derive(Clone, Debug)]
pub struct ProgramStroke {
    /// Index into the program's stations.
    pub station: usize,
    /// How far the arm leans about the roller's axis [rad], see [`RollerShape::contact`]; the same for the whole stroke.
    pub tilt: f64,
    /// Corners of the free way, straight in joints, from where the arm is to `approach`, both left out.
    pub transfer: Vec<Joints>,
    /// Off the surface, straight above the first contact.
    pub approach: Joints,
    /// One at least; between them the contact moves straight.
    pub contacts: Vec<Contact>,
    /// Off the surface, straight above the last contact.
    pub retreat: Joints,
}

/// The roller on a point of the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Index of the point in the path.
    pub point: usize,
    /// In the tool's frame: z into the surface, x along the travel forwards or backwards, y along the roller's axis, the
    /// origin in the middle of the line of contact.
    pub frame: Pose,
    pub joints: Joints,
    /// Least singular value of the Jacobian, see [`Arm::sigma_min`], and the distance to what might be hit [m].
    pub sigma_min: f64,
    pub clearance: f64,
}

/// Where an arm is at a moment of a program, and what it does there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProgramMoment {
    /// Since the program began [s].
    pub at: f64,
    pub joints: Joints,
    pub stroke: usize,
    pub motion: Motion,
    /// The angle of the turntable, into the program's stations, on the way there.
    pub station: usize,
    /// Points of the path up to the last that was pressed.
    pub pressed: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// A corner of a free way, the turntable at the station of the stroke before or behind.
    Free,
    /// Above a first contact or a last one.
    Above,
    /// On a contact.
    Contact,
}

/// Why no program can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProgramError {
    #[error("the program has no stroke, expected a point that the arm reaches")]
    Empty,
    #[error("{what} of the program has numbers that are not finite")]
    NotFinite { what: &'static str },
}

impl Program<'_> {
    /// Refuses a program without strokes, or with numbers that are none.
    fn check(&self) -> Result<(), ProgramError> {
        if self.strokes.is_empty() {
            return Err(ProgramError::Empty);
        }
        let strokes = self.strokes.iter().flat_map(|stroke| {
            let contacts = stroke.contacts.iter().map(|contact| &contact.joints);
            stroke
                .transfer
                .iter()
                .chain([&stroke.approach, &stroke.retreat])
                .chain(contacts)
        });
        let mut joints = strokes.chain([&self.home]).chain(&self.way_home);
        match joints.all(|joints| joints.iter().all(|q| q.is_finite())) {
            true => Ok(()),
            false => Err(ProgramError::NotFinite { what: "a pose" }),
        }
    }

    /// When the arm is where: every corner, approach and contact, straight in joints between free ones and straight in
    /// space between contacts, at constant speeds.
    pub fn moments(&self) -> Vec<ProgramMoment> {
        let mut moments = vec![ProgramMoment {
            at: 0.0,
            joints: self.home,
            stroke: 0,
            motion: Motion::Free,
            station: self.strokes.first().map_or(0, |stroke| stroke.station),
            pressed: 0,
        }];
        let (mut time, mut last, mut pressed) = (0.0, self.home, 0);
        for (k, stroke) in self.strokes.iter().enumerate() {
            let before = k.checked_sub(1).map(|k| self.strokes[k].station);
            let mut go = |joints: Joints, seconds: f64, motion: Motion, station, point| {
                // No two at once, and no joint faster than it can.
                time += seconds.max(self.fastest(&last, &joints)).max(1e-3);
                last = joints;
                pressed = pressed.max(point);
                moments.push(ProgramMoment {
                    at: time,
                    joints,
                    stroke: k,
                    motion,
                    station,
                    pressed,
                });
            };
            let turn_before = self.turn_before(k);
            let mut from = last_of(&self.strokes, k, &self.home);
            for (corner, joints) in stroke.transfer.iter().chain([&stroke.approach]).enumerate() {
                let wait = if turn_before == Some(corner) {
                    self.speeds.turn_s
                } else {
                    0.0
                };
                let is_turned = turn_before.is_none_or(|home| corner >= home);
                let station = before.filter(|_| !is_turned).unwrap_or(stroke.station);
                let seconds = wait + self.free(&from, joints);
                go(*joints, seconds, Motion::Free, station, 0);
                from = *joints;
            }
            let lift = self.lift(stroke) / self.speeds.approach;
            let mut before: Option<&Contact> = None;
            for contact in &stroke.contacts {
                let seconds = match before {
                    None => lift,
                    Some(before) => {
                        let way =
                            contact.frame.translation.vector - before.frame.translation.vector;
                        way.norm() / self.speeds.contact
                    }
                };
                let point = contact.point + 1;
                go(
                    contact.joints,
                    seconds,
                    Motion::Contact,
                    stroke.station,
                    point,
                );
                before = Some(contact);
            }
            if stroke.contacts.len() == 1 {
                let joints = stroke.contacts[0].joints;
                go(
                    joints,
                    self.speeds.press_s,
                    Motion::Contact,
                    stroke.station,
                    0,
                );
            }
            go(stroke.retreat, lift, Motion::Above, stroke.station, 0);
        }
        let mut from = last;
        for joints in self.way_home.iter().chain([&self.home]) {
            time += self.free(&from, joints).max(1e-3);
            from = *joints;
            moments.push(ProgramMoment {
                at: time,
                joints: *joints,
                stroke: self.strokes.len().saturating_sub(1),
                motion: Motion::Free,
                station: self.strokes.last().map_or(0, |stroke| stroke.station),
                pressed,
            });
        }
        moments
    }

    /// How long the whole program takes [s].
    pub fn seconds(&self) -> f64 {
        self.moments().last().map_or(0.0, |moment| moment.at)
    }

    /// Where the table turns for stroke `k`, if it does: behind so many corners of the way to it, at home.
    pub(crate) fn turn_before(&self, k: usize) -> Option<usize> {
        let stroke = &self.strokes[k];
        match k.checked_sub(1).map(|last| self.strokes[last].station) {
            None => {
                (self.stations[stroke.station].angle != 0.0 || self.stations.len() > 1).then_some(0)
            }
            Some(last) if last == stroke.station => None,
            Some(_) => {
                let home = stroke
                    .transfer
                    .iter()
                    .position(|corner| *corner == self.home);
                Some(home.map_or(0, |corner| corner + 1))
            }
        }
    }

    /// How far the roller lifts off before a stroke [m].
    fn lift(&self, stroke: &ProgramStroke) -> f64 {
        let [up, down] =
            [stroke.approach, stroke.contacts[0].joints].map(|joints| self.arm.flange_at(&joints));
        (up.translation.vector - down.translation.vector).norm()
    }

    /// Of a free way [s].
    fn free(&self, from: &Joints, to: &Joints) -> f64 {
        self.fastest(from, to) / self.speeds.free
    }

    /// The least that a move takes [s].
    fn fastest(&self, from: &Joints, to: &Joints) -> f64 {
        let joints = self.arm.joints.iter().enumerate();
        joints
            .map(|(j, joint)| (to[j] - from[j]).abs() / joint.speed)
            .fold(0.0, f64::max)
    }
}

/// Where the arm is before stroke `k`.
fn last_of(strokes: &[ProgramStroke], k: usize, home: &Joints) -> Joints {
    k.checked_sub(1)
        .map_or(*home, |before| strokes[before].retreat)
}
