use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Begin of the names of files and folders that are being made, which are moved when they are whole and may be removed
/// when they were left behind.
pub const UNFINISHED: &str = ".drape-";
/// End of those of temporary files.
const SUFFIX: &str = ".tmp";

/// Why a file could not be written. The previous file, if any, is as it was.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The folder the file belongs in is not there.
    #[error("cannot write {}: folder {} does not exist", path.display(), folder.display())]
    FolderMissing { path: PathBuf, folder: PathBuf },
    /// A device, pipe or socket: renaming over it would remove it.
    #[error("cannot write {}: it is not a regular file", path.display())]
    NotAFile { path: PathBuf },
    /// It would be removed some day.
    #[error("cannot write {}: it has a name that begins with `{UNFINISHED}`", path.display())]
    Name { path: PathBuf },
    /// The system or the caller's writer refused: disk full, no permission, ...
    #[error("cannot write {}", path.display())]
    Io {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
}

/// Replaces the file at `path` by what `write` writes, in one step.
///
/// The bytes go to a temporary file in the same folder, are flushed to the disk and renamed
/// over `path`; then the folder is flushed, so that the rename survives a power failure.
/// On failure, but of that last flush, `path` keeps its old content and nothing is left behind.
/// A symbolic link at `path` is replaced, not followed, but no device, pipe or socket
/// is, nor a link to one. The file's mode follows the process's umask.
pub fn write_atomic(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), WriteError> {
    check_kind(path)?;
    let folder = folder_of(path);
    replace(path, folder, write).map_err(|source| error(path, source))
}

/// Refuses a path with a name of what is [`UNFINISHED`]: what is written there would not stay.
pub fn check_name(path: &Path) -> Result<(), WriteError> {
    let is_unfinished = |name: &OsStr| name.as_encoded_bytes().starts_with(UNFINISHED.as_bytes());
    match path.iter().any(is_unfinished) {
        true => Err(WriteError::Name { path: path.into() }),
        false => Ok(()),
    }
}

/// Whether [`write_atomic`] could begin to write the file at `path`, where it stays: for work that takes long
/// and ends with that. Nothing is left behind.
pub fn check_writable(path: &Path) -> Result<(), WriteError> {
    check_name(path)?;
    check_kind(path)?;
    let begun = match path.is_dir() {
        true => Err(io::ErrorKind::IsADirectory.into()),
        false => create_temporary(folder_of(path)),
    };
    begun.map(drop).map_err(|source| error(path, source))
}

/// Removes temporary files of [`write_atomic`], and folders named alike, that a killed process has
/// left in `folder`, as far as that is possible. Nobody may be writing there.
pub fn remove_temporaries(folder: &Path) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with(UNFINISHED) && name.ends_with(SUFFIX) {
            let path = entry.path();
            let _ = std::fs::remove_file(&path).or_else(|_| std::fs::remove_dir_all(&path));
        }
    }
}

/// Folders are left to the rename, which says what they are.
fn check_kind(path: &Path) -> Result<(), WriteError> {
    if std::fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
        return Err(WriteError::NotAFile { path: path.into() });
    }
    Ok(())
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    }
}

fn error(path: &Path, source: io::Error) -> WriteError {
    let folder = folder_of(path);
    let path = path.into();
    if source.kind() == io::ErrorKind::NotFound && !folder.exists() {
        let folder = folder.into();
        return WriteError::FolderMissing { path, folder };
    }
    WriteError::Io { path, source }
}

fn replace(
    path: &Path,
    folder: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<()> {
    let (file, temporary) = create_temporary(folder)?.into_parts();
    let mut writer = BufWriter::new(file);
    write(&mut writer)?;
    writer.flush()?;
    writer.get_ref().sync_all()?;
    // Closed before the rename: some systems refuse to rename an open file.
    drop(writer);
    temporary.persist(path).map_err(|error| error.error)?;
    sync_folder(folder)
}

fn create_temporary(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(UNFINISHED).suffix(SUFFIX);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Without this the file would stay readable by its owner alone.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

#[cfg(unix)]
fn sync_folder(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

/// Elsewhere a folder cannot be opened as a file, and renames are journalled.
#[cfg(not(unix))]
fn sync_folder(_: &Path) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::error::Error;
    use std::fs;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn new_content_replaces_old() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        for content in ["first", "2nd"] {
            write_atomic(&path, |w| w.write_all(content.as_bytes())).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), content);
        }
        assert_eq!(names(folder.path()), ["a.txt"]);
    }

    #[test]
    fn failing_writer_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        let error = write_atomic(&path, |w| {
            // More than the buffer holds, so that some of it has reached the disk.
            w.write_all(&[b'x'; 100_000])?;
            Err(io::ErrorKind::StorageFull.into())
        })
        .unwrap_err();
        assert_eq!(
            error.to_string(),
            format!("cannot write {}", path.display())
        );
        assert_eq!(error.source().unwrap().to_string(), "no storage space");
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(folder.path()), ["a.txt"]);
    }

    #[test]
    fn panicking_writer_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        let outcome = std::panic::catch_unwind(|| write_atomic(&path, |_| panic!("planned")));
        assert!(outcome.is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(folder.path()), ["a.txt"]);
    }

    #[test]
    fn missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("none").join("a.txt");
        let error = write_atomic(&path, |_| Ok(())).unwrap_err();
        assert!(
            error.to_string().ends_with("none does not exist"),
            "{error}"
        );
        assert_eq!(names(folder.path()), [""; 0]);
    }

    #[test]
    fn folder_in_the_way_is_an_error_and_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        fs::create_dir(&path).unwrap();
        let error = write_atomic(&path, |w| w.write_all(b"x")).unwrap_err();
        assert!(matches!(error, WriteError::Io { .. }), "{error}");
        assert_eq!(names(folder.path()), ["a"]);
        assert!(path.is_dir());
    }

    #[test]
    fn what_cannot_be_written_is_known_before() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("a"), "old").unwrap();
        fs::create_dir(at("b")).unwrap();
        for name in ["a", "new"] {
            check_writable(&at(name)).unwrap();
        }
        assert_eq!(fs::read_to_string(at("a")).unwrap(), "old");
        for name in ["b", "none/a", "a/b"] {
            let known = check_writable(&at(name)).unwrap_err();
            let found = write_atomic(&at(name), |_| Ok(())).unwrap_err();
            assert_eq!(known.to_string(), found.to_string());
        }
        assert_eq!(names(folder.path()), ["a", "b"]);
    }

    #[cfg(unix)]
    #[test]
    fn sockets_and_links_to_them_stay() {
        use std::os::unix::fs::FileTypeExt;
        let folder = tempfile::tempdir().unwrap();
        let [socket, link] = ["socket", "link"].map(|name| folder.path().join(name));
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        std::os::unix::fs::symlink(&socket, &link).unwrap();
        for path in [&socket, &link] {
            let error = write_atomic(path, |w| w.write_all(b"x")).unwrap_err();
            assert!(matches!(error, WriteError::NotAFile { .. }), "{error}");
            assert!(fs::metadata(path).unwrap().file_type().is_socket());
        }
        assert_eq!(names(folder.path()), ["link", "socket"]);
    }

    #[cfg(unix)]
    #[test]
    fn mode_follows_the_umask() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [plain, atomic] = ["plain", "atomic"].map(|name| folder.path().join(name));
        fs::write(&plain, "").unwrap();
        write_atomic(&atomic, |_| Ok(())).unwrap();
        let [plain, atomic] = [plain, atomic].map(|p| fs::metadata(p).unwrap().permissions());
        assert_eq!(plain.mode(), atomic.mode());
    }
}
