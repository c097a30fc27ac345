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
    /// The log lost bytes that the checkpoint had seen.
    #[error(
        "cannot resume {}: it has {found} bytes, the checkpoint was saved at {expected}",
        path.display()
    )]
    Short {
        path: PathBuf,
        found: u64,
        expected: u64,
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

    /// Opens an existing log and drops everything after its first `length` bytes. A log
    /// shorter than that is an error and stays as it is.
    pub fn resume(path: &Path, length: u64) -> Result<Self, LogError> {
        let resume_error = |source| LogError::Resume {
            path: path.into(),
            source,
        };
        let mut file = OpenOptions::new()
            .write(true)
            .open(path)
            .map_err(resume_error)?;
        let found = file.metadata().map_err(resume_error)?.len();
        if found < length {
            return Err(LogError::Short {
                path: path.into(),
                found,
                expected: length,
            });
        }
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

    /// Makes all records survive a power failure and returns the length to resume from.
    pub fn sync(&self) -> Result<u64, LogError> {
        self.file
            .sync_data()
            .map_err(|source| self.append_error(source))?;
        Ok(self.length)
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
        let known = log.sync().unwrap();
        log.append(b"lost in the cr").unwrap();
        drop(log);

        let mut log = Log::resume(&path, known).unwrap();
        log.append(b"two").unwrap();
        assert_eq!(log.sync().unwrap(), 7);
        assert_eq!(fs::read(&path).unwrap(), b"one two");
    }

    #[test]
    fn log_shorter_than_the_checkpoint_knew_is_refused_untouched() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log");
        fs::write(&path, "abc").unwrap();
        let error = Log::resume(&path, 4).unwrap_err().to_string();
        assert!(
            error.ends_with("it has 3 bytes, the checkpoint was saved at 4"),
            "{error}"
        );
        assert_eq!(fs::read(&path).unwrap(), b"abc");
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
