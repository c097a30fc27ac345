//! `drape baseline`: searches without learning, kept as runs are.

use super::run::*;
use super::*;

const POLICIES: [&str; 3] = ["random", "sweep", "outwards"];

/// What a search leaves, sorted.
const FILES: [&str; 12] = [
    ".lock",
    "best_sequence.json",
    "config.toml",
    "pictures/after.png",
    "pictures/before.png",
    "pictures/crushed.png",
    "pictures/path.png",
    "pictures/recording.drape",
    "pictures/rollout.gif",
    "proof.json",
    "run.json",
    "trajectory.json",
];

/// Searches by a policy on so many threads, in `runs/POLICY-THREADS`.
fn search(folder: &Path, policy: &str, threads: &str, args: &[&str]) -> Value {
    fs::write(folder.join("config.toml"), CONFIG).unwrap();
    let name = format!("{policy}-{threads}");
    let mut command = Command::new(env!("CARGO_BIN_EXE_drape"));
    command.args(["baseline", "config.toml", "--json", "--policy", policy]);
    command.args(["--name", &name]).args(args);
    command
        .env("RAYON_NUM_THREADS", threads)
        .current_dir(folder);
    let output = command.output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && stderr.is_empty(), "{stderr}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Every policy keeps within its steps, ranks what it has found, and finds the same on any number of
/// threads. The best score is that of the path when it is played again.
#[test]
fn searches_keep_to_their_steps_and_leave_what_they_have_found() {
    let folder = folder();
    let path = folder.path();
    for policy in POLICIES {
        let outcome = search(path, policy, "1", &["--steps", "600"]);
        assert_eq!(outcome["policy"], policy);
        let steps = outcome["env_steps"].as_u64().unwrap();
        // Rounded down to whole steps of the four environments.
        assert!(steps <= 600 && steps.is_multiple_of(4), "{policy}: {steps}");
        assert!(outcome["episodes"].as_u64().unwrap() > 0);
        let run = path.join("runs").join(format!("{policy}-1"));
        assert_eq!(files(&run).into_keys().collect::<Vec<_>>(), FILES);
        let best = read_json(&run.join("best_sequence.json"));
        assert_eq!(best["score"], outcome["best_score"]);
        assert!(number(&outcome["mean_score"]) <= number(&best["score"]));
        let presses = best["vertices"].as_array().unwrap().len();
        assert_eq!(number(&outcome["path"]["presses"]), presses as f64);
        let others = best["others"].as_array().map_or(&[][..], Vec::as_slice);
        let scores = others.iter().map(|other| number(&other["score"]));
        let scores: Vec<f64> = [number(&best["score"])].into_iter().chain(scores).collect();
        assert!(scores.is_sorted_by(|a, b| a >= b), "{policy}: {scores:?}");
        assert_eq!(outcome["proof"][0]["order"], "path");
        let proved = number(&outcome["proof"][0]["count"]);
        // Twice as many as `proof_paths`.
        assert_eq!(proved, scores.len().min(8) as f64, "{policy}");
        let run = run.to_str().unwrap();
        let played = json(
            path,
            &["eval", run, "--sequence", "--episodes", "1", "--json"],
        );
        assert_eq!(played["episode"]["score"], best["score"]);
        search(path, policy, "3", &["--steps", "600"]);
        let other = path.join("runs").join(format!("{policy}-3"));
        let [one, three] = [&path.join(run), &other].map(|run| files(run));
        for name in ["best_sequence.json", "proof.json", "trajectory.json"] {
            assert!(one[name] == three[name], "{policy}: {name}");
        }
    }
    let exported = json(path, &["export", "runs/sweep-1", "--json"]);
    assert_eq!(exported["proved"], "solver");
}

/// Moves come to the same on any number of threads, better than where they begin, in worlds that scatter.
#[test]
fn moves_are_searched_in_scattered_worlds() {
    let folder = folder();
    let path = folder.path();
    let text = format!(
        "{CONFIG}\n[env.costs]\nsecond = 0.002\n[scatter]\nrisk = 0.5\nsubstep_rates = [600.0]\nfriction = 0.2\n\
         stencil = 0.1\n"
    );
    fs::write(path.join("scattered.toml"), text).unwrap();
    let search = |threads: &str| {
        let name = format!("moves-{threads}");
        let mut command = Command::new(env!("CARGO_BIN_EXE_drape"));
        command.args(["baseline", "scattered.toml", "--json", "--policy", "moves"]);
        command.args(["--name", &name, "--steps", "100000"]);
        command.env("RAYON_NUM_THREADS", threads).current_dir(path);
        let output = command.output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success() && stderr.is_empty(), "{stderr}");
        let outcome: Value = serde_json::from_slice(&output.stdout).unwrap();
        (outcome, files(&path.join("runs").join(name)))
    };
    let (outcome, one) = search("1");
    let row = |k: usize, key: &str| number(&outcome["proof"][k][key]);
    assert_eq!(outcome["proof"][0]["worlds"], 24);
    // What is left and the robot's time, together.
    let worth = |k| row(k, "score") - 0.002 * row(k, "robot_s");
    assert!((1..4).all(|k| worth(0) > worth(k) + 0.02), "{outcome}");
    assert!(row(0, "worst_score") < row(0, "worst_quarter_score"));
    assert!(row(0, "worst_quarter_score") < row(0, "score"));
    let (_, three) = search("3");
    for name in ["best_sequence.json", "proof.json", "trajectory.json"] {
        assert!(one[name] == three[name], "{name}");
    }
    let run = "runs/moves-1";
    let proved = json(
        path,
        &[
            "eval",
            run,
            "--sequence",
            "--prove",
            "--episodes",
            "4",
            "--json",
        ],
    );
    assert_eq!(proved["sensitivity"].as_array().unwrap().len(), 2);
    let pictures = path.join(proved["pictures"].as_str().unwrap());
    assert!(pictures.join("sensitivity.png").exists());
    let exported = json(path, &["export", run, "--json"]);
    assert_eq!(exported["scatter"]["friction"], 0.2, "{exported}");
}

/// Two seeds draw other episodes; a family that is exhausted spends no more.
#[test]
fn seeds_differ_and_families_end() {
    let folder = folder();
    let path = folder.path();
    let best = |name: &str| fs::read(path.join("runs").join(name).join("best_sequence.json"));
    search(path, "random", "1", &["--steps", "200", "--seed", "1"]);
    search(path, "random", "2", &["--steps", "200", "--seed", "2"]);
    assert!(best("random-1").unwrap() != best("random-2").unwrap());
    let outcome = search(path, "sweep", "1", &["--steps", "100000"]);
    assert!(outcome["env_steps"].as_u64().unwrap() < 50_000);
}

#[test]
fn what_needs_a_policy_says_that_there_is_none() {
    let folder = folder();
    let path = folder.path();
    search(path, "sweep", "1", &["--steps", "400"]);
    for args in [
        &["eval", "runs/sweep-1"][..],
        &["export", "runs/sweep-1", "--checkpoint", "last"],
        &["train", "--resume", "runs/sweep-1"],
    ] {
        let words = ["runs/sweep-1 has no policy, as `drape baseline --policy sweep` made it"];
        assert_failure(&drape(path, args), 2, &words);
    }
    fs::remove_file(path.join("runs/sweep-1/proof.json")).unwrap();
    fs::remove_file(path.join("runs/sweep-1/best_sequence.json")).unwrap();
    let words = [
        "runs/sweep-1 has no best sequence, as",
        ": search again, for more steps",
    ];
    assert_failure(&drape(path, &["export", "runs/sweep-1"]), 2, &words);
    let again = [
        "baseline",
        "config.toml",
        "--policy",
        "sweep",
        "--name",
        "sweep-1",
    ];
    let words = ["already exists: choose another name, or remove the folder"];
    assert_failure(&drape(path, &again), 2, &words);
    let args = ["baseline", "config.toml", "--policy", "best"];
    assert_eq!(drape(path, &args).status.code(), Some(2));
    let args = ["baseline", "none.toml", "--policy", "random"];
    assert_failure(&drape(path, &args), 2, &["none.toml"]);
}

/// Points of a tool that `tool.pose` has moved come from one frame to the other by the pose in their
/// file, and each file says which it has.
#[test]
fn exports_have_the_frame_that_they_say() {
    let folder = folder();
    let path = folder.path();
    let pose = "[scene.tool.pose]\nrotation_deg = [0, 0, 180]\ntranslation_mm = [3, 4, 0.5]\n";
    fs::write(path.join("config.toml"), format!("{CONFIG}\n{pose}")).unwrap();
    let search = ["baseline", "config.toml", "--policy", "random", "--steps"];
    json(
        path,
        &[&search[..], &["200", "--name", "a", "--json"]].concat(),
    );
    let export = |frame: &str| {
        let args = ["export", "runs/a", "--out", "a.json", "--json", "--frame"];
        let report = json(path, &[&args[..], &[frame]].concat());
        assert_eq!(report["frame"], frame);
        let file = read_json(&path.join("a.json"));
        let words = file["conventions"]["frame"].as_str().unwrap();
        assert!(words.starts_with(frame), "{words}");
        file
    };
    let [tool, scene] = ["tool", "scene"].map(export);
    assert_eq!(tool, read_json(&path.join("runs/a/trajectory.json")));
    let [points, expected] = [&tool, &scene].map(|file| file["points"].as_array().unwrap());
    assert!(!points.is_empty() && points.len() == expected.len());
    for (point, expected) in points.iter().zip(expected) {
        for axis in 0..3 {
            let row = &tool["tool_pose"]["matrix"][axis];
            let turned = (0..3).map(|k| number(&row[k]) * number(&point["position"][k]));
            let found = turned.sum::<f64>() + number(&row[3]);
            assert!((found - number(&expected["position"][axis])).abs() < 1e-12);
        }
    }
}
