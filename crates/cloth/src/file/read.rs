use std::fs::{self, File};
use std::io::{self, Read};
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

/// The bytes of the file at `path`, which is none that may never end: no pipe, device or socket,
/// and no file of more than `most` MiB.
pub fn read_bytes(path: &Path, most: u64) -> Result<Vec<u8>, ReadError> {
    let io = |source| ReadError::Io {
        path: path.into(),
        source,
    };
    // Before it is opened, which a pipe answers when somebody writes into it.
    let found = fs::metadata(path).map_err(io)?;
    // What a folder is, the system says.
    if !found.is_file() && !found.is_dir() {
        return Err(ReadError::fault(path, "not a regular file"));
    }
    let (size, most_bytes) = (found.len(), most << 20);
    let mut bytes = Vec::new();
    if size <= most_bytes {
        // One more than allowed: some files are longer than they say, or grow.
        let file = File::open(path).map_err(io)?;
        let mut file = file.take(most_bytes + 1);
        file.read_to_end(&mut bytes).map_err(io)?;
    }
    let size = size.max(bytes.len() as u64);
    if size > most_bytes {
        let fault = format!(
            "has {} MiB, expected at most {most}",
            size.div_ceil(1 << 20)
        );
        return Err(ReadError::fault(path, fault));
    }
    Ok(bytes)
}

/// Text in the file at `path`, of at most 16 MiB.
pub fn read_text(path: &Path) -> Result<String, ReadError> {
    let text = String::from_utf8(read_bytes(path, 16)?);
    text.map_err(|_| ReadError::fault(path, "not text in UTF-8"))
}
