//! A tiny but real training, and what its run folder holds.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::Child;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use super::*;

/// A coarse rib and a short fall. An iteration takes 80 environment steps and some 30 ms, an
/// episode about 25 presses.
pub const CONFIG: &str = r#"
seed = 3
steps = 240
environments = 4
evaluation_interval = 1
proof_paths = 4

[env]
objective = "distance"
region_mm = [-186.0, -186.0, -80.0, -80.0]

[ppo]
rollout_steps = 20
minibatch_size = 40
epochs = 2

[scene.blank]
vertices = [17, 17]

[scene.fall]
fall_s = 0.2
settle_s = 0.6
substep_rate = 1200

[[scene.clamps]]
at_mm = [-185.0, -185.0]
move_mm = [24.0, 0.0, 0.0]

[[scene.clamps]]
at_mm = [0.0, -185.0]

[scene.tool.source.shape]
kind = "rib"

[scene.tool.grid]
spacing_mm = 8
"#;

/// What a complete run leaves, sorted.
pub const FILES: [&str; 17] = [
    ".lock",
    "best_sequence.json",
    "checkpoints/best.drape",
    "checkpoints/last.drape",
    "config.toml",
    "events/events.out.tfevents.drape",
    "metrics.jsonl",
    "pictures/after.png",
    "pictures/before.png",
    "pictures/crushed.png",
    "pictures/path.png",
    "pictures/recording.drape",
    "pictures/reward.png",
    "pictures/rollout.gif",
    "proof.json",
    "run.json",
    "trajectory.json",
];

/// What the learner has found, without times.
pub const LEARNT: [&str; 4] = [
    "checkpoints/last.drape",
    "checkpoints/best.drape",
    "best_sequence.json",
    "proof.json",
];

pub type Files = BTreeMap<String, Vec<u8>>;

/// All files below `folder` with their content, by path.
pub fn files(folder: &Path) -> Files {
    let mut files = Files::new();
    for name in names(folder) {
        let path = folder.join(&name);
        if path.is_dir() {
            let inner = self::files(&path).into_iter();
            files.extend(inner.map(|(below, bytes)| (format!("{name}/{below}"), bytes)));
        } else {
            files.insert(name, fs::read(path).unwrap());
        }
    }
    files
}

/// A folder with a complete run of [`CONFIG`] in `runs/a`, trained once for all tests.
pub fn trained() -> TempDir {
    static TRAINED: OnceLock<Files> = OnceLock::new();
    let files = TRAINED.get_or_init(|| {
        let folder = folder();
        train(folder.path(), CONFIG, "a");
        files(&folder.path().join("runs/a"))
    });
    let folder = folder();
    write_files(&folder.path().join("runs/a"), files);
    folder
}

/// Writes what [`files`] has read.
pub fn write_files(folder: &Path, files: &Files) {
    for (name, bytes) in files {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
}

/// Trains `config` to the end in `runs/NAME`.
pub fn train(folder: &Path, config: &str, name: &str) -> Value {
    fs::write(folder.join("config.toml"), config).unwrap();
    json(folder, &["train", "config.toml", "--name", name, "--json"])
}

/// Trains `config` where it must fail, and gives what it printed.
pub fn refused(folder: &Path, config: &str) -> Output {
    fs::write(folder.join("config.toml"), config).unwrap();
    drape(folder, &["train", "config.toml", "--name", "a", "--json"])
}

pub fn read_json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// The lines of the metrics file, times taken out.
pub fn metrics(run: &Path) -> Vec<Value> {
    let text = fs::read_to_string(run.join("metrics.jsonl")).unwrap();
    assert!(text.ends_with('\n'));
    let line = |line: &str| {
        let mut value: Value = serde_json::from_str(line).unwrap();
        let object = value.as_object_mut().unwrap();
        object.retain(|key, _| key != "wall_time" && !key.starts_with("seconds_"));
        value
    };
    text.lines().map(line).collect()
}

pub fn steps(metrics: &[Value]) -> Vec<u64> {
    let step = |line: &Value| line["step"].as_u64().unwrap();
    metrics.iter().map(step).collect()
}

pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

/// Starts a training of `config` in `runs/NAME` and sends `signal` once `count` lines of
/// metrics are written.
#[cfg(unix)]
pub fn interrupted(
    folder: &Path,
    config: &str,
    name: &str,
    signal: &str,
    count: usize,
) -> (PathBuf, Output) {
    fs::write(folder.join("config.toml"), config).unwrap();
    let run = folder.join("runs").join(name);
    let mut command = Command::new(env!("CARGO_BIN_EXE_drape"));
    command.args(["train", "config.toml", "--name", name, "--json"]);
    let mut child = begun(command.current_dir(folder), &[]);
    wait_for_lines(&run, count);
    assert_eq!(child.try_wait().unwrap(), None, "ended by itself");
    send(signal, child.id());
    (run, child.wait_with_output().unwrap())
}

/// A command in which these signals are ignored and all others are not, whatever they are here.
#[cfg(unix)]
pub fn begun(command: &mut Command, ignored: &[libc::c_int]) -> Child {
    use std::os::unix::process::CommandExt;
    let signals = [
        libc::SIGINT,
        libc::SIGTERM,
        libc::SIGHUP,
        libc::SIGUSR1,
        libc::SIGUSR2,
    ];
    let act = |signal| match ignored.contains(&signal) {
        true => libc::SIG_IGN,
        false => libc::SIG_DFL,
    };
    let actions = signals.map(|signal| (signal, act(signal)));
    // SAFETY: `signal` may be called between fork and exec.
    unsafe {
        command.pre_exec(move || {
            let _ = actions.map(|(signal, action)| libc::signal(signal, action));
            Ok(())
        })
    };
    let piped = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    piped.spawn().unwrap()
}

/// Waits until a run has written so many lines of metrics.
pub fn wait_for_lines(run: &Path, count: usize) {
    let start = Instant::now();
    let lines = || {
        let written = fs::read(run.join("metrics.jsonl")).ok()?;
        Some(written.iter().filter(|&&byte| byte == b'\n').count())
    };
    while lines().is_none_or(|found| found < count) {
        assert!(start.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[cfg(unix)]
pub fn send(signal: &str, process: u32) {
    let script = format!("kill -{signal} {process}");
    let status = Command::new("sh").args(["-c", &script]).status();
    assert!(status.unwrap().success());
}
