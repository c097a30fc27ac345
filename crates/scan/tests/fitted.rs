//! Scans made of known states: how near the fitted blank comes to them.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::time::Instant;

use drape_cloth::math::Vec3;
use drape_cloth::scene::{Mark, Misplacement, Scene, SceneConfig, Unit};
use drape_cloth::sim::Parameters;
use drape_scan::{Fit, Rigid, set_up};
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

/// Corners of a mesh of rows and columns.
fn corners(scene: &Scene) -> Vec<usize> {
    let (low, high) = scene.lamina.mesh(&flat(scene)).bounds();
    let ends = [
        [low.x, low.y],
        [high.x, low.y],
        [high.x, high.y],
        [low.x, high.y],
    ];
    let square = |at: [f64; 2], [x, y]: [f64; 2]| (x - at[0]).powi(2) + (y - at[1]).powi(2);
    let nearest = |at| {
        let all = scene
            .lamina
            .rest
            .iter()
            .map(move |&x| square(at, x))
            .enumerate();
        all.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap().0
    };
    ends.map(nearest).to_vec()
}

fn flat(scene: &Scene) -> Vec<[f64; 3]> {
    scene
        .lamina
        .rest
        .iter()
        .map(|&[x, y]| [x, y, 0.0])
        .collect()
}

/// Which marks a scan comes with.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Marks {
    None,
    OnBlank,
    OnTool,
}

/// The state that a blank really has: laid a little off its place, wavier, with more friction.
fn truth(config: &SceneConfig) -> Scene {
    let off = Misplacement {
        shift: [4e-3, -3e-3, 2e-3],
        turn: 0.035,
        wave: [2e-3, 0.6, 1.0],
    };
    let parameters = Parameters {
        friction: [1.2; 2],
        bending: [1.3; 2],
        ..Parameters::default()
    };
    let scene = Scene::new(config, |_| ()).unwrap();
    scene
        .fallen(&[(off, parameters)], |_| ())
        .unwrap()
        .remove(0)
}

/// Mean and greatest distance of the fitted vertices from where they really were [mm], how far the fall alone
/// was off in the mean, and the fit.
fn error(config: &SceneConfig, truth: &Scene, scanner: &Scanner, marks: Marks) -> ([f64; 3], Fit) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scan.xyz");
    fs::write(&file, scanner.scan(truth)).unwrap();
    let mut config = config.clone();
    config.placement.scan = Some(file);
    if let Ok(s) = std::env::var("SETTLE") {
        config.fall.settle_s = s.parse().unwrap();
    }
    config.placement.scan_unit = Some(Unit::Mm);
    let position = truth.tool.in_scene(&truth.initial.position);
    config.placement.scan_marks = match marks {
        Marks::None => Vec::new(),
        Marks::OnBlank => corners(truth)
            .into_iter()
            .map(|v| Mark {
                seen: scanner.seen(position[v].into()),
                at_mm: Some(truth.lamina.rest[v].map(|x| 1e3 * x)),
                scene_mm: None,
            })
            .collect(),
        Marks::OnTool => [
            [0.1, 0.1, 0.0],
            [-0.1, 0.1, 0.0],
            [0.0, -0.1, 0.0],
            [0.0, 0.0, 0.08],
        ]
        .map(|x| Mark {
            seen: scanner.seen(x.into()),
            at_mm: None,
            scene_mm: Some(x.map(|x| 1e3 * x)),
        })
        .to_vec(),
    };
    let mut fallen = Vec::new();
    let (scene, fit) = set_up(&config, |_, _, state| fallen = state().position).unwrap();
    let apart = |found: &[[f64; 3]]| {
        let pairs = found.iter().zip(&truth.initial.position);
        let off: Vec<f64> = pairs
            .map(|(a, b)| 1e3 * (Vec3::from(*a) - Vec3::from(*b)).norm())
            .collect();
        (
            off.iter().sum::<f64>() / off.len() as f64,
            off.iter().copied().fold(0.0, f64::max),
        )
    };
    let (mean, max) = apart(&scene.initial.position);
    ([mean, max, apart(&fallen).0], fit.unwrap())
}

/// A small blank on a dome.
fn small() -> SceneConfig {
    let mut config = SceneConfig::read(Path::new("../../configs/scenes/hemisphere.toml")).unwrap();
    config.blank.vertices = [17, 17];
    config.fall.substep_rate = 1200.0;
    config.fall.contact_rate = 240.0;
    config
}

#[test]
#[ignore = "prints the table of docs/SCAN.md"]
fn table() {
    let names = std::env::var("SCENES").unwrap_or("small hemisphere rib outline-with-hole".into());
    println!(
        "scene, marks: fit mean, p95 | vertices mean, p95 | unseen | stray | spring-back | other places | material mean, max | fall alone | s"
    );
    for name in names.split(' ') {
        let config = match name {
            "small" => small(),
            name => {
                SceneConfig::read(Path::new(&format!("../../configs/scenes/{name}.toml"))).unwrap()
            }
        };
        let truth = truth(&config);
        for marks in [Marks::OnTool, Marks::OnBlank, Marks::None] {
            let start = Instant::now();
            let ([mean, max, alone], fit) = error(&config, &truth, &Scanner::good(), marks);
            println!(
                "{name}, {marks:?}: {:.2}, {:.2} | {:.2}, {:.2} | {:.3} | {:.3} | {:.2} | {} | {mean:.2}, {max:.2} | {alone:.2} | {:.1}",
                fit.mean_mm,
                fit.p95_mm,
                fit.vertices_mean_mm,
                fit.vertices_p95_mm,
                fit.unseen_share,
                fit.stray_share,
                fit.spring_back_mm,
                fit.other_places,
                start.elapsed().as_secs_f64()
            );
        }
    }
}
