use std::fs;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

use super::Failure;
use drape_cloth::file::check_writable;

/// Prints `text` and a line break on stdout. A reader that has left early is no failure.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = io::stdout().lock();
    let written = writeln!(stdout, "{text}").and_then(|()| stdout.flush());
    match written {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => Ok(written.context("cannot write to standard output")?),
    }
}

/// Prints `value` as one JSON object on stdout. Numbers that are not finite become `null`.
pub(super) fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    print(&serde_json::to_string_pretty(value)?)
}

/// A folder to write to. What was made for it, folders above it included, and is still empty goes
/// with this.
pub(super) struct OutFolder {
    pub path: PathBuf,
    /// How many folders of the path, from its end, were made for it.
    pub made: usize,
}

impl OutFolder {
    /// Makes the folder where it is missing. For before the work: one that cannot be made would
    /// waste it.
    pub fn make(path: &Path) -> Result<Self, Failure> {
        let missing = |at: &&Path| !at.as_os_str().is_empty() && !at.exists();
        let folder = Self {
            path: path.to_path_buf(),
            made: path.ancestors().take_while(missing).count(),
        };
        std::fs::create_dir_all(path)
            .with_context(|| format!("cannot create folder {}", path.display()))?;
        Ok(folder)
    }
}

impl Drop for OutFolder {
    fn drop(&mut self) {
        for folder in self.path.ancestors().take(self.made) {
            // Fails where it is not empty, and then it shall stay.
            let _ = std::fs::remove_dir(folder);
        }
    }
}

/// Lets `write` write files into an empty folder, and moves them to `folder` when it has: what is
/// there stays whole until all of them are.
pub(super) fn write_together(
    folder: &Path,
    write: impl FnOnce(&Path) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let cannot = || format!("cannot write to {}", folder.display());
    let mut staged = tempfile::Builder::new();
    let staged = staged.prefix(".drape-").suffix(".tmp").tempdir_in(folder);
    let staged = staged.with_context(cannot)?;
    write(staged.path()).map_err(|failure| failure.moved_to(folder))?;
    let names = fs::read_dir(staged.path()).with_context(cannot)?;
    let names = names.map(|entry| entry.map(|entry| entry.file_name()));
    let names = names.collect::<Result<Vec<_>, _>>().with_context(cannot)?;
    for name in &names {
        check_writable(&folder.join(name))?;
    }
    for name in &names {
        let to = folder.join(name);
        let moved = fs::rename(staged.path().join(name), &to);
        moved.with_context(|| format!("cannot write {}", to.display()))?;
    }
    Ok(())
}

/// A bar on stderr for so many things, in the words of `template`. With `--json` it is hidden, so that
/// a program sees no control codes; indicatif hides it where nobody watches.
pub(super) fn bar(total: u64, template: &str, json: bool) -> ProgressBar {
    let style = ProgressStyle::with_template(template).expect("the template is valid");
    let target = if json {
        ProgressDrawTarget::hidden()
    } else {
        ProgressDrawTarget::stderr()
    };
    ProgressBar::with_draw_target(Some(total), target).with_style(style)
}

/// A bar on stderr that `0..=1` fills; hidden where nobody watches, and on demand.
pub(super) struct Progress(ProgressBar);

/// Steps of the bar: finer than a terminal is wide.
const STEPS: u64 = 1000;

impl Progress {
    /// Starts a bar. With `--json` it is hidden, so that a program sees no control codes.
    pub fn new(title: &'static str, json: bool) -> Self {
        let template = "{msg} [{bar:40}] {percent:>3} % {eta}";
        let bar = bar(STEPS, template, json || !io::stderr().is_terminal());
        Self(bar.with_message(title))
    }

    /// Shows the share that is done, 0 to 1.
    pub fn set(&self, share: f64) {
        self.0.set_position((share * STEPS as f64) as u64);
    }

    /// Shows the share that is done, and what is being done.
    pub fn tell(&self, share: f64, doing: &str) {
        self.set(share);
        self.0.set_message(doing.to_owned());
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
