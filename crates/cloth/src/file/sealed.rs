use std::io::Write;
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{ReadError, WriteError, in_words, read_bytes, write_atomic};

/// Binary at a glance, and broken by transfers that rewrite line ends.
const MAGIC: [u8; 8] = *b"\x89drape\r\n";
/// Bytes before the content.
const PREAMBLE: usize = 20;
/// Largest file that is read [MiB].
const MOST_MIB: u64 = 8192;

/// A kind of binary file, whole or none at all. Layout, little-endian:
///
/// ```text
/// magic    8 bytes
/// format   u16
/// kind     u16
/// length   u64, of the content
/// content  by postcard
/// CRC-32   u32, of everything before
/// ```
///
/// All but the content stays where it is in later formats, so that a newer file is told from a
/// damaged one.
#[derive(Clone, Copy, Debug)]
pub struct Sealed {
    /// For people, with its article.
    pub name: &'static str,
    /// No other kind has it.
    pub kind: u16,
    /// Newest format.
    pub format: u16,
}

/// What is wrong with the bytes of a sealed file, in one line.
#[derive(Debug, PartialEq, thiserror::Error)]
enum Fault {
    #[error("not a drape file: it does not begin with the signature of one")]
    Magic,
    #[error("not {0}: another kind of drape file")]
    Kind(&'static str),
    #[error("format version is {found}, expected {expected}: {advice}", advice = if found > expected { "update drape" } else { "an older drape wrote it, make it again" })]
    Format { found: u16, expected: u16 },
    #[error("has {found} bytes, expected {expected}: it is cut short or another file's")]
    Length { found: u64, expected: u64 },
    #[error("checksum is {found:08x}, expected {expected:08x}: it is damaged")]
    Checksum { found: u32, expected: u32 },
    #[error("content is none of {0}: {1}")]
    Content(&'static str, String),
}

impl Sealed {
    /// Writes the file at `path` whole or not at all.
    pub fn write(self, path: &Path, content: &impl Serialize) -> Result<(), WriteError> {
        let content = postcard::to_allocvec(content).expect("plain data is serialisable");
        let bytes = self.sealed(&content);
        write_atomic(path, |file| file.write_all(&bytes))
    }

    /// Reads and checks the whole file at `path`. Nothing in it is trusted: memory use is bounded by
    /// its size whatever lengths it claims.
    pub fn read<T: DeserializeOwned>(self, path: &Path) -> Result<T, ReadError> {
        let content = self.content(&read_bytes(path, MOST_MIB)?);
        content.map_err(|fault| ReadError::fault(path, fault))
    }

    fn content<T: DeserializeOwned>(self, bytes: &[u8]) -> Result<T, Fault> {
        let head = &bytes[..bytes.len().min(MAGIC.len())];
        if !MAGIC.starts_with(head) {
            return Err(Fault::Magic);
        }
        let found = bytes.len() as u64;
        let short = |expected| Fault::Length { found, expected };
        let Some((preamble, rest)) = bytes.split_at_checked(PREAMBLE) else {
            return Err(short(PREAMBLE as u64 + 4));
        };
        if number(&preamble[10..12]) as u16 != self.kind {
            return Err(Fault::Kind(self.name));
        }
        let (format, expected) = (number(&preamble[8..10]) as u16, self.format);
        if format != expected {
            let found = format;
            return Err(Fault::Format { found, expected });
        }
        let expected = number(&preamble[12..]).saturating_add(PREAMBLE as u64 + 4);
        if found != expected {
            return Err(short(expected));
        }
        let (content, checksum) = rest.split_at(rest.len() - 4);
        let expected = crc32fast::hash(&bytes[..bytes.len() - 4]);
        let found = number(checksum) as u32;
        if found != expected {
            return Err(Fault::Checksum { found, expected });
        }
        postcard::from_bytes(content).map_err(|error| Fault::Content(self.name, in_words(error)))
    }

    /// `content` with what stands before and after it in a file.
    fn sealed(self, content: &[u8]) -> Vec<u8> {
        let length = content.len() as u64;
        let (format, kind) = (self.format.to_le_bytes(), self.kind.to_le_bytes());
        let mut bytes = [&MAGIC[..], &format, &kind, &length.to_le_bytes()].concat();
        bytes.extend(content);
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        bytes
    }
}

/// At most eight bytes as a number, the lowest first.
fn number(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .rev()
        .fold(0, |n, &byte| n << 8 | u64::from(byte))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    type Content = BTreeMap<String, Vec<u8>>;

    const LIST: Sealed = Sealed {
        name: "a list",
        kind: 7,
        format: 3,
    };

    fn small() -> Content {
        BTreeMap::from([
            ("empty".into(), vec![]),
            ("network".into(), vec![0, 1, 254, 255]),
            ("optimiser".into(), b"drape\n".to_vec()),
        ])
    }

    fn encoded() -> Vec<u8> {
        LIST.sealed(&postcard::to_allocvec(&small()).unwrap())
    }

    /// The fault of damaged `bytes`, checked to be one readable line.
    fn fault(bytes: &[u8]) -> Fault {
        let fault = LIST.content::<Content>(bytes).expect_err("damaged");
        let message = fault.to_string();
        assert!(!message.contains(char::is_control), "{message:?}");
        fault
    }

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("list.drape");
        for content in [small(), Content::new()] {
            LIST.write(&path, &content).unwrap();
            assert_eq!(LIST.read::<Content>(&path).unwrap(), content);
        }
        std::fs::write(&path, "solid cube").unwrap();
        let error = LIST.read::<Content>(&path).unwrap_err().to_string();
        assert!(error.ends_with(
            "list.drape: not a drape file: it does not begin with the signature of one"
        ));
    }

    #[test]
    fn every_truncation_and_trailing_bytes_are_errors() {
        let bytes = encoded();
        for length in 0..bytes.len() {
            let found = length as u64;
            assert!(
                matches!(fault(&bytes[..length]), Fault::Length { found: f, expected } if f == found && expected > f)
            );
        }
        let twice = bytes.repeat(2);
        let (found, expected) = (twice.len() as u64, bytes.len() as u64);
        assert_eq!(fault(&twice), Fault::Length { found, expected });
    }

    #[test]
    fn every_bit_flip_is_an_error() {
        let bytes = encoded();
        for bit in 0..8 * bytes.len() {
            let mut bytes = bytes.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            fault(&bytes);
        }
    }

    #[test]
    fn other_formats_and_kinds_are_told_apart_from_damage() {
        for (format, advice) in [(4, "update drape"), (2, "make it again")] {
            let fault = fault(&Sealed { format, ..LIST }.sealed(&[]));
            let (found, expected) = (format, 3);
            assert_eq!(fault, Fault::Format { found, expected });
            assert!(fault.to_string().ends_with(advice), "{fault}");
        }
        assert_eq!(
            fault(&Sealed { kind: 0, ..LIST }.sealed(&[])),
            Fault::Kind("a list")
        );
        assert!(matches!(fault(&LIST.sealed(&[])), Fault::Content(..)));
    }

    /// Lengths far beyond the file must neither be allocated nor overflow.
    #[test]
    fn absurd_lengths_are_errors() {
        let mut bytes = encoded();
        bytes[12..20].fill(0xff);
        let (found, expected) = (bytes.len() as u64, u64::MAX);
        assert_eq!(fault(&bytes), Fault::Length { found, expected });
        // A section of 2^63 bytes without a name.
        let content = [&[1, 0][..], &[0xff; 9], &[0x01]].concat();
        assert!(matches!(fault(&LIST.sealed(&content)), Fault::Content(..)));
    }
}
