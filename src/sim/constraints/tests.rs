use nalgebra::{DMatrix, DVector};

use super::*;
use crate::math::{Purpose, Stream, Vec3};
use crate::sim::model::EdgeLaw;

fn close(found: Vec3x<f64>, expected: Vec3, tolerance: f64) {
    let off = (Vec3::from(found.0) - expected).norm();
    assert!(
        off <= tolerance,
        "{:?} is not {expected:?}: {off:e}",
        found.0
    );
}

fn random_vector(stream: &mut Stream) -> Vec3 {
    Vec3::from_fn(|_, _| stream.normal())
}

#[test]
fn arc_tangent_keeps_its_bound() {
    let mut worst = 0.0f64;
    // Evenly in the angle, and densely where the polynomial is reflected.
    for i in 0..=200_000 {
        let angle = std::f64::consts::FRAC_PI_2 * f64::from(i) / 200_001.0;
        worst = worst.max((arc_tangent(angle.tan()) - angle).abs());
        let t = 1.0 + (f64::from(i) - 1e5) * 1e-9;
        worst = worst.max((arc_tangent(t) - t.atan()).abs());
    }
    assert!(worst < 2e-6, "{worst:e}");
    assert_eq!(arc_tangent(0.0f64), 0.0);
    let infinite = arc_tangent(f32::INFINITY);
    assert!((infinite - std::f32::consts::FRAC_PI_2).abs() < 2e-6);
}

/// Random chains, bent and stretched, with pinned vertices anywhere, against the dense system
/// (J W J^T + alpha_tilde) lambda = -C.
#[test]
fn chain_solves_its_linear_system() {
    let mut stream = Stream::new(1, Purpose::Evaluation, 0);
    for trial in 0..200 {
        let edges = 1 + stream.below(12);
        let law = EdgeLaw {
            tension: 1e-3 * stream.uniform(),
            compression: 1e-1 * stream.uniform(),
        };
        let chain = Chain {
            vertices: (0..=edges as u32).rev().collect(),
            edges: 0..edges,
            rest_length: 1.0,
            law,
        };
        let mut x: Vec<Vec3> = vec![random_vector(&mut stream)];
        for _ in 0..edges {
            let step = random_vector(&mut stream).normalize() * (0.5 + stream.uniform());
            x.push(x[x.len() - 1] + step);
        }
        let w: Vec<f64> = (0..=edges)
            .map(|_| {
                if stream.uniform() < 0.3 {
                    0.0
                } else {
                    0.1 + stream.uniform()
                }
            })
            .collect();
        let compressed: Vec<bool> = (0..edges).map(|_| stream.uniform() < 0.5).collect();

        let mut jacobian = DMatrix::zeros(edges, 3 * (edges + 1));
        let mut c = DVector::zeros(edges);
        let mut alpha_tilde = DMatrix::zeros(edges, edges);
        for j in 0..edges {
            let [a, b] = [chain.vertices[j] as usize, chain.vertices[j + 1] as usize];
            let d = x[b] - x[a];
            c[j] = d.norm() - 1.0;
            for k in 0..3 {
                jacobian[(j, 3 * a + k)] = -d[k] / d.norm();
                jacobian[(j, 3 * b + k)] = d[k] / d.norm();
            }
            let compliance = if compressed[j] {
                law.compression
            } else {
                law.tension
            };
            alpha_tilde[(j, j)] = 4.0 * compliance;
        }
        let mass = DMatrix::from_diagonal(&DVector::from_fn(3 * (edges + 1), |i, _| w[i / 3]));
        let system = &jacobian * &mass * jacobian.transpose() + alpha_tilde;
        let lambda = system.lu().solve(&-c).unwrap();
        let moved = &mass * jacobian.transpose() * &lambda;

        let mut found: Vec<Vec3x<f64>> = x.iter().map(|x| Vec3x((*x).into())).collect();
        let mut branch = compressed.clone();
        // More room than needed, filled with what must not be read.
        let mut scratch = ChainScratch::new(16);
        scratch.lambda.fill(f64::NAN);
        scratch.upper.fill(f64::NAN);
        project_chain(&chain, 4.0, &mut found, &w, &mut branch, &mut scratch);
        for (v, found) in found.iter().enumerate() {
            let expected = x[v] + Vec3::from_fn(|k, _| moved[3 * v + k]);
            close(*found, expected, 1e-9 * (1.0 + moved.norm()));
            assert!(
                w[v] > 0.0 || found.0 == <[f64; 3]>::from(x[v]),
                "trial {trial}"
            );
        }
        for j in 0..edges {
            assert_eq!(branch[j], lambda[j] > 0.0, "trial {trial}, edge {j}");
        }
    }
}

/// Two pinned ends without compliance, and a collapsed edge: nothing moves, nothing is NaN.
#[test]
fn impossible_chains_stay_finite() {
    let chain = Chain {
        vertices: vec![0, 1, 2],
        edges: 0..2,
        rest_length: 1.0,
        law: EdgeLaw {
            tension: 0.0,
            compression: 0.0,
        },
    };
    let start = [[0.0; 3], [3.0, 0.0, 0.0], [3.0, 0.0, 0.0]].map(Vec3x);
    let mut x = start;
    let mut scratch = ChainScratch::new(2);
    project_chain(
        &chain,
        1.0,
        &mut x,
        &[0.0; 3],
        &mut [false; 2],
        &mut scratch,
    );
    for (x, start) in x.iter().zip(start) {
        assert_eq!(x.0, start.0);
    }
    project_chain(
        &chain,
        1.0,
        &mut x,
        &[0.0, 1.0, 1.0],
        &mut [false; 2],
        &mut scratch,
    );
    assert!(x.iter().flat_map(|x| x.0).all(f64::is_finite));
}

fn pair(rest_length: f64) -> EdgeClass {
    EdgeClass {
        vertices: vec![[0, 1]],
        rest_length: vec![rest_length],
        law: vec![EdgeLaw {
            tension: 0.25,
            compression: 0.75,
        }],
    }
}

/// An edge of length 5 along (0.6, 0.8), w = 1 and 3, 1 / h^2 = 4.
#[test]
fn edge_moves_as_worked_by_hand() {
    let start = [[0.0; 3], [3.0, 4.0, 0.0]].map(Vec3x);
    // C = 1, alpha_tilde = 1: lambda = -1 / (1 + 3 + 1).
    let mut x = start;
    project_edges(&pair(4.0), 4.0, &mut x, &[1.0, 3.0]);
    close(x[0], Vec3::new(0.12, 0.16, 0.0), 1e-15);
    close(x[1], Vec3::new(2.64, 3.52, 0.0), 1e-15);
    // C = -1, alpha_tilde = 3: lambda = 1 / (1 + 3 + 3).
    let mut x = start;
    project_edges(&pair(6.0), 4.0, &mut x, &[1.0, 3.0]);
    close(x[0], Vec3::new(-0.6 / 7.0, -0.8 / 7.0, 0.0), 1e-15);
    close(
        x[1],
        Vec3::new(3.0 + 1.8 / 7.0, 4.0 + 2.4 / 7.0, 0.0),
        1e-15,
    );
    // Pinned or collapsed edges do not move.
    for (x, w) in [(start, [0.0; 2]), ([Vec3x([1.0; 3]); 2], [1.0, 3.0])] {
        let mut moved = x;
        project_edges(&pair(4.0), 4.0, &mut moved, &w);
        assert_eq!(moved.map(|x| x.0), x.map(|x| x.0));
    }
}

/// C = (0, 0, -2), w = 1 everywhere, alpha_tilde = 2: lambda = 2 / (1 + 4 + 1 + 2).
#[test]
fn triple_moves_as_worked_by_hand() {
    let triple = BendTriple {
        vertices: [0, 1, 2],
        compliance: 0.5,
    };
    let mut x = [[0.0; 3], [1.0, 0.0, 1.0], [2.0, 0.0, 0.0]].map(Vec3x);
    project_triples(&[triple], 4.0, &mut x, &[1.0; 3]);
    close(x[0], Vec3::new(0.0, 0.0, 0.25), 1e-15);
    close(x[1], Vec3::new(1.0, 0.0, 0.5), 1e-15);
    close(x[2], Vec3::new(2.0, 0.0, 0.25), 1e-15);
}

/// Signed angle between the normals of (0, 1, 2) and (1, 0, 3), by the textbook.
fn dihedral_angle(x: &[Vec3; 4]) -> f64 {
    let e = (x[1] - x[0]).normalize();
    let n1 = (x[1] - x[0]).cross(&(x[2] - x[0])).normalize();
    let n2 = (x[0] - x[1]).cross(&(x[3] - x[1])).normalize();
    n1.cross(&n2).dot(&e).atan2(n1.dot(&n2))
}

/// Under a large compliance a hinge moves each vertex by -w angle grad / alpha_tilde: this
/// shows its gradient, sign included, for finite differences of the angle to confirm.
#[test]
fn hinge_follows_the_gradient_of_its_angle() {
    let mut stream = Stream::new(2, Purpose::Evaluation, 0);
    for _ in 0..100 {
        let mut x = [[0.0; 3], [1.0, 0.0, 0.0], [0.4, 0.9, 0.0], [0.6, -0.8, 0.0]].map(Vec3::from);
        for x in &mut x {
            *x += 0.2 * random_vector(&mut stream);
        }
        let angle = dihedral_angle(&x);
        let compliance = 1e8;
        let hinge = BendHinge {
            vertices: [0, 1, 2, 3],
            compliance,
        };
        let w = [1.0, 2.0, 0.5, 3.0];
        let start = x.map(|x| Vec3x(x.into()));
        let mut moved = start;
        project_hinges(&[hinge], 1.0, &mut moved, &w);
        for v in 0..4 {
            let gradient = Vec3::from_fn(|k, _| {
                let shifted = |by: f64| {
                    let mut x = x;
                    x[v][k] += by;
                    dihedral_angle(&x)
                };
                (shifted(1e-6) - shifted(-1e-6)) / 2e-6
            });
            let expected = gradient * -angle;
            let found = Vec3::from((moved[v] - start[v]).0) * (compliance / w[v]);
            let off = (found - expected).norm();
            // The arc tangent is good to 4e-6 for the whole angle; 1e8 magnifies rounding.
            assert!(
                off < 1e-5 * (1.0 + gradient.norm()),
                "vertex {v} is {off:e} off"
            );
        }
    }
}

/// A stiff hinge is flat after few projections, whichever way it was folded.
#[test]
fn rigid_hinge_unfolds() {
    for fold in [0.7, -0.7, 2.5, -2.5f64] {
        let flap = Vec3::new(0.5, -fold.cos(), fold.sin());
        let start = [Vec3::zeros(), Vec3::x(), Vec3::new(0.5, 1.0, 0.0), flap];
        let mut x = start.map(|x| Vec3x(x.into()));
        let hinge = BendHinge {
            vertices: [0, 1, 2, 3],
            compliance: 0.0,
        };
        for _ in 0..20 {
            project_hinges(&[hinge], 1.0, &mut x, &[1.0; 4]);
        }
        let angle = dihedral_angle(&x.map(|x| Vec3::from(x.0)));
        assert!(angle.abs() < 1e-5, "{angle} left of {fold}");
    }
}
