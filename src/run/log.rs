use std::fs::{File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Why a log could not be created, resumed or extended.
#[derive(Debug, thiserror::Error)]
#[error("cannot {action} {}", path.display())]
pub struct LogError {
    action: &'static str,
    path: PathBuf,
    source: io::Error,
}

/// A file that only grows, one whole record at a time, and that can be cut back to a length
/// a checkpoint knew. Its content after a resume is then what it would have been without
/// the interruption.
#[derive(Debug)]
pub(super) struct Log {
    path: PathBuf,
    file: File,
    length: u64,
}

impl Log {
    /// A new, empty log. Fails if `path` exists.
    pub fn create(path: &Path) -> Result<Self, LogError> {
        let mut options = OpenOptions::new();
        Self::open(path, 0, "create", options.write(true).create_new(true))
    }

    /// Opens an existing log and drops everything after its first `length` bytes, which
    /// it must have.
    pub fn resume(path: &Path, length: u64) -> Result<Self, LogError> {
        Self::open(path, length, "resume", OpenOptions::new().write(true))
    }

    fn open(
        path: &Path,
        length: u64,
        action: &'static str,
        options: &OpenOptions,
    ) -> Result<Self, LogError> {
        let cut = |mut file: File| {
            file.set_len(length)?;
            file.seek(SeekFrom::Start(length))?;
            Ok(file)
        };
        let path = path.to_path_buf();
        match options.open(&path).and_then(cut) {
            Ok(file) => Ok(Self { path, file, length }),
            Err(source) => Err(LogError {
                action,
                path,
                source,
            }),
        }
    }

    /// Hands one record to the operating system. On failure the part already written is
    /// cut off again as far as the system allows.
    pub fn append(&mut self, record: &[u8]) -> Result<(), LogError> {
        if let Err(source) = self.file.write_all(record) {
            // The first failure is the one worth reporting.
            let _ = self.file.set_len(self.length);
            let _ = self.file.seek(SeekFrom::Start(self.length));
            return Err(self.append_error(source));
        }
        self.length += record.len() as u64;
        Ok(())
    }

    /// Makes all records survive a power failure.
    pub fn sync(&self) -> Result<(), LogError> {
        let synced = self.file.sync_data();
        synced.map_err(|source| self.append_error(source))
    }

    fn append_error(&self, source: io::Error) -> LogError {
        LogError {
            action: "append to",
            path: self.path.clone(),
            source,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn resumed_log_equals_an_uninterrupted_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log");
        let mut log = Log::create(&path).unwrap();
        log.append(b"one ").unwrap();
        log.sync().unwrap();
        log.append(b"lost in the cr").unwrap();
        drop(log);

        let mut log = Log::resume(&path, 4).unwrap();
        log.append(b"two").unwrap();
        log.sync().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"one two");
    }

    #[test]
    fn existing_log_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log");
        fs::write(&path, "abc").unwrap();
        let error = Log::create(&path).unwrap_err().to_string();
        assert!(error.starts_with("cannot create "), "{error}");
        assert_eq!(fs::read(&path).unwrap(), b"abc");
    }
}
