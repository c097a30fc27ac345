//! What a page is shown, and where all find it.

use std::sync::atomic::{AtomicU64, Ordering::SeqCst};
use std::sync::{Arc, Mutex, PoisonError};

use drape_cloth::sim::Snapshot;
use drape_task::env::{Draping, Task};
use serde::Serialize;
use serde_json::Value;

use super::host::Rival;
use super::message::Message;
use super::robot::Shown;
use super::shade::Shade;
use super::stage::Stage;

/// How well presses have done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Numbers {
    /// Summed distance of the region to the tool [m].
    pub distance_m: f64,
    /// Mean surplus of its yarns [mm].
    pub surplus_mm: f64,
    /// None where there is nothing to win.
    pub score: Option<f64>,
    /// Inner vertices off the tool.
    pub undraped: usize,
    pub presses: usize,
    pub strokes: usize,
    /// What a robot takes for it [s].
    pub robot_s: f64,
}

impl Numbers {
    pub fn of(task: &Task, state: &Snapshot, draping: &Draping) -> Self {
        let path = task.figures(&draping.points(0));
        Self {
            distance_m: task.distance(state),
            surplus_mm: 1e3 * task.surplus(state),
            score: task.can_win().then(|| task.score(state)),
            undraped: task.undraped_inner(state),
            presses: path.presses as usize,
            strokes: path.strokes as usize,
            robot_s: task.config.costs.seconds(&path),
        }
    }
}

/// All that is told in words and single numbers.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Status {
    /// `falling` or `ready`.
    pub phase: &'static str,
    /// Share of the fall that is done.
    pub share: f64,
    /// Number of the moment that is shown, how many there are, and how many of them are of the fall.
    pub at: usize,
    pub count: usize,
    pub fall: usize,
    pub waiting: usize,
    pub paused: bool,
    pub playing: bool,
    pub following: bool,
    pub rate: f64,
    pub accuracy: &'static str,
    pub has_policy: bool,
    /// Something was pulled by hand: no task has this.
    pub pulled: bool,
    pub over: bool,
    pub numbers: Numbers,
    /// Distance [m], surplus [mm] and score of what is shown beside.
    pub beside: Option<[f64; 3]>,
    pub rivals: Vec<Rival>,
    /// Vertices that were pressed, stroke by stroke.
    pub strokes: Vec<Vec<u32>>,
    /// What is odd about the scene.
    pub oddities: Vec<String>,
    /// The last words to the user, numbered.
    pub notices: Vec<(u64, String)>,
    pub curves: Value,
    /// Names of tools and materials to choose from.
    pub tools: Vec<String>,
    pub materials: Vec<String>,
    /// A robot is being asked, and the number of that which is shown, or 0.
    pub plans: bool,
    pub robot: u64,
    /// Digest of the positions' bits.
    pub bits: String,
}

/// A state of the cloth, and all that is told about it.
#[derive(Default)]
pub struct Moment {
    /// Each has a greater one than those before.
    pub number: u64,
    pub stage: Option<Arc<Stage>>,
    pub robot: Option<Arc<Shown>>,
    /// In the frame of the tool [m].
    pub position: Vec<[f64; 3]>,
    /// The sheet beside it [m].
    pub beside: Option<Vec<[f64; 3]>>,
    /// Those of [`drape_cloth::sim::Observations::marks`], and `REGION`, `CLAMPED` and `PULLED` of `stage.rs` `[vertex]`.
    pub marks: Vec<u8>,
    /// Probability of each press, as the policy has it `[vertex]`; empty without one.
    pub advice: Vec<f32>,
    pub status: Status,
}

impl Moment {
    /// As it is sent to a page that wants this `shade`.
    pub fn message(&self, shade: Shade) -> Message {
        #[derive(Serialize)]
        struct Header<'a> {
            kind: &'static str,
            number: u64,
            stage: u64,
            /// Where the sheet and that beside it lie [m], and their values.
            boxes: [Option<&'a Packed>; 2],
            #[serde(flatten)]
            status: &'a Status,
        }
        let stage = self.stage.as_ref();
        let packed = |at: &[[f64; 3]], advice: &[f32]| {
            let values = stage.map(|stage| shade.values(stage, at, advice));
            Packed::new(at, values.unwrap_or_default())
        };
        let own = packed(&self.position, &self.advice);
        let beside = self.beside.as_ref().map(|at| packed(at, &[]));
        let normal = |&x: &[f64; 3]| {
            let normal = stage.map(|stage| stage.scene.tool.distance(x).1);
            normal
                .unwrap_or_default()
                .map(|n| (127.0 * n).round() as i8)
        };
        let header = Header {
            kind: "moment",
            number: self.number,
            stage: stage.map_or(0, |stage| stage.number),
            boxes: [Some(&own), beside.as_ref()],
            status: &self.status,
        };
        let mut message = Message::new(&header)
            .with("marks", self.marks.iter().copied())
            .with("normal", self.position.iter().flat_map(normal));
        for (name, packed) in [("", Some(own)), ("beside_", beside)] {
            if let Some(Packed { place, value, .. }) = packed {
                message = message.with(&format!("{name}position"), place);
                message = message.with(&format!("{name}value"), value);
            }
        }
        message
    }
}

/// A sheet in 16 bits a number.
#[derive(Serialize)]
struct Packed {
    low: [f64; 3],
    size: [f64; 3],
    /// Least and greatest value.
    range: [f32; 2],
    #[serde(skip)]
    place: Vec<u16>,
    #[serde(skip)]
    value: Vec<u16>,
}

impl Packed {
    fn new(at: &[[f64; 3]], values: Vec<f32>) -> Self {
        let extreme =
            |k: usize, start: f64, of: fn(f64, f64) -> f64| at.iter().map(|x| x[k]).fold(start, of);
        let low = [0, 1, 2].map(|k| extreme(k, f64::INFINITY, f64::min));
        let high = [0, 1, 2].map(|k| extreme(k, f64::NEG_INFINITY, f64::max));
        let size = [0, 1, 2].map(|k| (high[k] - low[k]).max(1e-9));
        let least = values.iter().copied().fold(f32::INFINITY, f32::min);
        let most = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let span = (most - least).max(1e-9);
        let short = |share: f64| (65535.0 * share).round() as u16;
        let place = |x: &[f64; 3]| [0, 1, 2].map(|k| short((x[k] - low[k]) / size[k]));
        let value = |v: &f32| short(f64::from((v - least) / span));
        Self {
            low,
            size,
            range: [least, most],
            place: at.iter().flat_map(place).collect(),
            value: values.iter().map(value).collect(),
        }
    }
}

/// Where the session puts the newest moment, and pages find it.
#[derive(Default)]
pub struct Shared {
    newest: Mutex<Option<Arc<Moment>>>,
    number: AtomicU64,
}

impl Shared {
    /// The newest moment; none before the first.
    pub fn newest(&self) -> Option<Arc<Moment>> {
        self.newest
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Its number; 0 before the first.
    pub fn number(&self) -> u64 {
        self.number.load(SeqCst)
    }

    pub(super) fn publish(&self, mut moment: Moment) {
        let number = self.number() + 1;
        (moment.number, moment.status.bits) = (number, digest(&moment.position));
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some(moment.into());
        self.number.store(number, SeqCst);
    }
}

/// Of all bits of some places: tells different ones apart.
fn digest(position: &[[f64; 3]]) -> String {
    let words = position.as_flattened().iter().map(|x| x.to_bits());
    let mix = |hash: u64, word: u64| {
        let mixed = (hash ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        mixed ^ mixed >> 32
    };
    format!("{:016x}", words.fold(1, mix))
}
