use nalgebra::{DMatrix, DVector};

use super::*;
use crate::fabric::{BlankConfig, Material};
use crate::math::{Purpose, Stream, Vec3};

/// A line of random vertices, bent and stretched, any of them pinned.
struct Case {
    line: Line,
    x: Vec<Vec3>,
    mobility: Vec<f64>,
}

const PINNED: f64 = 0.3;

impl Case {
    fn new(stream: &mut Stream, vertices: usize, pinned: f64) -> Self {
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

    fn edges(&self) -> usize {
        self.line.vertices.len() - 1
    }

    /// M, three rows a vertex.
    fn masses(&self) -> DMatrix<f64> {
        let mobility = |i: usize, _| self.mobility[i / 3];
        DMatrix::from_diagonal(&DVector::from_fn(3 * self.x.len(), mobility))
    }

    /// C and J of the edges' lengths.
    fn constraints(&self) -> (DVector<f64>, DMatrix<f64>) {
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
    fn bending(&self) -> (DMatrix<f64>, DMatrix<f64>) {
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

    fn lanes(&self) -> Vec<Vec3x<f64>> {
        self.x.iter().map(|x| Vec3x((*x).into())).collect()
    }

    /// Where `solve` moves each vertex to.
    fn moved(&self, solve: impl FnOnce(&mut [Vec3x<f64>], &[f64], &mut Scratch<f64>)) -> Vec<Vec3> {
        let mut x = self.lanes();
        solve(&mut x, &self.mobility, &mut scratch());
        x.iter().map(|x| Vec3::from(x.0)).collect()
    }

    #[track_caller]
    fn check(&self, found: &[Vec3], moved: &DVector<f64>) {
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
    fn check_momentum(&self, found: &[Vec3], arms: &[Vec3]) {
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

fn random_vector(stream: &mut Stream) -> Vec3 {
    Vec3::from_fn(|_, _| stream.normal())
}

/// Solution of a dense system, which may be empty.
fn solved(system: DMatrix<f64>, right: &DVector<f64>) -> DVector<f64> {
    if right.is_empty() {
        return right.clone();
    }
    system.lu().solve(right).unwrap()
}

/// More room than needed, filled with what must not be read: what a longer line or a lane that
/// diverged may have left.
fn scratch() -> Scratch<f64> {
    let mut scratch = Scratch::new(16);
    scratch.edge.fill(Vec3x([f64::NAN; 3]));
    scratch.upper.fill(f64::NAN);
    scratch.second.fill(f64::NAN);
    scratch
}

/// A function of the case for lines of 1 to 13 vertices.
fn cases(seed: u64, pinned: f64, mut check: impl FnMut(&Case, &mut Stream)) {
    let mut stream = Stream::new(seed, Purpose::Evaluation, 0);
    for trial in 0..260 {
        let case = Case::new(&mut stream, 1 + trial % 13, pinned);
        check(&case, &mut stream);
    }
}

/// Solves from given force densities; returns positions and force densities.
fn stretched(case: &Case, density: &[f64]) -> (Vec<Vec3>, Vec<f64>) {
    let mut density = density.to_vec();
    let x = case.moved(|x, w, scratch| stretch(&case.line, x, w, &mut density, scratch));
    (x, density)
}

/// What `recall` finds where the line lies: pull and stress.
fn recalled(case: &Case, density: &[f64]) -> (Vec<Vec3>, Vec<f64>) {
    let mut pull = vec![Vec3x::zero(); case.x.len()];
    let mut stress = vec![0.0; case.x.len()];
    let mut grip = Grip {
        pull: &mut pull,
        stress: &mut stress,
    };
    recall(&case.line, &case.lanes(), density, &mut grip);
    (pull.iter().map(|p| Vec3::from(p.0)).collect(), stress)
}

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
        let densities = DVector::from_column_slice(&before).map(|q| kept(&case.line, q));
        let force = densities.component_mul(&length);
        let mass = case.masses();
        let system = &jacobian * &mass * jacobian.transpose() + DMatrix::from_diagonal(&compliance);
        let change = solved(system, &(c - compliance.component_mul(&force)));
        let total = force + &change;
        let (x, found) = stretched(case, &before);
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
fn recall_gives_pull_and_stress() {
    cases(2, PINNED, |case, stream| {
        let density: Vec<f64> = (0..case.edges()).map(|_| stream.normal()).collect();
        let (c, jacobian) = case.constraints();
        let all = DVector::from_column_slice(&density);
        let force = all
            .map(|q| kept(&case.line, q))
            .component_mul(&c.add_scalar(1.0));
        let pulled = -(jacobian.transpose() * force);
        let (pull, stress) = recalled(case, &density);
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
fn only_compression_that_bending_holds_is_kept() {
    cases(9, PINNED, |case, _| {
        let most = 4.0 * KEPT_COMPRESSION * case.line.bending;
        for (force, expected) in [(3.0, 3.0), (-0.5 * most, -0.5 * most), (-2.0 * most, -most)] {
            assert_eq!(kept(&case.line, force), expected);
        }
        let limp = Line {
            bending: 0.0,
            ..case.line.clone()
        };
        assert_eq!(kept(&limp, -1.0), 0.0);
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
        let densities: Vec<f64> = all.map(|q| kept(&case.line, q)).collect();
        for (j, density) in densities.iter().enumerate() {
            let [a, b] = [0, 1].map(|k| case.line.vertices[j + k] as usize);
            let compliance = match *density < 0.0 {
                true => case.line.law.compression,
                false => case.line.law.tension,
            };
            let length = 1.0 / (1.0 - compliance * density);
            case.x[b] = case.x[a] + random_vector(stream).normalize() * length;
        }
        let (x, found) = stretched(&case, &densities);
        for (found, x) in x.iter().zip(&case.x) {
            assert!((found - x).norm() < 1e-13);
        }
        for (found, density) in found.iter().zip(&densities) {
            assert!((found - density).abs() < 1e-9);
        }
    });
}

/// (J M J^T + compliance) d = C, with the compliance of the sign of C and of the shear.
#[test]
fn shear_solves_its_linear_system() {
    let trellis = trellis();
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
        let found = case.moved(|x, w, scratch| shear(&case.line, &trellis, x, w, scratch));
        case.check(&found, &-(&mass * jacobian.transpose() * force));
    });
}

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
        let found = case.moved(|x, w, scratch| bend(&case.line, x, w, scratch));
        case.check(&found, &moved);
    });
}

/// Inner forces: their sum is zero, and so is that of their moments. Lengths act along the
/// edges at the start of their solve, bending on the curve at its end.
#[test]
fn solves_keep_momentum() {
    let trellis = trellis();
    cases(6, 0.0, |case, stream| {
        let force: Vec<f64> = (0..case.edges()).map(|_| stream.normal()).collect();
        let (found, _) = stretched(case, &force);
        let (pull, _) = recalled(case, &force);
        case.check_momentum(&found, &case.x);
        let sum: Vec3 = pull.iter().sum();
        assert!(sum.norm() < 1e-11);
        let found = case.moved(|x, w, scratch| shear(&case.line, &trellis, x, w, scratch));
        case.check_momentum(&found, &case.x);
        let found = case.moved(|x, w, scratch| bend(&case.line, x, w, scratch));
        case.check_momentum(&found, &found);
    });
}

/// A straight line at rest, wherever it is moved and turned to, feels nothing.
#[test]
fn rigid_motion_moves_nothing() {
    let trellis = trellis();
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
        let (stretched, force) = stretched(&case, &vec![0.0; case.edges()]);
        let (pull, _) = recalled(&case, &force);
        let sheared = case.moved(|x, w, scratch| shear(&case.line, &trellis, x, w, scratch));
        let bent = case.moved(|x, w, scratch| bend(&case.line, x, w, scratch));
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
    let trellis = trellis();
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
                let (found, force) = stretched(&case, &force);
                let (pull, stress) = recalled(&case, &force);
                let sheared =
                    case.moved(|x, w, scratch| shear(&case.line, &trellis, x, w, scratch));
                let bent = case.moved(|x, w, scratch| bend(&case.line, x, w, scratch));
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

fn plain() -> Lamina {
    Lamina::new(&BlankConfig::default(), Material::interglas_92125()).unwrap()
}

fn holed() -> Lamina {
    let config = BlankConfig {
        outline: Some(
            concat!(
                env!("CARGO_MANIFEST_DIR"),
                "/../../assets/outlines/plate-with-hole.csv"
            )
            .into(),
        ),
        cell_mm: Some(10.0),
        yarn_angle_deg: 20.0,
        ..BlankConfig::default()
    };
    Lamina::new(&config, Material::interglas_92125()).unwrap()
}

fn trellis() -> Trellis {
    Trellis::new(&plain(), [50e3, 36e3])
}

/// Warps hold every vertex once, and so do wefts; their edges number those of the yarns in
/// their order.
#[test]
fn each_family_holds_every_vertex_once() {
    for lamina in [plain(), holed()] {
        let lines = Lines::new(&lamina, &PhysicsConfig::default(), Some(trellis()));
        for family in [&lines.warps, &lines.wefts] {
            let mut held: Vec<u32> = family.iter().flat_map(|l| l.vertices.clone()).collect();
            held.sort_unstable();
            let all: Vec<u32> = (0..lamina.vertex_count() as u32).collect();
            assert!(held == all);
        }
        let mut edges = 0;
        for (line, yarn) in lines
            .warps
            .iter()
            .chain(&lines.wefts)
            .filter(|line| line.vertices.len() > 1)
            .zip(&lamina.yarns)
        {
            assert_eq!(line.vertices, yarn.vertices);
            assert_eq!(line.edges, edges..edges + yarn.vertices.len() - 1);
            edges = line.edges.end;
        }
        assert_eq!(lines.edge_count, edges);
        let strains = lamina.yarn_strain(&vec![[0.0; 3]; lamina.vertex_count()]);
        assert!(lines.edge_count <= strains.len());
    }
    assert!(holed().membranes.len() > 20, "yarns end at a border");
    let alone = |line: &&Line| line.vertices.len() == 1;
    let lines = Lines::new(&holed(), &PhysicsConfig::default(), Some(trellis()));
    assert!(
        lines
            .warps
            .iter()
            .chain(&lines.wefts)
            .any(|line| alone(&line))
    );
}

/// Strung together, every diagonal is there once.
#[test]
fn rows_hold_every_diagonal_once() {
    for lamina in [plain(), holed()] {
        let lines = Lines::new(&lamina, &PhysicsConfig::default(), Some(trellis()));
        let mut found: Vec<[u32; 2]> = Vec::new();
        for row in &lines.diagonals {
            assert!(row.vertices.len() > 1 && row.edges.is_empty());
            assert!(row.vertices.len() <= lines.longest);
            assert!((row.rest_length / lamina.diagonals[0].rest_length - 1.0).abs() < 1e-12);
            found.extend(row.vertices.windows(2).map(|v| [v[0], v[1]]));
        }
        let mut expected: Vec<_> = lamina.diagonals.iter().map(|d| d.vertices).collect();
        found.sort_unstable();
        expected.sort_unstable();
        assert!(found == expected);
    }
    // Of 64 x 64 cells: 127 rows.
    let lines = Lines::new(&plain(), &PhysicsConfig::default(), Some(trellis()));
    assert_eq!(lines.diagonals.len(), 127);
}
