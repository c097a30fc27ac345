use nalgebra::{DMatrix, DVector};

use super::super::edges::project_edges;
use super::super::line::{Line, MAX_WARM};
use super::super::tests::{Case, PINNED, cases, random_vector, solved};
use super::*;
use crate::math::Vec3;

/// (J M J^T + compliance) d = C - compliance force, with the compliance of the sign of the
/// force; the kept force grows by d, and the vertices move by -M J^T d. Forces are densities
/// times lengths.
#[test]
fn stretch_solves_its_linear_system() {
    cases(1, PINNED, |case, stream| {
        let before: Vec<f64> = (0..case.edges()).map(|_| stream.normal()).collect();
        let (c, jacobian) = case.constraints();
        let length = c.add_scalar(1.0);
        let compliance = DVector::from_iterator(
            case.edges(),
            before.iter().map(|f| match *f < 0.0 {
                true => case.line.law.compression,
                false => case.line.law.tension,
            }),
        );
        let densities = DVector::from_column_slice(&before).map(|q| q.max(case.line.min_warm()));
        let force = densities.component_mul(&length);
        let mass = case.masses();
        let system = &jacobian * &mass * jacobian.transpose() + DMatrix::from_diagonal(&compliance);
        let change = solved(system, &(c - compliance.component_mul(&force)));
        let total = force + &change;
        let (x, found) = case.stretched(&before);
        case.check(&x, &-(&mass * jacobian.transpose() * &change));
        // Edges between pinned vertices have forces as large as 1 / compliance.
        let rounding = 1e-9 * (1.0 + total.amax());
        for ((found, length), total) in found.iter().zip(&length).zip(&total) {
            assert!((found * length - total).abs() < rounding, "not {total}");
        }
    });
}

/// The pull is -J^T of the kept forces, the stress the sum of all densities beside a vertex.
#[test]
fn warm_start_gives_pull_and_stress() {
    cases(2, PINNED, |case, stream| {
        let density: Vec<f64> = (0..case.edges()).map(|_| stream.normal()).collect();
        let (c, jacobian) = case.constraints();
        let all = DVector::from_column_slice(&density);
        let force = all
            .map(|q| q.max(case.line.min_warm()))
            .component_mul(&c.add_scalar(1.0));
        let pulled = -(jacobian.transpose() * force);
        let (pull, stress) = case.warm_start(&density);
        for v in 0..case.x.len() {
            let expected = Vec3::from_fn(|k, _| pulled[3 * v + k]);
            assert!((pull[v] - expected).norm() < 1e-12 * (1.0 + all.amax()));
        }
        for (i, &v) in case.line.vertices.iter().enumerate() {
            let beside = [i.checked_sub(1), Some(i)].into_iter().flatten();
            let sum: f64 = beside
                .filter_map(|j| density.get(j))
                .map(|q: &f64| q.abs())
                .sum();
            assert!((stress[v as usize] - sum).abs() < 1e-12 * (1.0 + sum));
        }
    });
}

/// Tension lasts, and compression up to a multiple of that at which bending gives way.
#[test]
fn only_compression_that_bending_holds_lasts() {
    cases(9, PINNED, |case, _| {
        let most = MAX_WARM * case.line.bending;
        for (force, expected) in [(3.0, 3.0), (-0.5 * most, -0.5 * most), (-2.0 * most, -most)] {
            assert_eq!(force.max(case.line.min_warm()), expected);
        }
        let limp = Line {
            bending: 0.0,
            ..case.line.clone()
        };
        assert_eq!((-1.0f64).max(limp.min_warm()), 0.0);
    });
}

/// A yarn whose force densities hold their strain by the law, in tension and in compression, is at rest.
#[test]
fn forces_that_meet_the_law_change_nothing() {
    cases(3, PINNED, |case, stream| {
        let mut case = Case {
            line: case.line.clone(),
            x: vec![Vec3::zeros(); case.x.len()],
            mobility: case.mobility.clone(),
        };
        // length = rest + compliance * density * length.
        let all = (0..case.edges()).map(|_| stream.normal());
        let densities: Vec<f64> = all.map(|q| q.max(case.line.min_warm())).collect();
        for (j, density) in densities.iter().enumerate() {
            let [a, b] = [0, 1].map(|k| case.line.vertices[j + k] as usize);
            let compliance = match *density < 0.0 {
                true => case.line.law.compression,
                false => case.line.law.tension,
            };
            let length = 1.0 / (1.0 - compliance * density);
            case.x[b] = case.x[a] + random_vector(stream).normalize() * length;
        }
        let (x, found) = case.stretched(&densities);
        for (found, x) in x.iter().zip(&case.x) {
            assert!((found - x).norm() < 1e-13);
        }
        for (found, density) in found.iter().zip(&densities) {
            assert!((found - density).abs() < 1e-9);
        }
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

fn pair(rest_length: f64) -> EdgeClass {
    EdgeClass {
        vertices: vec![[0, 1]],
        rest_length: vec![rest_length],
        law: vec![EdgeLaw {
            tension: 1.0,
            compression: 3.0,
        }],
        direction: vec![Direction::Warp],
    }
}

/// An edge of length 5 along (0.6, 0.8), mobility 1 and 3.
#[test]
fn edge_moves_as_worked_by_hand() {
    let start = [[0.0; 3], [3.0, 4.0, 0.0]].map(Vec3x);
    // C = 1, compliance 1: lambda = -1 / (1 + 3 + 1).
    let mut x = start;
    project_edges(
        &pair(4.0),
        &Limited(&[Limit::NONE]),
        &mut x,
        &[1.0, 3.0],
        None,
    );
    close(x[0], Vec3::new(0.12, 0.16, 0.0), 1e-15);
    close(x[1], Vec3::new(2.64, 3.52, 0.0), 1e-15);
    // C = -1, compliance 3: lambda = 1 / (1 + 3 + 3).
    let mut x = start;
    project_edges(
        &pair(6.0),
        &Limited(&[Limit::NONE]),
        &mut x,
        &[1.0, 3.0],
        None,
    );
    close(x[0], Vec3::new(-0.6 / 7.0, -0.8 / 7.0, 0.0), 1e-15);
    close(
        x[1],
        Vec3::new(3.0 + 1.8 / 7.0, 4.0 + 2.4 / 7.0, 0.0),
        1e-15,
    );
    // Pinned or collapsed edges do not move.
    for (x, w) in [(start, [0.0; 2]), ([Vec3x([1.0; 3]); 2], [1.0, 3.0])] {
        let mut moved = x;
        project_edges(&pair(4.0), &Limited(&[Limit::NONE]), &mut moved, &w, None);
        assert_eq!(moved.map(|x| x.0), x.map(|x| x.0));
    }
}

/// Beyond its limit of 0.5 N an edge of compliance 1 has compliance 0.25 or 4: C = 0.5 + 0.25
/// (f - 0.5), or 0.5 + 4 (f - 0.5). Mobilities 1 and 3: f = (C - offset) / (4 + compliance).
#[test]
fn limited_edge_moves_as_worked_by_hand() {
    let start = [[0.0; 3], [3.0, 4.0, 0.0]].map(Vec3x);
    let force = |rest: f64, compliance: f64| -> f64 {
        let limit = Limit {
            force: 0.5,
            compliance,
            offset: 0.5 - 0.5 * compliance,
        };
        let mut x = start;
        project_edges(&pair(rest), &Limited(&[limit]), &mut x, &[1.0, 3.0], None);
        x[0].0[0] / 0.6
    };
    for (rest, compliance, expected) in [
        // C = 5 - 0.375 = 4.625 over 4.25, C = 5 + 1.5 over 8.
        (0.0, 0.25, 4.625 / 4.25),
        (0.0, 4.0, 6.5 / 8.0),
        // Within the limit, and compressed.
        (4.0, 0.25, 0.2),
        (4.0, 4.0, 0.2),
        (6.0, 0.25, -1.0 / 7.0),
        (6.0, 4.0, -1.0 / 7.0),
    ] {
        let found = force(rest, compliance);
        assert!(
            (found - expected).abs() < 1e-14,
            "{found} is not {expected}"
        );
    }
}
