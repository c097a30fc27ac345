use serde::{Deserialize, Serialize};

use crate::path::PathFigures;
use drape_cloth::file::ValueError;

/// What a path that is given to a robot costs, as shares of its score, and how long a robot takes. Where
/// paths are judged it is taken off; learning does without: a policy that pays for strokes learns to crush
/// instead.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Costs {
    /// Each second of the robot's,
    pub second: f64,
    /// and each inner vertex that ends off the tool, see [`Region::undraped_inner`](super::Region::undraped_inner).
    pub undraped: f64,
    /// and each vertex that no stencil has been over: what becomes of it hangs on how far cloth is dragged,
    pub untouched: f64,
    /// and each press that the run's robot cannot make, see [`Feasibility::infeasible`](crate::path::Feasibility::infeasible).
    pub infeasible: f64,
    /// How long the robot takes for a press, beside its way [s],
    pub press_s: f64,
    /// to come down on the tool for a stroke, as [`PathFigures`] count them, and up again [s],
    pub stroke_s: f64,
    /// and for a sharp turn within one [s];
    pub turn_s: f64,
    /// how fast it goes in contact and from stroke to stroke [mm/s].
    pub contact_mm_s: f64,
    pub jump_mm_s: f64,
}

impl Default for Costs {
    fn default() -> Self {
        Self {
            second: 0.0,
            undraped: 0.0,
            untouched: 0.0,
            infeasible: 0.05,
            press_s: 0.2,
            stroke_s: 3.0,
            turn_s: 1.0,
            contact_mm_s: 100.0,
            jump_mm_s: 250.0,
        }
    }
}

impl Costs {
    pub(super) fn check(&self) -> Result<(), ValueError> {
        let (share, time, speed) = ([0.0, 1.0], [0.0, 3600.0], [1.0, 1e4]);
        for (key, value, range) in [
            ("second", self.second, share),
            ("undraped", self.undraped, share),
            ("untouched", self.untouched, share),
            ("infeasible", self.infeasible, share),
            ("press_s", self.press_s, time),
            ("stroke_s", self.stroke_s, time),
            ("turn_s", self.turn_s, time),
            ("contact_mm_s", self.contact_mm_s, speed),
            ("jump_mm_s", self.jump_mm_s, speed),
        ] {
            ValueError::unless_within(key, value, range)?;
        }
        Ok(())
    }

    /// How long a robot takes for a path [s].
    pub fn seconds(&self, path: &PathFigures) -> f64 {
        self.press_s * path.presses
            + self.stroke_s * path.strokes
            + self.turn_s * path.sharp_turns
            + 1e3 * (path.length_m / self.contact_mm_s + path.jump_m / self.jump_mm_s)
    }

    /// Of a path that has left so many inner vertices undraped, and so many untouched.
    pub(super) fn of(&self, path: &PathFigures, undraped: usize, untouched: usize) -> f64 {
        self.second * self.seconds(path)
            + self.undraped * undraped as f64
            + self.untouched * untouched as f64
    }
}
