use std::fs;
use std::io::{self, Write};
use std::path::{Component, Path, PathBuf};
use std::time::SystemTime;

use humantime::format_rfc3339_seconds;
use serde::{Deserialize, Serialize};

use drape_cloth::file::{WriteError, write_atomic};
use drape_task::env::ImageShape;

/// The folder of one run: `ROOT/NAME/`. Its layout is described in `runs/README.md`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunFolder {
    path: PathBuf,
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
        }
    }
}

/// `best_sequence.json`: the best episode ever seen, which can be replayed without the
/// network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BestSequence {
    /// Vertices in the order they were pressed, as the lamina counts them.
    pub vertices: Vec<u32>,
    /// Score of the episode; higher is better.
    pub score: f64,
    /// Rows and columns of the fabric's vertices.
    pub grid: ImageShape,
    /// [`config_digest`] of the configuration in which the sequence was found.
    pub config_digest: String,
}

/// A short name for a configuration text: `crc32:` and eight hexadecimal digits. Tells
/// different configurations apart; it is no protection against forgery.
pub fn config_digest(config: &str) -> String {
    format!("crc32:{:08x}", crc32fast::hash(config.as_bytes()))
}

/// Why a run folder could not be created, opened, read or written.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    #[error("{name:?} cannot name a run: expected one name of a folder")]
    Name { name: String },
    #[error(
        "run {} already exists: choose another name, resume it, or remove the folder",
        path.display()
    )]
    Exists { path: PathBuf },
    #[error("cannot create {}", path.display())]
    Create {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    #[error("there is no run {}", path.display())]
    Missing { path: PathBuf },
    #[error("{} is not a run folder: {reason}", path.display())]
    NotARun { path: PathBuf, reason: &'static str },
    #[error("cannot read {}", path.display())]
    Read {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    #[error("{} is damaged", path.display())]
    Json {
        path: PathBuf,
        #[source]
        source: serde_json::Error,
    },
    #[error("{} presses vertex {vertex}, expected one below {count}", path.display())]
    Vertex {
        path: PathBuf,
        vertex: u32,
        count: usize,
    },
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Makes an empty folder in `root` that is named after `prefix` and the minute of `now` (UTC),
/// as in `2026-11-21-0412`, or with `-2`, `-3`, ... where that is taken.
pub fn dated_folder(root: &Path, prefix: &str, now: SystemTime) -> Result<PathBuf, FolderError> {
    // To the minute, without colons, which no file name may have everywhere.
    let minute = &format_rfc3339_seconds(now).to_string()[..16];
    let base = prefix.to_owned() + &minute.replace('T', "-").replace(':', "");
    let numbered = (2..).map(|number| format!("{base}-{number}"));
    for name in std::iter::once(base.clone()).chain(numbered) {
        match new_folder(root, &name) {
            Err(FolderError::Exists { .. }) => {}
            outcome => return outcome,
        }
    }
    unreachable!("names do not run out")
}

fn new_folder(root: &Path, name: &str) -> Result<PathBuf, FolderError> {
    let path = root.join(name);
    let made = fs::create_dir_all(root).and_then(|()| fs::create_dir(&path));
    match made {
        Ok(()) => Ok(path),
        Err(source) if source.kind() == io::ErrorKind::AlreadyExists && root.is_dir() => {
            Err(FolderError::Exists { path })
        }
        Err(source) => Err(FolderError::Create { path, source }),
    }
}

impl RunFolder {
    /// Makes the folder of a new run, `root/name` or [`dated_folder`] without a name, and writes
    /// `config` (TOML, resolved) and `info` into it. Never touches an existing one; if it fails
    /// in the middle, what it made is removed.
    pub fn create(
        root: &Path,
        name: Option<&str>,
        config: &str,
        info: &RunInfo,
    ) -> Result<Self, FolderError> {
        let path = match name {
            None => dated_folder(root, "", SystemTime::now())?,
            Some(name) => {
                let mut parts = Path::new(name).components();
                match (parts.next(), parts.next()) {
                    (Some(Component::Normal(part)), None) if part == name => {}
                    _ => return Err(FolderError::Name { name: name.into() }),
                }
                new_folder(root, name)?
            }
        };
        let run = Self { path };
        run.fill(config, info).inspect_err(|_| {
            // The first failure is the one worth reporting.
            let _ = fs::remove_dir_all(&run.path);
        })?;
        Ok(run)
    }

    /// `run.json` comes last: a folder that has it is complete.
    fn fill(&self, config: &str, info: &RunInfo) -> Result<(), FolderError> {
        for path in [
            self.event_folder(),
            self.checkpoint_folder(),
            self.pictures(),
        ] {
            fs::create_dir(&path).map_err(|source| FolderError::Create { path, source })?;
        }
        write_atomic(&self.config(), |file| file.write_all(config.as_bytes()))?;
        write_json(&self.info(), info)
    }

    /// The existing run folder at `path`.
    pub fn open(path: &Path) -> Result<Self, FolderError> {
        let not_a_run = |reason| FolderError::NotARun {
            path: path.into(),
            reason,
        };
        let metadata = fs::metadata(path).map_err(|source| match source.kind() {
            io::ErrorKind::NotFound => FolderError::Missing { path: path.into() },
            _ => FolderError::Read {
                path: path.into(),
                source,
            },
        })?;
        if !metadata.is_dir() {
            return Err(not_a_run(
                "it is a file; give the folder that holds run.json",
            ));
        }
        let run = Self { path: path.into() };
        if !run.info().is_file() {
            return Err(not_a_run("it has no run.json"));
        }
        Ok(run)
    }

    /// The folder itself.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Resolved configuration.
    pub fn config(&self) -> PathBuf {
        self.path.join("config.toml")
    }

    /// What stands in [`RunFolder::config`].
    pub fn config_text(&self) -> Result<String, FolderError> {
        read(&self.config())
    }

    /// Where the run came from ([`RunInfo`]).
    pub fn info(&self) -> PathBuf {
        self.path.join("run.json")
    }

    /// One JSON object a line ([`super::MetricsWriter`]).
    pub fn metrics(&self) -> PathBuf {
        self.path.join("metrics.jsonl")
    }

    /// The TensorBoard file ([`super::EventWriter`]).
    pub fn events(&self) -> PathBuf {
        self.event_folder().join("events.out.tfevents.drape")
    }

    /// The checkpoint to resume from.
    pub fn last_checkpoint(&self) -> PathBuf {
        self.checkpoint_folder().join("last.drape")
    }

    /// The checkpoint that evaluated best.
    pub fn best_checkpoint(&self) -> PathBuf {
        self.checkpoint_folder().join("best.drape")
    }

    /// The best action sequence seen ([`BestSequence`]).
    pub fn best_sequence(&self) -> PathBuf {
        self.path.join("best_sequence.json")
    }

    /// Draping points of the best sequence ([`drape_task::path`]).
    pub fn trajectory(&self) -> PathBuf {
        self.path.join("trajectory.json")
    }

    /// Folder of pictures and films.
    pub fn pictures(&self) -> PathBuf {
        self.path.join("pictures")
    }

    fn event_folder(&self) -> PathBuf {
        self.path.join("events")
    }

    fn checkpoint_folder(&self) -> PathBuf {
        self.path.join("checkpoints")
    }

    /// Replaces the best sequence.
    pub fn write_best_sequence(&self, sequence: &BestSequence) -> Result<(), FolderError> {
        write_json(&self.best_sequence(), sequence)
    }

    /// Reads the best sequence and checks that its vertices are on its grid.
    pub fn read_best_sequence(&self) -> Result<BestSequence, FolderError> {
        let path = self.best_sequence();
        let json_error = |source| FolderError::Json {
            path: path.clone(),
            source,
        };
        let sequence: BestSequence = serde_json::from_str(&read(&path)?).map_err(json_error)?;
        let count = sequence.grid.pixel_count();
        let outside = sequence.vertices.iter().find(|&&v| v as usize >= count);
        match outside {
            None => Ok(sequence),
            Some(&vertex) => Err(FolderError::Vertex {
                path,
                vertex,
                count,
            }),
        }
    }
}

fn read(path: &Path) -> Result<String, FolderError> {
    fs::read_to_string(path).map_err(|source| FolderError::Read {
        path: path.into(),
        source,
    })
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<(), FolderError> {
    Ok(write_atomic(path, |file| {
        serde_json::to_writer_pretty(&mut *file, value)?;
        file.write_all(b"\n")
    })?)
}

#[cfg(test)]
mod tests {
    use super::*;
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
            config_digest: config_digest(CONFIG),
        }
    }

    #[test]
    fn created_folder_opens_and_gives_back_what_went_in() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path().join("runs");
        let created = RunFolder::create(&root, Some("a"), CONFIG, &info()).unwrap();
        let run = RunFolder::open(&root.join("a")).unwrap();
        assert_eq!(run, created);
        assert_eq!(fs::read_to_string(run.config()).unwrap(), CONFIG);
        let text = fs::read_to_string(run.info()).unwrap();
        assert_eq!(serde_json::from_str::<RunInfo>(&text).unwrap(), info());
        assert_eq!(info().created, "2026-11-21T04:12:09Z");
        for file in [run.events(), run.last_checkpoint(), run.best_checkpoint()] {
            assert!(file.parent().unwrap().is_dir(), "{}", file.display());
        }
        assert!(run.pictures().is_dir());
    }

    #[test]
    fn existing_run_is_refused_and_untouched() {
        let root = tempfile::tempdir().unwrap();
        RunFolder::create(root.path(), Some("a"), CONFIG, &info()).unwrap();
        let error = RunFolder::create(root.path(), Some("a"), "", &info()).unwrap_err();
        assert!(error.to_string().contains("choose another name"), "{error}");
        let run = RunFolder::open(&root.path().join("a")).unwrap();
        assert_eq!(fs::read_to_string(run.config()).unwrap(), CONFIG);
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
        for name in ["", ".", "..", "a/b", "a/", "./a", "/a"] {
            let error = RunFolder::create(root.path(), Some(name), CONFIG, &info()).unwrap_err();
            assert!(matches!(error, FolderError::Name { .. }), "{name}: {error}");
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
        let run = RunFolder::create(root.path(), Some("a"), CONFIG, &info()).unwrap();
        run.write_best_sequence(&sequence()).unwrap();
        assert_eq!(run.read_best_sequence().unwrap(), sequence());

        let text = fs::read_to_string(run.best_sequence()).unwrap();
        fs::write(run.best_sequence(), text.replace("5", "6")).unwrap();
        let error = run.read_best_sequence().unwrap_err();
        assert!(matches!(error, FolderError::Vertex { .. }), "{error}");
        fs::write(run.best_sequence(), &text[..text.len() / 2]).unwrap();
        let error = run.read_best_sequence().unwrap_err();
        assert!(matches!(error, FolderError::Json { .. }), "{error}");
    }
}
