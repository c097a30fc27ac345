use std::fs::{File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Why a log could not be created, resumed or extended.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    #[error("cannot create {}", path.display())]
    Create {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    #[error("cannot resume {}", path.display())]
    Resume {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    #[error("cannot append to {} at byte {length}", path.display())]
    Append {
        path: PathBuf,
        length: u64,
        #[source]
        source: io::Error,
    },
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
        let file = OpenOptions::new().write(true).create_new(true).open(path);
        Ok(Self {
            path: path.into(),
            file: file.map_err(|source| LogError::Create {
                path: path.into(),
                source,
            })?,
            length: 0,
        })
    }

    /// Opens an existing log and drops everything after its first `length` bytes, which
    /// it must have.
    pub fn resume(path: &Path, length: u64) -> Result<Self, LogError> {
        let resume_error = |source| LogError::Resume {
            path: path.into(),
            source,
        };
        let mut file = OpenOptions::new()
            .write(true)
            .open(path)
            .map_err(resume_error)?;
        file.set_len(length).map_err(resume_error)?;
        file.seek(SeekFrom::Start(length)).map_err(resume_error)?;
        Ok(Self {
            path: path.into(),
            file,
            length,
        })
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
        LogError::Append {
            path: self.path.clone(),
            length: self.length,
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
        assert!(matches!(Log::create(&path), Err(LogError::Create { .. })));
        assert_eq!(fs::read(&path).unwrap(), b"abc");
    }
}
