use serde::{Deserialize, Serialize};

use crate::file::ValueError;
use crate::math::{Purpose, Stream};

/// What an environment has of its own from one reset to the next; all else it shares with the others
/// of its [`World`](super::World). Factors are on what the model, the stencil and the roller have.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameters {
    /// Numbers of its tool, start and view among those of the world.
    pub tool: u16,
    pub start: u16,
    pub view: u16,
    /// On the stiffness of warp and weft where they are pulled, where they are pushed, and in bending.
    pub tension: [f64; 2],
    pub compression: [f64; 2],
    pub bending: [f64; 2],
    /// On the stiffness of positive and of negative shear.
    pub shear: [f64; 2],
    /// On static and dynamic friction.
    pub friction: [f64; 2],
    /// On the areal mass, the roller's pressure, and the side of the stencil.
    pub mass: f64,
    pub pressure: f64,
    pub side: f64,
    /// Where presses land.
    pub aim: Aim,
    /// What is drawn for each press on top of that, by the number of the press.
    pub spread: Spread,
}

/// Where a press lands against its vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Aim {
    /// Along the sides of the stencil [m].
    pub offset: [f64; 2],
    /// Turns of the stencil about its sides [rad].
    pub tilt: [f64; 2],
}

/// Standard deviations of an [`Aim`] from press to press, normally distributed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// [m]
    pub offset: f64,
    /// [rad]
    pub tilt: f64,
    /// The same numbers are drawn for the same seed.
    pub seed: u64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            tool: 0,
            start: 0,
            view: 0,
            tension: [1.0; 2],
            compression: [1.0; 2],
            bending: [1.0; 2],
            shear: [1.0; 2],
            friction: [1.0; 2],
            mass: 1.0,
            pressure: 1.0,
            side: 1.0,
            aim: Aim::default(),
            spread: Spread::default(),
        }
    }
}

impl Parameters {
    /// Factors that a model takes [-].
    const FACTORS: [f64; 2] = [1e-3, 1e3];
    /// Farthest that a press lands from its vertex [m], and most that it is tilted [rad].
    const FARTHEST: f64 = 0.1;
    const MOST_TILT: f64 = 0.8;

    /// Checks every value but the numbers of tool, start and view; the error names key, found and
    /// expected.
    pub fn check(&self) -> Result<(), ValueError> {
        let pairs = [
            ("tension", self.tension),
            ("compression", self.compression),
            ("bending", self.bending),
            ("shear", self.shear),
            ("friction", self.friction),
            ("mass", [self.mass; 2]),
            ("pressure", [self.pressure; 2]),
            ("side", [self.side; 2]),
        ];
        for (key, pair) in pairs {
            for factor in pair {
                ValueError::unless_within(key, factor, Self::FACTORS)?;
            }
        }
        let (Aim { offset, tilt }, spread) = (self.aim, self.spread);
        for k in 0..2 {
            let [far, tilted] = [Self::FARTHEST, Self::MOST_TILT].map(|most| [-most, most]);
            ValueError::unless_within("aim.offset", offset[k], far)?;
            ValueError::unless_within("aim.tilt", tilt[k], tilted)?;
        }
        ValueError::unless_within("spread.offset", spread.offset, [0.0, Self::FARTHEST])?;
        ValueError::unless_within("spread.tilt", spread.tilt, [0.0, Self::MOST_TILT])
    }

    /// Where the press of this number, from 0, lands.
    pub fn aim(&self, press: u32) -> Aim {
        let (mut aim, spread) = (self.aim, self.spread);
        if spread.offset > 0.0 || spread.tilt > 0.0 {
            let mut stream = Stream::new(spread.seed, Purpose::Presses, press);
            for offset in &mut aim.offset {
                *offset += spread.offset * stream.normal();
            }
            for tilt in &mut aim.tilt {
                *tilt += spread.tilt * stream.normal();
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
            aim: Aim {
                offset: [2e-3, 0.0],
                tilt: [0.0, 0.1],
            },
            spread: Spread {
                offset: 1e-3,
                tilt: 0.02,
                seed,
            },
            ..Parameters::default()
        };
        let aims = |seed| -> Vec<Aim> { (0..4000).map(|k| parameters(seed).aim(k)).collect() };
        assert_eq!(aims(1), aims(1));
        assert_ne!(aims(1)[0], aims(2)[0]);
        for (of, mean, deviation) in [
            ((|aim: &Aim| aim.offset[0]) as fn(&Aim) -> f64, 2e-3, 1e-3),
            (|aim| aim.offset[1], 0.0, 1e-3),
            (|aim| aim.tilt[0], 0.0, 0.02),
            (|aim| aim.tilt[1], 0.1, 0.02),
        ] {
            let drawn: Vec<f64> = aims(3).iter().map(of).collect();
            let [found, spread] = crate::math::mean_and_deviation(&drawn);
            // Five standard errors.
            assert!((found - mean).abs() < 0.08 * deviation, "{found}");
            assert!((spread / deviation - 1.0).abs() < 0.06, "{spread}");
        }
        assert_eq!(Parameters::default().aim(7), Aim::default());
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
        bad.aim.offset[1] = 1.0;
        assert_eq!(bad.check().unwrap_err().key, "aim.offset");
    }
}
