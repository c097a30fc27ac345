use serde::{Deserialize, Serialize};

use crate::fabric::{Lamina, Material};
use crate::file::ValueError;

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

impl Solver {
    /// All of them, the default first.
    pub const ALL: [Self; 2] = [Self::Yarn, Self::GaussSeidel];

    /// As in configurations and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::GaussSeidel => "gauss_seidel",
            Self::Yarn => "yarn",
        }
    }
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
    /// This, for warp and weft alike [N m].
    NewtonMetre(f64),
}

/// What a yarn does in tension.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tension {
    /// The first slope of the material's law at any strain.
    FirstBranch,
    /// Its first two slopes, the second going on; under a strain limit the first alone.
    Material,
}

/// Whether layers of cloth hold each other apart, and by how much.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SelfCollision {
    /// They pass through each other.
    #[default]
    Off,
    /// By the thickness of the material.
    Material,
    /// By this distance [mm].
    ThicknessMm(f64),
}

/// The physics of a scene: what is listed here is computed, the rest costs nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PhysicsConfig {
    pub solver: Solver,
    pub bending: Bending,
    pub bending_stiffness: BendingStiffness,
    /// The first slope if none, which has to be said of other curves than the built-in material's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tension: Option<Tension>,
    /// Resistance of the weave to shear.
    pub shear: bool,
    /// The material's locking at large shear; without, its first slope goes on as in the paper.
    pub shear_locking: bool,
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
}

impl Default for PhysicsConfig {
    fn default() -> Self {
        Self {
            solver: Solver::Yarn,
            bending: Bending::Yarns,
            bending_stiffness: BendingStiffness::NewtonMetre(2e-4),
            tension: None,
            shear: true,
            shear_locking: false,
            friction: true,
            adhesion: 0.0,
            strain_limit: None,
            self_collision: SelfCollision::Off,
            gravity: 9.81,
            damping: 50.0,
            speed_cap: 4.0,
        }
    }
}

impl PhysicsConfig {
    /// Checks every value; the error names key, found and expected.
    pub fn check(&self) -> Result<(), ValueError> {
        self.check_values().map_err(|error| error.within("physics"))
    }

    /// Checks what depends on the blank.
    pub fn check_for(&self, lamina: &Lamina) -> Result<(), ValueError> {
        let is_known = lamina.material.shear.locking.is_some();
        ValueError::unless(
            is_known || !self.shear_locking,
            "physics.shear_locking",
            self.shear_locking,
            "false where the material has no `shear.locking`",
        )?;
        self.check_tension(&lamina.material)?;
        self.self_collision.check(lamina)
    }

    /// No slope of a tension curve goes unused without a word.
    fn check_tension(&self, material: &Material) -> Result<(), ValueError> {
        let paper = Material::interglas_92125();
        for (key, yarn, paper) in [
            ("warp.tension", &material.warp, &paper.warp),
            ("weft.tension", &material.weft, &paper.weft),
        ] {
            let slopes = 1 + yarn.tension.kinks().len();
            let (found, is_valid, expected) = match self.tension {
                Some(Tension::FirstBranch) => break,
                Some(Tension::Material) => ("material", slopes <= 2, "first_branch"),
                None => {
                    let is_known = slopes == 1 || yarn.tension == paper.tension;
                    (
                        "not given",
                        is_known,
                        "first_branch or material (two slopes)",
                    )
                }
            };
            let expected = format!("{expected} where `{key}` has {slopes} slopes");
            ValueError::unless(is_valid, "physics.tension", found, expected)?;
        }
        Ok(())
    }

    fn check_values(&self) -> Result<(), ValueError> {
        // Slower cloth never comes down, and seems to be at rest; the square must not overflow in f32.
        let cap = self.speed_cap;
        let is_valid = cap == 0.0 || (0.05..=1e6).contains(&cap);
        let expected = "0 for none, or a number from 0.05 to 1e6";
        ValueError::unless(is_valid, "speed_cap", cap, expected)?;
        let is_valid = self.shear || !self.shear_locking;
        let expected = "false where `physics.shear` is false";
        ValueError::unless(is_valid, "shear_locking", self.shear_locking, expected)?;
        if let Some(limit) = self.strain_limit {
            ValueError::unless_within("strain_limit", limit, [1e-6, 10.0])?;
        }
        // More than any glue holds; its force must stay a number in f32.
        ValueError::unless_within("adhesion", self.adhesion, [0.0, 1e6])?;
        if let SelfCollision::ThicknessMm(t) = self.self_collision {
            let is_valid = t > 0.0 && t.is_finite();
            ValueError::unless(is_valid, "self_collision.thickness_mm", t, "a number > 0")?;
        }
        let gravity = self.gravity;
        ValueError::unless(gravity.is_finite(), "gravity", gravity, "a finite number")?;
        let bending = match self.bending_stiffness {
            BendingStiffness::NewtonMetre(stiffness) => stiffness,
            BendingStiffness::Material => 0.0,
        };
        for (key, value) in [("damping", self.damping), ("bending_stiffness", bending)] {
            let is_valid = value >= 0.0 && value.is_finite();
            ValueError::unless(is_valid, key, value, "a number >= 0")?;
        }
        Ok(())
    }
}

impl SelfCollision {
    /// Distance between the middles of two layers in contact [m].
    pub(super) fn thickness(self, lamina: &Lamina) -> Option<f64> {
        match self {
            Self::Off => None,
            Self::Material => Some(lamina.material.thickness()),
            Self::ThicknessMm(thickness) => Some(1e-3 * thickness),
        }
    }

    /// Checks that the cells of the blank are large enough: neighbours that share no vertex
    /// are 0.7 cells apart in the flat blank, and must not touch there.
    pub fn check(self, lamina: &Lamina) -> Result<(), ValueError> {
        let shortest = lamina.yarns.iter().map(|yarn| yarn.rest_length);
        let shortest = shortest.fold(f64::INFINITY, f64::min);
        let thickness = self.thickness(lamina).unwrap_or_default();
        let [t, cell] = [thickness, shortest].map(|length| 1e3 * length);
        let found = format!("a thickness of {t} mm on cells of {cell:.3} mm");
        let expected = "a thickness of at most half a cell";
        let is_valid = thickness <= 0.5 * shortest;
        ValueError::unless(is_valid, "physics.self_collision", found, expected)
    }
}
