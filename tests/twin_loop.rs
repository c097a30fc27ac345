//! The loop where the finite-element twin is the shop: its fabric is hidden, it presses what the run has proved, its
//! cloth is scanned, and the run is improved.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use drape::run::{RunConfig, RunFolder};
use drape_cloth::math::{Purpose, Stream, Vec3};
use drape_cloth::scene::{Misplacement, Scene};
use drape_cloth::sim::Parameters;
use drape_study::presses::{replay_in_twin, resting_in_twin};
use drape_study::study::Context;
use drape_task::env::Task;

/// Deviations of the logarithms of hidden friction, bending and shear.
const HIDDEN: [f64; 3] = [0.25, 0.3, 0.3];

/// Deviation of a coordinate of a scanned point [mm].
const NOISE_MM: f64 = 0.1;

/// A quarter of a small dome, in the spirit of the quickstart.
const TASK: &str = r#"
preset = "compact"
proof_paths = 8

[env]
region_mm = [-81.0, -81.0, 0.0, 0.0]
stencil_mm = 25.5
substep_rate = 1200.0
contact_rate = 240.0

[scatter]
risk = 0.5
substep_rates = [1200.0, 2400.0]
friction = 0.25
bending = 0.3
shear = 0.3

[scene.tool.grid]
spacing_mm = 4.0
[scene.tool.source.shape]
kind = "hemisphere"
radius_mm = 50.0
plate_mm = [240.0, 240.0]
[scene.blank]
size_mm = [160.0, 160.0]
vertices = [21, 21]
mass = "datasheet"
[scene.placement]
height_mm = 55.0
tilt_deg = 0.0
[scene.fall]
fall_s = 0.6
settle_s = 0.8
substep_rate = 3000.0
contact_rate = 600.0
"#;

fn drape(folder: &Path, args: &[&str]) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drape"));
    let output = command.args(args).current_dir(folder).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{args:?}: {stderr}");
}

/// The proved path of a run pressed in the twin with the hidden fabric: its score there, and points on the cloth [mm].
fn shop(run: &Path, hidden: &Parameters, stream: &mut Stream) -> (f64, String) {
    let folder = RunFolder::open(run).unwrap();
    let path = folder.read_proof().unwrap().unwrap().path.vertices;
    // The laws that all runs began with: those of an improved one are its own guess.
    let config = RunConfig::parse(TASK, "task.toml".as_ref()).unwrap();
    let scene = Arc::new(Scene::new(&config.scene, |_| ()).unwrap());
    let lying = resting_in_twin(&scene, &Misplacement::default(), hidden).unwrap();
    let mut env = config.env.clone();
    env.parameters = env.parameters.and(hidden);
    let task = Task::new(lying, &env).unwrap();
    let (ends, _) = replay_in_twin(&[(&task, &path)], &|_, _| (), &Context::quiet()).unwrap();
    let cloth = ends[0].as_ref().expect("the twin does not diverge").cloth();
    let position = scene.tool.in_scene(&cloth.position);
    let mut scan = String::new();
    for corners in &scene.lamina.triangles {
        let [a, b, c] = corners.map(|v| Vec3::from(position[v as usize]));
        let [mut s, mut t] = [stream.uniform(), stream.uniform()];
        if s + t > 1.0 {
            [s, t] = [1.0 - s, 1.0 - t];
        }
        let noise = Vec3::from_fn(|_, _| NOISE_MM * stream.normal());
        let x = 1e3 * (a + s * (b - a) + t * (c - a)) + noise;
        writeln!(scan, "{} {} {}", x.x, x.y, x.z).unwrap();
    }
    (task.score(cloth), scan)
}

/// Scores of the shop before a turn, after one and after two, and of a path that the same search has found without
/// scans. It prints a table; `DRAWS` and `STEPS` are five and 30 000 if not given.
#[test]
#[ignore = "an hour of CPU: prints the table of docs/LOOP.md"]
fn turns_of_the_loop_in_a_twin_with_a_hidden_fabric() {
    let number = |key: &str, default: u64| {
        std::env::var(key).map_or(default, |text| text.parse().expect("a number"))
    };
    let (draws, steps) = (number("DRAWS", 5), number("STEPS", 30_000));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("task.toml"), TASK).unwrap();
    let search = |steps: u64, name: &str| {
        let steps = steps.to_string();
        let args = [
            "baseline",
            "task.toml",
            "--policy",
            "moves",
            "--steps",
            &steps,
        ];
        drape(path, &[&args[..], &["--name", name]].concat());
    };
    search(steps, "before");
    search(3 * steps, "alone");
    println!("| Draw | Friction, bending, shear | Before | One turn | Two turns | Search alone |");
    println!("|---|---|---|---|---|---|");
    let mut sums = [0.0; 4];
    for draw in 1..=draws {
        let mut stream = Stream::new(7, Purpose::Worlds, draw as u32);
        let factors = HIDDEN.map(|deviation| (deviation * stream.normal()).exp());
        let [friction, bending, shear] = factors.map(|factor| [factor; 2]);
        let hidden = Parameters {
            friction,
            bending,
            shear,
            ..Parameters::default()
        };
        let (mut run, mut scores) = ("before".to_owned(), Vec::new());
        for turn in 1..=2 {
            let (score, scan) = shop(&path.join("runs").join(&run), &hidden, &mut stream);
            scores.push(score);
            let (file, name) = (format!("{draw}-{turn}.xyz"), format!("{draw}-{turn}"));
            fs::write(path.join(&file), scan).unwrap();
            let (old, steps) = (format!("runs/{run}"), steps.to_string());
            let args = [
                "improve", &old, "--scan", &file, "--unit", "mm", "--frame", "scene",
            ];
            drape(
                path,
                &[&args[..], &["--polish", &steps, "--name", &name]].concat(),
            );
            run = name;
        }
        for run in [&*run, "alone"] {
            scores.push(shop(&path.join("runs").join(run), &hidden, &mut stream).0);
        }
        let factors = factors.map(|factor| format!("{factor:.2}")).join(", ");
        let shown: Vec<String> = scores.iter().map(|s| format!("{:.1} %", 1e2 * s)).collect();
        println!("| {draw} | {factors} | {} |", shown.join(" | "));
        sums.iter_mut()
            .zip(scores)
            .for_each(|(sum, score)| *sum += score);
    }
    let means = sums.map(|sum| format!("{:.1} %", 1e2 * sum / draws as f64));
    println!("| mean | | {} |", means.join(" | "));
    // Worse than not to have looked would be a fault.
    assert!(sums[2] > sums[0] - 0.02 * draws as f64, "{sums:?}");
}
