use crate::fabric::{Curve, Material};
use crate::sim::Parameters;

/// A piecewise linear law as a sum of ramps: stress = sum of gain max(0, strain - start).
///
/// So it costs no branches, and its energy is exact.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ramps {
    /// Start [-] and gain of slope there [Pa], ascending from 0.
    steps: Vec<[f64; 2]>,
}

impl Ramps {
    /// The curve, `factor` times as stiff, its last slope going on.
    fn of(curve: &Curve, factor: f64) -> Self {
        let mut last = 0.0;
        let steps = curve.points().windows(2).map(|pair| {
            let [p, q] = [pair[0], pair[1]];
            let slope = (1e6 * q[1] - 1e6 * p[1]) / (q[0] - p[0]);
            let gain = factor * (slope - last);
            last = slope;
            [p[0], gain]
        });
        Self {
            steps: steps.collect(),
        }
    }

    /// Greatest slope up to `strain` [Pa], and the strain from which on there may be a greater.
    pub fn stiffest(&self, strain: f64) -> (f64, f64) {
        let (mut slope, mut greatest) = (0.0, 0.0f64);
        for &[start, gain] in &self.steps {
            slope += gain;
            if start > strain && slope > greatest {
                return (greatest, start);
            }
            greatest = greatest.max(slope);
        }
        (greatest, f64::INFINITY)
    }
}

/// Stress against a strain of either sign.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Law {
    pub positive: Ramps,
    /// Strain and stress both counted positive.
    pub negative: Ramps,
}

impl Law {
    fn of(curves: [&Curve; 2], factors: [f64; 2]) -> Self {
        Self {
            positive: Ramps::of(curves[0], factors[0]),
            negative: Ramps::of(curves[1], factors[1]),
        }
    }

    /// Stress [Pa] in every lane.
    #[inline(always)]
    pub fn stress<const N: usize>(&self, strain: &[f64; N]) -> [f64; N] {
        let mut stress = [0.0; N];
        for &[start, gain] in &self.positive.steps {
            for l in 0..N {
                let over = strain[l] - start;
                stress[l] += gain * if over > 0.0 { over } else { 0.0 };
            }
        }
        for &[start, gain] in &self.negative.steps {
            for l in 0..N {
                let over = -strain[l] - start;
                stress[l] -= gain * if over > 0.0 { over } else { 0.0 };
            }
        }
        stress
    }

    /// Energy per volume [J/m^3], the integral of the stress.
    pub fn energy(&self, strain: f64) -> f64 {
        let sum = |ramps: &Ramps, strain: f64| -> f64 {
            let over = |step: &[f64; 2]| 0.5 * step[1] * (strain - step[0]).max(0.0).powi(2);
            ramps.steps.iter().map(over).sum()
        };
        sum(&self.positive, strain) + sum(&self.negative, -strain)
    }

    fn is_finite(&self) -> bool {
        let steps = self.positive.steps.iter().chain(&self.negative.steps);
        steps.flatten().all(|x| x.is_finite())
    }
}

/// The three laws of a woven fabric: stress along each family, and shear stress.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Laws {
    pub yarns: [Law; 2],
    pub shear: Law,
}

impl Laws {
    pub fn new(material: &Material, shear_locking: bool, own: &Parameters) -> Self {
        let yarns = [&material.warp, &material.weft];
        let shear = material.shear.curves(shear_locking);
        let yarn = |k: usize| {
            let curves = [&yarns[k].tension, &yarns[k].compression];
            Law::of(curves, [own.tension[k], own.compression[k]])
        };
        Self {
            yarns: [0, 1].map(yarn),
            shear: Law::of(shear.each_ref(), own.shear),
        }
    }

    /// Stress along warp and weft [Pa] in every lane.
    #[inline(always)]
    pub fn along_yarns<const N: usize>(&self, [warp, weft]: &[[f64; N]; 2]) -> [[f64; N]; 2] {
        [self.yarns[0].stress(warp), self.yarns[1].stress(weft)]
    }

    /// Every slope is finite.
    pub fn are_finite(&self) -> bool {
        self.yarns.iter().all(Law::is_finite) && self.shear.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, expected: f64) {
        assert!(
            (found - expected).abs() <= 1e-12 * expected.abs(),
            "{found} is not {expected}"
        );
    }

    /// Stress per width of Table 2, in tension and compression, between points and beyond.
    #[test]
    fn ramps_have_the_stress_of_the_curves() {
        let material = Material::interglas_92125();
        let laws = Laws::new(&material, false, &Parameters::default());
        for (law, yarn) in laws.yarns.iter().zip([&material.warp, &material.weft]) {
            for strain in [0.0, 0.001, 0.005, 0.006, 0.0125, 0.02, 0.03, 0.5] {
                let [tension, compression] = law.stress(&[strain, -strain]);
                close(tension, yarn.tension.stress(strain));
                close(compression, -yarn.compression.stress(strain));
            }
        }
    }

    #[test]
    fn shear_beyond_the_data_goes_on_with_its_slope() {
        let law = Laws::new(&Material::interglas_92125(), false, &Parameters::default()).shear;
        for (angle, stress) in [(0.05, 2500.0), (0.9, 45_000.0), (-0.9, -32_400.0)] {
            close(law.stress(&[angle])[0], stress);
        }
    }

    #[test]
    fn energy_is_the_integral_of_the_stress() {
        let material = Material::interglas_92125();
        let laws = Laws::new(&material, false, &Parameters::default());
        for (law, reach) in [
            (&laws.yarns[0], 0.03),
            (&laws.yarns[1], 0.03),
            (&laws.shear, 1.2),
        ] {
            for sign in [1.0, -1.0] {
                let count = 30_000;
                let h = sign * reach / count as f64;
                let middle = |k: usize| law.stress(&[(k as f64 + 0.5) * h])[0];
                let sum: f64 = (0..count).map(|k| middle(k) * h).sum();
                let energy = law.energy(sign * reach);
                assert!((sum / energy - 1.0).abs() < 1e-6, "{sum} is not {energy}");
            }
        }
    }

    #[test]
    fn stiffest_slope_says_how_far_it_holds() {
        let laws = Laws::new(&Material::interglas_92125(), false, &Parameters::default());
        let (slope, limit) = laws.yarns[0].positive.stiffest(0.004);
        close(slope, 600e6);
        close(limit, 0.005);
        let (slope, limit) = laws.yarns[0].positive.stiffest(0.0051);
        close(slope, 37e6 / 0.015);
        assert_eq!(limit, f64::INFINITY);
    }
}
