use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::file::{ReadError, ValueError, read_toml};

/// A piecewise linear law through [strain, stress] points; stress in MPa as in the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Curve(Vec<[f64; 2]>);

impl Curve {
    /// Greatest angle of a shear curve that bends [rad]: yarns that turn farther lie on each other.
    pub(crate) const MAX_ANGLE: f64 = 1.4;

    /// Strains [-] and stresses [MPa] of any material, and many more.
    const BELIEVABLE: std::ops::RangeInclusive<f64> = 1e-12..=1e12;

    /// A straight law of one modulus [Pa]; an infinite one makes yarns of compliance 0.
    pub fn line(modulus: f64) -> Self {
        // The largest stress that a file can hold, in MPa, is infinite in Pa.
        Self(vec![[0.0, 0.0], [1.0, (1e-6 * modulus).min(f64::MAX)]])
    }

    /// Of points of strain and stress as in the file [MPa]; [`Material::check`] tells whether they are
    /// a law.
    pub fn new(points: Vec<[f64; 2]>) -> Self {
        Self(points)
    }

    /// Points of strain and stress as in the file [MPa], ascending from [0, 0].
    pub fn points(&self) -> &[[f64; 2]] {
        &self.0
    }

    /// This law, `factor` times as stiff.
    pub fn scaled(&self, factor: f64) -> Self {
        Self(self.0.iter().map(|&[e, s]| [e, factor * s]).collect())
    }

    /// Stress [Pa] at a strain >= 0; beyond the last point its slope goes on.
    pub fn stress(&self, strain: f64) -> f64 {
        let last = self.0.len() - 2;
        let mut inner = self.0[1..=last].iter();
        let segment = inner.position(|p| strain < p[0]).unwrap_or(last);
        let [p, q] = [self.0[segment], self.0[segment + 1]];
        1e6 * (p[1] + (strain - p[0]) * (q[1] - p[1]) / (q[0] - p[0]))
    }

    /// This law with `gain` times its first slope on top from the strain `start` on.
    fn stiffened(&self, start: f64, gain: f64) -> Self {
        let mut strains: Vec<f64> = self.0.iter().map(|p| p[0]).collect();
        // One strain beyond all, to tell the last slope.
        strains.extend([start, strains[strains.len() - 1] + start]);
        strains.sort_by(f64::total_cmp);
        strains.dedup();
        let more = |strain: f64| gain * self.modulus() * (strain - start).max(0.0);
        let point = |strain| [strain, 1e-6 * (self.stress(strain) + more(strain))];
        Self(strains.into_iter().map(point).collect())
    }

    /// Strains at which the slope changes, and the slope from there on over the first. Points on a
    /// straight line, to a millionth, are none.
    pub fn kinks(&self) -> Vec<[f64; 2]> {
        let mut last = 1.0;
        let pairs = self.0[1..].windows(2);
        let kink = |pair: &[[f64; 2]]| {
            let [p, q] = [pair[0], pair[1]];
            let slope = 1e6 * ((q[1] - p[1]) / (q[0] - p[0]));
            let over = slope / self.modulus();
            let bends = (over / last - 1.0).abs() > 1e-6;
            bends.then(|| {
                last = over;
                [p[0], over]
            })
        };
        pairs.filter_map(kink).collect()
    }

    /// All its slopes [Pa].
    pub fn moduli(&self) -> impl Iterator<Item = f64> {
        let first = self.modulus();
        let others = self.kinks().into_iter().map(move |[_, over]| first * over);
        std::iter::once(first).chain(others)
    }

    /// Slope at strain 0 [Pa].
    pub fn modulus(&self) -> f64 {
        1e6 * self.0[1][1] / self.0[1][0]
    }

    fn is_valid(&self) -> bool {
        let grows = |pair: &[[f64; 2]]| pair[1][0] > pair[0][0] && pair[1][1] > pair[0][1];
        self.0.len() >= 2
            && self.0[0] == [0.0, 0.0]
            && self.0[1..].iter().all(|&[strain, stress]| {
                // An infinite modulus is the largest stress.
                let is_stress = Self::BELIEVABLE.contains(&stress) || stress == f64::MAX;
                Self::BELIEVABLE.contains(&strain) && is_stress
            })
            && self.0.windows(2).all(grows)
    }
}

/// Law of one family of yarns (paper, Table 2).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct YarnLaw {
    pub tension: Curve,
    /// Stress and strain both counted positive.
    pub compression: Curve,
    pub static_friction: f64,
    pub dynamic_friction: f64,
}

/// Shear law (paper, Table 2): stress against the change of the yarn angle [rad].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShearLaw {
    pub positive: Curve,
    pub negative: Curve,
    /// For scenes that list it; none if it is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub locking: Option<ShearLocking>,
}

impl ShearLaw {
    /// Whether either curve has more than one slope, locking aside.
    pub fn bends(&self) -> bool {
        [&self.positive, &self.negative]
            .iter()
            .any(|curve| !curve.kinks().is_empty())
    }

    /// Positive and negative curve, with locking if asked for.
    pub fn curves(&self, with_locking: bool) -> [Curve; 2] {
        let locking = self.locking.filter(|_| with_locking);
        [&self.positive, &self.negative].map(|curve| match locking {
            Some(locking) => curve.stiffened(locking.angle_rad, locking.stiffening - 1.0),
            None => curve.clone(),
        })
    }
}

/// What shear gains where yarns have turned until they touch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShearLocking {
    /// Change of the yarn angle, of either sign, at which it begins [rad].
    pub angle_rad: f64,
    /// Slope beyond it over the slope at rest [-].
    pub stiffening: f64,
}

/// Mass of the fabric by area, as two sources have it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArealMass {
    /// As in the paper's model [g/m^2]; that of the data sheet if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paper: Option<f64>,
    /// As in the fabric's data sheet [g/m^2].
    pub datasheet: f64,
}

/// A woven fabric as characterised by tests. Files hold MPa, mm and g/m^2; methods give SI.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    pub name: String,
    pub thickness_mm: f64,
    pub areal_mass_g_m2: ArealMass,
    pub warp: YarnLaw,
    pub weft: YarnLaw,
    pub shear: ShearLaw,
}

/// The file of the fabric that is built in.
const INTERGLAS_92125: &str = include_str!("../../../../configs/materials/interglas-92125.toml");

impl Material {
    /// Reads and checks a material file.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        read_toml::<Self>(path)?.checked(path)
    }

    /// The fabric of the paper, Interglas 92125.
    pub fn interglas_92125() -> Self {
        toml::from_str(INTERGLAS_92125).expect("the built-in material is valid")
    }

    fn checked(self, path: &Path) -> Result<Self, ReadError> {
        let fault = |fault| ReadError::fault(path, fault);
        self.check().map_err(fault).map(|()| self)
    }

    /// Checks all values; the error names key, found and expected.
    pub fn check(&self) -> Result<(), ValueError> {
        for (key, curve) in [
            ("warp.tension", &self.warp.tension),
            ("warp.compression", &self.warp.compression),
            ("weft.tension", &self.weft.tension),
            ("weft.compression", &self.weft.compression),
            ("shear.positive", &self.shear.positive),
            ("shear.negative", &self.shear.negative),
        ] {
            let expected = "points from [0, 0] on, both coordinates growing, from 1e-12 to 1e12";
            ValueError::unless(curve.is_valid(), key, format!("{:?}", curve.0), expected)?;
        }
        for (key, curve) in [
            ("shear.positive", &self.shear.positive),
            ("shear.negative", &self.shear.negative),
        ] {
            let last = curve.0[curve.0.len() - 1][0];
            let is_valid = curve.kinks().is_empty() || last <= Curve::MAX_ANGLE;
            let expected = "angles up to 1.4 rad, of a curve that bends";
            ValueError::unless(is_valid, key, format!("{:?}", curve.0), expected)?;
        }
        for (key, curve) in [
            ("warp.compression", &self.warp.compression),
            ("weft.compression", &self.weft.compression),
        ] {
            let is_valid = curve.kinks().is_empty();
            let expected = "points on one straight line: yarns buckle long before a second slope";
            ValueError::unless(is_valid, key, format!("{:?}", curve.0), expected)?;
        }
        let ArealMass { datasheet, paper } = self.areal_mass_g_m2;
        let masses = [0.1, 1e5];
        for (key, value, range) in [
            ("thickness_mm", self.thickness_mm, [1e-3, 100.0]),
            ("areal_mass_g_m2.datasheet", datasheet, masses),
            ("areal_mass_g_m2.paper", paper.unwrap_or(datasheet), masses),
        ] {
            ValueError::unless_within(key, value, range)?;
        }
        for (key, value) in [
            ("warp.static_friction", self.warp.static_friction),
            ("warp.dynamic_friction", self.warp.dynamic_friction),
            ("weft.static_friction", self.weft.static_friction),
            ("weft.dynamic_friction", self.weft.dynamic_friction),
        ] {
            let is_valid = value >= 0.0 && value.is_finite();
            ValueError::unless(is_valid, key, value, "a number >= 0")?;
        }
        if let Some(locking) = self.shear.locking {
            let (angle, stiffening) = (locking.angle_rad, locking.stiffening);
            // The fast solver's laws of shear are fitted up to 60 degrees.
            ValueError::unless_within("shear.locking.angle_rad", angle, [0.1, 1.0])?;
            ValueError::unless_within("shear.locking.stiffening", stiffening, [1.01, 1e4])?;
        }
        Ok(())
    }

    /// Thickness [m].
    pub fn thickness(&self) -> f64 {
        self.thickness_mm * 1e-3
    }

    /// Law of a family of yarns.
    pub fn yarn(&self, family: Family) -> &YarnLaw {
        [&self.warp, &self.weft][family as usize]
    }

    /// Bending stiffness per width of a family of yarns [N m], from the bimodulus of tension
    /// and compression: D = E h^3 / 12 with E = 4 Et Ec / (sqrt Et + sqrt Ec)^2.
    pub fn bending_stiffness(&self, family: Family) -> f64 {
        let law = self.yarn(family);
        let (tension, compression) = (law.tension.modulus(), law.compression.modulus());
        let reduced = 4.0 * tension * compression / (tension.sqrt() + compression.sqrt()).powi(2);
        reduced * self.thickness().powi(3) / 12.0
    }

    /// Static and dynamic friction against the tool: the mean of both families, since the
    /// contact does not know along which yarn it slides (they differ by 4 %).
    pub fn friction(&self) -> [f64; 2] {
        let mean = |of: fn(&YarnLaw) -> f64| 0.5 * (of(&self.warp) + of(&self.weft));
        [
            mean(|law| law.static_friction),
            mean(|law| law.dynamic_friction),
        ]
    }
}

/// The two families of yarns of a woven fabric.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Family {
    Warp,
    Weft,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::parse_toml;

    fn close(found: f64, expected: f64, tolerance: f64) {
        assert!(
            (found - expected).abs() <= tolerance * expected.abs(),
            "{found} is not {expected}"
        );
    }

    #[test]
    fn force_per_width_is_that_of_table_2() {
        let material = Material::interglas_92125();
        let force = |law: &YarnLaw, strain| law.tension.stress(strain) * material.thickness();
        close(force(&material.warp, 0.005), 1050.0, 1e-12);
        close(force(&material.warp, 0.02), 14_000.0, 1e-12);
        close(force(&material.weft, 0.006), 1750.0, 1e-12);
        close(force(&material.weft, 0.025), 21_000.0, 1e-12);
        close(force(&material.warp, 0.0125), 7525.0, 1e-12);
    }

    #[test]
    fn beyond_the_last_point_the_slope_goes_on() {
        let curve = Material::interglas_92125().shear.positive;
        close(curve.stress(0.9), 45_000.0, 1e-12);
    }

    /// (40 - 3) MPa / 0.015 over 3 MPa / 0.005 for the warp.
    #[test]
    fn knee_is_where_the_slope_changes() {
        let material = Material::interglas_92125();
        let [strain, slope] = material.warp.tension.kinks()[0];
        close(strain, 0.005, 1e-12);
        close(slope, 37.0 / 9.0, 1e-12);
        let [strain, slope] = material.weft.tension.kinks()[0];
        close(strain, 0.006, 1e-12);
        close(slope, 55.0 / 19.0 * 6.0 / 5.0, 1e-12);
        let straight = Curve(vec![[0.0, 0.0], [0.1, 0.3], [0.2, 0.6], [0.5, 1.5]]);
        assert!(straight.kinks().is_empty() && !material.shear.bends());
        let bent = Curve(vec![
            [0.0, 0.0],
            [1.0, 1.0],
            [2.0, 2.0],
            [3.0, 5.0],
            [4.0, 5.5],
        ]);
        assert_eq!(bent.kinks(), [[2.0, 3.0], [3.0, 0.5]]);
    }

    /// Half a radian beyond the angle, 20 times the slope is on top of what came before; the points
    /// of a curve stay, also beyond the angle.
    #[test]
    fn locking_is_a_second_slope_of_both_curves() {
        let law = Material::interglas_92125().shear;
        assert_eq!(
            law.curves(false),
            [law.positive.clone(), law.negative.clone()]
        );
        for (curve, modulus) in law.curves(true).iter().zip([50e3, 36e3]) {
            close(curve.stress(0.05), 0.05 * modulus, 1e-12);
            close(curve.stress(0.7), 0.7 * modulus, 1e-12);
            close(curve.stress(1.2), (0.7 + 20.0 * 0.5) * modulus, 1e-12);
            assert!(curve.is_valid());
        }
        let bent = Curve(vec![[0.0, 0.0], [0.2, 1.0], [0.8, 2.0]]);
        let stiff = bent.stiffened(0.5, 3.0);
        for strain in [0.1, 0.2, 0.4, 0.6, 0.8, 2.0f64] {
            let more = 3.0 * 5e6 * (strain - 0.5).max(0.0);
            close(stiff.stress(strain), bent.stress(strain) + more, 1e-12);
        }
        let unknown = ShearLaw {
            locking: None,
            ..law
        };
        assert_eq!(unknown.curves(true), unknown.curves(false));
    }

    #[test]
    fn straight_and_scaled_laws_have_their_modulus() {
        for modulus in [1e-6, 600e6, 1e18, f64::INFINITY] {
            let line = Curve::line(modulus);
            assert!(line.is_valid());
            let same = line.modulus() == modulus || (line.modulus() / modulus - 1.0).abs() < 1e-12;
            assert!(same, "{} is not {modulus}", line.modulus());
        }
        let warp = Material::interglas_92125().warp.tension;
        close(warp.scaled(1e-3).modulus(), 1e-3 * warp.modulus(), 1e-12);
    }

    #[test]
    fn bending_stiffness_follows_the_bimodulus() {
        let material = Material::interglas_92125();
        close(material.bending_stiffness(Family::Warp), 7.09e-5, 1e-3);
        close(material.bending_stiffness(Family::Weft), 2.63e-5, 2e-3);
    }

    #[test]
    fn bad_values_are_located() {
        let read = |text: &str| {
            let path = Path::new("m.toml");
            parse_toml::<Material>(text, path)?.checked(path)
        };
        assert_eq!(read(INTERGLAS_92125).unwrap(), Material::interglas_92125());
        let bad = INTERGLAS_92125.replace("[0.1, 0.0036]", "[0.1, -0.0036]");
        let error = read(&bad).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("m.toml: `shear.negative` is [[0.0")
        );
        let bad = INTERGLAS_92125.replace("thickness_mm = 0.35", "thickness_mm = nan");
        let error = read(&bad).unwrap_err();
        assert_eq!(
            error.to_string(),
            "m.toml: `thickness_mm` is NaN, expected a number from 0.001 to 100"
        );
        for (good, bad, expected) in [
            (
                "angle_rad = 0.7",
                "angle_rad = 40",
                "`shear.locking.angle_rad` is 40, expected a number from 0.1 to 1",
            ),
            (
                "stiffening = 20.0",
                "stiffening = 1.0",
                "`shear.locking.stiffening` is 1, expected a number from 1.01 to 10000",
            ),
            (
                "compression = [[0.0, 0.0], [0.02, 0.12]]",
                "compression = [[0.0, 0.0], [0.02, 0.12], [0.04, 0.2]]",
                "`warp.compression` is [[0.0, 0.0], [0.02, 0.12], [0.04, 0.2]], expected points on \
                 one straight line: yarns buckle long before a second slope",
            ),
            (
                "positive = [[0.0, 0.0], [0.1, 0.005]]",
                "positive = [[0.0, 0.0], [10.0, 0.005], [40.0, 0.1]]",
                "`shear.positive` is [[0.0, 0.0], [10.0, 0.005], [40.0, 0.1]], expected angles up to \
                 1.4 rad, of a curve that bends",
            ),
        ] {
            let bad = INTERGLAS_92125.replace(good, bad);
            let error = read(&bad).unwrap_err();
            assert_eq!(error.to_string(), format!("m.toml: {expected}"));
        }
    }
}
