use serde::{Deserialize, Serialize};

/// Bending stiffness per width.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BendingStiffness {
    /// What the material's bimodulus gives.
    #[default]
    Material,
    /// The same for warp and weft [N m]; 0 for none.
    NewtonMetre(f64),
    /// Of warp and of weft [N m].
    Families([f64; 2]),
}

/// Shear stress beyond the end of the measured curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Extrapolation {
    /// As much as at the end: what Abaqus does if nothing else is asked for.
    Constant,
    /// The last slope goes on.
    #[default]
    Linear,
}

/// The physics of the twin, and how it is integrated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TwinConfig {
    pub bending_stiffness: BendingStiffness,
    pub shear_extrapolation: Extrapolation,
    /// Shear angle from which on the weave locks; never if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub locking_deg: Option<f64>,
    /// Slope that is gained there, over the first slope of shear [-].
    pub locking_factor: f64,
    /// Gravity [m/s^2], along -z.
    pub gravity: f64,
    /// Coulomb friction against the tool.
    pub friction: bool,
    /// Tack of the tool [kPa], which acts within 0.2 mm; 0 for none.
    pub adhesion: f64,
    /// Distance of the mid-surface from a tool that it touches [mm].
    pub contact_offset_mm: f64,
    /// Decay rate of every velocity [1/s]: Rayleigh damping by mass.
    pub damping: f64,
    /// Damping of the yarns' strain, as a share of critical damping at the highest frequency:
    /// Rayleigh damping by stiffness, as Abaqus' bulk viscosity [-].
    pub viscosity: f64,
    /// Inertia over mass [-]. The time step grows by its square root; weight stays.
    pub mass_scaling: f64,
    /// Time step over the largest that is known to be stable [-].
    pub safety: f64,
}

impl Default for TwinConfig {
    fn default() -> Self {
        Self {
            bending_stiffness: BendingStiffness::Material,
            shear_extrapolation: Extrapolation::Linear,
            locking_deg: None,
            locking_factor: 100.0,
            gravity: 9.81,
            friction: true,
            adhesion: 0.0,
            contact_offset_mm: 0.0,
            damping: 5.0,
            viscosity: 0.06,
            mass_scaling: 1.0,
            safety: 0.9,
        }
    }
}

/// A value of the twin that cannot be simulated.
#[derive(Debug, thiserror::Error)]
#[error("`twin.{key}` is {found}, expected {expected}")]
pub struct TwinError {
    pub(super) key: &'static str,
    pub(super) found: String,
    pub(super) expected: &'static str,
}

impl TwinConfig {
    /// The paper's accelerated variant: inertia `mass_scaling` times as large, no damping by
    /// mass. Output is as sparse as the calls for it in any case.
    pub fn accelerated(&self, mass_scaling: f64) -> Self {
        Self {
            mass_scaling,
            damping: 0.0,
            ..self.clone()
        }
    }

    /// Checks every value; the error names key, found and expected.
    pub fn check(&self) -> Result<(), TwinError> {
        let fail = |key, found: String, expected| {
            Err(TwinError {
                key,
                found,
                expected,
            })
        };
        let stiffness = match self.bending_stiffness {
            BendingStiffness::Material => [0.0; 2],
            BendingStiffness::NewtonMetre(d) => [d; 2],
            BendingStiffness::Families(d) => d,
        };
        if !stiffness.iter().all(|d| (0.0..=1e6).contains(d)) {
            let expected = "stiffnesses from 0 to 1e6 N m";
            return fail("bending_stiffness", format!("{stiffness:?}"), expected);
        }
        if let Some(angle) = self.locking_deg
            && !(angle > 0.0 && angle < 90.0)
        {
            let expected = "an angle between 0 and 90 degrees";
            return fail("locking_deg", angle.to_string(), expected);
        }
        if !(-1e6..=1e6).contains(&self.gravity) {
            return fail("gravity", self.gravity.to_string(), "within +-1e6 m/s^2");
        }
        let non_negative = [
            ("locking_factor", self.locking_factor),
            ("adhesion", self.adhesion),
            ("contact_offset_mm", self.contact_offset_mm),
            ("damping", self.damping),
        ];
        for (key, value) in non_negative {
            if !(0.0..=1e6).contains(&value) {
                return fail(key, value.to_string(), "a number from 0 to 1e6");
            }
        }
        if !(0.0..=1.0).contains(&self.viscosity) {
            let expected = "a share from 0 to 1";
            return fail("viscosity", self.viscosity.to_string(), expected);
        }
        if !(1e-6..=1e9).contains(&self.mass_scaling) {
            let expected = "a factor from 1e-6 to 1e9";
            return fail("mass_scaling", self.mass_scaling.to_string(), expected);
        }
        // Beyond 1 it diverges, which is there to be shown.
        if !(self.safety > 0.0 && self.safety <= 10.0) {
            return fail("safety", self.safety.to_string(), "a factor in (0, 10]");
        }
        Ok(())
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
            "`twin.viscosity` is NaN, expected a share from 0 to 1"
        );
        let bad = TwinConfig {
            bending_stiffness: BendingStiffness::Families([1e-4, -1.0]),
            ..TwinConfig::default()
        };
        assert_eq!(bad.check().unwrap_err().key, "bending_stiffness");
        assert!(TwinConfig::default().accelerated(150.0).check().is_ok());
    }

    #[test]
    fn unknown_keys_are_refused_and_missing_ones_default() {
        let config: TwinConfig = toml::from_str("damping = 1.0").unwrap();
        assert_eq!(config.damping, 1.0);
        assert_eq!(config.gravity, 9.81);
        assert!(toml::from_str::<TwinConfig>("dampning = 1.0").is_err());
    }
}
