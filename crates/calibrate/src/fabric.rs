use drape_cloth::fabric::{ArealMass, Curve, Family, Material, ShearLaw, YarnLaw};
use drape_cloth::file::ValueError;
use drape_task::env::{Quantity, Scatter, Spread};

use crate::curve::{self, Sample};
use crate::lab::{Lab, Specimen};
use crate::specimens::{Measured, factor_spread, measured};

/// Standard gravity, by which laboratories weigh [m/s²].
const GRAVITY: f64 = 9.80665;

/// Points that are farther off their curve than this share of them are no noise: stress falls where strain grows.
const DOUBTFUL: f64 = 0.2;

/// Most slopes of a law that the solver has: of yarns in tension, and of shear.
const SLOPES: [usize; 2] = [2, 3];

/// A material that tests and a base have made.
#[derive(Clone, Debug)]
pub struct Calibrated {
    pub material: Material,
    /// By the spread of specimens; of what had two at least.
    pub scatter: Scatter,
    /// What was measured, by names with units.
    pub parameters: Vec<(String, Measured)>,
    /// Keys of the material that are those of the base.
    pub kept: Vec<String>,
    pub curves: Vec<FittedCurve>,
    /// What has to be known beside the numbers, in sentences.
    pub notes: Vec<String>,
}

/// Measured points and the law through them.
#[derive(Clone, Debug)]
pub struct FittedCurve {
    /// Key in the material file.
    pub key: String,
    /// Strain or angle, and stress [MPa].
    pub points: Vec<[f64; 2]>,
    pub fit: Vec<[f64; 2]>,
}

/// Why tests make no material.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    #[error("nothing tells {}, expected tests of that, or a material to keep it from", .0.join(", "))]
    Missing(Vec<String>),
    #[error("{key}: {fault}")]
    Curve { key: String, fault: String },
    #[error(
        "{key}: a bending stiffness of {found:.3e} N m, expected less than {most:.3e} N m, which yarns of this \
         tension and thickness have that bear as much in compression"
    )]
    Stiff { key: String, found: f64, most: f64 },
    #[error(transparent)]
    Value(#[from] ValueError),
}

/// The material that tests tell; what they do not tell is that of `base`.
///
/// Bending has no key of its own: it is that of the compression which gives, with tension and thickness, the stiffness
/// D = g m c³ of the cantilevers, c half their overhang (ASTM D1388), or that of the base.
///
/// # Errors
/// If the base is missing for something, or tests contradict each other.
pub fn calibrate(lab: &Lab, base: Option<&Material>, name: &str) -> Result<Calibrated, FitError> {
    let mut made = Making {
        base,
        missing: Vec::new(),
        kept: Vec::new(),
        parameters: Vec::new(),
        notes: Vec::new(),
        curves: Vec::new(),
        spreads: Vec::new(),
    };
    let thickness_mm = made.scalar("thickness_mm", &lab.thickness, 1e3, |m| m.thickness_mm);
    let of = |m: &Material| m.areal_mass_g_m2.datasheet;
    let datasheet = made.scalar("areal_mass_g_m2", &lab.areal_mass, 1e3, of);
    let kept = base.filter(|_| lab.areal_mass.is_empty());
    let paper = kept.and_then(|m| m.areal_mass_g_m2.paper);
    let areal_mass_g_m2 = ArealMass { paper, datasheet };
    made.spread(Quantity::ArealMass, [&lab.areal_mass[..]]);

    let thickness = 1e-3 * thickness_mm;
    let mut yarns = Vec::new();
    let (mut tension_factors, mut stiffnesses) = (Vec::new(), Vec::new());
    for (k, family) in [Family::Warp, Family::Weft].into_iter().enumerate() {
        let side = ["warp", "weft"][k];
        let key = format!("{side}.tension");
        let of = |m: &Material| m.yarn(family).tension.clone();
        let (tension, factors) = made.curve(&key, &lab.tension[k], thickness, SLOPES[0], of)?;
        tension_factors.push(factors);
        let overhangs = lab.overhang[k].iter();
        let stiffness = |overhang: &f64| GRAVITY * 1e-3 * datasheet * (0.5 * overhang).powi(3);
        let stiffness: Vec<f64> = overhangs.map(stiffness).collect();
        let key = format!("{side}.compression");
        let compression = made.compression(&key, family, &stiffness, &tension, thickness, lab)?;
        stiffnesses.push(stiffness);
        let [resting, sliding] = &lab.friction[k];
        let key = format!("{side}.static_friction");
        let static_friction = made.scalar(&key, resting, 1.0, |m| m.yarn(family).static_friction);
        let key = format!("{side}.dynamic_friction");
        let dynamic_friction = made.scalar(&key, sliding, 1.0, |m| m.yarn(family).dynamic_friction);
        yarns.push(YarnLaw {
            tension,
            compression,
            static_friction,
            dynamic_friction,
        });
    }
    let shear = |positive: bool| {
        move |m: &Material| match positive {
            true => m.shear.positive.clone(),
            false => m.shear.negative.clone(),
        }
    };
    let [positive, negative] = &lab.shear;
    let most = SLOPES[1];
    let (positive, p) = made.curve("shear.positive", positive, thickness, most, shear(true))?;
    let (negative, n) = made.curve("shear.negative", negative, thickness, most, shear(false))?;
    let locking = made.locking([&positive, &negative], lab);

    made.spread(Quantity::Tension, tension_factors.iter().map(|f| &f[..]));
    made.spread(Quantity::Bending, stiffnesses.iter().map(|d| &d[..]));
    made.spread(Quantity::Shear, [&p[..], &n]);
    made.spread(
        Quantity::Friction,
        lab.friction.iter().flatten().map(|f| &f[..]),
    );
    if !made.missing.is_empty() {
        return Err(FitError::Missing(made.missing));
    }
    let [warp, weft] = yarns.try_into().expect("two families");
    let material = Material {
        name: name.into(),
        thickness_mm,
        areal_mass_g_m2,
        warp,
        weft,
        shear: ShearLaw {
            positive,
            negative,
            locking,
        },
    };
    material.check()?;
    made.tell_what_scenes_have_to_say(&material, lab);
    let scatter = Scatter {
        spreads: made.spreads.into_iter().collect(),
        ..Scatter::default()
    };
    scatter.check().map_err(|error| error.within("scatter"))?;
    Ok(Calibrated {
        material,
        scatter,
        parameters: made.parameters,
        kept: made.kept,
        curves: made.curves,
        notes: made.notes,
    })
}

/// A number in as many digits as measurements have, so that files can be read.
pub(crate) fn rounded(number: f64) -> f64 {
    format!("{number:.5e}").parse().expect("a number")
}

/// The modulus in compression [Pa] with which yarns of a modulus in tension [Pa] bend so stiffly [N m]; none beyond what
/// any has. Inverts [`Material::bending_stiffness`].
pub(crate) fn compression(tension: f64, bending: f64, thickness: f64) -> Option<f64> {
    let reduced = 12.0 * bending / thickness.powi(3);
    let root = 2.0 / reduced.sqrt() - 1.0 / tension.sqrt();
    (root > 0.0).then(|| 1.0 / (root * root))
}

/// Greatest bending stiffness of yarns of this modulus [N m], which compression cannot reach.
pub(crate) fn stiffest(tension: f64, thickness: f64) -> f64 {
    4.0 * tension * thickness.powi(3) / 12.0
}

/// What is gathered on the way.
struct Making<'a> {
    base: Option<&'a Material>,
    missing: Vec<String>,
    kept: Vec<String>,
    parameters: Vec<(String, Measured)>,
    notes: Vec<String>,
    curves: Vec<FittedCurve>,
    spreads: Vec<(Quantity, Spread)>,
}

impl Making<'_> {
    /// The base's value of a key, or none and a word that it is missing.
    fn keep<T>(&mut self, key: &str, of: impl Fn(&Material) -> T) -> Option<T> {
        let list = match self.base {
            Some(_) => &mut self.kept,
            None => &mut self.missing,
        };
        list.push(key.into());
        self.base.map(of)
    }

    /// A number as specimens have it [SI], in the unit of the file.
    fn scalar(
        &mut self,
        key: &str,
        values: &[f64],
        unit: f64,
        of: impl Fn(&Material) -> f64,
    ) -> f64 {
        let values: Vec<f64> = values.iter().map(|value| unit * value).collect();
        match measured(&values) {
            Some(found) => {
                self.parameters.push((key.into(), found));
                rounded(found.value)
            }
            // What is missing ends in an error before it is used.
            None => self.keep(key, of).unwrap_or(1.0),
        }
    }

    /// The curve through all specimens, and the factor of each of them on it.
    fn curve(
        &mut self,
        key: &str,
        specimens: &[Specimen],
        thickness: f64,
        most: usize,
        of: impl Fn(&Material) -> Curve,
    ) -> Result<(Curve, Vec<f64>), FitError> {
        if specimens.is_empty() {
            let kept = self.keep(key, of);
            return Ok((kept.unwrap_or(Curve::line(1e6)), Vec::new()));
        }
        let fault = |number: usize| FitError::Curve {
            key: key.into(),
            fault: format!(
                "specimen {} has no two points at different strains > 0, one of them with a stress > 0",
                number + 1
            ),
        };
        let mut stresses: Vec<Vec<Sample>> = Vec::new();
        for (number, specimen) in specimens.iter().enumerate() {
            let unit = 1e-6
                / if specimen.is_per_width {
                    thickness
                } else {
                    1.0
                };
            let in_mpa = |s: &Sample| Sample {
                value: unit * s.value,
                ..*s
            };
            let samples: Vec<Sample> = specimen.samples.iter().map(in_mpa).collect();
            let strained = || samples.iter().filter(|s| s.at > 0.0);
            let first = strained().next().ok_or_else(|| fault(number))?;
            let is_curve =
                strained().any(|s| s.at != first.at) && strained().any(|s| s.value > 0.0);
            if !is_curve {
                return Err(fault(number));
            }
            stresses.push(samples);
        }
        // What a specimen is stiffer or softer by is no noise of its points.
        let shape = curve::fit(&stresses.concat(), most);
        let factors: Vec<f64> = stresses.iter().map(|s| factor(&shape, s)).collect();
        let mean = measured(&factors).ok_or_else(|| fault(0))?.value;
        let alike = stresses.iter().zip(&factors).flat_map(|(samples, factor)| {
            samples.iter().map(move |s| Sample {
                value: s.value * mean / factor,
                ..*s
            })
        });
        let alike: Vec<Sample> = alike.collect();
        let fit = curve::fewest(&alike, most);
        self.tell_slopes(key, &fit, &stresses);
        let off = curve::misfit(&alike, &fit);
        if off > DOUBTFUL {
            self.notes.push(format!(
                "{key}: points are {:.0} % off the curve, root mean square, expected at most {:.0} %: do they fall where \
                 the strain grows?",
                100.0 * off,
                100.0 * DOUBTFUL
            ));
        }
        let end = fit[fit.len() - 1][0];
        self.notes.push(format!(
            "{key} was measured up to {end:.3}; beyond that its last slope goes on"
        ));
        let shown = |s: &Sample| [s.at, s.value - s.half * curve::value(&fit, 0.5 * s.at)];
        self.curves.push(FittedCurve {
            key: key.into(),
            points: stresses.iter().flatten().map(shown).collect(),
            fit: fit.clone(),
        });
        let points = fit.into_iter().map(|point| point.map(rounded)).collect();
        Ok((Curve::new(points), factors))
    }

    /// Slopes and kinks of a curve, with intervals by those of its specimens.
    fn tell_slopes(&mut self, key: &str, fit: &[[f64; 2]], specimens: &[Vec<Sample>]) {
        let slopes = fit.len() - 1;
        // One of which too few points are known is as all are.
        let own = |samples: &Vec<Sample>| match samples.len() > 4 * slopes {
            true => curve::fit(samples, slopes),
            false => {
                let factor = factor(fit, samples);
                fit.iter().map(|&[e, s]| [e, factor * s]).collect()
            }
        };
        let curves: Vec<Vec<[f64; 2]>> = specimens.iter().map(own).collect();
        let slope = |c: &[[f64; 2]], k: usize| (c[k + 1][1] - c[k][1]) / (c[k + 1][0] - c[k][0]);
        let mut tell = |name: String, of: &dyn Fn(&[[f64; 2]]) -> f64| {
            let values: Vec<f64> = curves.iter().map(|curve| of(curve)).collect();
            let mut found = measured(&values).expect("one specimen at least");
            let by = of(fit) / found.value;
            found.value *= by;
            found.interval = found.interval.map(|ends| ends.map(|end| by * end));
            self.parameters.push((name, found));
        };
        for k in 0..slopes {
            if k > 0 {
                tell(format!("{key} kink {k}"), &|curve| curve[k][0]);
            }
            tell(format!("{key} slope {} [MPa]", k + 1), &|c| slope(c, k));
        }
    }

    /// Compression that gives the bending stiffness which cantilevers have [N m], or the base.
    fn compression(
        &mut self,
        key: &str,
        family: Family,
        stiffness: &[f64],
        tension: &Curve,
        thickness: f64,
        lab: &Lab,
    ) -> Result<Curve, FitError> {
        let bending = match measured(stiffness) {
            Some(found) => {
                let side = key.split('.').next().unwrap_or_default();
                self.parameters
                    .push((format!("{side} bending [N m]"), found));
                found.value
            }
            None => {
                let missing = format!("{key} (overhangs of cantilevers)");
                let shown = if self.base.is_some() { key } else { &missing };
                let of = |m: &Material| {
                    (
                        m.bending_stiffness(family),
                        m.yarn(family).compression.clone(),
                    )
                };
                let Some((bending, compression)) = self.keep(shown, of) else {
                    return Ok(Curve::line(1e6));
                };
                if lab.thickness.is_empty() && lab.tension[family as usize].is_empty() {
                    return Ok(compression);
                }
                self.kept.pop();
                self.notes.push(format!(
                    "{key} is chosen so that bending stays {bending:.3e} N m, as in the base"
                ));
                bending
            }
        };
        if !self.missing.is_empty() {
            return Ok(Curve::line(1e6));
        }
        bending_by_compression(key, bending, tension, thickness)
    }

    /// Locking is the base's, unless curves reach into it.
    fn locking(
        &mut self,
        curves: [&Curve; 2],
        lab: &Lab,
    ) -> Option<drape_cloth::fabric::ShearLocking> {
        let locking = self.base?.shear.locking?;
        let ends = curves.map(|curve| curve.points()[curve.points().len() - 1][0]);
        let is_measured = lab.shear.iter().any(|side| !side.is_empty());
        if is_measured && ends[0].max(ends[1]) > locking.angle_rad {
            self.notes.push(format!(
                "shear.locking of the base, from {} rad on, is left out: curves were measured beyond",
                locking.angle_rad
            ));
            return None;
        }
        self.kept.push("shear.locking".into());
        Some(locking)
    }

    /// The spread of a factor by its groups of specimens.
    fn spread<'s>(&mut self, quantity: Quantity, groups: impl IntoIterator<Item = &'s [f64]>) {
        let groups: Vec<&[f64]> = groups.into_iter().collect();
        match factor_spread(groups.iter().copied()) {
            Some(deviation) => {
                let deviation = Spread::Deviation(rounded(deviation));
                self.spreads.push((quantity, deviation));
            }
            None if groups.iter().any(|group| !group.is_empty()) => self.notes.push(format!(
                "the spread of {} is unknown: there is one specimen of it",
                quantity.name()
            )),
            None => {}
        }
    }

    /// Where a scene does not use all that was measured by itself.
    fn tell_what_scenes_have_to_say(&mut self, material: &Material, lab: &Lab) {
        if lab.overhang.iter().any(|side| !side.is_empty()) {
            self.notes.push(
                "bending counts in scenes that say physics.bending_stiffness = \"material\"".into(),
            );
        }
        let tensions = [&material.warp.tension, &material.weft.tension];
        if tensions.iter().any(|curve| !curve.kinks().is_empty()) {
            self.notes.push(
                "tension has two slopes: scenes have to say physics.tension = \"material\", or \
                 \"first_branch\" for the first alone"
                    .into(),
            );
        }
    }
}

/// The straight law of compression with which yarns bend so stiffly [N m].
pub(crate) fn bending_by_compression(
    key: &str,
    bending: f64,
    tension: &Curve,
    thickness: f64,
) -> Result<Curve, FitError> {
    let modulus = tension.modulus();
    let stiff = || FitError::Stiff {
        key: key.into(),
        found: bending,
        most: stiffest(modulus, thickness),
    };
    let compression = compression(modulus, bending, thickness).ok_or_else(stiff)?;
    let point = [0.02, rounded(0.02e-6 * compression)];
    Ok(Curve::new(vec![[0.0; 2], point]))
}

/// What takes a curve to the samples of one specimen, by weighted least squares.
fn factor(curve: &[[f64; 2]], samples: &[Sample]) -> f64 {
    let predicted = |s: &Sample| curve::predicted(curve, s);
    let weights = curve::weights(samples, predicted);
    let sum = |of: &dyn Fn(&Sample) -> f64| -> f64 {
        samples.iter().zip(&weights).map(|(s, w)| w * of(s)).sum()
    };
    sum(&|s| s.value * predicted(s)) / sum(&|s| predicted(s).powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn twice(value: f64) -> Vec<f64> {
        vec![0.9 * value, value / 0.9]
    }

    #[test]
    fn cantilevers_become_the_rigidity_of_astm_d1388() {
        let base = Material::interglas_92125();
        let lab = Lab {
            overhang: [twice(0.1), vec![0.08]],
            ..Lab::default()
        };
        let made = calibrate(&lab, Some(&base), "m").unwrap();
        let expected = 9.80665 * 0.28 * 0.05f64.powi(3);
        let found = made.material.bending_stiffness(Family::Warp);
        assert!((found / expected - 1.0).abs() < 1e-4, "{found}");
        let found = made.material.bending_stiffness(Family::Weft);
        let expected = 9.80665 * 0.28 * 0.04f64.powi(3);
        assert!((found / expected - 1.0).abs() < 1e-4, "{found}");
        // Its logarithm spreads three times as much as that of the overhang.
        let deviation = 3.0 * (1.0 / 0.81f64).ln() / 2f64.sqrt();
        let spread = made.scatter.spreads[&Quantity::Bending];
        assert_eq!(spread, Spread::Deviation(rounded(deviation)));
        assert_eq!(made.material.warp.tension, base.warp.tension);
        assert!(
            made.kept.contains(&"shear.locking".into()),
            "{:?}",
            made.kept
        );
        let one = Lab {
            overhang: [vec![0.1], vec![]],
            ..Lab::default()
        };
        let made = calibrate(&one, Some(&base), "m").unwrap();
        let unknown = "the spread of bending is unknown: there is one specimen of it";
        assert!(made.notes.iter().any(|note| note == unknown));
        assert!(made.scatter.spreads.is_empty());
        assert_eq!(made.material.weft.compression, base.weft.compression);
    }

    #[test]
    fn bending_stays_where_thickness_alone_is_measured() {
        let base = Material::interglas_92125();
        let lab = Lab {
            thickness: vec![0.4e-3],
            ..Lab::default()
        };
        let made = calibrate(&lab, Some(&base), "m").unwrap().material;
        for family in [Family::Warp, Family::Weft] {
            let [a, b] = [&made, &base].map(|m| m.bending_stiffness(family));
            assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
        }
        assert_eq!(made.thickness_mm, 0.4);
    }

    #[test]
    fn what_is_missing_or_cannot_be_is_named() {
        let lab = Lab {
            thickness: vec![0.4e-3],
            ..Lab::default()
        };
        let error = calibrate(&lab, None, "m").unwrap_err().to_string();
        for key in [
            "areal_mass_g_m2",
            "warp.tension",
            "weft.compression (overhangs",
            "shear.negative",
        ] {
            assert!(error.contains(key), "{error}");
        }
        let base = Material::interglas_92125();
        let lab = Lab {
            overhang: [vec![2.0], vec![]],
            ..Lab::default()
        };
        let error = calibrate(&lab, Some(&base), "m").unwrap_err();
        assert!(matches!(error, FitError::Stiff { .. }), "{error}");
        let lab = Lab {
            areal_mass: vec![0.01, 1.0],
            ..Lab::default()
        };
        let error = calibrate(&lab, Some(&base), "m").unwrap_err().to_string();
        assert!(error.contains("`scatter.areal_mass` is 3.25"), "{error}");
    }
}
