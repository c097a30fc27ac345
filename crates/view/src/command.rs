use drape_cloth::scene::{Clamp, Placement};
use drape_cloth::sim::Accuracy;
use serde::Deserialize;

use super::robot::RobotPlace;

/// What a page asks of the session.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Command {
    /// Presses vertices in turn.
    Press {
        vertices: Vec<u32>,
    },
    Undo {},
    Redo {},
    /// Back to where the blank lay before the first press.
    Reset {},
    /// Shows a moment: of the fall, and then after so many presses.
    Seek {
        to: usize,
    },
    /// Goes on through the moments, or with what the policy wants.
    Play {
        on: bool,
    },
    /// Lets the policy press on.
    Follow {
        on: bool,
    },
    Pause {
        on: bool,
    },
    /// One press that waits, or one moment.
    Step {},
    /// Moments a second.
    Speed {
        rate: f64,
    },
    Accuracy {
        name: Accuracy,
    },
    /// Holds a vertex and pulls it to a place in the frame of the tool [m].
    Pull {
        vertex: u32,
        to: [f64; 3],
    },
    Release {},
    /// Another task.
    Task {
        change: Change,
    },
    /// Takes what the run has found so far instead of what was pressed.
    Path {},
    /// Keeps what was pressed beside what is pressed next; puts away what stands there.
    Beside {},
    /// Asks what a robot reaches, where it stands or there, and if `plan` how it moves.
    Robot {
        place: Option<RobotPlace>,
        plan: bool,
    },
    SavePresses {},
    SaveTask {},
}

/// What a page changes of the task. What is not given stays, but for the region.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Change {
    /// Least x and y, greatest x and y; all of the blank if not given.
    pub region_mm: Option<[f64; 4]>,
    pub placement: Option<Placement>,
    pub clamps: Option<Vec<Clamp>>,
    /// Names of those that are offered.
    pub tool: Option<String>,
    pub material: Option<String>,
}
