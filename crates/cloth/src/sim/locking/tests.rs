use nalgebra::DMatrix;

use super::super::shear::Trellis;
use super::super::tests::{Case, PINNED, cases, solved};
use super::*;
use crate::fabric::{BlankConfig, Material};

const MODULI: [f64; 2] = [50e3, 36e3];
const ANGLE: f64 = 0.7;
const STIFFENING: f64 = 20.0;

/// Both laws of the diagonals of square cells, or others.
fn laws(cell_mm: [f64; 2]) -> (Trellis, Locking) {
    let config = BlankConfig {
        size_mm: cell_mm.map(|c| 4.0 * c),
        vertices: [5, 5],
        ..BlankConfig::default()
    };
    let lamina = Lamina::new(&config, Material::interglas_92125()).unwrap();
    let physics = PhysicsConfig {
        shear_locking: true,
        ..PhysicsConfig::default()
    };
    let locking = locking(&lamina, &physics).unwrap();
    (Trellis::new(&lamina, MODULI), locking)
}

/// What locking adds to the energy of a cell at shear `gamma` [J].
fn energy([a, b]: [f64; 2], gamma: f64) -> f64 {
    let modulus = MODULI[usize::from(gamma < 0.0)];
    let over = (gamma.abs() - ANGLE).max(0.0);
    0.5 * (STIFFENING - 1.0) * modulus * 0.35e-3 * a * b * over * over
}

/// Force of locking along a diagonal of `length` in cells of sides `cell` [N].
fn force((trellis, locking): &(Trellis, Locking), cell: [f64; 2], length: f64) -> f64 {
    let rest = cell[0].hypot(cell[1]);
    let [beyond, share] = locking.of_diagonal(length / rest);
    let law = trellis.at_rest;
    let at_rest = if beyond < 0.0 {
        law.compression
    } else {
        law.tension
    };
    beyond * rest / (at_rest * share)
}

/// The force is the derivative of the energy by the diagonal's length, of either sign.
#[test]
fn diagonal_has_the_force_of_locking() {
    for cell_mm in [[5.0, 5.0], [5.0, 6.0], [4.0, 9.0]] {
        let laws = laws(cell_mm);
        let cell = cell_mm.map(|side| 1e-3 * side);
        let length = |gamma: f64| {
            (cell[0].powi(2) + cell[1].powi(2) + 2.0 * cell[0] * cell[1] * gamma.sin()).sqrt()
        };
        for sign in [1.0, -1.0] {
            for k in 1..=600 {
                let gamma = sign * f64::from(k) / 600.0 * MAX_SINE.asin();
                let found = force(&laws, cell, length(gamma));
                if gamma.abs() < ANGLE {
                    assert_eq!(found, 0.0, "{gamma}");
                    continue;
                }
                let step = sign * 1e-5;
                let [low, high] = [gamma - step, gamma + step];
                let work = energy(cell, high) - energy(cell, low);
                let expected = work / (length(high) - length(low));
                let off = (found - expected).abs() / expected.abs().max(1e-3);
                assert!(off < 1e-3, "{found} at {gamma}, not {expected}");
            }
        }
    }
}

/// Beyond the fit it resists ever more, down to nothing and up to any length.
#[test]
fn absurd_lengths_are_resisted_ever_more() {
    for cell_mm in [[5.0, 5.0], [5.0, 6.0], [3.0, 20.0]] {
        let laws = laws(cell_mm);
        let cell = cell_mm.map(|side| 1e-3 * side);
        let rest = cell[0].hypot(cell[1]);
        for lengths in [[0.2, 0.1, 1e-3, 0.0], [1.45, 2.0, 100.0, 1e8]] {
            let forces = lengths.map(|length| force(&laws, cell, length * rest).abs());
            assert!(forces.iter().all(|f| f.is_finite()));
            assert!(forces.is_sorted(), "{forces:?}");
        }
    }
}

/// A constraint |sin gamma| - sine with this compliance has the force of the angle beyond.
#[test]
fn sine_has_the_force_of_locking() {
    let (_, locking) = laws([5.0; 2]);
    for k in 1..=600 {
        let gamma = f64::from(k) / 600.0 * MAX_SINE.asin();
        for gamma in [gamma, -gamma] {
            let [beyond, share] = locking.of_sine(gamma.sin());
            let over = (gamma.abs() - ANGLE).max(0.0) * gamma.signum();
            let expected = (STIFFENING - 1.0) * over / gamma.cos();
            let off = (beyond / share - expected).abs();
            assert!(off <= 1e-3 * expected.abs(), "{gamma}");
        }
    }
}

/// (J M J^T + compliance) d = C of the diagonals that are locked; the others stay free.
#[test]
fn locked_rows_solve_their_linear_system() {
    let (_, locking) = laws([5.0; 2]);
    let (mut locked, mut free) = (0, 0);
    cases(4, PINNED, |case, _| {
        let (c, jacobian) = case.constraints();
        let laws = c.map(|c| locking.of_diagonal(1.0 + c));
        let active: Vec<usize> = (0..c.len()).filter(|&j| laws[j][0] != 0.0).collect();
        locked += active.len();
        free += c.len() - active.len();
        let compliance = laws.map(|[beyond, share]| {
            let law = case.line.law;
            share
                * if beyond < 0.0 {
                    law.compression
                } else {
                    law.tension
                }
        });
        let jacobian = jacobian.select_rows(&active);
        let compliance = compliance.select_rows(&active);
        let beyond = laws.map(|[beyond, _]| beyond).select_rows(&active);
        let mass = case.masses();
        let system = &jacobian * &mass * jacobian.transpose() + DMatrix::from_diagonal(&compliance);
        let force = solved(system, &beyond);
        let found = locked_by(case, &locking);
        case.check(&found, &-(&mass * jacobian.transpose() * force));
    });
    assert!(locked > 100 && free > 100, "{locked} {free}");
}

fn locked_by(case: &Case, locking: &Locking) -> Vec<crate::math::Vec3> {
    case.moved(&mut [], |row| lock(row, locking))
}

/// Inner forces, whose sum is zero, and so is that of their moments.
#[test]
fn locking_keeps_momentum() {
    let (_, locking) = laws([5.0; 2]);
    cases(6, 0.0, |case, _| {
        case.check_momentum(&locked_by(case, &locking), &case.x);
    });
}
