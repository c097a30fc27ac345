use serde::{Deserialize, Serialize};

use crate::path::PathFigures;
use drape_cloth::file::ValueError;

/// What a path that is given to a robot costs, as shares of its score. Where paths are polished and proved
/// it is taken off; learning does without: a policy that pays for strokes learns to crush instead.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Costs {
    /// Each stroke, as [`PathFigures`] count them on the tool,
    pub stroke: f64,
    /// each sharp turn within one,
    pub turn: f64,
    /// each metre of the way from press to press,
    pub metre: f64,
    /// and each inner vertex that ends off the tool, see [`Region::undraped_inner`](super::Region::undraped_inner).
    pub undraped: f64,
}

impl Costs {
    pub(super) fn check(&self) -> Result<(), ValueError> {
        for (key, value) in [
            ("stroke", self.stroke),
            ("turn", self.turn),
            ("metre", self.metre),
            ("undraped", self.undraped),
        ] {
            ValueError::unless_within(key, value, [0.0, 1.0])?;
        }
        Ok(())
    }

    /// Of a path that has left so many inner vertices undraped.
    pub(super) fn of(&self, path: &PathFigures, undraped: usize) -> f64 {
        self.stroke * path.strokes
            + self.turn * path.sharp_turns
            + self.metre * (path.length_m + path.jump_m)
            + self.undraped * undraped as f64
    }
}
