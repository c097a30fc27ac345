//! Names for how finely time is stepped, from previews to what results are checked with.

use serde::{Deserialize, Serialize};

use super::physics::PhysicsConfig;
use super::state::Control;

/// How finely cloth is stepped: a name for a point between speed and accuracy.
///
/// A preset decides what the *method* does in a second and nothing of the scene: mesh, law and
/// tool stay those that were asked for, and falls have a rate of their own. `drape study verify`
/// holds each against closed forms, `drape study tradeoff` against the converged solution, and
/// `drape study transfer` against finite elements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// 5 substeps a frame of 1/60 s: previews, and statics of the yarn solver.
    Fast,
    /// 10 substeps a frame: the defaults of episodes, what is trained with.
    #[default]
    Balanced,
    /// 200 substeps a frame: what results are checked with.
    Accurate,
}

impl Preset {
    /// All of them, the fastest first.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Balanced, Self::Accurate];

    /// The preset of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|preset| preset.name() == name)
    }

    /// As in configurations and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Balanced => "balanced",
            Self::Accurate => "accurate",
        }
    }

    /// Substeps in a second [1/s].
    pub fn substep_rate(self) -> f64 {
        match self {
            Self::Fast => 300.0,
            Self::Balanced => 600.0,
            Self::Accurate => 12_000.0,
        }
    }

    /// Substeps between two looks for the tool's tangent planes.
    pub fn contact_interval(self) -> usize {
        match self {
            Self::Fast | Self::Balanced => 5,
            Self::Accurate => 10,
        }
    }

    /// `physics` with what this preset decides.
    pub fn applied(self, physics: PhysicsConfig) -> PhysicsConfig {
        PhysicsConfig {
            contact_interval: self.contact_interval(),
            ..physics
        }
    }

    /// A control step of about `dt` [s] in whole substeps, at least one.
    pub fn control(self, dt: f64) -> Control {
        Control {
            dt,
            substeps: ((dt * self.substep_rate()).round() as usize).max(1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_ordered_by_accuracy_and_keep_the_scene() {
        let rates = Preset::ALL.map(Preset::substep_rate);
        assert!(rates.is_sorted_by(|a, b| a < b));
        // Planes of the tool are looked up at least as often in a second.
        let looks = Preset::ALL.map(|p| p.substep_rate() / p.contact_interval() as f64);
        assert!(looks.is_sorted());
        for preset in Preset::ALL {
            assert_eq!(Preset::named(preset.name()), Some(preset));
            let frame = preset.control(1.0 / 60.0);
            assert_eq!(frame.substeps as f64, preset.substep_rate() / 60.0);
            assert_eq!(preset.control(1e-9).substeps, 1);
            let physics = PhysicsConfig {
                damping: 3.0,
                ..PhysicsConfig::default()
            };
            let applied = preset.applied(physics.clone());
            assert_eq!(applied.contact_interval, preset.contact_interval());
            let back = PhysicsConfig {
                contact_interval: physics.contact_interval,
                ..applied
            };
            assert_eq!(back, physics);
        }
    }
}
