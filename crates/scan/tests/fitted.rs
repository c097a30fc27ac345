//! Scans made of known states: how near the fitted blank comes to them.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::time::Instant;

use drape_cloth::math::Vec3;
use drape_cloth::scene::{Mark, Misplacement, Scene, SceneConfig, Unit};
use drape_cloth::sim::Parameters;
use drape_scan::{Rigid, ScanFit, kabsch, set_up};
use nalgebra::Point3;
use rand::{RngExt as _, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// How a scan is made.
struct Scanner {
    /// Points on each triangle.
    points: usize,
    /// Standard deviation of a coordinate [m].
    noise: f64,
    /// Holes, as shares of the blank's vertices, and stray points as a share of all.
    holes: [f64; 4],
    stray: f64,
    rigid: Rigid,
}

impl Scanner {
    fn good() -> Self {
        Self {
            points: 4,
            noise: 5e-4,
            holes: [0.0125; 4],
            stray: 0.01,
            rigid: Rigid::new(Vec3::new(0.31, -1.2, 0.45), Vec3::new(0.7, -1.9, 1.1)),
        }
    }

    /// The text of a scan of the scene's blank in millimetres, its points in no order.
    fn scan(&self, scene: &Scene) -> String {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let position = &scene.initial.position;
        let mesh = scene.lamina.mesh(&scene.tool.in_scene(position));
        let count = position.len();
        let holes = self.holes.map(|share| {
            let middle = scene.lamina.rest[random.random_range(0..count)];
            // Of a disc with that share of the area.
            (
                middle,
                (share * scene.lamina.area() / std::f64::consts::PI).sqrt(),
            )
        });
        let mut points = Vec::new();
        let mut normal = || {
            let twelve: f64 = (0..12).map(|_| random.random::<f64>()).sum();
            twelve - 6.0
        };
        let mut spin = ChaCha8Rng::seed_from_u64(8);
        for (k, corners) in mesh.triangles.iter().enumerate() {
            let [u, v] = [0, 1].map(|k| {
                corners
                    .iter()
                    .map(|&c| scene.lamina.rest[c as usize][k])
                    .sum::<f64>()
                    / 3.0
            });
            let is_in = |&([x, y], radius): &([f64; 2], f64)| (u - x).hypot(v - y) < radius;
            if holes.iter().any(is_in) {
                continue;
            }
            let [a, b, c] = mesh.corners(k);
            for _ in 0..self.points {
                let (mut s, mut t): (f64, f64) = (spin.random(), spin.random());
                if s + t > 1.0 {
                    (s, t) = (1.0 - s, 1.0 - t);
                }
                let noise = Vec3::new(normal(), normal(), normal()) * self.noise;
                points.push(a + (b - a) * s + (c - a) * t + noise);
            }
        }
        let (low, high) = mesh.bounds();
        for _ in 0..(self.stray * points.len() as f64) as usize {
            let at = Vec3::from_fn(|_, _| spin.random());
            points.push(
                low + (high - low).component_mul(&at) + Vec3::z() * 0.05 * spin.random::<f64>(),
            );
        }
        for k in (1..points.len()).rev() {
            points.swap(k, spin.random_range(0..=k));
        }
        let mut text = String::new();
        for x in points {
            let [x, y, z] = self.seen(x);
            let _ = writeln!(text, "{x:.4} {y:.4} {z:.4}");
        }
        text
    }

    /// Where the scanner sees a point [mm].
    fn seen(&self, x: Vec3) -> [f64; 3] {
        ((self.rigid * Point3::from(x)).coords * 1e3).into()
    }
}

/// The vertices nearest to the corners of the box that holds the flat blank.
fn corners(scene: &Scene) -> Vec<usize> {
    let extreme = |k: usize, sign: f64| {
        let all = scene.lamina.rest.iter().map(|x| sign * x[k]);
        sign * all.fold(f64::NEG_INFINITY, f64::max)
    };
    let ends = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let ends = ends.map(|[x, y]| [extreme(0, x), extreme(1, y)]);
    let nearest = |end: [f64; 2]| {
        let square = |[x, y]: &[f64; 2]| (x - end[0]).powi(2) + (y - end[1]).powi(2);
        let all = scene.lamina.rest.iter().map(square).enumerate();
        all.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap().0
    };
    ends.map(nearest).to_vec()
}

/// Which marks a scan comes with.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Marks {
    No,
    Blank,
    Tool,
}

impl Marks {
    fn of(self, scanner: &Scanner, truth: &Scene) -> Vec<Mark> {
        let position = truth.tool.in_scene(&truth.initial.position);
        let on_blank = |v: usize| Mark {
            seen: scanner.seen(position[v].into()),
            at_mm: Some(truth.lamina.rest[v].map(|x| 1e3 * x)),
            scene_mm: None,
        };
        let on_tool = |x: [f64; 3]| Mark {
            seen: scanner.seen(x.into()),
            at_mm: None,
            scene_mm: Some(x.map(|x| 1e3 * x)),
        };
        let places = [
            [0.1, 0.1, 0.0],
            [-0.1, 0.1, 0.0],
            [0.0, -0.1, 0.0],
            [0.0, 0.0, 0.08],
        ];
        match self {
            Self::No => Vec::new(),
            Self::Blank => corners(truth).into_iter().map(on_blank).collect(),
            Self::Tool => places.map(on_tool).to_vec(),
        }
    }
}

/// The state that a blank really has: laid a little off its place, and wavier; `laws` are its factors on friction and
/// bending.
fn truth(config: &SceneConfig, laws: [f64; 2]) -> Scene {
    let off = Misplacement {
        shift: [4e-3, -3e-3, 2e-3],
        turn: 0.035,
        wave: [2e-3, 0.6, 1.0],
    };
    let parameters = Parameters {
        friction: [laws[0]; 2],
        bending: [laws[1]; 2],
        ..Parameters::default()
    };
    let scene = Scene::new(config, |_| ()).unwrap();
    scene
        .fallen(&[(off, parameters)], |_| ())
        .unwrap()
        .remove(0)
}

/// A scene that starts from a scan with some text and marks.
fn scanned(
    config: &SceneConfig,
    text: &str,
    marks: Vec<Mark>,
) -> Result<(Scene, Vec<[f64; 3]>, ScanFit), String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scan.xyz");
    fs::write(&file, text).unwrap();
    let mut config = config.clone();
    config.placement.scan = Some(file);
    config.placement.scan_unit.get_or_insert(Unit::Mm);
    config.placement.scan_marks = marks;
    let mut fallen = Vec::new();
    let set_up = set_up(&config, |_, _, state| fallen = state().position);
    let (scene, fit) = set_up.map_err(|error| {
        error
            .to_string()
            .replace(&folder.path().display().to_string(), "")
    })?;
    Ok((scene, fallen, fit.unwrap()))
}

/// Mean and 95th percentile of the distance of vertices from where they really were [mm].
fn apart(found: &[[f64; 3]], truth: &Scene) -> [f64; 2] {
    let pairs = found.iter().zip(&truth.initial.position);
    let off = pairs.map(|(a, b)| 1e3 * (Vec3::from(*a) - Vec3::from(*b)).norm());
    let mut off: Vec<f64> = off.collect();
    off.sort_by(f64::total_cmp);
    [
        off.iter().sum::<f64>() / off.len() as f64,
        off[off.len() * 95 / 100],
    ]
}

/// That once the best rigid motion is taken out [mm].
fn apart_in_shape(found: &[[f64; 3]], truth: &Scene) -> [f64; 2] {
    let [from, to] = [found, &truth.initial.position]
        .map(|all| all.iter().map(|&x| Vec3::from(x)).collect::<Vec<_>>());
    let (rigid, _) = kabsch(&from, &to).unwrap();
    let moved = from
        .iter()
        .map(|&x| (rigid * Point3::from(x)).coords.into());
    apart(&moved.collect::<Vec<_>>(), truth)
}

/// A scene of `configs`, or a small one that takes a moment.
fn config(name: &str) -> SceneConfig {
    let file = |name| Path::new("../../configs/scenes").join(format!("{name}.toml"));
    if name != "small" {
        return SceneConfig::read(&file(name)).unwrap();
    }
    let mut config = SceneConfig::read(&file("hemisphere")).unwrap();
    config.blank.vertices = [17, 17];
    config.fall.substep_rate = 1200.0;
    config.fall.contact_rate = 240.0;
    config
}

/// Through noise, holes, stray points and an unknown order the blank is found, each vertex of it nearer to where it is
/// than the points lie apart; and for one thread as for two.
#[test]
fn the_state_of_a_blank_is_found() {
    let config = config("small");
    let truth = truth(&config, [1.0; 2]);
    let scanner = Scanner::good();
    let (text, marks) = (scanner.scan(&truth), Marks::Tool.of(&scanner, &truth));
    let fitted = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| scanned(&config, &text, marks.clone()).unwrap())
    };
    let (scene, fallen, fit) = fitted(1);
    let (alone, found) = (
        apart(&fallen, &truth),
        apart(&scene.initial.position, &truth),
    );
    assert!(alone[0] > 8.0, "{alone:?}");
    assert!(found[0] < 2.5 && found[1] < 5.0, "{found:?}");
    assert!(fit.pulled_mean_mm < 1.0 && fit.mean_mm < 1.5, "{fit:?}");
    assert!(fit.stray_share < 0.02 && fit.unseen_share < 0.05, "{fit:?}");
    assert_eq!(fit.other_places, 0);
    let (again, _, same) = fitted(2);
    assert_eq!(again.initial, scene.initial);
    assert_eq!(same, fit);
}

/// Without marks a round tool leaves several places open, which is told; the shape is found.
#[test]
fn a_scan_without_marks_finds_its_place() {
    let config = config("small");
    let truth = truth(&config, [1.0; 2]);
    let (scene, _, fit) = scanned(&config, &Scanner::good().scan(&truth), Vec::new()).unwrap();
    assert!(fit.other_places >= 1, "{fit:?}");
    assert!(fit.pulled_mean_mm < 2.0, "{fit:?}");
    assert!(scene.initial.is_finite());
}

/// What cannot be the blank is refused with its reason.
#[test]
fn scans_of_something_else_are_refused() {
    let config = config("small");
    let truth = truth(&config, [1.0; 2]);
    let scanner = Scanner {
        rigid: Rigid::identity(),
        ..Scanner::good()
    };
    let (text, marks) = (scanner.scan(&truth), Marks::Tool.of(&scanner, &truth));
    let lines = |change: &dyn Fn([f64; 3]) -> Vec<[f64; 3]>| -> String {
        let points = text.lines().flat_map(|line| {
            let mut words = line.split(' ').map(|word| word.parse().unwrap());
            change(std::array::from_fn(|_| words.next().unwrap()))
        });
        points.map(|[x, y, z]| format!("{x} {y} {z}\n")).collect()
    };
    let refused = |text: &str, marks: &[Mark], unit: Unit| {
        let mut config = config.clone();
        config.placement.scan_unit = Some(unit);
        scanned(&config, text, marks.to_vec())
            .map(|(.., fit)| fit)
            .unwrap_err()
    };
    let half = lines(&|x| if x[0] < 5.0 { vec![x] } else { Vec::new() });
    let error = refused(&half, &marks, Unit::Mm);
    assert!(
        error.contains("of the blank, expected at most 40 % unseen"),
        "{error}"
    );
    let above = lines(&|[x, y, z]| vec![[x, y, z], [x, y, z + 30.0]]);
    let error = refused(&above, &marks, Unit::Mm);
    assert!(
        error.contains("off the blank that was pulled on to them"),
        "{error}"
    );
    let beside = lines(&|[x, y, z]| vec![[x, y, z], [x + 300.0, y, z]]);
    let error = refused(&beside, &marks, Unit::Mm);
    assert!(error.contains("times as large as the blank"), "{error}");
    let error = refused(&text, &marks, Unit::Cm);
    assert!(
        error.contains("is \"cm\", with which it is") && error.contains("in \"mm\" it would have"),
        "{error}"
    );
    let mut mirrored = marks;
    mirrored.iter_mut().for_each(|mark| mark.seen[0] *= -1.0);
    let error = refused(&text, &mirrored, Unit::Mm);
    assert!(
        error.contains("`placement.scan_marks`: its marks are mirrored"),
        "{error}"
    );
}

/// `SCENES="hemisphere" cargo test --release -p drape_scan --test fitted -- --ignored --nocapture`
#[test]
#[ignore = "prints the table of docs/SCAN.md"]
fn table() {
    let names = std::env::var("SCENES").unwrap_or("hemisphere rib outline-with-hole".into());
    println!(
        "| Scene | Laws | Marks | Scan, mean and p95 | Pulled | Spring-back | Material, mean and p95 | In shape | \
         Fall alone | Unseen | Stray | Other places | Time [s] |"
    );
    for name in names.split(' ') {
        let config = config(name);
        for (laws, label) in [([1.0, 1.0], "its own"), ([1.2, 1.3], "others")] {
            let truth = truth(&config, laws);
            let scanner = Scanner::good();
            let text = scanner.scan(&truth);
            for marks in [Marks::Tool, Marks::Blank, Marks::No] {
                let start = Instant::now();
                let given = marks.of(&scanner, &truth);
                let (scene, fallen, fit) = match scanned(&config, &text, given) {
                    Ok(found) => found,
                    Err(error) => {
                        println!("| {name} | {label} | {marks:?} | {error}");
                        continue;
                    }
                };
                let [mean, p95] = apart(&scene.initial.position, &truth);
                let [shape, _] = apart_in_shape(&scene.initial.position, &truth);
                let [alone, _] = apart(&fallen, &truth);
                println!(
                    "| {name} | {label} | {marks:?} | {:.2}, {:.2} | {:.2} | {:.2} | {mean:.2}, {p95:.2} | {shape:.2} | \
                     {alone:.2} | {:.1} % | {:.1} % | {} | {:.1} |",
                    fit.mean_mm,
                    fit.p95_mm,
                    fit.pulled_mean_mm,
                    fit.spring_back_mm,
                    1e2 * fit.unseen_share,
                    1e2 * fit.stray_share,
                    fit.other_places,
                    start.elapsed().as_secs_f64()
                );
            }
        }
    }
}
