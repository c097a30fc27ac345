use fixedbitset::FixedBitSet;
use serde::{Deserialize, Serialize};

use super::costs::Costs;
use super::objective::Objective;
use crate::path::{Robot, Rolling};
use drape_cloth::fabric::Lamina;
use drape_cloth::file::ValueError;
use drape_cloth::scene::Scene;
use drape_cloth::sim::{Accuracy, Device, Mask, Parameters, Precision, Roller, Stepping};

/// The draping task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EnvConfig {
    /// Focus region on the flat blank [mm, in its frame]: least x, least y, greatest x,
    /// greatest y. The whole blank if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub region_mm: Option<[f64; 4]>,
    /// Shows the agent the focus region only, instead of the whole blank.
    pub crop: bool,
    /// Where the agent may press, and when an episode ends.
    #[serde(skip_serializing_if = "is_default")]
    pub mask: Mask,
    /// What episodes are judged by and rewarded for.
    pub objective: Objective,
    /// Side of the square stencil [mm].
    pub stencil_mm: f64,
    /// A touched vertex nearer to the tool than this is draped [mm].
    pub drape_threshold_mm: f64,
    /// A yarn stretched by more than this [-] pulls a vertex off the tool again: the vertex
    /// is draped once a press leaves it at most this much.
    pub drape_strain: f64,
    /// Duration of a press [s]; the roller is gone at its end.
    pub press_s: f64,
    /// Pressure of the roller under the stencil [N/mm^2].
    pub press_mpa: f64,
    /// Speed at which the roller comes down [m/s]; cloth as fast feels no pressure.
    pub press_speed: f64,
    /// Time to settle after the press [s].
    pub settle_s: f64,
    /// Where the way turns by more, a stroke ends [degrees], see [`Rolling`]; 90 is no bound.
    pub roller_turn_deg: f64,
    /// How finely episodes are stepped, unless the two rates below say otherwise.
    pub accuracy: Accuracy,
    /// Substeps [1/s].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub substep_rate: Option<f64>,
    /// Refreshes of the tool's tangent planes [1/s].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact_rate: Option<f64>,
    /// Steps after which an episode is truncated; none if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_steps: Option<usize>,
    /// An episode that leaves a yarn stretched by more than this [-] has diverged,
    pub max_tension: f64,
    /// and one that leaves a vertex deeper in the tool [mm].
    pub max_depth_mm: f64,
    pub precision: Precision,
    /// Where the cloth is computed: `cpu`, `gpu` or `gpu:N`.
    #[serde(skip_serializing_if = "is_default")]
    pub device: Device,
    /// What is taken off the score of a path that is polished or proved.
    pub costs: Costs,
    /// How its world differs from what scene and task say.
    #[serde(skip_serializing_if = "is_default")]
    pub parameters: Parameters,
    /// Which presses are possible at all. Files do not have it: it is made from a cell, once the tool is known.
    #[serde(skip)]
    pub robot: Robot,
}

impl Default for EnvConfig {
    fn default() -> Self {
        Self {
            region_mm: None,
            crop: false,
            mask: Mask::Stroke,
            objective: Objective::default(),
            stencil_mm: 18.0,
            drape_threshold_mm: 1.0,
            drape_strain: 0.1,
            press_s: 1.0 / 60.0,
            press_mpa: 1.0,
            press_speed: 4.0,
            settle_s: 0.0,
            roller_turn_deg: 90.0,
            accuracy: Accuracy::default(),
            substep_rate: None,
            contact_rate: None,
            max_steps: None,
            max_tension: 0.5,
            max_depth_mm: 2.0,
            precision: Precision::F32,
            device: Device::Cpu,
            costs: Costs::default(),
            parameters: Parameters::default(),
            robot: Robot::default(),
        }
    }
}

/// Resolved configurations without the key read as they always did.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// The vertices of the focus region, and the rows and columns, ends exclusive, that hold them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Region {
    pub rows: std::ops::Range<usize>,
    pub columns: std::ops::Range<usize>,
    /// One bit a vertex of the blank. In rows and columns that run obliquely to the region, or
    /// over a hole, not every place has one.
    pub vertices: FixedBitSet,
}

impl Region {
    /// Inner vertices, all eight neighbours within the region, that are farther than `threshold` [m] from
    /// the tool of `scene`: the paper counts these, as the border hangs on cloth that nobody presses.
    pub fn undraped_inner(&self, scene: &Scene, threshold: f64, at: &[[f64; 3]]) -> usize {
        let has = |v: u32| self.vertices.contains(v as usize);
        let is_inner = |v: &usize| {
            let near = || scene.lamina.neighbors(*v as u32);
            near().count() == 8 && near().all(has)
        };
        let inner = self.vertices.ones().filter(is_inner);
        inner
            .filter(|&v| scene.tool.distance(at[v]).0 > threshold)
            .count()
    }
}

impl EnvConfig {
    /// The paper's: the agent sees the whole blank and brings down its distance to the tool.
    pub fn paper() -> Self {
        Self {
            objective: Objective::Distance,
            ..Self::default()
        }
    }

    /// The agent sees its region only. The roller is too slow to throw cloth about, and cloth rests before the next press, as
    /// under a robot (docs/NOTES.md).
    pub fn compact() -> Self {
        Self {
            crop: true,
            press_s: 0.03,
            press_speed: 2.0,
            settle_s: 0.03,
            ..Self::default()
        }
    }

    /// How finely episodes are stepped: a rate that is given, else that of the accuracy.
    pub fn stepping(&self) -> Stepping {
        let named = self.accuracy.stepping();
        Stepping {
            substep_rate: self.substep_rate.unwrap_or(named.substep_rate),
            contact_rate: self.contact_rate.unwrap_or(named.contact_rate),
        }
    }

    /// Steps episodes as `accuracy` says, whatever rates were given.
    pub fn set_accuracy(&mut self, accuracy: Accuracy) {
        (self.accuracy, self.substep_rate, self.contact_rate) = (accuracy, None, None);
    }

    /// Steps episodes as `stepping` says.
    pub fn set_stepping(&mut self, stepping: Stepping) {
        self.substep_rate = Some(stepping.substep_rate);
        self.contact_rate = Some(stepping.contact_rate);
    }

    /// A touched vertex this near to the tool is draped [m].
    pub fn drape_threshold(&self) -> f64 {
        1e-3 * self.drape_threshold_mm
    }

    /// What presses, here and in the finite-element twin.
    pub fn roller(&self) -> Roller {
        Roller {
            pressure: 1e6 * self.press_mpa,
            speed: self.press_speed,
        }
    }

    /// Presses nearer to each other than the stencil is wide are of one stroke, unless the roller would have to turn too far.
    pub fn rolling(&self) -> Rolling {
        Rolling {
            join_distance: 1e-3 * self.stencil_mm,
            turn: self.roller_turn_deg.to_radians(),
        }
    }

    /// Checks every value and finds the region on the blank; the error names key, found and
    /// expected.
    pub fn region(&self, lamina: &Lamina) -> Result<Region, ValueError> {
        self.checked_region(lamina)
            .map_err(|error| error.within("env"))
    }

    fn checked_region(&self, lamina: &Lamina) -> Result<Region, ValueError> {
        for (key, value, range) in [
            ("stencil_mm", self.stencil_mm, [1e-3, 1e5]),
            ("drape_threshold_mm", self.drape_threshold_mm, [1e-6, 1e5]),
            ("drape_strain", self.drape_strain, [1e-9, 1e5]),
            ("press_mpa", self.press_mpa, [1e-6, 1e3]),
            ("press_speed", self.press_speed, [1e-3, 100.0]),
            ("roller_turn_deg", self.roller_turn_deg, [0.0, 90.0]),
            ("max_tension", self.max_tension, [1e-3, 1e5]),
            ("max_depth_mm", self.max_depth_mm, [1e-3, 1e5]),
        ] {
            ValueError::unless_within(key, value, range)?;
        }
        self.costs.check().map_err(|error| error.within("costs"))?;
        self.parameters
            .check()
            .map_err(|error| error.within("parameters"))?;
        let stepping = self.stepping();
        stepping.check()?;
        let (press, settle, substep) = (self.press_s, self.settle_s, 1.0 / stepping.substep_rate);
        let expected = format!("a time from one substep, {substep} s, to 10 s");
        let is_valid = |time: f64| time >= substep * (1.0 - 1e-9) && time <= 10.0;
        ValueError::unless(is_valid(press), "press_s", press, &expected)?;
        let (is_valid, expected) = (is_valid(settle), format!("0, or {expected}"));
        ValueError::unless(settle == 0.0 || is_valid, "settle_s", settle, expected)?;
        ValueError::unless(self.max_steps != Some(0), "max_steps", 0, "a number > 0")?;
        // A vertex exactly on the border of the region belongs to it.
        let slack = 1e-9;
        let inside = |at: &[f64; 2]| {
            self.region_mm.is_none_or(|[x0, y0, x1, y1]| {
                let between = |at: f64, low: f64, high: f64| {
                    low * 1e-3 - slack <= at && at <= high * 1e-3 + slack
                };
                between(at[0], x0, x1) && between(at[1], y0, y1)
            })
        };
        let mut vertices = FixedBitSet::with_capacity(lamina.vertex_count());
        for (vertex, at) in lamina.rest.iter().enumerate() {
            vertices.set(vertex, inside(at));
        }
        let range = |k: usize| {
            let places = || vertices.ones().map(|v| lamina.place(v as u32)[k]);
            Some(places().min()?..places().max()? + 1)
        };
        match (range(0), range(1)) {
            (Some(rows), Some(columns)) => Ok(Region {
                rows,
                columns,
                vertices,
            }),
            _ => {
                let found = format!("{:?}", self.region_mm.unwrap_or_default());
                let expected = "[least x, least y, greatest x, greatest y] with vertices of the \
                                blank inside";
                Err(ValueError::new("region_mm", found, expected))
            }
        }
    }
}

#[cfg(test)]
mod tests;
