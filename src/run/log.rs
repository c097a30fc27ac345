use std::fs::{File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

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
    pub fn create(path: &Path) -> Result<Self> {
        let mut options = OpenOptions::new();
        Self::open(path, 0, options.write(true).create_new(true))
            .with_context(|| format!("cannot create {}", path.display()))
    }

    /// Opens an existing log and drops everything after its first `length` bytes, which
    /// it must have.
    pub fn resume(path: &Path, length: u64) -> Result<Self> {
        Self::open(path, length, OpenOptions::new().write(true))
            .with_context(|| format!("cannot resume {}", path.display()))
    }

    fn open(path: &Path, length: u64, options: &OpenOptions) -> io::Result<Self> {
        let path = path.to_path_buf();
        let mut file = options.open(&path)?;
        file.set_len(length)?;
        file.seek(SeekFrom::Start(length))?;
        Ok(Self { path, file, length })
    }

    /// Hands one record to the operating system. On failure the part already written is
    /// cut off again as far as the system allows.
    pub fn append(&mut self, record: &[u8]) -> Result<()> {
        let written = self.file.write_all(record).inspect_err(|_| {
            // The first failure is the one worth reporting.
            let _ = self.file.set_len(self.length);
            let _ = self.file.seek(SeekFrom::Start(self.length));
        });
        written.with_context(|| format!("cannot append to {}", self.path.display()))?;
        self.length += record.len() as u64;
        Ok(())
    }

    /// Makes all records survive a power failure.
    pub fn sync(&self) -> Result<()> {
        let synced = self.file.sync_data();
        synced.with_context(|| format!("cannot append to {}", self.path.display()))
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
