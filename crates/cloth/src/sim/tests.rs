//! Lines of random vertices and the dense algebra that their solves are held against.

use nalgebra::{DMatrix, DVector};

use super::bend::bend;
use super::law::EdgeLaw;
use super::length::{stretch, warm_start};
use super::line::{Along, Chain, Line, Scratch};
use super::shear::{Trellis, shear};
use crate::fabric::{BlankConfig, Lamina, Material};
use crate::math::{Purpose, Stream, Vec3, Vec3x};

/// A line of random vertices, bent and stretched, any of them pinned.
pub(super) struct Case {
    pub line: Line,
    pub x: Vec<Vec3>,
    pub mobility: Vec<f64>,
}

pub(super) const PINNED: f64 = 0.3;

impl Case {
    pub fn new(stream: &mut Stream, vertices: usize, pinned: f64) -> Self {
        let mut uniform = |from: f64, to: f64| from + (to - from) * stream.uniform();
        let law = EdgeLaw {
            tension: uniform(0.0, 1e-3),
            compression: uniform(0.0, 1e-1),
        };
        let line = Line {
            vertices: (0..vertices as u32).rev().collect(),
            edges: 0..vertices - 1,
            rest_length: 1.0,
            law,
            limit: None,
            bending: uniform(0.01, 10.0),
        };
        let mobility = (0..vertices)
            .map(|_| uniform(0.1, 1.1) * f64::from(u8::from(uniform(0.0, 1.0) >= pinned)))
            .collect();
        let mut x = vec![random_vector(stream)];
        while x.len() < vertices {
            let step = random_vector(stream).normalize() * (0.5 + stream.uniform());
            x.push(x[x.len() - 1] + step);
        }
        Self { line, x, mobility }
    }

    pub fn edges(&self) -> usize {
        self.line.vertices.len() - 1
    }

    /// M, three rows a vertex.
    pub fn masses(&self) -> DMatrix<f64> {
        let mobility = |i: usize, _| self.mobility[i / 3];
        DMatrix::from_diagonal(&DVector::from_fn(3 * self.x.len(), mobility))
    }

    /// C and J of the edges' lengths.
    pub fn constraints(&self) -> (DVector<f64>, DMatrix<f64>) {
        let mut c = DVector::zeros(self.edges());
        let mut jacobian = DMatrix::zeros(self.edges(), 3 * self.x.len());
        for j in 0..self.edges() {
            let [a, b] = [0, 1].map(|k| self.line.vertices[j + k] as usize);
            let d = self.x[b] - self.x[a];
            c[j] = d.norm() - 1.0;
            for k in 0..3 {
                jacobian[(j, 3 * a + k)] = -d[k] / d.norm();
                jacobian[(j, 3 * b + k)] = d[k] / d.norm();
            }
        }
        (c, jacobian)
    }

    /// K = B^T k B, the same for x, y and z, and the positions it acts on: along the line.
    pub fn bending(&self) -> (DMatrix<f64>, DMatrix<f64>) {
        let count = self.x.len();
        let differences = DMatrix::from_fn(count.saturating_sub(2), count, |j, i| {
            match i.wrapping_sub(j) {
                0 | 2 => 1.0,
                1 => -2.0,
                _ => 0.0,
            }
        });
        let at = |i: usize, k: usize| self.x[self.line.vertices[i] as usize][k];
        let k = differences.transpose() * self.line.bending * differences;
        (k, DMatrix::from_fn(count, 3, at))
    }

    pub fn lanes(&self) -> Vec<Vec3x<f64>> {
        self.x.iter().map(|x| Vec3x((*x).into())).collect()
    }

    /// Where `solve` moves each vertex to, from these force densities.
    pub fn moved(&self, density: &mut [f64], solve: impl FnOnce(Along<f64, Line>)) -> Vec<Vec3> {
        let mut x = self.lanes();
        solve(Along {
            line: &self.line,
            law: self.line.law(),
            x: &mut x,
            previous: &[],
            mobility: &self.mobility,
            density,
            scratch: &mut scratch(),
        });
        x.iter().map(|x| Vec3::from(x.0)).collect()
    }

    /// Lengths solved from these force densities: positions and force densities.
    pub fn stretched(&self, density: &[f64]) -> (Vec<Vec3>, Vec<f64>) {
        let mut density = density.to_vec();
        let x = self.moved(&mut density, stretch);
        (x, density)
    }

    pub fn sheared(&self, trellis: &Trellis) -> Vec<Vec3> {
        self.moved(&mut [], |row| shear(row, trellis))
    }

    pub fn bent(&self) -> Vec<Vec3> {
        self.moved(&mut [], bend)
    }

    /// What a warm start finds where the line lies: pull and stress.
    pub fn warm_start(&self, density: &[f64]) -> (Vec<Vec3>, Vec<f64>) {
        let mut pull = vec![Vec3x([f64::NAN; 3]); self.x.len()];
        let mut stress = vec![f64::NAN; self.x.len()];
        let x = self.lanes();
        warm_start(
            &self.line,
            self.line.min_warm(),
            &x,
            density,
            &mut pull,
            &mut stress,
        );
        (pull.iter().map(|p| Vec3::from(p.0)).collect(), stress)
    }

    #[track_caller]
    pub fn check(&self, found: &[Vec3], moved: &DVector<f64>) {
        for (v, found) in found.iter().enumerate() {
            let expected = self.x[v] + Vec3::from_fn(|k, _| moved[3 * v + k]);
            let off = (found - expected).norm();
            assert!(
                off <= 1e-9 * (1.0 + moved.norm()),
                "vertex {v}: {off:e} off"
            );
            assert!(self.mobility[v] > 0.0 || *found == self.x[v], "vertex {v}");
        }
    }

    /// Sum of the pushes d / mobility, and of their moments about `arms`.
    #[track_caller]
    pub fn check_momentum(&self, found: &[Vec3], arms: &[Vec3]) {
        let mut sum = [Vec3::zeros(); 2];
        let mut size = 0.0;
        for (v, found) in found.iter().enumerate() {
            let push = (found - self.x[v]) / self.mobility[v];
            sum[0] += push;
            sum[1] += arms[v].cross(&push);
            size += push.norm() * (1.0 + arms[v].norm());
        }
        assert!(sum[0].norm() + sum[1].norm() < 1e-12 * (1.0 + size));
    }
}

pub(super) fn random_vector(stream: &mut Stream) -> Vec3 {
    Vec3::from_fn(|_, _| stream.normal())
}

/// Solution of a dense system, which may be empty.
pub(super) fn solved(system: DMatrix<f64>, right: &DVector<f64>) -> DVector<f64> {
    if right.is_empty() {
        return right.clone();
    }
    system.lu().solve(right).unwrap()
}

/// More room than needed, filled with what must not be read: what a longer line or a lane that
/// diverged may have left.
pub(super) fn scratch() -> Scratch<f64> {
    let mut scratch = Scratch::new(16);
    scratch.edge.fill(Vec3x([f64::NAN; 3]));
    scratch.upper.fill(f64::NAN);
    scratch.second.fill(f64::NAN);
    scratch
}

/// A function of the case for lines of 1 to 13 vertices.
pub(super) fn cases(seed: u64, pinned: f64, mut check: impl FnMut(&Case, &mut Stream)) {
    let mut stream = Stream::new(seed, Purpose::Evaluation, 0);
    for trial in 0..260 {
        let case = Case::new(&mut stream, 1 + trial % 13, pinned);
        check(&case, &mut stream);
    }
}

/// The trellis of the standard blank.
pub(super) fn standard_trellis() -> Trellis {
    let lamina = Lamina::new(&BlankConfig::default(), Material::interglas_92125()).unwrap();
    Trellis::new(&lamina, [50e3, 36e3])
}

/// Inner forces: their sum is zero, and so is that of their moments. Lengths act along the
/// edges at the start of their solve, bending on the curve at its end.
#[test]
fn solves_keep_momentum() {
    let trellis = standard_trellis();
    cases(6, 0.0, |case, stream| {
        let force: Vec<f64> = (0..case.edges()).map(|_| stream.normal()).collect();
        let (found, _) = case.stretched(&force);
        let (pull, _) = case.warm_start(&force);
        case.check_momentum(&found, &case.x);
        let sum: Vec3 = pull.iter().sum();
        assert!(sum.norm() < 1e-11);
        let found = case.sheared(&trellis);
        case.check_momentum(&found, &case.x);
        let found = case.bent();
        case.check_momentum(&found, &found);
    });
}

/// A straight line at rest, wherever it is moved and turned to, feels nothing.
#[test]
fn rigid_motion_moves_nothing() {
    let trellis = standard_trellis();
    cases(7, PINNED, |case, stream| {
        let (at, along) = (random_vector(stream), random_vector(stream).normalize());
        let mut case = Case {
            line: case.line.clone(),
            x: vec![at; case.x.len()],
            mobility: case.mobility.clone(),
        };
        for (i, &v) in case.line.vertices.iter().enumerate() {
            case.x[v as usize] += along * i as f64;
        }
        let (stretched, force) = case.stretched(&vec![0.0; case.edges()]);
        let (pull, _) = case.warm_start(&force);
        let sheared = case.sheared(&trellis);
        let bent = case.bent();
        for found in [stretched, sheared, bent] {
            for (found, x) in found.iter().zip(&case.x) {
                assert!((found - x).norm() < 1e-13);
            }
        }
        // A pinned edge turns rounding over the compliance into force.
        assert!(
            force
                .iter()
                .all(|f| f.abs() < 1e-15 / case.line.law.tension * 10.0)
        );
        assert!(
            pull.iter()
                .all(|p| p.norm() < 1e-13 / case.line.law.tension)
        );
    });
}

/// Two pinned ends without compliance, collapsed edges, all in one point: nothing is NaN, what
/// is pinned stays.
#[test]
fn impossible_lines_stay_finite() {
    let trellis = standard_trellis();
    let line = Line {
        vertices: vec![0, 1, 2],
        edges: 0..2,
        rest_length: 1.0,
        law: EdgeLaw {
            tension: 0.0,
            compression: 0.0,
        },
        limit: None,
        bending: 1e30,
    };
    for x in [
        [[0.0; 3], [3.0, 0.0, 0.0], [3.0, 0.0, 0.0]],
        [[0.0; 3], [1.0, 0.0, 0.0], [5.0, 0.0, 0.0]],
        [[0.5; 3]; 3],
    ] {
        for mobility in [[0.0; 3], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]] {
            let case = Case {
                line: line.clone(),
                x: x.map(Vec3::from).to_vec(),
                mobility: mobility.to_vec(),
            };
            for force in [[0.0; 2], [1e3, -1e3], [-1e3; 2]] {
                let (found, force) = case.stretched(&force);
                let (pull, stress) = case.warm_start(&force);
                let sheared = case.sheared(&trellis);
                let bent = case.bent();
                for found in [&found, &sheared, &bent] {
                    assert!(found.iter().flatten().all(|x| x.is_finite()));
                    for v in (0..3).filter(|&v| mobility[v] == 0.0) {
                        assert_eq!(found[v], case.x[v]);
                    }
                }
                assert!(pull.iter().flatten().all(|x| x.is_finite()));
                assert!(force.iter().chain(&stress).all(|x| x.is_finite()));
            }
        }
    }
}
