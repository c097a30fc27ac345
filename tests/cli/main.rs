//! Runs the binary in temporary folders: what it prints and writes, and how it fails.

mod baseline;
mod bench;
mod blank;
mod calibrate;
mod changes;
mod compare;
mod damage;
mod eval;
mod field;
mod improve;
mod inp;
mod inputs;
mod learning;
mod plan;
mod robot;
mod run;
mod scan;
mod scene;
mod stack;
mod study;
mod tool;
mod train;
mod unheard;
mod unseen;

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn drape(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drape"));
    command.args(args).current_dir(folder).output().unwrap()
}

/// What a successful command printed on stdout; it must not print anything else.
fn stdout(folder: &Path, args: &[&str]) -> String {
    let output = drape(folder, args);
    let stderr = said(output.stderr);
    assert!(output.status.success(), "{args:?}: {stderr}");
    assert_eq!(stderr, "", "{args:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// What a command said on stderr, but for lines about how far it is: whether there are any depends
/// on how fast the machine is.
fn said(stderr: Vec<u8>) -> String {
    let stderr = String::from_utf8(stderr).unwrap();
    let is_progress =
        |line: &str| line.contains(" steps, ") || line.ends_with(" %") || line.ends_with(" left");
    let lines = stderr.lines().filter(|line| !is_progress(line));
    lines.map(|line| line.to_owned() + "\n").collect()
}

fn json(folder: &Path, args: &[&str]) -> Value {
    let text = stdout(folder, args);
    let value: Value = serde_json::from_str(&text).unwrap();
    assert!(value.is_object(), "{text}");
    value
}

/// Checks that a command failed with `code`, no output and one line that holds all of
/// `words`.
fn assert_failure(output: &Output, code: i32, words: &[&str]) {
    let stderr = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(code), "{stderr}");
    assert!(output.stdout.is_empty(), "{stderr}");
    assert!(
        stderr.starts_with("error: ") && stderr.ends_with('\n'),
        "{stderr:?}"
    );
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    for word in words {
        assert!(stderr.contains(word), "no `{word}` in {stderr}");
    }
    assert!(!stderr.contains("panicked"), "{stderr}");
}

/// Names of all files in `folder`, sorted.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let name = |entry: fs::DirEntry| entry.file_name().into_string().unwrap();
    let mut names: Vec<String> = entries.map(|entry| name(entry.unwrap())).collect();
    names.sort();
    names
}

/// A coarse scene that takes some milliseconds, with `tool` as its table of the tool.
fn scene(tool: &str) -> String {
    format!(
        "[blank]\nvertices = [17, 17]\n\
         [fall]\nfall_s = 0.2\nsettle_s = 0.5\nsubstep_rate = 1200\n\
         [[clamps]]\nat_mm = [0, -185]\n\
         [tool.grid]\nspacing_mm = 8\n{tool}"
    )
}

const RIB: &str = "[tool.source.shape]\nkind = \"rib\"\n";

/// Writes `text` as the scene file of `folder` and sets it up.
fn set_up(folder: &Path, text: &str) -> Output {
    fs::write(folder.join("scene.toml"), text).unwrap();
    drape(folder, &["scene", "scene.toml", "--out", "out", "--json"])
}

#[test]
fn help_version_and_missing_commands() {
    let folder = folder();
    assert_eq!(
        stdout(folder.path(), &["--version"]),
        concat!("drape ", env!("CARGO_PKG_VERSION"), "\n")
    );
    let bash = stdout(folder.path(), &["completions", "bash"]);
    for command in ["train", "view", "calibrate"] {
        assert!(bash.contains(&format!("drape__subcmd__{command}")));
        let page = stdout(folder.path(), &["man", command]);
        assert!(
            page.contains(".SH OPTIONS") && page.contains("Examples:"),
            "{page}"
        );
    }
    assert!(stdout(folder.path(), &["man"]).contains("drape\\-calibrate"));
    let output = drape(folder.path(), &["man", "cut"]);
    assert_eq!(output.status.code(), Some(2));
    for args in [&["--help"][..], &["tool", "--help"], &["scene", "--help"]] {
        assert!(stdout(folder.path(), args).contains("Usage: drape"));
    }
    for args in [
        &[][..],
        &["cut"],
        &["tool", "cube", "--out", "a"],
        &["tool", "rib"],
        &["scene"],
    ] {
        let output = drape(folder.path(), args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(
            output.stdout.is_empty() && !output.stderr.is_empty(),
            "{args:?}"
        );
    }
    assert_eq!(names(folder.path()), [""; 0]);
}

/// Runs drape where no file may grow beyond 51 200 bytes.
#[cfg(unix)]
fn drape_on_full_disk(folder: &Path, args: &[&str]) -> Output {
    drape_with_limit(100, folder, args)
}

/// Runs drape where no file may grow beyond so many blocks of 512 bytes.
#[cfg(unix)]
fn drape_with_limit(blocks: u32, folder: &Path, args: &[&str]) -> Output {
    let script = format!("ulimit -f {blocks}; exec \"$0\" \"$@\"");
    let mut command = Command::new("sh");
    command.args(["-c", &script, env!("CARGO_BIN_EXE_drape")]);
    command.args(args).current_dir(folder).output().unwrap()
}

#[cfg(unix)]
#[test]
fn full_disk_leaves_whole_files_only() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("a.stl"), "old").unwrap();
    let output = drape_on_full_disk(path, &["tool", "rib", "--out", "a.stl"]);
    assert_failure(&output, 1, &["cannot write a.stl: File too large"]);
    assert_eq!(fs::read(path.join("a.stl")).unwrap(), b"old");
    assert_eq!(names(path), ["a.stl"]);

    // The tool is larger than the lamina, which is written before it.
    fs::write(path.join("scene.toml"), scene(RIB)).unwrap();
    let args = ["scene", "scene.toml", "--out", "out", "--json"];
    let output = drape_on_full_disk(path, &args);
    let words = ["cannot write out/tool.stl: File too large"];
    assert_failure(&output, 1, &words);
    assert!(!path.join("out").exists());
    fs::create_dir(path.join("out")).unwrap();
    fs::write(path.join("out/lamina.stl"), "old").unwrap();
    assert_failure(&drape_on_full_disk(path, &args), 1, &words);
    assert_eq!(names(&path.join("out")), ["lamina.stl"]);
    assert_eq!(fs::read(path.join("out/lamina.stl")).unwrap(), b"old");
}

#[cfg(target_os = "linux")]
#[test]
fn stdout_that_takes_nothing_is_a_failure_but_a_closed_pipe_is_none() {
    let folder = folder();
    let command = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drape"));
        command
            .args(["tool", "plate", "--out", "a.stl"])
            .current_dir(folder.path());
        command.stderr(Stdio::piped());
        command
    };
    let full = fs::OpenOptions::new()
        .write(true)
        .open("/dev/full")
        .unwrap();
    let output = command().stdout(full).output().unwrap();
    assert_failure(
        &output,
        1,
        &["cannot write to standard output: No space left"],
    );

    let mut child = command().stdout(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "");
    assert!(output.status.success());
}
