use crate::file::ValueError;
use crate::sim::Parameters;

/// The physics of the twin, and how it is integrated.
#[derive(Clone, Debug, PartialEq)]
pub struct TwinConfig {
    /// Bending stiffness per width of warp and of weft [N m]; what the material's bimodulus gives
    /// if none.
    pub bending_stiffness: Option<[f64; 2]>,
    /// Gravity [m/s^2], along -z.
    pub gravity: f64,
    /// The material's locking at large shear.
    pub shear_locking: bool,
    /// Coulomb friction against the tool.
    pub friction: bool,
    /// Tack of the tool [kPa], which acts within 0.2 mm; 0 for none.
    pub adhesion: f64,
    /// Decay rate of every velocity [1/s]: Rayleigh damping by mass.
    pub damping: f64,
    /// Damping of the yarns' strain, as a share of critical damping at the highest frequency:
    /// Rayleigh damping by stiffness, as Abaqus' bulk viscosity [-].
    pub viscosity: f64,
    /// Inertia over mass [-]. The time step grows by its square root; weight stays.
    pub mass_scaling: f64,
    /// Time step over the largest that is known to be stable [-]. Beyond 1 it diverges, which is
    /// there to be shown.
    pub safety: f64,
    /// What this lamina has of its own, as environments of the fast solver have; of tool, start and view
    /// there is one.
    pub parameters: Parameters,
}

impl Default for TwinConfig {
    fn default() -> Self {
        Self {
            bending_stiffness: None,
            gravity: 9.81,
            shear_locking: false,
            friction: true,
            adhesion: 0.0,
            damping: 5.0,
            viscosity: 0.06,
            mass_scaling: 1.0,
            safety: 0.9,
            parameters: Parameters::default(),
        }
    }
}

impl TwinConfig {
    /// The paper's accelerated variant: inertia `mass_scaling` times as large, no damping by
    /// mass.
    pub fn accelerated(&self, mass_scaling: f64) -> Self {
        Self {
            mass_scaling,
            damping: 0.0,
            ..self.clone()
        }
    }

    /// Checks every value; the error names key, found and expected.
    pub fn check(&self) -> Result<(), ValueError> {
        let [warp, weft] = self.bending_stiffness.unwrap_or_default();
        for (key, value, range) in [
            ("bending_stiffness", warp, [0.0, 1e6]),
            ("bending_stiffness", weft, [0.0, 1e6]),
            ("gravity", self.gravity, [-1e6, 1e6]),
            ("adhesion", self.adhesion, [0.0, 1e6]),
            ("damping", self.damping, [0.0, 1e6]),
            ("viscosity", self.viscosity, [0.0, 1.0]),
            ("mass_scaling", self.mass_scaling, [1e-6, 1e9]),
            ("safety", self.safety, [1e-6, 10.0]),
        ] {
            ValueError::unless_within(key, value, range)?;
        }
        self.parameters.check()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_values_are_named() {
        let bad = TwinConfig {
            viscosity: f64::NAN,
            ..TwinConfig::default()
        };
        assert_eq!(
            bad.check().unwrap_err().to_string(),
            "`viscosity` is NaN, expected a number from 0 to 1"
        );
        let bad = TwinConfig {
            bending_stiffness: Some([1e-4, -1.0]),
            ..TwinConfig::default()
        };
        assert_eq!(bad.check().unwrap_err().key, "bending_stiffness");
        assert!(TwinConfig::default().accelerated(150.0).check().is_ok());
    }
}
