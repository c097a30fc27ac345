//! `drape plan`: a path for a task that nothing was trained on.

use super::run::*;
use super::*;

const SCATTER: &str =
    "\n[scatter]\nrisk = 0.5\nsubstep_rates = [600.0]\nfriction = 0.2\nstencil = 0.1\n";

/// So many presses come to the same bits on any number of threads, also from what a policy plays; the best path is
/// better than orders that anybody could think of.
#[test]
fn plans_are_searched_and_proved() {
    let folder = trained();
    let path = folder.path();
    // Nearly every order brings this blank on to the tool, but not without surplus.
    let task = CONFIG.replace("\"distance\"", "\"surplus\"");
    fs::write(path.join("task.toml"), format!("{task}{SCATTER}")).unwrap();
    let plan = |name: &str, threads: &str, more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drape"));
        command.args(["plan", "task.toml", "--name", name, "--json"]);
        command.args(more).env("RAYON_NUM_THREADS", threads);
        let output = command.current_dir(path).output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        // On a slow machine two seconds may be too few for a move.
        let is_told = stderr.is_empty() || more[0] == "--seconds" && stderr.starts_with("warning");
        assert!(output.status.success() && is_told, "{stderr}");
        let outcome: Value = serde_json::from_slice(&output.stdout).unwrap();
        (outcome, files(&path.join("runs").join(name)))
    };
    let from = ["--steps", "20000", "--from", "runs/a"];
    let (outcome, one) = plan("one", "1", &from);
    let played = number(&outcome["policy_paths"]);
    assert!((1.0..=16.0).contains(&played), "{outcome}");
    let score = |k: usize| number(&outcome["proof"][k]["score"]);
    assert!((1..5).all(|k| score(0) > score(k)), "{outcome}");
    let (_, three) = plan("three", "3", &from);
    for name in ["best_sequence.json", "proof.json", "trajectory.json"] {
        assert!(one[name] == three[name], "{name}");
    }
    // A study of what judges a path begins with the proved one, whichever the search had thought the best.
    let file = path.join("runs/one/best_sequence.json");
    let mut kept: Value = serde_json::from_slice(&one["best_sequence.json"]).unwrap();
    let proved: Value = serde_json::from_slice(&one["proof.json"]).unwrap();
    let proved = &proved["path"]["vertices"];
    let mut shorter = proved.as_array().unwrap().clone();
    shorter.pop();
    let lengths = [shorter.len() + 1, shorter.len()];
    kept["vertices"] = shorter.into();
    kept["others"] = serde_json::json!([{ "vertices": proved, "score": 0.5 }]);
    fs::write(file, kept.to_string()).unwrap();
    let args = "study judge runs/one --paths 4 --twin-worlds 2 --out judged --json";
    let judged = json(path, &args.split(' ').collect::<Vec<_>>());
    let paths = judged["paths"].as_array().unwrap().iter();
    let presses: Vec<f64> = paths.map(|path| number(&path["presses"])).collect();
    assert_eq!(presses, lengths.map(|length| length as f64));
    // Nothing but time bounds it.
    let (outcome, _) = plan("timed", "2", &["--seconds", "2"]);
    assert_eq!(outcome["policy_paths"], 0);
    assert!(number(&outcome["env_steps"]) > 0.0);
    assert_eq!(outcome["proof"][0]["worlds"], 24);
    let exported = json(path, &["export", "runs/timed", "--json"]);
    assert_eq!(exported["proved"], "solver");
}

/// What a policy knows is a file of its own, from which plans come to the bits that they come to from its run, and trainings
/// begin: with steps of next to nothing they end with it.
#[test]
fn policies_are_files() {
    let folder = trained();
    let path = folder.path();
    let export = |run: &str| {
        let args = ["export", run, "--format", "policy", "--json"];
        (json(path, &args), path.join(run).join("policy.drape"))
    };
    let (report, file) = export("runs/a");
    assert_eq!(report["file"], "runs/a/policy.drape");
    assert!(number(&report["parameters"]) > 1000.0);
    let plan = |name: &str, from: &str| {
        let begin = ["plan", "task.toml", "--steps", "20000", "--json"];
        json(
            path,
            &[&begin[..], &["--name", name, "--from", from]].concat(),
        );
        fs::read(path.join("runs").join(name).join("best_sequence.json")).unwrap()
    };
    fs::write(path.join("task.toml"), format!("{CONFIG}{SCATTER}")).unwrap();
    assert!(plan("run", "runs/a") == plan("file", "runs/a/policy.drape"));

    let slow = CONFIG.replace("[ppo]", "[ppo]\nlearning_rate = 1e-37");
    fs::write(path.join("slow.toml"), slow).unwrap();
    let train = |name: &str, more: &[&str]| {
        let begin = [
            "train",
            "slow.toml",
            "--name",
            name,
            "--seed",
            "9",
            "--json",
        ];
        json(path, &[&begin[..], more].concat());
        fs::read(export(&format!("runs/{name}")).1).unwrap()
    };
    let policy = fs::read(file).unwrap();
    assert!(train("on", &["--from", "runs/a/policy.drape"]) == policy);
    assert!(train("scratch", &[]) != policy);

    // Each says from which policy it began, and none begins anew without it.
    let digest = |run: &str| {
        let info = fs::read_to_string(path.join("runs").join(run).join("run.json")).unwrap();
        serde_json::from_str::<Value>(&info).unwrap()["policy"].clone()
    };
    assert_eq!(
        [digest("file"), digest("on")],
        [0, 1].map(|_| report["digest"].clone())
    );
    assert!(digest("scratch").is_null());
    fs::remove_file(path.join("runs/on/checkpoints/last.drape")).unwrap();
    fs::write(path.join("runs/on/metrics.jsonl"), "").unwrap();
    let output = drape(path, &["train", "--resume", "runs/on"]);
    assert_eq!(output.status.code(), Some(2));
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(stderr.contains("begin another with --from"), "{stderr}");
    // Keys are changed of runs that are gone on with, and of no others.
    let output = drape(
        path,
        &["train", "slow.toml", "--from", "runs/a", "--set", "steps=9"],
    );
    assert_eq!(output.status.code(), Some(2));
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(stderr.contains("expected --resume"), "{stderr}");

    fs::write(path.join("cut.drape"), &policy[..99]).unwrap();
    for (from, fault) in [("cut.drape", "cut short"), ("runs/b", "runs/b")] {
        for command in ["plan", "train"] {
            let output = drape(path, &[command, "slow.toml", "--from", from]);
            assert_eq!(output.status.code(), Some(2));
            let stderr = String::from_utf8(output.stderr).unwrap();
            assert!(
                stderr.contains(fault) && stderr.lines().count() == 1,
                "{stderr}"
            );
        }
    }
}

/// A policy whose weights belong to places plays on images of its size alone, and a run without one plays none; both are refused
/// before a blank falls.
#[test]
fn policies_that_cannot_play_are_refused() {
    let folder = trained();
    let path = folder.path();
    let other = CONFIG.replace("-80.0, -80.0]", "-60.0, -60.0]");
    fs::write(path.join("other.toml"), other).unwrap();
    fs::create_dir(path.join("runs/empty")).unwrap();
    for (from, fault) in [("runs/a", "or a `unet`"), ("runs/empty", "runs/empty")] {
        let output = drape(path, &["plan", "other.toml", "--from", from, "--json"]);
        assert_eq!(output.status.code(), Some(2));
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(
            stderr.contains(fault) && stderr.lines().count() == 1,
            "{stderr}"
        );
    }
    assert_eq!(names(&path.join("runs")), ["a", "empty"]);
}
