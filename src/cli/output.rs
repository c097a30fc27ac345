use std::fmt;
use std::fs;
use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::{Context, anyhow};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use serde::Serialize;

use super::Failure;
use super::terminal::{is_json, show, tell, tells};
use crate::run::RunFolder;
use drape_cloth::file::{UNFINISHED, check_name, check_writable};
use drape_task::search::Searching;

/// A score, or a dash for none.
pub(super) fn percent(score: Option<f64>) -> String {
    score.map_or("-".into(), |score| format!("{:.2} %", 100.0 * score))
}

/// Prints what was found on stdout: with `--json` as one object, in which numbers that are not finite become
/// `null`, or else as `text` has it.
pub(super) fn print<R: Serialize>(
    found: &R,
    text: impl FnOnce(&R) -> String,
) -> Result<(), Failure> {
    let text = match is_json() {
        true => serde_json::to_string_pretty(found)?,
        false => text(found),
    };
    Ok(show(&text).context("cannot write to standard output")?)
}

/// Checks that files can be written, before the work, and that none of them is one that is read, or part of a run.
pub(super) fn check_outputs<'a>(
    outputs: impl IntoIterator<Item = &'a Path>,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    let same = |path: &Path| path.canonicalize().ok();
    let inputs: Vec<PathBuf> = inputs.into_iter().filter_map(same).collect();
    for output in outputs {
        check_writable(output)?;
        if let Some(run) = RunFolder::of(output) {
            return Err(Failure::invalid(anyhow!(
                "{} would be replaced, but the run {} needs it: expected another file to write to",
                output.display(),
                run.display()
            )));
        }
        if same(output).is_some_and(|output| inputs.contains(&output)) {
            return Err(Failure::invalid(anyhow!(
                "{} would be replaced, but is read: expected another file to write to",
                output.display()
            )));
        }
    }
    Ok(())
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
        check_name(path)?;
        let missing = |at: &&Path| !at.as_os_str().is_empty() && !at.exists();
        let folder = Self {
            path: path.to_path_buf(),
            made: path.ancestors().take_while(missing).count(),
        };
        let made = fs::create_dir_all(path);
        made.with_context(|| format!("cannot create folder {}", path.display()))?;
        Ok(folder)
    }
}

impl Drop for OutFolder {
    fn drop(&mut self) {
        for folder in self.path.ancestors().take(self.made) {
            // Fails where it is not empty, and then it shall stay.
            let _ = fs::remove_dir(folder);
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
    let staged = staged.prefix(UNFINISHED).suffix(".tmp").tempdir_in(folder);
    let staged = staged.with_context(cannot)?;
    write(staged.path()).map_err(|failure| failure.moved_to(folder))?;
    let files = fs::read_dir(staged.path()).and_then(|files| files.collect::<Result<Vec<_>, _>>());
    let files = files.with_context(cannot)?;
    for file in &files {
        check_writable(&folder.join(file.file_name()))?;
    }
    for file in &files {
        let to = folder.join(file.file_name());
        let moved = fs::rename(file.path(), &to);
        moved.with_context(|| format!("cannot write {}", to.display()))?;
    }
    Ok(())
}

/// Time between two lines about work that no terminal shows.
const INTERVAL: Duration = Duration::from_secs(10);

/// How far work is, on stderr: a bar on a terminal, and elsewhere a plain line every ten seconds.
/// With `--json` it is silent.
pub(super) struct Progress {
    bar: ProgressBar,
    /// Writes the lines until the sender is dropped.
    lines: Option<(Sender<()>, JoinHandle<()>)>,
}

/// Steps of a bar that `0..=1` fills: finer than a terminal is wide.
const STEPS: u64 = 1000;

impl Progress {
    /// Starts with nothing done of what is called `title`.
    pub fn new(title: &'static str) -> Self {
        let bar = ProgressBar::hidden().with_message(title).with_prefix(title);
        bar.set_length(STEPS);
        Self::start(bar, "{msg} [{bar:40}] {percent:>3} %{rest}", None)
    }

    /// Starts with `done` of `total` steps.
    pub fn of_steps(done: u64, total: u64) -> Self {
        let bar = ProgressBar::hidden().with_position(done);
        bar.set_length(total);
        let template = "{bar:24} {pos}/{len} steps{rest}; {msg}";
        Self::start(bar, template, Some(done))
    }

    fn start(bar: ProgressBar, template: &str, begun: Option<u64>) -> Self {
        let style = ProgressStyle::with_template(template).expect("the template is valid");
        let rest = move |state: &ProgressState, out: &mut dyn fmt::Write| {
            let steps = [state.pos(), state.len().unwrap_or(0)];
            let _ = out.write_str(&left(begun, steps, state.elapsed()));
        };
        bar.set_style(style.with_key("rest", rest));
        let mut lines = None;
        if tells() && io::stderr().is_terminal() {
            bar.set_draw_target(ProgressDrawTarget::stderr());
        } else if tells() {
            let bar = bar.clone();
            lines = every(INTERVAL, move || tell(line(&bar, begun)));
        }
        Self { bar, lines }
    }

    /// Shows the share that is done, 0 to 1.
    pub fn set(&self, share: f64) {
        self.bar.set_position((share * STEPS as f64) as u64);
    }

    /// Shows the share that is done, and what is being done.
    pub fn tell(&self, share: f64, doing: &str) {
        self.set(share);
        self.bar.set_message(doing.to_owned());
    }

    /// Shows the steps that are done, and what they have brought.
    pub fn step(&self, done: u64, brought: String) {
        self.bar.set_position(done);
        self.bar.set_message(brought);
    }

    /// Shows where a search by moves is, of which such a share is done.
    pub fn searching(&self, share: f64, at: Searching) {
        let best = at
            .best
            .map(|best| format!("worth of the best {}", percent(Some(best))));
        let best = best.unwrap_or("choosing where to begin".into());
        self.tell(share, &format!("{} presses, {best}", at.spent));
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
        if let Some((sender, writer)) = self.lines.take() {
            drop(sender);
            let _ = writer.join();
        }
    }
}

/// Calls `say` again and again, first after the `interval`, until the sender is dropped; never where no thread can
/// be started for it.
fn every(
    interval: Duration,
    mut say: impl FnMut() + Send + 'static,
) -> Option<(Sender<()>, JoinHandle<()>)> {
    let (sender, stopped) = mpsc::channel();
    let thread = std::thread::Builder::new().spawn(move || {
        while stopped.recv_timeout(interval) == Err(RecvTimeoutError::Timeout) {
            say();
        }
    });
    Some((sender, thread.ok()?))
}

/// As in `proof, proving at accurate: 35 %, 40 seconds left`, or where steps are counted, of which some had
/// `begun` it, in `12800/200000 steps, 1623 a second, 2 minutes left; score: ...`.
fn line(bar: &ProgressBar, begun: Option<u64>) -> String {
    let (done, total) = (bar.position(), bar.length().unwrap_or(0));
    let left = left(begun, [done, total], bar.elapsed());
    let (title, doing) = (bar.prefix(), bar.message());
    match begun {
        None if doing.is_empty() || doing == title => {
            format!("{title}: {} %{left}", 100 * done / total)
        }
        None => format!("{title}, {doing}: {} %{left}", 100 * done / total),
        Some(_) if doing.is_empty() => format!("{done}/{total} steps{left}"),
        Some(_) => format!("{done}/{total} steps{left}; {doing}"),
    }
}

/// What is left by the rate from the start on, which is told of steps: work comes in a few large parts, between
/// which the bar's own estimate grows without end.
fn left(begun: Option<u64>, [done, total]: [u64; 2], elapsed: Duration) -> String {
    let new = done.saturating_sub(begun.unwrap_or(0));
    let rest = total.saturating_sub(done);
    if new == 0 || begun.is_none() && rest == 0 {
        return String::new();
    }
    let rate = new as f64 / elapsed.as_secs_f64().max(1e-9);
    let rate = begun.map_or(String::new(), |_| format!(", {rate:.0} a second"));
    let rest = elapsed.mul_f64(rest as f64 / new as f64);
    format!("{rate}, {} left", HumanDuration(rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_of_a_share_follows_from_what_is_done() {
        let left = |done| left(None, [done, STEPS], Duration::from_secs(600));
        assert_eq!(left(800), ", 3 minutes left");
        assert_eq!([left(0), left(STEPS)], ["", ""]);
    }

    #[test]
    fn lines_come_until_the_work_ends() {
        let (said, heard) = mpsc::channel();
        let say = move || {
            let _ = said.send(());
        };
        let (sender, thread) = every(Duration::from_millis(1), say).unwrap();
        for _ in 0..3 {
            heard.recv().unwrap();
        }
        drop(sender);
        thread.join().unwrap();
        // Its end of the channel is gone.
        heard.iter().for_each(drop);
    }

    #[test]
    fn lines_say_how_far_the_work_is() {
        let proof = Progress::new("proof");
        proof.set(0.0);
        assert_eq!(line(&proof.bar, None), "proof: 0 %");
        proof.tell(0.35, "the twin's fall");
        let line = super::line(&proof.bar, None);
        assert!(line.starts_with("proof, the twin's fall: 35 %"), "{line}");
        let training = Progress::of_steps(100, 400);
        training.step(200, "score: 5 %".into());
        let line = super::line(&training.bar, Some(100));
        assert!(line.starts_with("200/400 steps, "), "{line}");
        assert!(line.ends_with(" left; score: 5 %"), "{line}");
        let left = |done| left(Some(100), [done, 400], Duration::from_secs(60));
        assert_eq!([left(100), left(200)], ["", ", 2 a second, 2 minutes left"]);
        assert!(training.lines.is_none());
    }
}
