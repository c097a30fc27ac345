use serde::{Deserialize, Serialize};

use drape_cloth::file::ValueError;
use drape_cloth::sim::{Aim, Parameters, Spread};

/// How the world of an episode differs from what scene and task say; the fall does not. Factors are on
/// warp and weft, unless said otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ParametersConfig {
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
    /// tilted about them [degrees].
    pub offset_mm: [f64; 2],
    pub tilt_deg: [f64; 2],
    /// Standard deviations of both from press to press, drawn under `seed`.
    pub offset_deviation_mm: f64,
    pub tilt_deviation_deg: f64,
    pub seed: u64,
}

impl Default for ParametersConfig {
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
            seed: 0,
        }
    }
}

impl ParametersConfig {
    /// As the solvers have them.
    ///
    /// # Errors
    /// A value out of range.
    pub fn parameters(&self) -> Result<Parameters, ValueError> {
        let parameters = Parameters {
            tension: self.tension,
            compression: self.compression,
            bending: self.bending,
            shear: self.shear,
            friction: self.friction,
            mass: self.areal_mass,
            pressure: self.pressure,
            side: self.stencil,
            aim: Aim {
                offset: self.offset_mm.map(|mm| 1e-3 * mm),
                tilt: self.tilt_deg.map(f64::to_radians),
            },
            spread: Spread {
                offset: 1e-3 * self.offset_deviation_mm,
                tilt: self.tilt_deviation_deg.to_radians(),
                seed: self.seed,
            },
            ..Parameters::default()
        };
        parameters
            .check()
            .map_err(|error| error.within("parameters"))?;
        Ok(parameters)
    }
}
