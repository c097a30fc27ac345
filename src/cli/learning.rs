//! The trainings of `drape study learning`: each is a `drape train` of its own, whose run folder
//! tells what it has learnt.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context, anyhow};
use serde_json::Value;

use super::Failure;
use super::failure::OrInvalid;
use super::result::is_proved;
use super::setup::read_config;
use crate::run::{RunFolder, curve, read_metrics};
use drape_cloth::file::{check_name, read_text};
use drape_study::study::StudyError;
use drape_study::trainings::{LearnedRun, Trainings, Treatment};

/// One training of the study.
struct Training {
    config: Option<PathBuf>,
    seed: u64,
    /// Steps that it has to have.
    steps: u64,
    folder: PathBuf,
}

/// Trains what is not yet complete in the folder of the study, and reads all.
pub(super) fn train(
    options: &Trainings,
    out: &Path,
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Result<Vec<Treatment>, StudyError> {
    learnt(options, out, progress).map_err(|failure| match failure.is_input {
        true => StudyError::Invalid(failure.to_string()),
        false => StudyError::Damaged(failure.to_string().into()),
    })
}

fn learnt(
    options: &Trainings,
    out: &Path,
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Result<Vec<Treatment>, Failure> {
    // What configurations say wrong is refused before the first training.
    let configs: Vec<Option<&Path>> = match &*options.configs {
        [] => vec![None],
        configs => configs.iter().map(|path| Some(&**path)).collect(),
    };
    let (mut treatments, mut trainings, mut names) = (Vec::new(), Vec::new(), BTreeSet::new());
    for config in configs {
        let name = config.map_or("quickstart".into(), name_of);
        // Beside the folders of runs stand the files of the study.
        let end = Path::new(&name).extension().unwrap_or_default();
        let is_file = ["csv", "json", "md", "png"]
            .iter()
            .any(|of| end.eq_ignore_ascii_case(of));
        check_name(Path::new(&name))?;
        if is_file || Path::new(&name).file_name() != Some(name.as_ref()) {
            return Err(Failure::invalid(anyhow!(
                "a configuration is called `{name}`, expected the name of a folder that no file of the study has"
            )));
        }
        if !names.insert(name.clone()) {
            return Err(Failure::invalid(anyhow!(
                "two configurations are called `{name}`, expected different names of files"
            )));
        }
        trainings.extend(planned(options, config, &out.join(&name))?);
        let runs = Vec::new();
        treatments.push(Treatment { name, runs });
    }
    run_all(&trainings, options.jobs.into(), progress)?;
    for (treatment, trainings) in treatments
        .iter_mut()
        .zip(trainings.chunks(options.seeds.into()))
    {
        for training in trainings {
            treatment.runs.push(read(training)?);
        }
    }
    Ok(treatments)
}

fn name_of(config: &Path) -> String {
    let name = config.file_stem().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// The trainings of a configuration. A run that is there already must be one of them.
fn planned(
    options: &Trainings,
    path: Option<&Path>,
    folder: &Path,
) -> Result<Vec<Training>, Failure> {
    let (mut config, place) = read_config(path)?;
    config.steps = options.steps.unwrap_or(config.steps);
    // As a run keeps it.
    let steps = config.steps;
    config.keep_inputs().or_invalid_in(&place)?;
    let mut trainings = Vec::new();
    for seed in 1..=u64::from(options.seeds) {
        let folder = folder.join(format!("seed-{seed}"));
        config.seed = seed;
        if folder.exists() {
            let found = RunFolder::open(&folder).or_invalid()?;
            if read_text(&found.config).or_invalid()? != config.to_toml() {
                return Err(Failure::invalid(anyhow!(
                    "{}: trained with another configuration than {place} for seed {seed}: choose \
                     another folder",
                    found.path.display()
                )));
            }
        }
        trainings.push(Training {
            config: path.map(Path::to_path_buf),
            seed,
            steps,
            folder,
        });
    }
    Ok(trainings)
}

/// Runs `jobs` trainings at a time. None is begun after one that has failed.
fn run_all(
    trainings: &[Training],
    jobs: usize,
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Result<(), Failure> {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let failed = Mutex::new(None);
    let count = trainings.len();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let work = || {
        while failed.lock().expect("nobody panics with it").is_none()
            && let Some(training) = trainings.get(next.fetch_add(1, Ordering::Relaxed))
        {
            if let Err(failure) = complete(training, cores.div_ceil(jobs)) {
                *failed.lock().expect("nobody panics with it") = Some(failure);
            }
            let done = 1 + done.fetch_add(1, Ordering::Relaxed);
            progress(
                done as f64 / count as f64,
                &format!("{done} of {count} runs"),
            );
        }
    };
    progress(0.0, &format!("0 of {count} runs"));
    std::thread::scope(|scope| {
        for _ in 1..jobs.min(count) {
            // Where no thread can be started there is one less.
            let _ = std::thread::Builder::new().spawn_scoped(scope, work);
        }
        work();
    });
    let failed = failed.into_inner().expect("nobody panics with it");
    failed.map_or(Ok(()), Err)
}

/// Runs a training in a process of its own unless its run is complete already.
fn complete(training: &Training, threads: usize) -> Result<(), Failure> {
    let Training { folder, .. } = training;
    if is_complete(training)? {
        return Ok(());
    }
    let drape = std::env::current_exe().context("cannot find this program")?;
    let mut command = Command::new(drape);
    command.arg("train");
    if folder.exists() {
        command.args([option("resume", folder), "--json".into()]);
    } else {
        let treatment = folder
            .parent()
            .expect("it stands in the folder of its treatment");
        command.arg(option("runs", treatment));
        let values = [("seed", training.seed), ("steps", training.steps)];
        for (key, value) in values {
            command.args([format!("--{key}"), value.to_string()]);
        }
        command.args(["--name", &format!("seed-{}", training.seed), "--json"]);
        // Behind all options: its name may begin like one.
        command.arg("--").args(&training.config);
    }
    // Results are the same on any number of threads.
    if std::env::var_os("RAYON_NUM_THREADS").is_none() {
        command.env("RAYON_NUM_THREADS", threads.to_string());
    }
    command.stdin(Stdio::null());
    end_with_this(&mut command);
    let output = command.output().context("cannot start a training")?;
    let place = folder.display();
    if output.status.code() > Some(128) {
        return Err(anyhow!("{place}: interrupted; go on with `--resume`").into());
    }
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let last = said.lines().last().unwrap_or("ended without a word");
        let error = anyhow!("{place}: {}", last.trim_start_matches("error: "));
        return Err(match output.status.code() {
            Some(2) => Failure::invalid(error),
            _ => error.into(),
        });
    }
    let outcome: Value = serde_json::from_slice(&output.stdout)?;
    match outcome["complete"] == true {
        true => Ok(()),
        false => Err(anyhow!("{place}: not complete").into()),
    }
}

/// An option whose value may begin like one.
fn option(name: &str, value: &Path) -> OsString {
    let mut option = OsString::from(format!("--{name}="));
    option.push(value);
    option
}

/// Lets a training stop, as after Ctrl-C, when this process ends, however it ends.
fn end_with_this(command: &mut Command) {
    #[cfg(target_os = "linux")]
    {
        use std::os::unix::process::CommandExt;
        let own = std::process::id();
        // SAFETY: both may be called between fork and exec.
        unsafe {
            command.pre_exec(move || {
                libc::prctl(libc::PR_SET_PDEATHSIG, super::signals::ORPHANED);
                // It may have ended before.
                match libc::getppid() as u32 == own {
                    true => Ok(()),
                    false => Err(std::io::ErrorKind::Interrupted.into()),
                }
            })
        };
    }
    #[cfg(not(target_os = "linux"))]
    let _ = command;
}

/// Whether all steps are taken, and proved where there is something to be proved.
fn is_complete(training: &Training) -> Result<bool, Failure> {
    if !training.folder.exists() {
        return Ok(false);
    }
    let folder = RunFolder::open(&training.folder)?;
    // Drawn between the last step and the proof.
    let is_drawn = folder.pictures.join("reward.png").exists();
    let last = match is_drawn && (is_proved(&folder) || !folder.best_sequence.exists()) {
        true => read_metrics(&folder.metrics)?.pop(),
        false => None,
    };
    Ok(last.is_some_and(|line| line.step >= training.steps))
}

/// What the folder of a complete run tells.
fn read(training: &Training) -> Result<LearnedRun, Failure> {
    let folder = RunFolder::open(&training.folder)?;
    let metrics = read_metrics(&folder.metrics)?;
    let seconds: Vec<f64> = ["simulation", "inference", "update"]
        .iter()
        .flat_map(|name| curve(&metrics, &format!("seconds_{name}")))
        .map(|(_, seconds)| seconds)
        .collect();
    let proved = folder.read_proof()?;
    let undraped_inner = match &proved {
        None => None,
        Some(proved) => {
            let all: Value = serde_json::from_str(&read_text(&folder.proof)?)?;
            let rows = all["proof"].as_array();
            let of_paths =
                |row: &&Value| row["order"] == "path" && row["physics"] == proved.physics.name();
            rows.and_then(|rows| rows.iter().find(of_paths)?["undraped_inner"].as_f64())
        }
    };
    Ok(LearnedRun {
        seed: training.seed,
        mean: curve(&metrics, "mean_score"),
        greedy: curve(&metrics, "greedy_score"),
        best: curve(&metrics, "best_score"),
        explained_variance: curve(&metrics, "explained_variance"),
        proved: proved.map(|proved| proved.path.score),
        undraped_inner,
        seconds: (!seconds.is_empty()).then(|| seconds.iter().sum()),
    })
}
