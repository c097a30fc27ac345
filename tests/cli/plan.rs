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
    fs::write(path.join("task.toml"), format!("{CONFIG}{SCATTER}")).unwrap();
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
    assert!((1..4).all(|k| score(0) > score(k)), "{outcome}");
    let (_, three) = plan("three", "3", &from);
    for name in ["best_sequence.json", "proof.json", "trajectory.json"] {
        assert!(one[name] == three[name], "{name}");
    }
    // Nothing but time bounds it.
    let (outcome, _) = plan("timed", "2", &["--seconds", "2"]);
    assert_eq!(outcome["policy_paths"], 0);
    assert!(number(&outcome["env_steps"]) > 0.0);
    assert_eq!(outcome["proof"][0]["worlds"], 24);
    let exported = json(path, &["export", "runs/timed", "--json"]);
    assert_eq!(exported["proved"], "solver");
}

/// A policy whose weights belong to places plays no other task, and a run without one plays none; both are refused
/// before a blank falls.
#[test]
fn policies_that_cannot_play_are_refused() {
    let folder = trained();
    let path = folder.path();
    let other = CONFIG.replace("-80.0, -80.0]", "-60.0, -60.0]");
    fs::write(path.join("other.toml"), other).unwrap();
    fs::create_dir(path.join("runs/empty")).unwrap();
    for (from, fault) in [("runs/a", "expected `unet`"), ("runs/empty", "runs/empty")] {
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
