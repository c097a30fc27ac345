use serde::{Deserialize, Serialize};

use super::self_contact::SelfCollision;

/// How the yarns' length is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Solver {
    /// Coloured Gauss-Seidel over the edges, as in the paper.
    GaussSeidel,
    /// A direct tridiagonal solve along each yarn: all warps, then all wefts.
    #[default]
    Yarn,
}

/// How bending is modelled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Bending {
    /// Along each yarn, by the second difference of three neighbouring vertices.
    #[default]
    Yarns,
    /// By the angle between neighbouring triangles, as in the paper. Isotropic.
    Dihedral,
    /// Not at all.
    Off,
}

/// Bending stiffness per width.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BendingStiffness {
    /// What the material's bimodulus gives.
    #[default]
    Material,
    /// The same for warp and weft [N m].
    NewtonMetre(f64),
}

/// What a yarn does against compression.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Compression {
    /// The material's own compression branch.
    #[default]
    Material,
    /// As stiff as in tension.
    AsTension,
}

/// What a yarn does in tension.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tension {
    /// The first slope of the material's law at any strain.
    #[default]
    FirstBranch,
    /// Its first two slopes, the second going on; under a strain limit the first alone.
    Material,
}

/// The physics of a scene: what is listed here is computed, the rest costs nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PhysicsConfig {
    pub solver: Solver,
    pub bending: Bending,
    pub bending_stiffness: BendingStiffness,
    pub tension: Tension,
    pub compression: Compression,
    /// Resistance of the weave to shear.
    pub shear: bool,
    /// Coulomb friction against the tool.
    pub friction: bool,
    /// Tack of the tool [kPa]: greatest pull per area on cloth that lies on it; 0 for none.
    pub adhesion: f64,
    /// Tensile strain beyond which a yarn hardly stretches [-].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub strain_limit: Option<f64>,
    /// Contact of the cloth with itself; with friction where `friction` is listed.
    pub self_collision: SelfCollision,
    /// Gravity [m/s^2], along -z.
    pub gravity: f64,
    /// Decay rate of every velocity [1/s].
    pub damping: f64,
    /// Largest speed of a vertex [m/s]; 0 means no limit.
    pub speed_cap: f64,
    /// Stiffness with which the stencil holds a vertex down [N/m].
    pub press_stiffness: f64,
}

impl Default for PhysicsConfig {
    fn default() -> Self {
        Self {
            solver: Solver::Yarn,
            bending: Bending::Yarns,
            bending_stiffness: BendingStiffness::NewtonMetre(2e-4),
            tension: Tension::FirstBranch,
            compression: Compression::Material,
            shear: true,
            friction: true,
            adhesion: 0.0,
            strain_limit: None,
            self_collision: SelfCollision::Off,
            gravity: 9.81,
            damping: 50.0,
            speed_cap: 4.0,
            press_stiffness: 300.0,
        }
    }
}

/// A value of the physics that cannot be simulated.
#[derive(Debug, thiserror::Error)]
#[error("`physics.{key}` is {found}, expected {expected}")]
pub struct PhysicsError {
    pub(super) key: &'static str,
    pub(super) found: String,
    pub(super) expected: &'static str,
}

impl PhysicsConfig {
    /// Checks every value; the error names key, found and expected.
    pub fn check(&self) -> Result<(), PhysicsError> {
        let fail = |key, found: String, expected| {
            Err(PhysicsError {
                key,
                found,
                expected,
            })
        };
        // Its square must neither overflow nor vanish in f32.
        if self.speed_cap != 0.0 && !(1e-6..=1e6).contains(&self.speed_cap) {
            let expected = "0 for none, or a number from 1e-6 to 1e6";
            return fail("speed_cap", self.speed_cap.to_string(), expected);
        }
        if let Some(limit) = self.strain_limit
            && !(1e-6..=10.0).contains(&limit)
        {
            let expected = "a strain from 1e-6 to 10";
            return fail("strain_limit", limit.to_string(), expected);
        }
        // More than any glue holds; its force must stay a number in f32.
        if !(0.0..=1e6).contains(&self.adhesion) {
            let expected = "a tack from 0 to 1000000 kPa";
            return fail("adhesion", self.adhesion.to_string(), expected);
        }
        let non_negative = [
            ("damping", self.damping),
            ("press_stiffness", self.press_stiffness),
        ];
        for (key, value) in non_negative {
            if !(value >= 0.0 && value.is_finite()) {
                return fail(key, value.to_string(), "a number >= 0");
            }
        }
        self.self_collision.check_value()?;
        if !self.gravity.is_finite() {
            return fail("gravity", self.gravity.to_string(), "a finite number");
        }
        if let BendingStiffness::NewtonMetre(d) = self.bending_stiffness
            && !(d >= 0.0 && d.is_finite())
        {
            return fail("bending_stiffness", d.to_string(), "a number >= 0");
        }
        Ok(())
    }
}
