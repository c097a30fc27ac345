use serde::{Deserialize, Serialize};

use crate::file::ValueError;

/// The unit of a file, which says nothing of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Unit {
    Mm,
    Cm,
    In,
    M,
}

impl Unit {
    /// All of them, the smallest first.
    pub const ALL: [Self; 4] = [Self::Mm, Self::Cm, Self::In, Self::M];

    /// Its length [m].
    pub fn metres(self) -> f64 {
        match self {
            Self::Mm => 1e-3,
            Self::Cm => 1e-2,
            Self::In => 0.0254,
            Self::M => 1.0,
        }
    }

    /// As in configurations.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mm => "mm",
            Self::Cm => "cm",
            Self::In => "in",
            Self::M => "m",
        }
    }
}

/// What the coordinates of a scan count from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ScanFrame {
    /// A frame of the scanner's own, that is to be found.
    #[default]
    Scanner,
    /// That of the scene.
    Scene,
}

/// A point that is known in a scan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mark {
    /// Where the scanner saw it, in its frame and the unit of its file.
    pub seen: [f64; 3],
    /// Its place on the flat blank, as of a clamp [mm],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_mm: Option<[f64; 2]>,
    /// or where it stands in the scene, on the tool say [mm].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene_mm: Option<[f64; 3]>,
}

impl Mark {
    /// Checks that it is at one place, in the world.
    pub(super) fn check(&self) -> Result<(), ValueError> {
        let found = match (self.at_mm, self.scene_mm) {
            (Some(_), None) | (None, Some(_)) => None,
            (None, None) => Some("neither"),
            _ => Some("both"),
        };
        let expected = "one of `at_mm` and `scene_mm`";
        ValueError::unless(
            found.is_none(),
            "at_mm",
            found.unwrap_or_default(),
            expected,
        )?;
        let places = self.seen.iter().chain(self.at_mm.iter().flatten());
        for &x in places.chain(self.scene_mm.iter().flatten()) {
            ValueError::unless_within("seen", x, [-1e6, 1e6])?;
        }
        Ok(())
    }
}
