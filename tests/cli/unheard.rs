//! Commands that nobody hears, signals, and names that a terminal would obey.
#![cfg(unix)]

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;

use super::run::*;
use super::*;

fn command(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drape"));
    command.args(args).current_dir(folder);
    command
}

/// A training and a search come to their end whatever becomes of stderr and of stdout.
#[cfg(target_os = "linux")]
#[test]
fn work_does_not_end_where_nobody_reads() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("config.toml"), CONFIG).unwrap();
    let train = ["train", "config.toml", "--name"];
    let search = [
        "baseline",
        "config.toml",
        "--policy",
        "sweep",
        "--steps",
        "200",
        "--name",
    ];
    for (name, args) in [("t", &train[..]), ("s", &search)] {
        for is_full in [true, false] {
            let run = format!("{name}{is_full}");
            let mut command = command(path, &[args, &[&run]].concat());
            let mut child = match is_full {
                true => {
                    let full = fs::OpenOptions::new().write(true).open("/dev/full");
                    let full: Stdio = full.unwrap().into();
                    command.stdout(Stdio::piped()).stderr(full).spawn().unwrap()
                }
                false => command
                    .stdout(Stdio::piped())
                    .stderr(Stdio::piped())
                    .spawn()
                    .unwrap(),
            };
            // Nobody reads what is said, or what is printed.
            drop((child.stderr.take(), child.stdout.take()));
            assert_eq!(child.wait().unwrap().code(), Some(0), "{run}");
            assert!(
                path.join("runs").join(&run).join("proof.json").exists(),
                "{run}"
            );
        }
    }
}

#[test]
fn signals_write_checkpoints_and_stop_unless_they_are_ignored() {
    let folder = folder();
    let path = folder.path();
    let config = CONFIG.replace("steps = 240", "steps = 1000000");
    fs::write(path.join("config.toml"), config).unwrap();
    let train = |name: &str, ignored: &[libc::c_int]| {
        let args = ["train", "config.toml", "--json", "--name", name];
        let child = begun(&mut command(path, &args), ignored);
        let run = path.join("runs").join(name);
        wait_for_lines(&run, 1);
        (child, run)
    };
    // What was ignored stays so.
    let (child, run) = train("a", &[libc::SIGHUP, libc::SIGINT]);
    for signal in ["HUP", "INT", "USR1", "USR2"] {
        let before = metrics(&run).len();
        send(signal, child.id());
        wait_for_lines(&run, before + 2);
    }
    send("TERM", child.id());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(143));
    let outcome: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(outcome["complete"], false);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        stderr.matches("checkpoint written after").count(),
        2,
        "{stderr}"
    );
    assert_eq!(stderr.matches("stopping").count(), 1, "{stderr}");

    let (child, run) = train("b", &[]);
    let checkpoint = run.join("checkpoints/last.drape");
    let before = fs::read(&checkpoint).unwrap();
    send("USR1", child.id());
    let start = std::time::Instant::now();
    while fs::read(&checkpoint).unwrap() == before {
        assert!(start.elapsed().as_secs() < 60);
    }
    // A terminal that closes sends it more than once.
    send("HUP", child.id());
    send("HUP", child.id());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(129));
    assert!(serde_json::from_slice::<Value>(&output.stdout).is_ok());

    let args = [
        "baseline",
        "config.toml",
        "--policy",
        "random",
        "--json",
        "--name",
        "c",
    ];
    let child = begun(&mut command(path, &args), &[]);
    let best = path.join("runs/c/best_sequence.json");
    while !best.exists() {
        assert!(start.elapsed().as_secs() < 60);
    }
    send("INT", child.id());
    assert_eq!(child.wait_with_output().unwrap().status.code(), Some(130));
    assert!(stdout(path, &["--help"]).contains("130 interrupted"));
}

#[test]
fn names_say_nothing_to_a_terminal_and_need_be_no_unicode() {
    let folder = folder();
    let path = folder.path();
    let output = drape(path, &["scene", "a\u{1b}[31m\u{9b}.toml", "--out", "o"]);
    assert_failure(&output, 2, &["cannot read a\\u001b[31m\\u009b.toml"]);
    let text = stdout(path, &["tool", "plate", "--out", "\u{1b}[2J.stl"]);
    assert!(text.starts_with("\\u001b[2J.stl: 9 vertices"), "{text}");

    fs::write(path.join("config.toml"), CONFIG).unwrap();
    fs::write(path.join("scene.toml"), scene(RIB)).unwrap();
    // What has a name of something unfinished would not stay.
    for args in [
        &["scene", "--out", ".drape-x.new"][..],
        &["scene", "--out", ".drape-x.new/a"],
        &["tool", "plate", "--out", "a/.drape-x.tmp"],
        &["train", "config.toml", "--json", "--runs", ".drape-x.new"],
    ] {
        let found = args[args.len() - 1];
        let words = format!("cannot write {found}: it has a name that begins with `.drape-`");
        assert_failure(&drape(path, args), 2, &[&words]);
    }
    let name = OsStr::from_bytes(b"r\xff");
    let told = |args: &[&str], option: &str| {
        let mut command = command(path, args);
        command.arg(option).arg(name);
        let output = command.output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{stderr}");
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let outcome = told(&["train", "config.toml", "--json", "--name", "a"], "--runs");
    assert_eq!(outcome["run"], "r\u{fffd}/a");
    let report = told(
        &["study", "episodes", "scene.toml", "--count", "1", "--json"],
        "--out",
    );
    assert_eq!(report["out"], "r\u{fffd}");
}

#[test]
fn threads_that_cannot_be_started_are_told() {
    let folder = folder();
    let script = "ulimit -v 4000000; RAYON_NUM_THREADS=20000 exec \"$0\" tool plate --out a.stl";
    let mut command = Command::new("sh");
    command
        .args(["-c", script, env!("CARGO_BIN_EXE_drape")])
        .current_dir(&folder);
    // Rust's library aborts, by chance, where a thread that has been started finds no memory for its signals.
    let is_ours = |output: &Output| !said(output.stderr.clone()).contains("alternative stack");
    let mut outputs = (0..20).map(|_| command.output().unwrap());
    let output = outputs.find(is_ours).expect("threads fail to start");
    let words = ["cannot start threads: ", "RAYON_NUM_THREADS"];
    assert_failure(&output, 1, &words);
}
