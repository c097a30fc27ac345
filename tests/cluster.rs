//! A training by processes that `mpirun` has started, with the real binary.
#![cfg(feature = "cluster")]

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

const CONFIG: &str = r#"
preset = "compact"
steps = 600
search = 0
polish = 0
proof_paths = 1
environments = 5
ppo = { rollout_steps = 20 }

[env]
region_mm = [-131.0, -131.0, 0.0, 0.0]
stencil_mm = 40.0

[scene]
tool = { source = { shape = { kind = "hemisphere", radius_mm = 75.0 } }, grid = { spacing_mm = 4.0 } }
blank = { size_mm = [260.0, 260.0], vertices = [17, 17], mass = "datasheet" }
placement = { height_mm = 80.0, tilt_deg = 0.0 }
"#;

/// `drape` in so many processes, whatever the number of cores, each with one thread.
fn drape(folder: &Path, size: usize, args: &[&str]) -> Command {
    let mut command = Command::new("mpirun");
    command.args(["--oversubscribe", "--bind-to", "none", "-n"]);
    command.arg(size.to_string());
    command.arg(env!("CARGO_BIN_EXE_drape")).args(args);
    for (name, value) in [
        ("OMPI_ALLOW_RUN_AS_ROOT", "1"),
        ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"),
        ("RAYON_NUM_THREADS", "1"),
    ] {
        command.env(name, value);
    }
    command.current_dir(folder);
    command
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.toml"), CONFIG).unwrap();
    folder
}

fn train(folder: &Path, size: usize, name: &str, more: &[&str]) -> Vec<u8> {
    let args = [&["train", "a.toml", "--name", name, "--json"], more].concat();
    let output = drape(folder, size, &args).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    // One process reports.
    let stdout = String::from_utf8(output.stdout).unwrap();
    serde_json::from_str::<serde_json::Value>(&stdout).expect(&stdout);
    checkpoint(folder, name)
}

fn checkpoint(folder: &Path, name: &str) -> Vec<u8> {
    fs::read(folder.join(format!("runs/{name}/checkpoints/last.drape"))).unwrap()
}

/// All that an iteration is told by, but for the time it took.
fn metrics(folder: &Path, name: &str) -> Vec<serde_json::Map<String, serde_json::Value>> {
    let text = fs::read_to_string(folder.join("runs").join(name).join("metrics.jsonl")).unwrap();
    let lines = text.lines().map(|line| {
        let mut line: serde_json::Map<_, _> = serde_json::from_str(line).unwrap();
        line.retain(|key, _| !key.starts_with("seconds") && key != "wall_time");
        line
    });
    lines.collect()
}

#[test]
fn processes_repeat_their_bits_and_learn_what_one_does() {
    let folder = folder();
    let folder = folder.path();
    train(folder, 1, "one", &[]);
    let several = train(folder, 3, "several", &[]);
    assert!(train(folder, 3, "again", &[]) == several);
    assert_eq!(metrics(folder, "again"), metrics(folder, "several"));
    // The first rollout is the same to the bit, its update within the order of sums.
    let [one, several] = ["one", "several"].map(|name| metrics(folder, name).swap_remove(0));
    for (key, found) in &several {
        let [a, b] = [&one[key], found].map(|value| value.as_f64().unwrap());
        assert!((a - b).abs() <= 2e-3 * a.abs().max(0.1), "{key}: {a} {b}");
    }
    assert_eq!(one["mean_score"], several["mean_score"]);
}

#[test]
fn one_that_is_killed_ends_all_and_any_number_goes_on() {
    let folder = folder();
    let folder = folder.path();
    let long = ["train", "a.toml", "--name", "killed", "--steps", "1000000"];
    let mut all = drape(folder, 2, &long);
    let mut all = all
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let deadline = Instant::now() + Duration::from_secs(300);
    let wait = |what: &str| {
        assert!(Instant::now() < deadline, "{what}");
        sleep(Duration::from_millis(50));
    };
    while metrics_length(folder) == 0 {
        wait("the training does not begin");
    }
    // The youngest child of mpirun is the last process.
    let children = format!("/proc/{0}/task/{0}/children", all.id());
    let children = fs::read_to_string(children).unwrap();
    let last = children.split_whitespace().next_back().unwrap();
    assert!(
        Command::new("kill")
            .args(["-9", last])
            .status()
            .unwrap()
            .success()
    );
    while all.try_wait().unwrap().is_none() {
        wait("the others go on");
    }
    let output = all.wait_with_output().unwrap();
    assert!(!output.status.success());
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(stderr.contains("signal 9"), "{stderr}");

    // A process of another number goes on from the last checkpoint, here the one before the first rollout
    // or later; a configuration that asks for less would be complete.
    let resume = ["train", "--resume", "runs/killed"];
    let mut one = drape(folder, 3, &resume);
    let mut one = one
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let before = checkpoint(folder, "killed");
    while checkpoint(folder, "killed") == before {
        wait("nothing goes on");
        assert!(one.try_wait().unwrap().is_none(), "resuming fails");
    }
    // It stops them all, which a killed one would not.
    let one_id = one.id().to_string();
    assert!(Command::new("kill").arg(one_id).status().unwrap().success());
    while one.try_wait().unwrap().is_none() {
        wait("a request to stop stops nothing");
    }
}

fn metrics_length(folder: &Path) -> u64 {
    fs::metadata(folder.join("runs/killed/metrics.jsonl")).map_or(0, |file| file.len())
}

#[test]
fn what_is_wrong_is_said_and_ends_all() {
    let folder = folder();
    let folder = folder.path();
    let fails = |size: usize, args: &[&str], expected: &str, code: i32| {
        let output = drape(folder, size, args).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(stderr.contains(expected), "{stderr}");
        assert_eq!(output.status.code(), Some(code), "{stderr}");
    };
    fails(
        2,
        &["train", "none.toml"],
        "error: cannot read none.toml",
        2,
    );
    let few = CONFIG.replace(
        "rollout_steps = 20",
        "rollout_steps = 20, minibatch_size = 1",
    );
    fs::write(folder.join("few.toml"), few).unwrap();
    let expected = "`ppo.minibatch_size` is 1, expected at least 2, one sample a process";
    fails(2, &["train", "few.toml"], expected, 2);
    assert!(!folder.join("runs").exists());
}
