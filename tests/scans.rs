//! What scans are worth where simulations play the shop. The finite-element twin hides its fabric, presses what a run has
//! proved, and its cloth is scanned, from which the run is improved; and blanks that lie off their place are scanned
//! before they are pressed.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use drape::run::{Checkpoint, RunConfig, RunFolder, play, random_episodes};
use drape_cloth::math::{Purpose, Stream, Vec3};
use drape_cloth::scene::{Misplacement, ScanFrame, Scene, Unit};
use drape_cloth::sim::Parameters;
use drape_learn::ppo::{Agent, NETWORK, Sampling, read_section};
use drape_proof::Listener;
use drape_proof::presses::{replay, replay_in_twin, resting_in_twin};
use drape_task::env::{Draping, Quantity, Task, Tasks, Worlds};

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
spacing_mm = 8.0
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

/// The proved path of a run.
fn path_of(run: &Path) -> Vec<u32> {
    let folder = RunFolder::open(run).unwrap();
    folder.read_proof().unwrap().unwrap().path.vertices
}

/// So many points on each triangle of the cloth of a scene, as a scanner with a deviation of `noise` sees it in the
/// scene's frame [mm].
fn scanned(
    scene: &Scene,
    position: &[[f64; 3]],
    count: usize,
    noise: f64,
    stream: &mut Stream,
) -> String {
    let position = scene.tool.in_scene(position);
    let mut scan = String::new();
    for corners in scene
        .lamina
        .triangles
        .iter()
        .flat_map(|corners| std::iter::repeat_n(corners, count))
    {
        let [a, b, c] = corners.map(|v| Vec3::from(position[v as usize]));
        let [mut s, mut t] = [stream.uniform(), stream.uniform()];
        if s + t > 1.0 {
            [s, t] = [1.0 - s, 1.0 - t];
        }
        let noise = Vec3::from_fn(|_, _| noise * stream.normal());
        let x = 1e3 * (a + s * (b - a) + t * (c - a)) + noise;
        writeln!(scan, "{} {} {}", x.x, x.y, x.z).unwrap();
    }
    scan
}

/// The proved path of a run pressed in the twin with the hidden fabric: its score there, and points on the cloth [mm].
fn shop(run: &Path, hidden: &Parameters, stream: &mut Stream) -> (f64, String) {
    let path = path_of(run);
    // The laws that all runs began with: those of an improved one are its own guess.
    let config = RunConfig::parse(TASK, "task.toml".as_ref()).unwrap();
    let scene = Arc::new(Scene::new(&config.scene, |_| ()).unwrap());
    let lying = resting_in_twin(&scene, &Misplacement::default(), hidden).unwrap();
    let mut env = config.env.clone();
    env.parameters = env.parameters.and(hidden);
    let task = Task::new(lying, &env).unwrap();
    let (ends, _) = replay_in_twin(&[(&task, &path)], &|_, _| (), Listener::QUIET).unwrap();
    let cloth = ends[0].as_ref().expect("the twin does not diverge").cloth();
    let scan = scanned(&scene, &cloth.position, 1, NOISE_MM, stream);
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

/// Presses of 12 worlds on a scene, as they scatter in a configuration: mean scores of some paths.
fn pressed_on(scene: &Arc<Scene>, config: &RunConfig, paths: &[&[u32]]) -> Vec<f64> {
    let mut scatter = config.scatter.clone();
    scatter
        .spreads
        .retain(|&quantity, _| quantity >= Quantity::Pressure);
    let worlds = Worlds::new(scene, &scatter, 1, 5, |_| ()).unwrap();
    let mut sums = vec![0.0; paths.len()];
    for number in 0..12 {
        let mut env = scatter.finest(&config.env);
        env.parameters = env.parameters.and(&worlds.world(number).parameters);
        let mut draping = Draping::new(scene.clone(), &env, paths.len()).unwrap();
        let ends = replay(&mut draping, paths, |_| ());
        for (sum, end) in sums.iter_mut().zip(ends) {
            *sum += draping
                .task(0)
                .score(end.expect("nothing diverges").cloth())
                / 12.0;
        }
    }
    sums
}

/// What the policy of a run presses, greedily, on the blank of another scene.
fn played_on(scene: &Arc<Scene>, run: &Path, config: &RunConfig) -> Vec<u32> {
    let folder = RunFolder::open(run).unwrap();
    let checkpoint = Checkpoint::of_run(&folder.best_checkpoint, &folder).unwrap();
    let mut draping = Draping::new(scene.clone(), &config.env, 1).unwrap();
    let (shape, terrains) = (draping.shape(), draping.terrains());
    let agent = Agent::new(&config.policy, shape, &terrains, config.seed, config.device);
    let mut agent = agent.unwrap();
    read_section(&checkpoint.sections, NETWORK, |bytes| agent.load(bytes)).unwrap();
    let choose = |seen: &Draping| agent.act(&[seen.observation(0)], Sampling::Greedy)[0];
    play(&mut draping, choose, |_| ())
        .unwrap()
        .recording
        .vertices()
}

/// The blank of the quickstart lies off its place and is scanned there: what paths that were learned on the truth, on
/// the fit and for the place where the blank should lie come to on the truth, beside random presses; and what the policy
/// of the truth presses greedily when it sees the truth, and when it sees the fit.
#[test]
#[ignore = "a quarter of an hour of CPU: prints the table of docs/SCAN.md"]
fn paths_from_a_fit_are_pressed_on_the_truth() {
    let [draws, steps] = [("DRAWS", 3), ("STEPS", 20_000)].map(|(name, default)| {
        std::env::var(name).map_or(default, |text| text.parse().expect("a number"))
    });
    println!(
        "| Draw | Path of the truth | of the fit | of the place | Policy sees the truth | the fit | Random |"
    );
    println!("|---|---|---|---|---|---|---|");
    let mut sums = [0.0; 6];
    for draw in 1..=draws {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        let mut stream = Stream::new(3, Purpose::Worlds, draw as u32);
        let mut config = RunConfig::quickstart();
        (config.steps, config.polish, config.seed) = (steps, steps, draw);
        let nominal = config.clone();
        // 5 mm off in some direction, 2 degrees steeper.
        let [sin, cos] = {
            let angle = std::f64::consts::TAU * stream.uniform();
            [angle.sin(), angle.cos()]
        };
        config.scene.placement.centre_mm = [5.0 * cos, 5.0 * sin];
        config.scene.placement.tilt_deg = 2.0;
        let truth = config;
        let scene = Arc::new(Scene::new(&truth.scene, |_| ()).unwrap());
        let scan = scanned(&scene, &scene.initial.position, 4, 0.5, &mut stream);
        fs::write(path.join("scan.xyz"), scan).unwrap();
        let mut fitted = nominal.clone();
        let placement = &mut fitted.scene.placement;
        placement.scan = Some(path.join("scan.xyz"));
        placement.scan_unit = Some(Unit::Mm);
        placement.scan_frame = ScanFrame::Scene;
        for (config, name) in [(&truth, "truth"), (&fitted, "fit"), (&nominal, "place")] {
            fs::write(path.join(name), config.to_toml()).unwrap();
            drape(path, &["train", name, "--name", name]);
        }
        let (fit, _) = drape_scan::set_up(&fitted.scene, |_, _, _| ()).unwrap();
        let run = |name| path.join("runs").join(name);
        let mut paths: Vec<Vec<u32>> = ["truth", "fit", "place"]
            .map(|name| path_of(&run(name)))
            .into();
        for seen in [&scene, &Arc::new(fit)] {
            paths.push(played_on(seen, &run("truth"), &truth));
        }
        let paths: Vec<&[u32]> = paths.iter().map(|path| &path[..]).collect();
        let mut scores = pressed_on(&scene, &truth, &paths);
        let env = truth.scatter.finest(&truth.env);
        let random = random_episodes(&scene, &env, 16, |_| ()).unwrap();
        scores.push(random.iter().map(|episode| episode.score).sum::<f64>() / 16.0);
        let shown: Vec<String> = scores.iter().map(|s| format!("{:.1} %", 1e2 * s)).collect();
        println!("| {draw} | {} |", shown.join(" | "));
        (sums.iter_mut().zip(scores)).for_each(|(sum, score)| *sum += score);
    }
    let means = sums.map(|sum| format!("{:.1} %", 1e2 * sum / draws as f64));
    println!("| mean | {} |", means.join(" | "));
    assert!(sums[1] > sums[5] + 0.1 * draws as f64, "{sums:?}");
}
