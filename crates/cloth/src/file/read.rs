use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Why a file could not be used.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    #[error("cannot read {}", path.display())]
    Io { path: PathBuf, source: io::Error },
    /// What it says makes no sense: at a `place` such as `:3` (a line) or `:3:13` (and a column),
    /// which count from 1, or as a whole.
    #[error("{}{place}: {fault}", path.display())]
    Fault {
        path: PathBuf,
        place: String,
        fault: String,
    },
}

impl ReadError {
    /// The file at `path` as a whole makes no sense.
    pub fn fault(path: &Path, fault: impl ToString) -> Self {
        Self::Fault {
            path: path.into(),
            place: String::new(),
            fault: fault.to_string(),
        }
    }
}

/// The bytes of the file at `path`, which is none that may never end: no pipe, device or socket.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>, ReadError> {
    let io = |source| ReadError::Io {
        path: path.into(),
        source,
    };
    let found = fs::metadata(path).map_err(io)?;
    // What a folder is, the system says.
    if !found.is_file() && !found.is_dir() {
        return Err(ReadError::fault(path, "not a regular file"));
    }
    fs::read(path).map_err(io)
}
