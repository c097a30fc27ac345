use serde::{Deserialize, Serialize};

use crate::file::ValueError;
use crate::math::{Purpose, Stream};

/// What an environment has of its own from one reset to the next; all else it shares with the others
/// of its [`World`](super::World).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Own {
    /// Numbers of its tool, start and view among those of the world.
    pub tool: u16,
    pub start: u16,
    pub view: u16,
    pub parameters: Parameters,
}

/// How an environment differs from what model, stencil and roller say. Factors are on warp and weft, unless
/// said otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Parameters {
    /// On the stiffness of yarns in tension, in compression, and in bending.
    pub tension: [f64; 2],
    pub compression: [f64; 2],
    pub bending: [f64; 2],
    /// On positive and negative shear.
    pub shear: [f64; 2],
    /// On static and dynamic friction.
    pub friction: [f64; 2],
    /// On the areal mass, the pressure of the roller, and the side of the stencil.
    pub areal_mass: f64,
    pub pressure: f64,
    pub stencil: f64,
    /// How far presses land from their vertices, along the sides of the stencil [mm], and how they are
    /// turned about them [degrees].
    pub offset_mm: [f64; 2],
    pub tilt_deg: [f64; 2],
    /// Standard deviations of both from press to press, drawn under `seed`.
    pub offset_deviation_mm: f64,
    pub tilt_deviation_deg: f64,
    /// Share of presses that do not reach the cloth, drawn so, too.
    pub misses: f64,
    pub seed: u64,
}

/// Where a press lands against its vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Aim {
    /// Along the sides of the stencil [m].
    pub offset: [f64; 2],
    /// Turns of the stencil about its sides [rad].
    pub tilt: [f64; 2],
}

impl Aim {
    /// How far away a press lands that does not reach the cloth: beyond any blank [m].
    pub(super) const MISSED: f64 = 1e4;

    /// Whether it does not reach the cloth.
    pub fn misses(&self) -> bool {
        self.offset[0] >= Self::MISSED
    }
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            tension: [1.0; 2],
            compression: [1.0; 2],
            bending: [1.0; 2],
            shear: [1.0; 2],
            friction: [1.0; 2],
            areal_mass: 1.0,
            pressure: 1.0,
            stencil: 1.0,
            offset_mm: [0.0; 2],
            tilt_deg: [0.0; 2],
            offset_deviation_mm: 0.0,
            tilt_deviation_deg: 0.0,
            misses: 0.0,
            seed: 0,
        }
    }
}

impl Parameters {
    /// Checks every value; the error names key, found and expected.
    pub fn check(&self) -> Result<(), ValueError> {
        let (factors, far, tilted) = ([1e-3, 1e3], [-100.0, 100.0], [-45.0, 45.0]);
        let [farther, more_tilted] = [far, tilted].map(|[_, max]| [0.0, max]);
        for (key, values, range) in [
            ("tension", &self.tension[..], factors),
            ("compression", &self.compression, factors),
            ("bending", &self.bending, factors),
            ("shear", &self.shear, factors),
            ("friction", &self.friction, factors),
            ("areal_mass", &[self.areal_mass], factors),
            ("pressure", &[self.pressure], factors),
            ("stencil", &[self.stencil], factors),
            ("offset_mm", &self.offset_mm, far),
            ("tilt_deg", &self.tilt_deg, tilted),
            ("offset_deviation_mm", &[self.offset_deviation_mm], farther),
            (
                "tilt_deviation_deg",
                &[self.tilt_deviation_deg],
                more_tilted,
            ),
            ("misses", &[self.misses], [0.0, 0.9]),
        ] {
            for &value in values {
                ValueError::unless_within(key, value, range)?;
            }
        }
        Ok(())
    }

    /// What both say together: factors are multiplied, places and turns added, and scatters as of
    /// independent draws, under the seed of `other`.
    pub fn and(&self, other: &Self) -> Self {
        let each =
            |a: [f64; 2], b: [f64; 2], of: fn(f64, f64) -> f64| [0, 1].map(|k| of(a[k], b[k]));
        let times = |a, b| each(a, b, |a, b| a * b);
        let plus = |a, b| each(a, b, |a, b| a + b);
        Self {
            tension: times(self.tension, other.tension),
            compression: times(self.compression, other.compression),
            bending: times(self.bending, other.bending),
            shear: times(self.shear, other.shear),
            friction: times(self.friction, other.friction),
            areal_mass: self.areal_mass * other.areal_mass,
            pressure: self.pressure * other.pressure,
            stencil: self.stencil * other.stencil,
            offset_mm: plus(self.offset_mm, other.offset_mm),
            tilt_deg: plus(self.tilt_deg, other.tilt_deg),
            offset_deviation_mm: self.offset_deviation_mm.hypot(other.offset_deviation_mm),
            tilt_deviation_deg: self.tilt_deviation_deg.hypot(other.tilt_deviation_deg),
            misses: self.misses + other.misses - self.misses * other.misses,
            seed: other.seed,
        }
    }

    /// Where the press of this number, from 0, lands.
    pub fn aim(&self, press: u32) -> Aim {
        let [offset, tilt] = [
            1e-3 * self.offset_deviation_mm,
            self.tilt_deviation_deg.to_radians(),
        ];
        let mut aim = Aim {
            offset: self.offset_mm.map(|mm| 1e-3 * mm),
            tilt: self.tilt_deg.map(f64::to_radians),
        };
        if offset > 0.0 || tilt > 0.0 || self.misses > 0.0 {
            let mut stream = Stream::new(self.seed, Purpose::Presses, press);
            let mut drawn = |mean: f64, deviation: f64| mean + deviation * stream.normal();
            aim.offset = aim.offset.map(|mean| drawn(mean, offset));
            aim.tilt = aim.tilt.map(|mean| drawn(mean, tilt));
            if stream.uniform() < self.misses {
                aim.offset = [Aim::MISSED; 2];
            }
        }
        aim
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presses_scatter_round_their_aim_and_repeat_under_a_seed() {
        let parameters = |seed| Parameters {
            offset_mm: [2.0, 0.0],
            tilt_deg: [0.0, 6.0],
            offset_deviation_mm: 1.0,
            tilt_deviation_deg: 1.2,
            seed,
            ..Parameters::default()
        };
        let aims = |seed| -> Vec<Aim> { (0..4000).map(|k| parameters(seed).aim(k)).collect() };
        assert_eq!(aims(1), aims(1));
        assert_ne!(aims(1)[0], aims(2)[0]);
        for (of, mean, deviation) in [
            ((|aim: &Aim| aim.offset[0]) as fn(&Aim) -> f64, 2e-3, 1e-3),
            (|aim| aim.offset[1], 0.0, 1e-3),
            (|aim| aim.tilt[0].to_degrees(), 0.0, 1.2),
            (|aim| aim.tilt[1].to_degrees(), 6.0, 1.2),
        ] {
            let drawn: Vec<f64> = aims(3).iter().map(of).collect();
            let [found, spread] = crate::math::mean_and_deviation(&drawn);
            // Five standard errors.
            assert!((found - mean).abs() < 0.08 * deviation, "{found}");
            assert!((spread / deviation - 1.0).abs() < 0.06, "{spread}");
        }
        assert_eq!(Parameters::default().aim(7), Aim::default());
        let half = Parameters {
            misses: 0.5,
            ..Parameters::default()
        };
        let count = (0..1000).filter(|&k| half.aim(k).misses()).count();
        assert!((450..550).contains(&count), "{count}");
    }

    #[test]
    fn values_out_of_range_are_named() {
        assert_eq!(Parameters::default().check(), Ok(()));
        let bad = Parameters {
            friction: [1.0, f64::NAN],
            ..Parameters::default()
        };
        let error = bad.check().unwrap_err().to_string();
        assert_eq!(
            error,
            "`friction` is NaN, expected a number from 0.001 to 1000"
        );
        let mut bad = Parameters::default();
        bad.offset_mm[1] = 1000.0;
        assert_eq!(bad.check().unwrap_err().key, "offset_mm");
    }
}
