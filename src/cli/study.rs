use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime};

use anyhow::anyhow;
use clap::Subcommand;
use serde_json::{Value, json};

use super::Failure;
use super::failure::{OrInvalid, study_failure};
use super::learning;
use super::output::{OutFolder, Progress, print, write_together};
use super::terminal::{Told, note};
use crate::run::{BestSequence, RunConfig, RunFolder, dated_folder};
use drape_cloth::file::{WriteError, check_writable, read_text, write_atomic};
use drape_report::replace_tables;
use drape_study::episodes::Episodes;
use drape_study::judge::Judging;
use drape_study::learning::Learning;
use drape_study::stability::Stability;
use drape_study::study::{Context, KeptPaths, Report, Study, StudyError, TrainedPath};
use drape_study::tradeoff::Tradeoff;
use drape_study::twin::TwinStudy;
use drape_study::verify::Verify;

/// Measure the simulator itself
#[derive(Debug, clap::Args)]
pub struct StudyArgs {
    #[command(subcommand)]
    study: Name,
}

#[derive(Debug, Subcommand)]
enum Name {
    Episodes(Measure<Episodes>),
    Learning(Measure<Learning>),
    Stability(Measure<Stability>),
    Tradeoff(Measure<Tradeoff>),
    Verify(Measure<Verify>),
    Twin(Measure<TwinStudy>),
    Judge(Measure<Judging>),
}

/// Runs `drape study`.
pub fn run(args: StudyArgs) -> Result<(), Failure> {
    let prefix = Some("study-");
    match args.study {
        Name::Episodes(study) => study.run(prefix),
        Name::Learning(study) => study.run(prefix),
        Name::Stability(study) => study.run(prefix),
        Name::Tradeoff(study) => study.run(prefix),
        Name::Verify(study) => study.run(prefix),
        Name::Twin(study) => study.run(prefix),
        Name::Judge(study) => study.run(prefix),
    }
}

// A study and where its report goes. No doc comment: it would be the command's.
#[derive(Debug, clap::Args)]
pub struct Measure<S: clap::Args> {
    #[command(flatten)]
    study: S,

    /// Folder for the tables (CSV, Markdown, JSON) and pictures; files of an earlier study in it
    /// are replaced. Of `drape study` runs/study-NAME-DATE if not given
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,

    /// Markdown file in which what stands between `<!-- table STUDY.TABLE -->` and `<!-- end -->`
    /// is replaced by the table of this name, for all tables of the study that have a place there;
    /// `STUDY.TABLE: COLUMN, COLUMN` has these columns only
    #[arg(long, value_name = "FILE.md")]
    into: Option<PathBuf>,
}

impl<S: clap::Args + Study> Measure<S> {
    /// Runs the study, writes what it has found and prints it. Without `--out` it writes to a
    /// dated folder whose name begins with `prefix`, if there is one.
    pub fn run(self, prefix: Option<&str>) -> Result<(), Failure> {
        // What would make the work useless is found before it.
        if let Some(path) = &self.into {
            replaced::<S>(path, |_, _| Ok(String::new()))?;
            check_writable(path)?;
        }
        if let Some(path) = self.study.resumed().filter(|path| !path.is_dir()) {
            let error = anyhow!("there is no folder {}", path.display());
            return Err(Failure::invalid(error));
        }
        let out = match (self.study.resumed().or(self.out.as_deref()), prefix) {
            (Some(path), _) => Some(OutFolder::make(path)?),
            (None, Some(prefix)) => {
                let runs = Path::new("runs");
                let made = if runs.exists() { 1 } else { 2 };
                let prefix = format!("{prefix}{}-", S::NAME);
                let path = dated_folder(runs, &prefix, SystemTime::now())?;
                Some(OutFolder { path, made })
            }
            (None, None) => None,
        };
        let start = Instant::now();
        let progress = Progress::new(S::NAME);
        let told = |share: f64, doing: &str| progress.tell(share, doing);
        let found = self.study.run(&Context {
            progress: &told,
            read_task: &|path| {
                let (_, RunConfig { scene, env, .. }) = read_config(path)?;
                let run = path.display();
                note(format_args!(
                    "using the scene and the focus region of {run}, not what it has learnt"
                ));
                Ok((scene, env))
            },
            read_run: &read_run,
            read_kept: &read_kept,
            train: &|options| {
                let out = out.as_ref().expect("a study of the command has a folder");
                learning::train(options, &out.path, &told)
            },
        });
        drop(progress);
        let place = self.study.scene().map(|scene| scene.place());
        let report = found.map_err(|error| study_failure(error, place))?;
        let seconds = start.elapsed().as_secs_f64();

        let folder = out.as_ref().map(|out| &*out.path);
        let all = object(S::NAME, &report, seconds, folder);
        if let Some(folder) = folder {
            write_together(folder, |folder| write(&report, S::NAME, &all, folder))?;
        }
        if let Some(path) = &self.into {
            let text = replaced::<S>(path, |name, columns| {
                let table = report.tables.iter().find(|table| table.name == name);
                let missing = || format!("there is no table `{name}` without its option");
                table.ok_or_else(missing)?.markdown(columns)
            })?;
            write_atomic(path, |file| file.write_all(text.as_bytes()))?;
        }
        print(&all, |_| {
            let shown = report.tables.iter().filter(|table| !table.is_hidden());
            let mut parts: Vec<String> = shown.map(|table| table.text() + "\n").collect();
            parts.extend(report.notes);
            parts.push(match folder {
                Some(folder) => format!("{seconds:.0} s; files in {}", folder.display()),
                None => format!("{seconds:.0} s"),
            });
            parts.join("\n")
        })
    }
}

/// All that was found: what `--json` prints.
fn object(name: &str, report: &Report, seconds: f64, out: Option<&Path>) -> Value {
    let mut all = report.facts.clone();
    let tables = report.tables.iter();
    all.extend(tables.map(|table| (table.name.into(), table.json())));
    let files: Vec<&str> = report.files.iter().map(|(name, _)| &**name).collect();
    all.insert("study".into(), name.into());
    all.insert("seconds".into(), seconds.into());
    all.insert("out".into(), json!(out.map(Told::from)));
    all.insert("files".into(), json!(out.map(|_| files)));
    all.into()
}

/// Writes each table as CSV, those for readers as Markdown, all as JSON, and the report's own
/// files.
fn write(report: &Report, name: &str, all: &Value, folder: &Path) -> Result<(), Failure> {
    let text = |name: String, text: String| {
        write_atomic(&folder.join(name), |file| file.write_all(text.as_bytes()))
    };
    let mut markdown = String::new();
    for table in &report.tables {
        text(format!("{}.csv", table.name), table.csv())?;
        if !table.is_hidden() {
            let text = table.markdown(&[]).map_err(|message| anyhow!(message))?;
            markdown += &format!("{}\n\n{text}\n\n", table.title);
        }
    }
    markdown += &(report.notes.join("\n") + "\n");
    text(format!("{name}.md"), markdown)?;
    let json = serde_json::to_string_pretty(all)? + "\n";
    text(format!("{name}.json"), json)?;
    for (name, write) in &report.files {
        write(&folder.join(name)).map_err(|error| match error.downcast::<WriteError>() {
            Ok(error) => anyhow::Error::new(*error),
            Err(error) => anyhow!(error),
        })?;
    }
    Ok(())
}

/// The document with `content` in the places of the study's tables.
fn replaced<S: Study>(
    path: &Path,
    content: impl Fn(&str, &[&str]) -> Result<String, String>,
) -> Result<String, Failure> {
    let text = read_text(path).or_invalid()?;
    let new = replace_tables(&text, S::NAME, S::TABLES, content);
    new.map_err(|message| Failure::invalid(anyhow!("{}: {message}", path.display())))
}

/// A run folder with its configuration.
fn read_config(path: &Path) -> Result<(RunFolder, RunConfig), StudyError> {
    let unread = |error: anyhow::Error| StudyError::Read(error.into());
    let folder = RunFolder::open(path).map_err(unread)?;
    let config = RunConfig::read(&folder.config).map_err(unread)?;
    Ok((folder, config))
}

/// A path that a run folder has, which is refused where its configuration has changed since.
fn checked(
    folder: &RunFolder,
    best: BestSequence,
    place: &Path,
) -> Result<BestSequence, StudyError> {
    let digest = folder.config_digest();
    let digest = digest.map_err(|error| StudyError::Read(error.into()))?;
    let fault = |fault| StudyError::Invalid(format!("{}: {fault}", place.display()));
    best.check_config(&digest).map_err(fault)?;
    Ok(best)
}

/// The path of a run folder, proved or before that its best sequence.
fn read_run(path: &Path) -> Result<TrainedPath, StudyError> {
    let damaged = |error: anyhow::Error| StudyError::Damaged(error.into());
    let (folder, RunConfig { scene, env, .. }) = read_config(path)?;
    let (best, place) = match folder.read_proof().map_err(damaged)? {
        Some(proved) => (proved.path, &folder.proof),
        None => {
            let best = folder.read_best_sequence().map_err(damaged)?;
            (best, &folder.best_sequence)
        }
    };
    Ok(TrainedPath {
        scene,
        env,
        vertices: checked(&folder, best, place)?.vertices,
    })
}

/// All paths that a run folder has kept, the proved one first.
fn read_kept(path: &Path) -> Result<KeptPaths, StudyError> {
    let damaged = |error: anyhow::Error| StudyError::Damaged(error.into());
    let (folder, config) = read_config(path)?;
    let best = folder.read_best_sequence().map_err(damaged)?;
    let best = checked(&folder, best, &folder.best_sequence)?;
    let mut lists: Vec<Vec<u32>> = best.all().cloned().collect();
    if let Some(proved) = folder.read_proof().map_err(damaged)? {
        let proved = checked(&folder, proved.path, &folder.proof)?.vertices;
        lists.retain(|list| *list != proved);
        lists.insert(0, proved);
    }
    let RunConfig {
        scene,
        env,
        scatter,
        ..
    } = config;
    Ok(KeptPaths {
        scene,
        env,
        scatter,
        lists,
    })
}
