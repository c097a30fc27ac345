//! The one place that writes to stdout and stderr. Nobody need be there to read: a reader that has gone away, a
//! full disk under a log and a closed terminal end no work.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Serialize, Serializer};

/// Says something on stderr, in one line.
pub(super) fn tell(line: impl Display) {
    let line = visible(&line.to_string()).replace('\n', "\\u000a");
    let _ = writeln!(io::stderr(), "{line}");
}

/// What `--json` has said, once for the process: how results are printed.
static IS_JSON: AtomicBool = AtomicBool::new(false);
/// Whether anybody is told how far work is. A library is silent.
static TELLS: AtomicBool = AtomicBool::new(false);

/// Results are printed as text, and stderr tells how far work is, or as JSON while that is silent.
pub(super) fn set_json(is_json: bool) {
    IS_JSON.store(is_json, Ordering::Relaxed);
    TELLS.store(!is_json, Ordering::Relaxed);
}

/// From now on warnings and errors only, as from all processes of a cluster but the first.
pub(super) fn hush() {
    TELLS.store(false, Ordering::Relaxed);
}

pub(super) fn is_json() -> bool {
    IS_JSON.load(Ordering::Relaxed)
}

pub(super) fn tells() -> bool {
    TELLS.load(Ordering::Relaxed)
}

/// A line on stderr about what is being done.
pub(super) fn note(line: impl Display) {
    if tells() {
        tell(line);
    }
}

/// Prints results on stdout. A reader that has left early is no failure.
pub(super) fn show(text: &str) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    match writeln!(stdout, "{}", visible(text)).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

/// A path that is told. JSON has no place for what in it is no Unicode, which is replaced.
#[derive(Clone, Debug)]
pub(super) struct Told(PathBuf);

impl<P: AsRef<Path>> From<P> for Told {
    fn from(path: P) -> Self {
        Self(path.as_ref().into())
    }
}

impl Deref for Told {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

impl Serialize for Told {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&self.0.display())
    }
}

/// A text in which a terminal finds nothing to obey but line breaks, escaped so that JSON stays the same.
fn visible(text: &str) -> String {
    let shown = |c: char| match c.is_control() && c != '\n' {
        true => format!("\\u{:04x}", u32::from(c)),
        false => c.into(),
    };
    text.chars().map(shown).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped_and_json_stays_the_same() {
        let name = "a\u{1b}[31m\u{7f}\u{9b}2J\nü";
        assert_eq!(visible(name), "a\\u001b[31m\\u007f\\u009b2J\nü");
        let json = serde_json::to_string_pretty(&[name]).unwrap();
        let shown = visible(&json);
        assert!(!shown.contains(|c: char| c.is_control() && c != '\n'));
        assert_eq!(serde_json::from_str::<[String; 1]>(&shown).unwrap(), [name]);
    }
}
