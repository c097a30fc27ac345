use serde::{Deserialize, Serialize};

use super::config::TwinError;
use super::step::Diverged;
use super::twin::Twin;
use crate::fabric::Lamina;
use crate::math::Vec3;
use crate::tool::Tool;

/// How far on the flat blank to look for vertices below the box, in its sides: more cloth than
/// the box itself lies below it in a wrinkle.
const REACH: f64 = 1.5;

/// Which way pressure acts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PressDirection {
    /// Against the tool's normal nearest to each vertex.
    #[default]
    ToolNormal,
    /// Along -z.
    Down,
}

/// What holds cloth that a press has laid on to the tool.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hold {
    /// The pressure stays on, and friction holds (the paper's VDLOAD).
    #[default]
    Pressure,
    /// It is fixed where it is, as in the fast solver.
    Fixed,
}

/// How the roller presses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PressConfig {
    /// Pressure [N/mm^2].
    pub pressure_mpa: f64,
    /// Speed at which the roller comes down [m/s]. The pressure falls to nothing where cloth is
    /// as fast: without that, 1 N/mm^2 throws bare vertices at the tool with some 100 m/s.
    pub speed: f64,
    /// Duration of a press [s].
    pub press_s: f64,
    /// Time to settle after it [s].
    pub settle_s: f64,
    /// A vertex nearer to the tool than this after its press is draped [mm].
    pub drape_threshold_mm: f64,
    pub direction: PressDirection,
    pub hold: Hold,
}

impl Default for PressConfig {
    fn default() -> Self {
        Self {
            pressure_mpa: 1.0,
            speed: 1.0,
            press_s: 1.0 / 30.0,
            settle_s: 0.0,
            drape_threshold_mm: 1.0,
            direction: PressDirection::ToolNormal,
            hold: Hold::Pressure,
        }
    }
}

impl PressConfig {
    /// Checks every value; the error names key, found and expected.
    pub fn check(&self) -> Result<(), TwinError> {
        let positive = [
            ("press.pressure_mpa", self.pressure_mpa, 1e6),
            ("press.speed", self.speed, 1e6),
            ("press.press_s", self.press_s, 600.0),
            ("press.drape_threshold_mm", self.drape_threshold_mm, 1e5),
        ];
        for (key, value, most) in positive {
            if !(value > 0.0 && value <= most) {
                return Err(TwinError {
                    key,
                    found: value.to_string(),
                    expected: "a number > 0 in a sensible range",
                });
            }
        }
        if !(0.0..=600.0).contains(&self.settle_s) {
            return Err(TwinError {
                key: "press.settle_s",
                found: self.settle_s.to_string(),
                expected: "a number from 0 to 600",
            });
        }
        Ok(())
    }
}

/// One press of a list.
#[derive(Clone, Debug, PartialEq)]
pub struct PressAction {
    /// The vertices under the roller.
    pub vertices: Vec<u32>,
}

/// The vertices below a square of `side` [m] around `vertex`, ascending: its normal is that of
/// the tool there, one side along the projection of x (of y where x is steep). It is extended
/// along its normal both ways, through all cloth of the neighbourhood.
pub fn under_box(
    lamina: &Lamina,
    tool: &Tool,
    vertex: u32,
    side: f64,
    positions: &[[f64; 3]],
) -> Vec<u32> {
    let centre = Vec3::from(positions[vertex as usize]);
    let normal = Vec3::from(tool.distance(centre.into()).1);
    let flat = |axis: Vec3| axis - normal * normal.dot(&axis);
    let (x, y) = (flat(Vec3::x()), flat(Vec3::y()));
    let along = if x.norm() > 0.1 { x } else { y }.normalize();
    let across = normal.cross(&along);
    // A vertex exactly on the border is below, however it was rounded.
    let half = 0.5 * side * (1.0 + 1e-6);
    let is_below = |v: &u32| {
        let offset = Vec3::from(positions[*v as usize]) - centre;
        *v == vertex || offset.dot(&along).abs() <= half && offset.dot(&across).abs() <= half
    };
    lamina
        .within(vertex, REACH * side)
        .filter(is_below)
        .collect()
}

impl Twin {
    /// Presses on some vertices, and holds those that come to lie on the tool. Returns which.
    /// `config` must have been checked.
    ///
    /// # Errors
    /// As for [`Twin::advance`].
    pub fn press(
        &mut self,
        tool: &Tool,
        config: &PressConfig,
        action: &PressAction,
    ) -> Result<Vec<u32>, Diverged> {
        self.contact.press_speed = config.speed;
        self.contact.press_down = config.direction == PressDirection::Down;
        for &v in &action.vertices {
            let v = v as usize;
            self.contact.pressure[v] = 1e6 * config.pressure_mpa * self.area[v];
        }
        self.advance(Some(tool), config.press_s)?;
        let threshold = 1e-3 * (config.drape_threshold_mm + self.config.contact_offset_mm);
        let mut draped = Vec::new();
        for &v in &action.vertices {
            let is_draped = tool.distance(self.position(v)).0 <= threshold;
            if is_draped {
                draped.push(v);
            }
            if !(is_draped && config.hold == Hold::Pressure) {
                self.contact.pressure[v as usize] = 0.0;
            }
            if is_draped && config.hold == Hold::Fixed && !self.is_held(v) {
                self.fix(v);
            }
        }
        self.advance(Some(tool), config.settle_s)?;
        Ok(draped)
    }

    /// Presses on a list of vertices one after the other, under a square roller of `side` [m].
    /// `seen` is shown the twin and what was draped after each. Returns all draped vertices,
    /// ascending.
    ///
    /// # Errors
    /// As for [`Twin::advance`].
    pub fn replay(
        &mut self,
        lamina: &Lamina,
        tool: &Tool,
        config: &PressConfig,
        (actions, side): (&[u32], f64),
        mut seen: impl FnMut(&Self, &[u32]),
    ) -> Result<Vec<u32>, Diverged> {
        let mut all = std::collections::BTreeSet::new();
        for &vertex in actions {
            let vertices = under_box(lamina, tool, vertex, side, &self.positions());
            let draped = self.press(tool, config, &PressAction { vertices })?;
            seen(self, &draped);
            all.extend(draped);
        }
        Ok(all.into_iter().collect())
    }
}
