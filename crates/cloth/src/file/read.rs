use std::borrow::Cow;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use super::words::in_words;

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

/// What a file says behind its byte-order mark, if it has one, as editors and spreadsheets write it.
///
/// # Errors
/// Text in UTF-16 or UTF-32, which is called by its name, with a mark or without.
pub fn unmarked(bytes: &[u8]) -> Result<&[u8], String> {
    let is_shown = |byte: &u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
    let encoding = match bytes {
        [0xff, 0xfe, 0, 0, ..] | [0, 0, 0xfe, 0xff, ..] => "UTF-32",
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => "UTF-16",
        [a, 0, b, 0, ..] | [0, a, 0, b, ..] if is_shown(a) && is_shown(b) => "UTF-16",
        _ => return Ok(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)),
    };
    Err(format!("text in {encoding}, expected UTF-8"))
}

/// The text that a file says behind its byte-order mark, with a line feed at the end of every line that had a carriage
/// return alone.
///
/// # Errors
/// Text in UTF-16 or UTF-32.
pub fn plain(bytes: &[u8]) -> Result<Cow<'_, [u8]>, String> {
    let text = unmarked(bytes)?;
    let is_alone = |i: &usize| text[*i] == b'\r' && text.get(i + 1) != Some(&b'\n');
    let mut alone = (0..text.len()).filter(is_alone).peekable();
    if alone.peek().is_none() {
        return Ok(text.into());
    }
    let mut owned = text.to_vec();
    alone.for_each(|i| owned[i] = b'\n');
    Ok(owned.into())
}

/// Text in the file at `path`, of at most 16 MiB, as `plain` has it.
pub fn read_text(path: &Path) -> Result<String, ReadError> {
    let bytes = read_bytes(path, 16)?;
    let text = plain(&bytes).map_err(|fault| ReadError::fault(path, fault))?;
    String::from_utf8(text.into_owned()).map_err(|error| {
        let before = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        ReadError::Fault {
            path: path.into(),
            place: format!(":{line}"),
            fault: "not text in UTF-8".into(),
        }
    })
}

/// Reads the JSON file at `path`, of at most 1 GiB. The error calls what it should have been `kind`.
pub fn read_json<T: DeserializeOwned>(path: &Path, kind: &str) -> Result<T, ReadError> {
    let bytes = read_bytes(path, 1024)?;
    let fault = |fault| ReadError::fault(path, format!("not {kind}: {fault}"));
    serde_json::from_slice(unmarked(&bytes).map_err(fault)?).map_err(|e| fault(in_words(e)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_and_line_ends_are_understood_and_encodings_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let read = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            read_text(&path).map_err(|error| error.to_string())
        };
        for (bytes, text) in [
            (&b"a\r\nb\n"[..], "a\r\nb\n"),
            (b"\xef\xbb\xbfa\rb\r\nc\r", "a\nb\r\nc\n"),
            (b"\xef\xbb\xbf", ""),
        ] {
            assert_eq!(read(bytes).unwrap(), text);
        }
        let wide = |text: &str| text.encode_utf16().collect::<Vec<u16>>();
        let little: Vec<u8> = wide("a = 1").iter().flat_map(|c| c.to_le_bytes()).collect();
        let big: Vec<u8> = wide("a = 1").iter().flat_map(|c| c.to_be_bytes()).collect();
        for (bytes, fault) in [
            (little.clone(), ": text in UTF-16, expected UTF-8"),
            (big.clone(), ": text in UTF-16, expected UTF-8"),
            (
                [b"\xff\xfe", &*little].concat(),
                ": text in UTF-16, expected UTF-8",
            ),
            (
                [b"\xfe\xff", &*big].concat(),
                ": text in UTF-16, expected UTF-8",
            ),
            (
                b"\xff\xfe\0\0a\0\0\0".into(),
                ": text in UTF-32, expected UTF-8",
            ),
            (b"a\rb\nc \xb5m".into(), ":3: not text in UTF-8"),
        ] {
            let place = path.display();
            assert_eq!(read(&bytes).unwrap_err(), format!("{place}{fault}"));
        }
    }
}
