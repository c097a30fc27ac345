//! Scans of what was pressed: beside the run, and what is learned from them.

use std::sync::{Arc, OnceLock};

use drape::run::{RunConfig, RunFolder};
use drape_cloth::math::Vec3;
use drape_cloth::scene::Scene;
use drape_task::env::Draping;

use super::run::{CONFIG, Files, files, number, read_json, write_files};
use super::*;

/// A run `runs/a` with a proved path, in coarse steps, made once for all tests, and its configuration `task.toml`.
fn pressed_run(folder: &Path) {
    static PRESSED: OnceLock<Files> = OnceLock::new();
    let pressed = PRESSED.get_or_init(|| {
        let folder = super::folder();
        press_run(folder.path(), "");
        files(folder.path())
    });
    write_files(folder, pressed);
}

/// The same now. `more` ends its configuration.
fn press_run(folder: &Path, more: &str) {
    let text = format!("{CONFIG}\n[scatter]\nsubstep_rates = [600.0]\n{more}");
    fs::write(folder.join("task.toml"), text).unwrap();
    let args = ["baseline", "task.toml", "--policy", "outwards"];
    let more = ["--steps", "120", "--name", "a", "--json"];
    json(folder, &[&args[..], &more].concat());
}

/// [`points`] where the path of `runs/a` leaves the cloth in the scene of a configuration.
fn pressed(folder: &Path, config: &str) -> Vec<[f64; 3]> {
    let config = RunConfig::read(&folder.join(config)).unwrap();
    let (scene, _) = drape_scan::set_up(&config.scene, |_, _, _| ()).unwrap();
    let scene = Arc::new(scene);
    let run = RunFolder::open(&folder.join("runs/a")).unwrap();
    let path = run.read_proof().unwrap().unwrap().path.vertices;
    let env = config.scatter.finest(&config.env);
    let mut draping = Draping::new(scene.clone(), &env, 1).unwrap();
    let mut end = Vec::new();
    let ended = draping.replay(&[&path], |draping, _, presses| {
        if presses == path.len() {
            end = draping.state(0).position;
        }
    });
    assert!(ended[0].is_ok());
    points(&scene, &end)
}

/// Points of the cloth of a scene that lies at `position` [m], in the frame of the scene [mm]: vertices and middles of
/// triangles.
fn points(scene: &Scene, position: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mesh = scene.lamina.mesh(&scene.tool.in_scene(position));
    let corners = |t: &[u32; 3]| t.map(|v| mesh.vertices[v as usize]);
    let middle = |t: &[u32; 3]| corners(t).iter().sum::<Vec3>() / 3.0;
    let middles = mesh.triangles.iter().map(middle);
    let points = mesh.vertices.iter().copied().chain(middles);
    points.map(|x| (1e3 * x).into()).collect()
}

fn write_points(file: &Path, points: impl IntoIterator<Item = [f64; 3]>) {
    let lines = points.into_iter().map(|[x, y, z]| format!("{x} {y} {z}\n"));
    fs::write(file, lines.collect::<String>()).unwrap();
}

const IN_SCENE: [&str; 4] = ["--unit", "mm", "--frame", "scene"];

#[test]
fn scan_of_what_was_pressed_lies_on_the_run() {
    let folder = folder();
    let path = folder.path();
    pressed_run(path);
    let points = pressed(path, "task.toml");
    write_points(&path.join("scan.xyz"), points.iter().copied());
    let args = [&["compare", "scan.xyz", "runs/a"], &IN_SCENE[..]].concat();
    let report = json(path, &[&args[..], &["--out", "a.png", "--json"]].concat());
    assert_eq!(report["a_source"]["kind"], "scan");
    // Means of neighbours over a fold are a little off it.
    let spread = |key: &str| number(&report["scan_to_run_mm"][key]);
    assert!(spread("p95") < 0.3, "{report}");
    assert!(spread("min") > -3.0 && spread("max") < 3.0, "{report}");
    assert!(number(&report["run_to_scan_mm"]["max"]) < 1e-3, "{report}");
    for key in ["far_share", "unseen_share"] {
        assert_eq!(number(&report[key]), 0.0, "{key}");
    }
    let undraped = ["scan", "run"].map(|of| number(&report[&format!("undraped_share_{of}")]));
    assert!((undraped[0] - undraped[1]).abs() < 0.15, "{undraped:?}");
    assert!(0.0 < undraped[1] && undraped[1] < 1.0, "{undraped:?}");
    assert!(
        fs::read(path.join("a.png"))
            .unwrap()
            .starts_with(b"\x89PNG")
    );
    let text = stdout(path, &args);
    assert!(text.starts_with("A  scan.xyz ("), "{text}");
    assert!(text.contains("not applicable: surplus_mm, "), "{text}");

    // Of a half all points lie there, but half of the blank is not seen.
    let half = points.iter().copied().filter(|x| x[0] < 0.0);
    write_points(&path.join("half.xyz"), half);
    let args = [&["compare", "half.xyz", "runs/a"], &IN_SCENE[..]].concat();
    let report = json(path, &[&args[..], &["--json"]].concat());
    let unseen = number(&report["unseen_share"]);
    assert!((0.35..0.55).contains(&unseen), "{unseen}");
    assert!(number(&report["scan_to_run_mm"]["p95"]) < 0.3, "{report}");

    // Turned by a quarter about z, moved, in centimetres; marks on the tool say so.
    let moved = |[x, y, z]: [f64; 3]| [(100.0 - y) / 10.0, (x + 30.0) / 10.0, (z + 7.0) / 10.0];
    write_points(&path.join("moved.xyz"), points.into_iter().map(moved));
    let mark = |at: [f64; 3]| {
        let seen = moved(at);
        format!("[[scan_marks]]\nscene_mm = {at:?}\nseen = {seen:?}\n")
    };
    let marks = [[0.0, 0.0, 60.0], [200.0, 0.0, 0.0], [0.0, 150.0, 30.0]].map(mark);
    fs::write(path.join("marks.toml"), marks.concat()).unwrap();
    let args = ["compare", "moved.xyz", "runs/a", "--unit", "cm"];
    let report = json(
        path,
        &[&args[..], &["--marks", "marks.toml", "--json"]].concat(),
    );
    assert!(number(&report["scan_to_run_mm"]["rms"]) < 0.3, "{report}");
    assert_eq!(report["other_places"], 0);
}

#[test]
fn a_turn_learns_from_a_scan_and_leaves_the_old_run_alone() {
    let folder = folder();
    let path = folder.path();
    pressed_run(path);
    // As the shop has it: half the friction.
    let material = include_str!("../../configs/materials/interglas-92125.toml");
    let slippery = material
        .replace("friction = 0.28", "friction = 0.14")
        .replace("friction = 0.27", "friction = 0.135")
        .replace("friction = 0.25", "friction = 0.125")
        .replace("friction = 0.24", "friction = 0.12");
    assert_ne!(material, slippery);
    fs::write(path.join("slippery.toml"), slippery).unwrap();
    let task = fs::read_to_string(path.join("task.toml")).unwrap();
    let task = format!("{task}[scene]\nmaterial = \"slippery.toml\"\n");
    fs::write(path.join("shop.toml"), task).unwrap();
    write_points(&path.join("scan.xyz"), pressed(path, "shop.toml"));

    let before = files(&path.join("runs/a"));
    let args = [&["improve", "runs/a", "--scan", "scan.xyz"], &IN_SCENE[..]].concat();
    let more = ["--polish", "100", "--name", "b", "--json"];
    let report = json(path, &[&args[..], &more].concat());
    assert!(files(&path.join("runs/a")) == before);
    assert_eq!(report["turn"], 1);
    let names = ["friction", "bending", "shear", "tension"];
    for (parameter, name) in report["parameters"].as_array().unwrap().iter().zip(names) {
        let [low, value, high] = ["low", "value", "high"].map(|key| number(&parameter[key]));
        assert!(low < value && value < high, "{parameter}");
        assert_eq!(parameter["name"], name);
    }
    let [old, new] = ["score_before", "score_after"].map(|key| number(&report[key]));
    assert!(old <= 1.0 && new <= 1.0, "{report}");
    let [all, kept] = ["presses_after", "presses_kept"].map(|key| number(&report[key]));
    assert!(0.0 < all && kept <= all, "{report}");

    let run = path.join("runs/b");
    let turns = read_json(&run.join("loop.json"));
    assert_eq!(turns.as_array().unwrap().len(), 1);
    for key in ["from", "scans", "parameters", "score_before", "score_after"] {
        assert_eq!(turns[0][key], report[key], "{key}");
    }
    assert_eq!(turns[0]["scans"][0]["file"], "scan.xyz");
    let proof = read_json(&run.join("proof.json"));
    assert!(
        (number(&proof["path"]["score"]) - new).abs() < 1e-12,
        "{proof}"
    );
    // The new run has the new fabric, and what the scans tell scatters.
    let friction = number(&report["parameters"][0]["value"]);
    let text = fs::read_to_string(run.join("inputs/material.toml")).unwrap();
    let made: toml::Table = text.parse().unwrap();
    let found = made["warp"]["static_friction"].as_float().unwrap();
    assert!((found / (0.28 * friction) - 1.0).abs() < 1e-3, "{found}");
    let config = RunConfig::read(&run.join("config.toml")).unwrap();
    let scattered: Vec<String> = config.scatter.spreads.keys().map(|q| q.name()).collect();
    let told = report["parameters"].as_array().unwrap().iter();
    let told = told.filter(|parameter| parameter["told"] == true);
    let told: Vec<&str> = told.map(|p| p["name"].as_str().unwrap()).collect();
    assert_eq!(scattered.len(), told.len(), "{scattered:?} {told:?}");
    // It can be gone on with as any run.
    json(path, &["export", "runs/b", "--json"]);
    let output = drape(path, &["train", "--resume", "runs/b"]);
    assert_failure(
        &output,
        2,
        &["runs/b has no policy, as `drape improve` made it"],
    );
}

#[test]
fn a_blank_that_starts_from_its_scan_is_improved_too() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("fallen.toml"), CONFIG).unwrap();
    let config = RunConfig::read(&path.join("fallen.toml")).unwrap();
    let scene = Scene::new(&config.scene, |_| ()).unwrap();
    let laid = points(&scene, &scene.initial.position);
    write_points(&path.join("laid.xyz"), laid);
    let scan = "scan = \"laid.xyz\"\nscan_unit = \"mm\"\nscan_frame = \"scene\"\n";
    press_run(path, &format!("[scene.placement]\n{scan}"));
    write_points(&path.join("scan.xyz"), pressed(path, "task.toml"));
    let args = [&["improve", "runs/a", "--scan", "scan.xyz"], &IN_SCENE[..]].concat();
    let more = ["--polish", "50", "--name", "b", "--json"];
    let report = json(path, &[&args[..], &more].concat());
    assert!(number(&report["rms_mm"]) < 1.0, "{report}");
}

#[test]
fn what_nothing_can_be_learned_from_is_refused_in_one_line() {
    let folder = folder();
    let path = folder.path();
    pressed_run(path);
    let points = pressed(path, "task.toml");
    write_points(&path.join("scan.xyz"), points.iter().copied());
    let beside = points.iter().map(|&[x, y, z]| [x + 200.0, y, z + 80.0]);
    write_points(&path.join("beside.xyz"), beside);
    let fails = |args: &[&str], words: &[&str]| {
        assert_failure(&drape(path, args), 2, words);
        assert_eq!(names(&path.join("runs")), ["a"]);
    };
    let improve = |scan: &'static str| ["improve", "runs/a", "--scan", scan];
    fails(
        &improve("scan.xyz"),
        &["--unit is missing, expected mm, cm, in or m"],
    );
    let missing = [&improve("none.ply")[..], &["--unit", "mm"]].concat();
    fails(&missing, &["none.ply"]);
    let metres = [&improve("scan.xyz")[..], &["--unit", "m"]].concat();
    fails(&metres, &["scan.xyz", "in \"mm\" it would have the size"]);
    let beside = [&improve("beside.xyz")[..], &IN_SCENE].concat();
    fails(
        &beside,
        &[
            "beside.xyz",
            "off the simulated blank, expected at most 25 %",
        ],
    );
    let compared = ["compare", "scan.xyz", "task.toml", "--unit", "mm"];
    fails(&compared, &["task.toml is no run folder"]);
    fs::write(
        path.join("marks.toml"),
        "[[scan_marks]]\nseen = [1, 2, 3]\n",
    )
    .unwrap();
    let marks = [
        &improve("scan.xyz")[..],
        &["--unit", "mm", "--marks", "marks.toml"],
    ]
    .concat();
    fails(
        &marks,
        &["marks.toml", "`scan_marks` is 1, expected three or more"],
    );
    let twice = [&improve("scan.xyz")[..], &["scan.xyz"], &IN_SCENE].concat();
    fails(&twice, &["scan.xyz is the same as scan.xyz"]);
    fs::remove_file(path.join("runs/a/proof.json")).unwrap();
    let unproved = [&improve("scan.xyz")[..], &IN_SCENE].concat();
    fails(&unproved, &["runs/a has no proved path", "--prove"]);
}
