use nalgebra::DMatrix;

use super::super::tests::{PINNED, cases, solved, standard_trellis};
use super::*;
use crate::fabric::{BlankConfig, Material};

const MODULI: [f64; 2] = [50e3, 36e3];

fn trellis(cell_mm: [f64; 2]) -> (Trellis, [f64; 2]) {
    let config = BlankConfig {
        size_mm: cell_mm.map(|c| 4.0 * c),
        vertices: [5, 5],
        ..BlankConfig::default()
    };
    let lamina = Lamina::new(&config, Material::interglas_92125()).unwrap();
    (Trellis::new(&lamina, MODULI), cell_mm.map(|c| 1e-3 * c))
}

/// Energy of a cell at shear `gamma` [J].
fn energy([a, b]: [f64; 2], gamma: f64) -> f64 {
    let modulus = MODULI[usize::from(gamma < 0.0)];
    0.5 * modulus * 0.35e-3 * a * b * gamma * gamma
}

fn length([a, b]: [f64; 2], gamma: f64) -> f64 {
    (a * a + b * b + 2.0 * a * b * gamma.sin()).sqrt()
}

/// Force of the spring at `length`.
fn force(trellis: &Trellis, cell: [f64; 2], length: f64) -> f64 {
    let rest = cell[0].hypot(cell[1]);
    let law = trellis.at_rest;
    let at_rest = if length < rest {
        law.compression
    } else {
        law.tension
    };
    (length - rest) / (at_rest * trellis.share(length * length, 1.0 / rest))
}

/// The force is the derivative of the trellis's energy by the diagonal's length, and its
/// integral the energy.
#[test]
fn diagonal_has_force_and_energy_of_the_trellis() {
    for (cell, tolerance) in [
        ([5.0, 5.0], 2e-3),
        ([5.0, 6.0], 1.3e-2),
        ([4.0, 9.0], 1.3e-2),
    ] {
        let (trellis, cell) = trellis(cell);
        for sign in [1.0, -1.0] {
            let mut work = 0.0;
            let count = 6000;
            let at = |k: f64| sign * (k / 100.0f64).to_radians();
            for k in 0..count {
                let [from, middle, to] = [0.0, 0.5, 1.0].map(|part| at(f64::from(k) + part));
                let [low, high] = [from, to].map(|gamma| length(cell, gamma));
                let expected = (energy(cell, to) - energy(cell, from)) / (high - low);
                let found = force(&trellis, cell, length(cell, middle));
                // The finite difference is off by its step, relatively most at rest.
                let off = (found / expected - 1.0).abs();
                assert!(
                    off < tolerance + 1e-3,
                    "{found} at {middle}, not {expected}"
                );
                work += found * (high - low);
                let off = (work / energy(cell, to) - 1.0).abs();
                assert!(off < tolerance + 1e-3, "energy at {to}");
            }
        }
    }
}

/// A constraint C = sin gamma with this compliance has the force k gamma dgamma/dC.
#[test]
fn sine_has_the_force_of_the_angle() {
    for k in 1..=60 {
        let gamma = f64::from(k).to_radians();
        for gamma in [gamma, -gamma] {
            let force = gamma.sin() / share_of_sine(gamma.sin());
            let expected = gamma / gamma.cos();
            assert!((force / expected - 1.0).abs() < 1.5e-3, "{gamma}");
        }
    }
}

/// Beyond the fit, collapsed and torn diagonals have a compliance, no less than a fifth and no
/// more than two and a half times that at rest.
#[test]
fn absurd_lengths_have_a_law() {
    for cell in [[5.0, 5.0], [5.0, 6.0], [3.0, 20.0]] {
        let (trellis, cell) = trellis(cell);
        let inverse = 1.0 / cell[0].hypot(cell[1]);
        for length in [0.0, 1e-9, 0.004, 0.02, 1.0, 1e6] {
            let share = trellis.share(length * length, inverse);
            assert!((0.2..2.5).contains(&share), "{share} at {length}");
        }
    }
}

/// (J M J^T + compliance) d = C, with the compliance of the sign of C and of the shear.
#[test]
fn shear_solves_its_linear_system() {
    let trellis = standard_trellis();
    cases(4, PINNED, |case, _| {
        let (c, jacobian) = case.constraints();
        let compliance = c.map(|c| {
            let at_rest = match c < 0.0 {
                true => case.line.law.compression,
                false => case.line.law.tension,
            };
            at_rest * trellis.share((1.0 + c).powi(2), 1.0)
        });
        let mass = case.masses();
        let system = &jacobian * &mass * jacobian.transpose() + DMatrix::from_diagonal(&compliance);
        let force = solved(system, &c);
        let found = case.sheared(&trellis);
        case.check(&found, &-(&mass * jacobian.transpose() * force));
    });
}
