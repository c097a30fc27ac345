use super::state::Twin;
use super::step::Diverged;
use crate::fabric::Lamina;
use crate::sim::{Own, Presses, Roller, Snapshot, under_stencil};
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
        let pressure = config.roller.pressure * self.config.parameters.pressure;
        for &v in vertices {
            self.contact.pressure[v as usize] = pressure * self.area[v as usize];
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
    /// [m], and shows `observe` the twin at the start and after each.
    ///
    /// # Errors
    /// As for [`Twin::advance`].
    pub fn replay(
        &mut self,
        lamina: &Lamina,
        tool: &Tool,
        config: &PressConfig,
        list: &[u32],
        side: f64,
        mut observe: impl FnMut(&Self, &Presses),
    ) -> Result<Presses, Diverged> {
        let own = self.config.parameters.clone();
        let mut presses = Presses::new();
        observe(self, &presses);
        for &vertex in list {
            let position = |v| self.position(v);
            let (side, aim) = (side * own.stencil, own.aim(self.pressed.count));
            let under = under_stencil(lamina, tool, vertex, side, aim, position);
            presses.push((vertex, position(vertex)));
            let draped = self.press(tool, config, &under)?;
            let marks = |vertices: &[u32]| vertices.iter().map(|&v| v as usize).collect::<Vec<_>>();
            self.pressed.touched.extend(marks(&under));
            self.pressed.draped.extend(marks(&draped));
            self.pressed.stencil = under;
            self.pressed.count += 1;
            observe(self, &presses);
        }
        Ok(presses)
    }

    /// What the fast solver would go on from: all but what only a twin has.
    pub fn snapshot(&self) -> Snapshot {
        let held = (0..self.count).filter(|&v| self.held[v].is_some());
        let mut snapshot = Snapshot {
            velocity: self.velocities(),
            pressed: self.pressed.clone(),
            own: Own {
                parameters: self.config.parameters.clone(),
                ..Own::default()
            },
            ..Snapshot::at_rest(self.positions())
        };
        snapshot.fixed.extend(held);
        snapshot
    }
}
