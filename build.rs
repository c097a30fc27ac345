//! Tells drape the commit that it is built from, for the run folders.

use std::path::Path;
use std::process::Command;

fn main() {
    // Grows with every commit and checkout. Named only where it exists: cargo takes a missing
    // file for a changed one.
    let log = ".git/logs/HEAD";
    println!("cargo::rerun-if-changed=build.rs");
    if Path::new(log).exists() {
        println!("cargo::rerun-if-changed={log}");
    }
    let mut git = Command::new("git");
    let output = git.args(["rev-parse", "--short=12", "HEAD"]).output();
    // Outside a checkout, or without git, the commit stays unknown.
    if let Some(output) = output.ok().filter(|output| output.status.success()) {
        let commit = String::from_utf8_lossy(&output.stdout);
        println!("cargo::rustc-env=DRAPE_COMMIT={}", commit.trim());
    }
}
