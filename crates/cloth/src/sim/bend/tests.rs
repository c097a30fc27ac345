use nalgebra::{DMatrix, DVector};

use super::super::tests::{PINNED, cases};
use super::*;
use crate::math::Vec3;

/// (1 + M K) d = -M K x.
#[test]
fn bend_solves_its_linear_system() {
    cases(5, PINNED, |case, _| {
        let (k, x) = case.bending();
        let count = case.x.len();
        let along = case
            .line
            .vertices
            .iter()
            .map(|&v| case.mobility[v as usize]);
        let mass = DMatrix::from_diagonal(&DVector::from_iterator(count, along));
        let pushed = -(&mass * &k * x);
        let d = (DMatrix::identity(count, count) + mass * k)
            .lu()
            .solve(&pushed)
            .unwrap();
        let mut moved = DVector::zeros(3 * count);
        for (i, &v) in case.line.vertices.iter().enumerate() {
            for k in 0..3 {
                moved[3 * v as usize + k] = d[(i, k)];
            }
        }
        let found = case.bent();
        case.check(&found, &moved);
    });
}

fn close(found: Vec3x<f64>, expected: Vec3, tolerance: f64) {
    let off = (Vec3::from(found.0) - expected).norm();
    assert!(
        off <= tolerance,
        "{:?} is not {expected:?}: {off:e}",
        found.0
    );
}

/// C = (0, 0, -2), mobility 1 everywhere, compliance 2: lambda = 2 / (1 + 4 + 1 + 2).
#[test]
fn triple_moves_as_worked_by_hand() {
    let triple = BendTriple {
        vertices: [0, 1, 2],
        compliance: 2.0,
        family: Family::Warp,
    };
    let mut x = [[0.0; 3], [1.0, 0.0, 1.0], [2.0, 0.0, 0.0]].map(Vec3x);
    project_triples(&[triple], &mut x, &[1.0; 3], None);
    close(x[0], Vec3::new(0.0, 0.0, 0.25), 1e-15);
    close(x[1], Vec3::new(1.0, 0.0, 0.5), 1e-15);
    close(x[2], Vec3::new(2.0, 0.0, 0.25), 1e-15);
}
