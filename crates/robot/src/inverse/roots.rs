use std::f64::consts::TAU;

use nalgebra::Complex;

/// Greatest degree of a trigonometric polynomial.
const DEGREE: usize = 12;
/// How many values tell one.
pub const SAMPLES: usize = 32;

/// Share of the greatest coefficient that is rounding.
const ROUNDING: f64 = 1e-13;
/// How far from the unit circle a root may be to be tried: where two zeros meet, rounding moves them off it.
const OFF_CIRCLE: f64 = 1e-3;
/// Steps of the search for roots at most; about ten are usual.
const STEPS: usize = 60;

/// Calls `each` with the angles at which a trigonometric polynomial of degree [`DEGREE`] at most is zero, and some where it is
/// nearly so. It is given by its values at multiples of a turn's [`SAMPLES`]th part.
///
/// With z = exp(i angle) it is an ordinary polynomial of twice the degree, of which Aberth's iteration finds all roots at
/// once; those on the unit circle are angles.
pub fn angles_at_zero(samples: &[f64; SAMPLES], mut each: impl FnMut(f64)) {
    let coefficients = coefficients(samples);
    for z in roots(&coefficients) {
        if (z.norm() - 1.0).abs() < OFF_CIRCLE {
            each(z.arg());
        }
    }
}

/// Coefficients of the polynomial in z, the constant first, whose leading one is not zero.
fn coefficients(samples: &[f64; SAMPLES]) -> Vec<Complex<f64>> {
    let powers: [Complex<f64>; SAMPLES] =
        std::array::from_fn(|k| Complex::cis(-TAU * k as f64 / SAMPLES as f64));
    let harmonic = |j: usize| -> Complex<f64> {
        let values = samples.iter().enumerate();
        values
            .map(|(k, value)| powers[j * k % SAMPLES] * value)
            .sum()
    };
    let half: [Complex<f64>; DEGREE + 1] = std::array::from_fn(harmonic);
    let most = half.iter().map(|c| c.norm()).fold(0.0, f64::max);
    let degree = half
        .iter()
        .rposition(|c| c.norm() > ROUNDING * most)
        .unwrap_or(0);
    let negative = half[1..=degree].iter().rev().map(Complex::conj);
    negative.chain(half[..=degree].iter().copied()).collect()
}

fn roots(coefficients: &[Complex<f64>]) -> Vec<Complex<f64>> {
    let degree = coefficients.len() - 1;
    // Off the circle and not in pairs, as which roots come.
    let start = |k: usize| {
        let radius = [0.9, 1.15][k % 2];
        Complex::from_polar(radius, TAU * (k as f64 + 0.3) / degree as f64)
    };
    let mut z: Vec<_> = (0..degree).map(start).collect();
    let mut is_found = vec![false; degree];
    for _ in 0..STEPS {
        for i in 0..degree {
            if is_found[i] {
                continue;
            }
            let (mut p, mut slope) = (Complex::from(0.0), Complex::from(0.0));
            for c in coefficients.iter().rev() {
                slope = slope * z[i] + p;
                p = p * z[i] + c;
            }
            let newton = p / slope;
            let others: Complex<f64> = (0..degree)
                .filter(|j| *j != i)
                .map(|j| (z[i] - z[j]).inv())
                .sum();
            let step = newton / (Complex::from(1.0) - newton * others);
            if !step.is_finite() {
                is_found[i] = true;
                continue;
            }
            z[i] -= step;
            is_found[i] = step.norm_sqr() < 1e-26;
        }
        if is_found.iter().all(|is_found| *is_found) {
            break;
        }
    }
    z
}
