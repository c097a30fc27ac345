use std::collections::BTreeSet;

use super::state::Twin;
use super::step::Diverged;
use crate::fabric::Lamina;
use crate::sim::{Roller, under_stencil};
use crate::tool::Tool;

/// What holds cloth that a press has laid on to the tool.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Hold {
    /// The pressure stays on, and friction holds (the paper's VDLOAD).
    #[default]
    Pressure,
    /// It is fixed where it is, as in the fast solver.
    Fixed,
}

/// How the roller presses, against the tool's normal nearest to each vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct PressConfig {
    pub roller: Roller,
    /// Duration of a press [s].
    pub press_s: f64,
    /// Time to settle after it [s].
    pub settle_s: f64,
    /// A vertex nearer to the tool than this after its press is draped [mm].
    pub drape_threshold_mm: f64,
    pub hold: Hold,
}

impl Default for PressConfig {
    fn default() -> Self {
        Self {
            roller: Roller {
                pressure: 1e6,
                speed: 1.0,
            },
            press_s: 1.0 / 30.0,
            settle_s: 0.0,
            drape_threshold_mm: 1.0,
            hold: Hold::Pressure,
        }
    }
}

/// How the presses of a list have ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Replay {
    /// All vertices that came to lie on the tool, ascending.
    pub draped: Vec<u32>,
    /// Why the list was not pressed to its end; none if it was.
    pub diverged: Option<Diverged>,
}

impl Twin {
    /// Presses on some vertices, and holds those that come to lie on the tool. Returns which.
    ///
    /// # Errors
    /// As for [`Twin::advance`].
    pub fn press(
        &mut self,
        tool: &Tool,
        config: &PressConfig,
        vertices: &[u32],
    ) -> Result<Vec<u32>, Diverged> {
        self.contact.press_speed = config.roller.speed;
        for &v in vertices {
            self.contact.pressure[v as usize] = config.roller.pressure * self.area[v as usize];
        }
        self.advance(Some(tool), config.press_s)?;
        let threshold = 1e-3 * config.drape_threshold_mm;
        let mut draped = Vec::new();
        for &v in vertices {
            let is_draped = tool.distance(self.position(v)).0 <= threshold;
            if is_draped {
                draped.push(v);
            }
            if !(is_draped && config.hold == Hold::Pressure) {
                self.contact.pressure[v as usize] = 0.0;
            }
            if is_draped && config.hold == Hold::Fixed && self.held[v as usize].is_none() {
                self.fix(v);
            }
        }
        self.advance(Some(tool), config.settle_s)?;
        Ok(draped)
    }

    /// Presses on the vertices of `list` one after the other, under a square roller of `side`
    /// [m], and shows `observe` the twin after each.
    pub fn replay(
        &mut self,
        lamina: &Lamina,
        tool: &Tool,
        config: &PressConfig,
        (list, side): (&[u32], f64),
        mut observe: impl FnMut(&Self),
    ) -> Replay {
        let mut draped = BTreeSet::new();
        let presses = list.iter().try_for_each(|&vertex| {
            let position = |v| self.position(v);
            let vertices = under_stencil(lamina, tool, vertex, side, position);
            draped.extend(self.press(tool, config, &vertices)?);
            observe(self);
            Ok(())
        });
        Replay {
            draped: draped.into_iter().collect(),
            diverged: presses.err(),
        }
    }
}
