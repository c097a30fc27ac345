use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use anyhow::{Context, Result, bail};
use humantime::format_rfc3339_seconds;
use serde::{Deserialize, Serialize};

use super::best::BestSequence;
use super::changes::fixed;
use drape_cloth::file::{
    UNFINISHED, check_name, read_json, read_text, remove_temporaries, write_atomic,
};
use drape_proof::{Physics, Row};

/// The folder of one run: `ROOT/NAME/`. Its layout is described in `runs/README.md`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunFolder {
    /// The folder itself.
    pub path: PathBuf,
    /// Resolved configuration.
    pub config: PathBuf,
    /// Where the run came from ([`RunInfo`]).
    pub info: PathBuf,
    /// One JSON object a line.
    pub metrics: PathBuf,
    /// The TensorBoard file.
    pub events: PathBuf,
    /// The checkpoint to resume from, and the one that evaluated best.
    pub last_checkpoint: PathBuf,
    pub best_checkpoint: PathBuf,
    /// The best action sequence seen ([`BestSequence`]).
    pub best_sequence: PathBuf,
    /// What [`Proved`] says.
    pub proof: PathBuf,
    /// Draping points of the proved path ([`drape_task::path`]).
    pub trajectory: PathBuf,
    /// Folder of pictures, films and recordings.
    pub pictures: PathBuf,
    /// The proved path as it was pressed ([`drape_task::recording`]).
    pub recording: PathBuf,
}

/// `run.json`: where a run came from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunInfo {
    /// Seed of all random streams of the run.
    pub seed: u64,
    /// Version of drape.
    pub version: String,
    /// Commit drape was built from; unknown if it was not built in a checkout.
    pub commit: Option<String>,
    /// Architecture and operating system, for example `x86_64-linux`.
    pub platform: String,
    /// UTC, ISO 8601.
    pub created: String,
    /// What `drape baseline` searched with, or `improve` or `plan` after the command; a training has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<String>,
    /// [`Weights::digest`](super::Weights::digest) of the policy that it began from, if it did from one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub policy: Option<String>,
}

impl RunInfo {
    /// Describes this drape and the moment `now`.
    pub fn new(seed: u64, now: SystemTime) -> Self {
        use std::env::consts::{ARCH, OS};
        Self {
            seed,
            version: env!("CARGO_PKG_VERSION").into(),
            commit: option_env!("DRAPE_COMMIT").map(Into::into),
            platform: format!("{ARCH}-{OS}"),
            created: format_rfc3339_seconds(now).to_string(),
            search: None,
            policy: None,
        }
    }
}

/// `proof.json`: the best of the best sequences in the finest physics that they were played in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Proved {
    /// Where it is the best.
    pub physics: Physics,
    /// Its score there.
    pub path: BestSequence,
    /// What it is held against; for people, nothing reads it back.
    #[serde(skip_deserializing)]
    pub proof: Vec<Row>,
}

/// A short name for a configuration or another file: `crc32:` and eight hexadecimal digits. Tells
/// different ones apart; it is no protection against forgery.
pub fn digest(content: impl AsRef<[u8]>) -> String {
    format!("crc32:{:08x}", crc32fast::hash(content.as_ref()))
}

/// A file that a run is made from: path in the folder of the run, and content.
pub type Input = (PathBuf, Vec<u8>);

/// A run that cannot be made, or not be written to.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    #[error(
        "{0:?} cannot name a run: expected one name of a folder, without control characters, that does not \
         begin with `{UNFINISHED}`"
    )]
    Name(String),
    #[error("{} is in use: another drape writes into it", .0.display())]
    InUse(PathBuf),
    /// A training can be resumed, what was searched cannot.
    #[error("run {} already exists: choose another name, {_1}or remove the folder", .0.display())]
    Taken(PathBuf, &'static str),
    #[error(
        "{} has no policy, as `drape {_1}` made it; what it has is its best path (eval --sequence)",
        .0.display()
    )]
    Searched(PathBuf, String),
    /// A checkpoint of another run, or of one whose configuration was edited.
    #[error("{}: written for another configuration than {}", .0.display(), .1.display())]
    OtherConfig(PathBuf, PathBuf),
}

/// `prefix` and the minute of `now` (UTC), as in `2026-11-21-0412`, then with `-2`, `-3`, ...
fn dated_names(prefix: &str, now: SystemTime) -> impl Iterator<Item = String> {
    // To the minute, without colons, which no file name may have everywhere.
    let minute = &format_rfc3339_seconds(now).to_string()[..16];
    let base = prefix.to_owned() + &minute.replace('T', "-").replace(':', "");
    let first = std::iter::once(base.clone());
    first.chain((2..).map(move |number| format!("{base}-{number}")))
}

/// Makes an empty folder in `root` that is named after `prefix` and the minute of `now`, with a
/// number where that is taken.
pub fn dated_folder(root: &Path, prefix: &str, now: SystemTime) -> Result<PathBuf> {
    fs::create_dir_all(root).with_context(|| cannot_create(root))?;
    for name in dated_names(prefix, now) {
        let path = root.join(name);
        match fs::create_dir(&path) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            made => {
                made.with_context(|| cannot_create(&path))?;
                return Ok(path);
            }
        }
    }
    unreachable!("names do not run out")
}

fn cannot_create(path: &Path) -> String {
    format!("cannot create {}", path.display())
}

/// End of the name of a run that is [`UNFINISHED`].
const NEW: &str = ".new";

/// An unfinished run this old was left by a drape that was killed: making one takes no second.
const STALE: Duration = Duration::from_secs(3600);

/// Removes what is left of unfinished runs in `root`, as far as that is possible.
fn remove_stale(root: &Path) {
    for entry in fs::read_dir(root).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let modified = entry.metadata().and_then(|found| found.modified()).ok();
        let age = modified.and_then(|then| then.elapsed().ok());
        if name.starts_with(UNFINISHED) && name.ends_with(NEW) && age > Some(STALE) {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

/// Moves a folder to a name that nothing has; false where something has it.
fn moved(from: &Path, to: &Path) -> io::Result<bool> {
    use io::ErrorKind::{AlreadyExists, DirectoryNotEmpty, NotADirectory};
    if fs::symlink_metadata(to).is_ok() {
        return Ok(false);
    }
    match fs::rename(from, to) {
        // Made by another since.
        Err(error) if [AlreadyExists, DirectoryNotEmpty, NotADirectory].contains(&error.kind()) => {
            Ok(false)
        }
        moved => moved.map(|()| true),
    }
}

/// Folders in that of a run; the first is all that a search has.
const FOLDERS: [&str; 3] = ["pictures", "events", "checkpoints"];

impl RunFolder {
    fn at(path: PathBuf) -> Self {
        Self {
            config: path.join("config.toml"),
            info: path.join("run.json"),
            metrics: path.join("metrics.jsonl"),
            events: path.join("events/events.out.tfevents.drape"),
            last_checkpoint: path.join("checkpoints/last.drape"),
            best_checkpoint: path.join("checkpoints/best.drape"),
            best_sequence: path.join("best_sequence.json"),
            proof: path.join("proof.json"),
            trajectory: path.join("trajectory.json"),
            pictures: path.join("pictures"),
            recording: path.join("pictures/recording.drape"),
            path,
        }
    }

    /// The run that the file at `path` is a part of: one that a run is gone on with or read from, in whose place nothing
    /// else may be written.
    pub fn of(path: &Path) -> Option<PathBuf> {
        // It need not be there yet.
        let new = || {
            Some(
                path.parent()?
                    .join(".")
                    .canonicalize()
                    .ok()?
                    .join(path.file_name()?),
            )
        };
        let path = path.canonicalize().ok().or_else(new)?;
        let mut folders = path.ancestors().skip(1).take(2);
        let run = folders.find(|folder| Self::at(folder.into()).info.is_file())?;
        let own = Self::at(run.into());
        let parts = [
            &own.config,
            &own.info,
            &own.metrics,
            &own.best_sequence,
            &own.proof,
            &own.recording,
            &run.join("demonstrations.json"),
            &run.join("loop.json"),
            &run.join("robot/cell.toml"),
        ];
        let folders = ["checkpoints", "events", "inputs"].map(|name| run.join(name));
        let is_part =
            parts.contains(&&path) || folders.iter().any(|folder| path.starts_with(folder));
        is_part.then(|| run.into())
    }

    /// Makes the folder of a new run, `root/name`, or named by the minute without a name, with
    /// `config` (TOML, resolved), the `inputs` it is read with and `info` in it. It appears whole or
    /// not at all, and never in place of another.
    pub fn create(
        root: &Path,
        name: Option<&str>,
        config: &str,
        inputs: &[Input],
        info: &RunInfo,
    ) -> Result<Self> {
        let search = info.search.as_deref();
        Self::check_free(root, name, search)?;
        let names: Box<dyn Iterator<Item = String>> = match name {
            None => Box::new(dated_names("", SystemTime::now())),
            Some(name) => Box::new(std::iter::once(name.into())),
        };
        check_name(root)?;
        fs::create_dir_all(root).with_context(|| cannot_create(root))?;
        remove_stale(root);
        let mut unfinished = tempfile::Builder::new();
        unfinished.prefix(UNFINISHED).suffix(NEW);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // Without this the folder would stay its owner's alone.
            unfinished.permissions(fs::Permissions::from_mode(0o777));
        }
        let unfinished = unfinished.tempdir_in(root);
        let unfinished = unfinished.with_context(|| cannot_create(root))?;
        let filled = Self::at(unfinished.path().into()).fill(config, inputs, info);
        filled.with_context(|| cannot_create(&root.join(name.unwrap_or_default())))?;
        let mut last = root.into();
        for name in names {
            let path = root.join(name);
            if moved(unfinished.path(), &path).with_context(|| cannot_create(&path))? {
                let _ = unfinished.keep();
                return Ok(Self::at(path));
            }
            last = path;
        }
        bail!(Self::taken(last, search))
    }

    /// Whether a run that `search` fills, or else a training, can be given this name: what [`RunFolder::create`] asks again
    /// after the work.
    pub fn check_free(root: &Path, name: Option<&str>, search: Option<&str>) -> Result<()> {
        let Some(name) = name else { return Ok(()) };
        let is_name = Path::new(name).file_name() == Some(name.as_ref())
            && !name.starts_with(UNFINISHED)
            && !name.contains(char::is_control);
        if !is_name {
            bail!(RunError::Name(name.into()));
        }
        let path = root.join(name);
        match path.symlink_metadata() {
            Ok(_) => bail!(Self::taken(path, search)),
            Err(_) => Ok(()),
        }
    }

    fn taken(path: PathBuf, search: Option<&str>) -> RunError {
        let other = Self::open(&path).and_then(|other| other.check_trained());
        let is_resumed = search.is_none() && other.is_ok();
        RunError::Taken(path, if is_resumed { "resume it, " } else { "" })
    }

    fn fill(&self, config: &str, inputs: &[Input], info: &RunInfo) -> Result<()> {
        let has_all = info.search.is_none();
        self.make_folders(if has_all { &FOLDERS } else { &FOLDERS[..1] })?;
        for (path, content) in inputs {
            let path = self.path.join(path);
            let folder = path.parent().expect("an input stands in a folder");
            fs::create_dir_all(folder).with_context(|| cannot_create(folder))?;
            write_atomic(&path, |file| file.write_all(content))?;
        }
        write_atomic(&self.config, |file| file.write_all(config.as_bytes()))?;
        write_json(&self.info, info)
    }

    /// Makes those of these folders in it that are missing.
    fn make_folders(&self, names: &[&str]) -> Result<()> {
        for name in names {
            let path = self.path.join(name);
            fs::create_dir_all(&path).with_context(|| cannot_create(&path))?;
        }
        Ok(())
    }

    /// Keeps other processes from writing into the run until the file that it gives is closed or this
    /// process ends, however it ends. What a killed one left behind goes, and folders that are missing
    /// are made.
    pub fn lock(&self) -> Result<File> {
        let path = self.path.join(".lock");
        let mut options = OpenOptions::new();
        let file = options.create(true).truncate(false).write(true).open(&path);
        let file = file.with_context(|| cannot_create(&path))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => bail!(RunError::InUse(self.path.clone())),
            // Where the file system has no locks, as on some network drives.
            Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => {}
            locked => locked.with_context(|| format!("cannot lock {}", path.display()))?,
        }
        let has_all = self.check_trained().is_ok();
        self.make_folders(if has_all { &FOLDERS } else { &FOLDERS[..1] })?;
        for folder in std::iter::once("").chain(FOLDERS) {
            remove_temporaries(&self.path.join(folder));
        }
        Ok(file)
    }

    /// The existing run folder at `path`.
    pub fn open(path: &Path) -> Result<Self> {
        let shown = path.display();
        let exists = path.try_exists();
        if !exists.with_context(|| format!("cannot read {shown}"))? {
            bail!("there is no run {shown}");
        }
        if path.is_file() {
            bail!("{shown} is not a run folder: it is a file; give the folder that holds run.json");
        }
        let run = Self::at(path.into());
        if !run.info.is_file() {
            bail!("{shown} is not a run folder: it has no run.json");
        }
        Ok(run)
    }

    /// Where it came from; none if the file is damaged.
    pub fn read_info(&self) -> Option<RunInfo> {
        read_json(&self.info, "what tells of a run").ok()
    }

    /// Refuses a run that was never trained, but searched.
    pub fn check_trained(&self) -> Result<()> {
        match self.read_info().and_then(|info| info.search) {
            None => Ok(()),
            Some(name) => {
                let is_command = matches!(&*name, "improve" | "plan");
                let command = ["baseline --policy ", ""][usize::from(is_command)];
                bail!(RunError::Searched(
                    self.path.clone(),
                    command.to_owned() + &name
                ))
            }
        }
    }

    /// [`digest`] of what may not change in [`RunFolder::config`], see [`changed`](super::changed).
    pub fn config_digest(&self) -> Result<String> {
        Ok(digest(fixed(&read_text(&self.config)?, &self.config)?))
    }

    /// Replaces the configuration by one that says the same but for what may change.
    pub fn write_config(&self, text: &str) -> Result<()> {
        Ok(write_atomic(&self.config, |file| {
            file.write_all(text.as_bytes())
        })?)
    }

    /// Replaces the best sequence.
    pub fn write_best_sequence(&self, sequence: &BestSequence) -> Result<()> {
        write_json(&self.best_sequence, sequence)
    }

    /// Reads the best sequence and checks that it and the others have vertices and that they are
    /// on its grid.
    pub fn read_best_sequence(&self) -> Result<BestSequence> {
        let path = &self.best_sequence;
        let sequence: BestSequence = read_json(path, "a best path")?;
        sequence.check_vertices(path)?;
        Ok(sequence)
    }

    /// Replaces the proof, which it gives back.
    pub fn write_proof(&self, proved: Proved) -> Result<Proved> {
        write_json(&self.proof, &proved).map(|()| proved)
    }

    /// Reads the proof, if there is one, and checks its path as the best sequence is checked.
    pub fn read_proof(&self) -> Result<Option<Proved>> {
        let path = &self.proof;
        let cannot = || format!("cannot read {}", path.display());
        if !path.try_exists().with_context(cannot)? {
            return Ok(None);
        }
        let proved: Proved = read_json(path, "a proof")?;
        proved.path.check_vertices(path)?;
        Ok(Some(proved))
    }
}

pub(super) fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    Ok(write_atomic(path, |file| {
        serde_json::to_writer_pretty(&mut *file, value)?;
        file.write_all(b"\n")
    })?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::best::Scored;
    use drape_task::env::ImageShape;
    use std::time::Duration;

    const CONFIG: &str = "[train]\nseed = 7\n";

    fn now() -> SystemTime {
        SystemTime::UNIX_EPOCH + Duration::from_secs(1_795_234_329)
    }

    fn info() -> RunInfo {
        RunInfo::new(u64::MAX, now())
    }

    fn sequence() -> BestSequence {
        BestSequence {
            vertices: vec![5, 0, 5],
            score: 0.75,
            grid: ImageShape {
                rows: 2,
                columns: 3,
            },
            config_digest: digest(CONFIG),
            others: vec![Scored {
                vertices: vec![3],
                score: 0.5,
            }],
        }
    }

    #[test]
    fn created_folder_opens_and_gives_back_what_went_in() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path().join("runs");
        let created = RunFolder::create(&root, Some("a"), CONFIG, &[], &info()).unwrap();
        let run = RunFolder::open(&root.join("a")).unwrap();
        assert_eq!(run, created);
        assert_eq!(fs::read_to_string(&run.config).unwrap(), CONFIG);
        let text = fs::read_to_string(&run.info).unwrap();
        assert_eq!(serde_json::from_str::<RunInfo>(&text).unwrap(), info());
        assert_eq!(info().created, "2026-11-21T04:12:09Z");
        for file in [run.events, run.last_checkpoint, run.best_checkpoint] {
            assert!(file.parent().unwrap().is_dir(), "{}", file.display());
        }
        assert!(run.pictures.is_dir());
    }

    /// A run is written to by one process, and what killed ones left behind goes.
    #[test]
    fn lock_is_held_by_one_and_tidies_up() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path();
        let [old, new] = [".drape-a.new", ".drape-b.new"].map(|name| root.join(name));
        for folder in [&old, &new] {
            fs::create_dir(folder).unwrap();
            fs::write(folder.join("config.toml"), "").unwrap();
        }
        let before = SystemTime::now() - 2 * STALE;
        File::open(&old).unwrap().set_modified(before).unwrap();
        let run = RunFolder::create(root, Some("a"), CONFIG, &[], &info()).unwrap();
        assert!(!old.exists() && new.exists());

        let temporary = run.path.join("checkpoints/.drape-a.tmp");
        fs::write(&temporary, "").unwrap();
        let staged = run.pictures.join(".drape-b.tmp");
        fs::create_dir(&staged).unwrap();
        fs::write(staged.join("before.png"), "").unwrap();
        fs::write(&run.last_checkpoint, "").unwrap();
        fs::remove_dir(run.events.parent().unwrap()).unwrap();
        let lock = run.lock().unwrap();
        assert!(!temporary.exists() && run.last_checkpoint.exists());
        assert!(!staged.exists() && run.events.parent().unwrap().is_dir());
        let error = run.lock().unwrap_err();
        assert!(
            matches!(error.downcast_ref(), Some(RunError::InUse(_))),
            "{error}"
        );
        drop(lock);
        run.lock().unwrap();
    }

    #[test]
    fn existing_run_is_refused_and_untouched() {
        let root = tempfile::tempdir().unwrap();
        RunFolder::create(root.path(), Some("a"), CONFIG, &[], &info()).unwrap();
        let error = RunFolder::create(root.path(), Some("a"), "", &[], &info()).unwrap_err();
        assert!(error.to_string().contains("choose another name"), "{error}");
        let run = RunFolder::open(&root.path().join("a")).unwrap();
        assert_eq!(fs::read_to_string(&run.config).unwrap(), CONFIG);
    }

    #[test]
    fn dated_names_count_up_where_taken() {
        let root = tempfile::tempdir().unwrap();
        for expected in ["2026-11-21-0412", "2026-11-21-0412-2", "2026-11-21-0412-3"] {
            let path = dated_folder(root.path(), "", now()).unwrap();
            assert_eq!(path, root.path().join(expected));
        }
    }

    #[test]
    fn names_that_leave_the_root_are_refused() {
        let root = tempfile::tempdir().unwrap();
        for name in [
            "",
            ".",
            "..",
            "a/b",
            "a/",
            "./a",
            "/a",
            ".drape-q.new",
            "a\u{1b}b",
        ] {
            let error =
                RunFolder::create(root.path(), Some(name), CONFIG, &[], &info()).unwrap_err();
            assert!(error.is::<RunError>(), "{name}: {error}");
        }
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0);
    }

    #[test]
    fn what_is_no_run_folder_is_refused_with_the_reason() {
        let root = tempfile::tempdir().unwrap();
        let open = |path: &Path| RunFolder::open(path).unwrap_err().to_string();
        assert!(open(&root.path().join("none")).starts_with("there is no run"));
        assert!(open(root.path()).ends_with("is not a run folder: it has no run.json"));
        let file = root.path().join("file");
        fs::write(&file, "").unwrap();
        assert!(open(&file).ends_with("it is a file; give the folder that holds run.json"));
    }

    #[test]
    fn best_sequence_round_trips_and_damage_is_located() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::create(root.path(), Some("a"), CONFIG, &[], &info()).unwrap();
        run.write_best_sequence(&sequence()).unwrap();
        assert_eq!(run.read_best_sequence().unwrap(), sequence());

        let text = fs::read_to_string(&run.best_sequence).unwrap();
        fs::write(&run.best_sequence, text.replace("5", "6")).unwrap();
        let error = run.read_best_sequence().unwrap_err();
        assert!(
            error
                .to_string()
                .ends_with("presses vertex 6, expected one below 6")
        );
        fs::write(&run.best_sequence, &text[..text.len() / 2]).unwrap();
        let error = run.read_best_sequence().unwrap_err();
        assert!(
            error.to_string().contains("not a best path: EOF"),
            "{error}"
        );
    }
}
