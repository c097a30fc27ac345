//! How finely time is stepped: two rates, and names for three pairs of them.

use serde::{Deserialize, Serialize};

use crate::file::ValueError;

/// Solves of the yarns' lengths in a substep under the roller, which pulls on all that it presses
/// at once: with one, paths rank less as in finite elements.
const PRESS_SWEEPS: usize = 2;

/// How finely cloth is stepped, owned by whoever steps it. Mesh, law and tool stay as asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stepping {
    /// Substeps [1/s].
    pub substep_rate: f64,
    /// Refreshes of the tool's tangent plane under each vertex [1/s].
    pub contact_rate: f64,
}

/// One control step in whole substeps, as [`Stepping::control`] rounds it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Control {
    /// Duration of the step [s].
    pub dt: f64,
    /// Substeps in it, > 0.
    pub substeps: usize,
    /// Substeps between two refreshes of the tangent planes, > 0. The first is at the start.
    pub contact_interval: usize,
    /// How often a substep solves for the lengths of the yarns, > 0; more than once where cloth
    /// is pressed. The Gauss-Seidel solver does so once.
    pub sweeps: usize,
}

impl Control {
    /// A step of `dt` [s] in which every substep solves once.
    pub const fn new(dt: f64, substeps: usize, contact_interval: usize) -> Self {
        Self {
            dt,
            substeps,
            contact_interval,
            sweeps: 1,
        }
    }
}

impl Stepping {
    /// Substeps and refreshes from one of each in every `interval` substeps.
    pub fn every(substep_rate: f64, interval: usize) -> Self {
        Self {
            substep_rate,
            contact_rate: substep_rate / interval as f64,
        }
    }

    /// Checks both rates; the error names key, found and expected.
    pub fn check(self) -> Result<(), ValueError> {
        ValueError::unless_within("substep_rate", self.substep_rate, [60.0, 1e6])?;
        ValueError::unless_within("contact_rate", self.contact_rate, [1.0, 1e6])
    }

    /// A control step of `dt` [s]: the nearest numbers of substeps, at least one each.
    pub fn control(self, dt: f64) -> Control {
        let whole = |x: f64| (x.round() as usize).max(1);
        let interval = whole(self.substep_rate / self.contact_rate);
        Control::new(dt, whole(dt * self.substep_rate), interval)
    }

    /// A control step of `dt` [s] under a roller.
    pub fn press(self, dt: f64) -> Control {
        Control {
            sweeps: PRESS_SWEEPS,
            ..self.control(dt)
        }
    }
}

/// A name for a point between speed and accuracy. `drape study verify` holds each against closed
/// forms, `drape study tradeoff` against the converged solution; `drape eval --prove --twin` against
/// finite elements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Accuracy {
    /// 5 substeps a frame of 1/60 s: previews, and statics of the yarn solver.
    Fast,
    /// 10 substeps a frame: the defaults of episodes, what is trained with.
    #[default]
    Balanced,
    /// 200 substeps a frame: what results are checked with.
    Accurate,
}

impl Accuracy {
    /// All of them, the fastest first.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Balanced, Self::Accurate];

    /// The accuracy of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|all| all.name() == name)
    }

    /// As in configurations and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Balanced => "balanced",
            Self::Accurate => "accurate",
        }
    }

    /// The rates that it stands for.
    pub fn stepping(self) -> Stepping {
        match self {
            Self::Fast => Stepping::every(300.0, 5),
            Self::Balanced => Stepping::every(600.0, 5),
            Self::Accurate => Stepping::every(12_000.0, 10),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accuracies_are_ordered_and_round_to_whole_substeps() {
        let steppings = Accuracy::ALL.map(Accuracy::stepping);
        assert!(steppings.is_sorted_by(|a, b| a.substep_rate < b.substep_rate));
        assert!(steppings.is_sorted_by(|a, b| a.contact_rate < b.contact_rate));
        for (accuracy, interval) in Accuracy::ALL.into_iter().zip([5, 5, 10]) {
            assert_eq!(Accuracy::named(accuracy.name()), Some(accuracy));
            let stepping = accuracy.stepping();
            assert_eq!(stepping.check(), Ok(()));
            let frame = stepping.control(1.0 / 60.0);
            assert_eq!(frame.substeps as f64, stepping.substep_rate / 60.0);
            assert_eq!(frame.contact_interval, interval);
            let least = stepping.control(1e-9);
            assert_eq!(least.substeps, 1);
        }
        let rare = Stepping {
            substep_rate: 100.0,
            contact_rate: 1e6,
        };
        assert_eq!(rare.control(1.0).contact_interval, 1);
    }
}
