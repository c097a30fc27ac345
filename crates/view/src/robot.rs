//! A robot beside the cloth: which presses it can make, and how it moves.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;

use drape_cloth::math::Vec3;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::message::Message;

/// Where a robot stands and what turns the tool.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotPlace {
    /// Of its base in the scene [mm].
    pub at_mm: [f64; 3],
    /// Of its base about the vertical [degrees].
    pub turn_deg: f64,
    /// By which the table turns at a time [degrees]; 0 where the tool stands still.
    pub step_deg: f64,
}

/// What a robot makes of presses.
pub struct ViewedRobot {
    /// What the arm is called.
    pub name: String,
    pub place: RobotPlace,
    /// Of each press in turn: its vertex, and why the robot does not make it, if so.
    pub points: Vec<(u32, Option<String>)>,
    /// How long the program takes [s]; none if it was only asked what can be reached.
    pub program_s: Option<f64>,
    /// Corners of the triangles of each part in its own frame [m].
    pub parts: Vec<Vec<[Vec3; 3]>>,
    /// In order; one at least.
    pub moments: Vec<RobotMoment>,
}

/// Where all parts are at a moment of the program.
pub struct RobotMoment {
    /// Since it began [s].
    pub at: f64,
    /// Presses up to the last that was made.
    pub pressed: u32,
    /// Of each part in the frame of the tool, which stands still: row by row, three of four numbers [m].
    pub poses: Vec<[f64; 12]>,
}

/// Asks a robot, on a thread of its own.
pub type RobotJob = Box<dyn FnOnce() -> Result<ViewedRobot, String> + Send>;

/// A robot as it is sent to pages.
pub struct Shown {
    /// Tells it from others of the session.
    pub number: u64,
    message: Vec<u8>,
}

impl Shown {
    pub fn new(number: u64, robot: &ViewedRobot) -> Arc<Self> {
        let header = json!({
            "kind": "robot",
            "robot": number,
            "name": robot.name,
            "place": robot.place,
            "program_s": robot.program_s,
            "faults": robot.points.iter().map(|(_, fault)| fault).collect::<Vec<_>>(),
        });
        let corners = |part: &Vec<[Vec3; 3]>| 3 * part.len() as u32;
        let moments = || robot.moments.iter();
        let message = Message::new(&header)
            .with("vertices", robot.points.iter().map(|(vertex, _)| *vertex))
            .with("counts", robot.parts.iter().map(corners))
            .with(
                "corners",
                (robot.parts.iter().flatten().flatten())
                    .flat_map(|x| [x.x as f32, x.y as f32, x.z as f32]),
            )
            .with("at", moments().map(|moment| moment.at as f32))
            .with("pressed", moments().map(|moment| moment.pressed))
            .with(
                "poses",
                (moments().flat_map(|moment| &moment.poses).flatten()).map(|&x| x as f32),
            )
            .bytes();
        Self { number, message }.into()
    }

    pub fn message(&self) -> Vec<u8> {
        self.message.clone()
    }
}

/// The robot that is shown, and what it is being asked. Of wishes that come meanwhile only the last is of use.
#[derive(Default)]
pub struct Asking {
    shown: Option<Arc<Shown>>,
    /// How many have been shown.
    count: u64,
    asked: Option<Receiver<Result<ViewedRobot, String>>>,
    wish: Option<(Option<RobotPlace>, bool)>,
}

impl Asking {
    pub fn wish(&mut self, place: Option<RobotPlace>, plan: bool) {
        self.wish = Some((place, plan));
    }

    /// What to ask next; none while something is asked.
    pub fn next(&mut self) -> Option<(Option<RobotPlace>, bool)> {
        self.wish.take_if(|_| self.asked.is_none())
    }

    /// Nothing that was found or asked is of use any more.
    pub fn forget(&mut self) {
        (self.shown, self.asked, self.wish) = (None, None, None);
    }

    pub fn begin(&mut self, job: RobotJob) {
        let (sender, receiver) = channel();
        let begun = thread::Builder::new().spawn(move || drop(sender.send(job())));
        self.asked = begun.ok().map(|_| receiver);
    }

    pub fn is_asked(&self) -> bool {
        self.asked.is_some()
    }

    pub fn shown(&self) -> Option<Arc<Shown>> {
        self.shown.clone()
    }

    /// Shows what has been found since, or says why nothing was.
    pub fn look(&mut self) -> Option<Result<(), String>> {
        let found = match self.asked.as_ref()?.try_recv() {
            Err(TryRecvError::Empty) => return None,
            found => found,
        };
        self.asked = None;
        let failed = |_| "the robot's plan has failed".into();
        let found = found.map_err(failed).and_then(|found| found);
        Some(found.map(|robot| self.show(&robot)))
    }

    /// Waits for what is being asked, if anything is, and shows it.
    pub fn wait(&mut self) -> Result<(), String> {
        match self.asked.take().map(|asked| asked.recv()) {
            None => Ok(()),
            Some(Ok(found)) => found.map(|robot| self.show(&robot)),
            Some(Err(_)) => Err("the robot's plan has failed".into()),
        }
    }

    fn show(&mut self, robot: &ViewedRobot) {
        self.count += 1;
        self.shown = Some(Shown::new(self.count, robot));
    }
}
