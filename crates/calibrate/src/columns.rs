//! What the header of a test may say.

/// What a column of numbers holds, in SI.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CsvColumn {
    /// Overhang at 41.5 degrees [m].
    Overhang,
    Strain,
    /// Nominal stress [Pa].
    Stress,
    /// Force per width, or per side of a sheared cell [N/m].
    LineForce,
    /// Change of the yarn angle [rad].
    Angle,
    Displacement,
    Force,
    /// Of a bias strip between the clamps [m].
    Length,
    Width,
    StaticFriction,
    DynamicFriction,
    /// Of an incline on which it begins to slide, and goes on [rad].
    StaticAngle,
    DynamicAngle,
    /// That pulls a weighted specimen [N].
    StaticForce,
    DynamicForce,
    NormalForce,
    ArealMass,
    Thickness,
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Names with their units, and what takes them to SI.
const COLUMNS: [(&str, CsvColumn, f64); 32] = {
    use CsvColumn::*;
    [
        ("overhang_mm", Overhang, 1e-3),
        ("overhang_cm", Overhang, 1e-2),
        ("strain", Strain, 1.0),
        ("strain_percent", Strain, 1e-2),
        ("stress_mpa", Stress, 1e6),
        ("stress_kpa", Stress, 1e3),
        ("force_n_per_mm", LineForce, 1e3),
        ("force_n_per_m", LineForce, 1.0),
        ("force_kn_per_m", LineForce, 1e3),
        ("angle_rad", Angle, 1.0),
        ("angle_deg", Angle, DEGREE),
        ("displacement_mm", Displacement, 1e-3),
        ("force_n", Force, 1.0),
        ("force_kn", Force, 1e3),
        ("length_mm", Length, 1e-3),
        ("width_mm", Width, 1e-3),
        ("static_friction", StaticFriction, 1.0),
        ("dynamic_friction", DynamicFriction, 1.0),
        ("static_angle_deg", StaticAngle, DEGREE),
        ("static_angle_rad", StaticAngle, 1.0),
        ("dynamic_angle_deg", DynamicAngle, DEGREE),
        ("dynamic_angle_rad", DynamicAngle, 1.0),
        ("static_force_n", StaticForce, 1.0),
        ("static_force_kn", StaticForce, 1e3),
        ("dynamic_force_n", DynamicForce, 1.0),
        ("dynamic_force_kn", DynamicForce, 1e3),
        ("normal_force_n", NormalForce, 1.0),
        ("normal_force_kn", NormalForce, 1e3),
        ("areal_mass_g_m2", ArealMass, 1e-3),
        ("areal_mass_kg_m2", ArealMass, 1.0),
        ("thickness_mm", Thickness, 1e-3),
        ("thickness_um", Thickness, 1e-6),
    ]
};

/// A standard test, by the columns that it has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Test {
    Cantilever,
    Tension,
    Shear,
    Bias,
    Friction,
    Sheet,
}

/// What [`Test::of`] knows.
pub const TESTS: &str = "those of one test: overhang_*; strain and stress_* or force_*_per_*; angle_* and stress_* or \
    force_*_per_*; displacement_*, force_n, length_mm and width_mm; static_*, dynamic_* or both, forces with \
    normal_force_*; areal_mass_* or thickness_*";

impl Test {
    /// The test that has these columns, in the order of [`CsvColumn`].
    pub fn of(columns: &[CsvColumn]) -> Option<Self> {
        use CsvColumn::*;
        Some(match columns {
            [Overhang] => Self::Cantilever,
            [Strain, Stress | LineForce] => Self::Tension,
            [Stress | LineForce, Angle] => Self::Shear,
            [Displacement, Force, Length, Width] => Self::Bias,
            [StaticFriction | DynamicFriction]
            | [StaticFriction, DynamicFriction]
            | [StaticAngle | DynamicAngle]
            | [StaticAngle, DynamicAngle]
            | [StaticForce | DynamicForce, NormalForce]
            | [StaticForce, DynamicForce, NormalForce] => Self::Friction,
            [ArealMass | Thickness] | [ArealMass, Thickness] => Self::Sheet,
            _ => return None,
        })
    }

    /// What its column `direction` may say, and whether it must be there.
    pub fn directions(self) -> ([&'static str; 2], bool) {
        match self {
            Self::Shear | Self::Bias => (["positive", "negative"], false),
            Self::Friction | Self::Sheet => (["warp", "weft"], false),
            Self::Cantilever | Self::Tension => (["warp", "weft"], true),
        }
    }
}

impl CsvColumn {
    /// What a name in the header says, and the factor to SI. The error is what was expected.
    pub fn named(name: &str) -> Result<(Self, f64), String> {
        let known = COLUMNS.iter().find(|(known, ..)| *known == name);
        if let Some(&(_, column, factor)) = known {
            return Ok((column, factor));
        }
        let stem = |name: &str| {
            name.split(['_', ' ', '[', '('])
                .next()
                .map(str::to_lowercase)
        };
        let names = || COLUMNS.iter().map(|(known, ..)| *known);
        let alike: Vec<&str> = names().filter(|known| stem(known) == stem(name)).collect();
        Err(match alike.is_empty() {
            false => alike.join(" or "),
            true => format!("direction, specimen, or {TESTS}"),
        })
    }

    /// Whether it can be measured.
    pub fn is_valid(self, value: f64) -> bool {
        let may_be_zero = self.may_be_zero();
        value <= self.most() && (value > 0.0 || may_be_zero && value == 0.0)
    }

    /// What [`CsvColumn::is_valid`] asks for, in a unit of that many of SI.
    pub fn expected(self, factor: f64) -> String {
        let sign = if self.may_be_zero() { ">=" } else { ">" };
        // Four digits: factors of degrees have no end.
        let most = self.most() / factor;
        let digits = 10.0_f64.powf(3.0 - most.log10().floor());
        format!(
            "a number {sign} 0 and at most {}",
            (most * digits).round() / digits
        )
    }

    fn may_be_zero(self) -> bool {
        use CsvColumn::*;
        matches!(
            self,
            Strain | Stress | LineForce | Angle | Displacement | Force
        )
    }

    /// The most that makes sense.
    fn most(self) -> f64 {
        match self {
            Self::Angle => 1.4,
            Self::StaticAngle | Self::DynamicAngle => 1.5,
            Self::Strain | Self::StaticFriction | Self::DynamicFriction => 10.0,
            Self::Overhang | Self::Length | Self::Width | Self::Displacement => 10.0,
            Self::Thickness => 0.02,
            Self::ArealMass => 100.0,
            _ => 1e9,
        }
    }
}
