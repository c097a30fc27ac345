use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use serde::{Deserialize, Serialize};

use super::config::RunConfig;
use super::folder::RunFolder;
use drape_cloth::file::{WriteError, in_words, read_bytes, write_atomic};
use drape_learn::ppo::Sections;

/// Binary at a glance, and broken by transfers that rewrite line ends.
const MAGIC: [u8; 8] = *b"\x89drape\r\n";
/// Newest format.
/// 2: states of the simulation hold the forces of their yarns;
/// 3: force densities in place of forces;
/// 4: episodes hold what they have earned; one checksum over everything;
/// 5: a run remembers several best sequences;
/// 6: tasks are on several scenes;
/// 7: a run remembers whether its learner has been prepared;
/// 8: observations are without the last presses.
const FORMAT: u32 = 8;
/// Bytes before the content.
const PREAMBLE: usize = 20;

/// Everything a run needs to go on exactly where it was, in one file.
///
/// It knows names and bytes, not what they mean: whoever owns a network, optimiser or random
/// stream turns it into a section. Layout, little-endian:
///
/// ```text
/// magic    8 bytes
/// format   u32
/// length   u64, of the content
/// content  this struct, by postcard
/// CRC-32   u32, of everything before
/// ```
///
/// Magic and format stay where they are in all later formats, so that a newer file is told from
/// a damaged one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Resolved configuration of the run, TOML.
    pub config: String,
    /// Binary content by name.
    pub sections: Sections,
}

/// What is wrong with the bytes of a checkpoint, in one line.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum Fault {
    #[error("not a drape file: it does not begin with the signature of one")]
    Magic,
    #[error("format version is {found}, expected {FORMAT}: {advice}", advice = if *found > FORMAT { "update drape" } else { "an older drape wrote it, train again" })]
    Format { found: u32 },
    #[error("has {found} bytes, expected {expected}: it is cut short or another file's")]
    Length { found: u64, expected: u64 },
    #[error("checksum is {found:08x}, expected {expected:08x}: it is damaged")]
    Checksum { found: u32, expected: u32 },
    #[error("content is none of a checkpoint: {}", in_words(.0))]
    Content(postcard::Error),
}

/// A checkpoint of another run, or of one whose configuration was edited.
#[derive(Debug, thiserror::Error)]
#[error("{}: written for another configuration than {}", path.display(), config.display())]
pub struct OtherConfig {
    pub path: PathBuf,
    pub config: PathBuf,
}

impl Checkpoint {
    /// The checkpoint of the run in `folder`, whose configuration is `config`.
    pub fn of_run(path: &Path, config: &RunConfig, folder: &RunFolder) -> Result<Self> {
        let checkpoint = Self::load(path)?;
        if !config.is_read_from(&checkpoint.config, &folder.config) {
            bail!(OtherConfig {
                path: path.into(),
                config: folder.config.clone(),
            });
        }
        Ok(checkpoint)
    }

    /// Writes the file whole or not at all.
    pub fn save(&self, path: &Path) -> Result<(), WriteError> {
        let bytes = self.encode();
        write_atomic(path, |file| file.write_all(&bytes))
    }

    /// Reads and checks a whole file. Nothing in it is trusted: memory use is bounded by
    /// the file's size whatever lengths it claims.
    pub fn load(path: &Path) -> Result<Self> {
        let place = || path.display().to_string();
        Self::decode(&read_bytes(path, 8192)?).with_context(place)
    }

    fn encode(&self) -> Vec<u8> {
        let content = postcard::to_allocvec(self).expect("plain data is serialisable");
        sealed(FORMAT, &content)
    }

    fn decode(bytes: &[u8]) -> Result<Self, Fault> {
        let head = &bytes[..bytes.len().min(MAGIC.len())];
        if !MAGIC.starts_with(head) {
            return Err(Fault::Magic);
        }
        let found = bytes.len() as u64;
        let short = |expected| Fault::Length { found, expected };
        let least = short(PREAMBLE as u64 + 4);
        let Some((preamble, rest)) = bytes.split_at_checked(PREAMBLE) else {
            return Err(least);
        };
        let format = number(&preamble[8..12]) as u32;
        if format != FORMAT {
            return Err(Fault::Format { found: format });
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
        postcard::from_bytes(content).map_err(Fault::Content)
    }
}

/// `content` with what stands before and after it in a file.
fn sealed(format: u32, content: &[u8]) -> Vec<u8> {
    let length = content.len() as u64;
    let mut bytes = [&MAGIC[..], &format.to_le_bytes(), &length.to_le_bytes()].concat();
    bytes.extend(content);
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
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

    fn small() -> Checkpoint {
        Checkpoint {
            config: "[train]\nseed = 7\n".into(),
            sections: BTreeMap::from([
                ("empty".into(), vec![]),
                ("network".into(), vec![0, 1, 254, 255]),
                ("optimiser".into(), b"drape\n".to_vec()),
            ]),
        }
    }

    /// The fault of damaged `bytes`, checked to be one readable line.
    fn fault(bytes: &[u8]) -> Fault {
        let fault = Checkpoint::decode(bytes).expect_err("damaged");
        let message = fault.to_string();
        assert!(!message.contains(char::is_control), "{message:?}");
        fault
    }

    #[test]
    fn saved_checkpoint_loads_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("last.drape");
        let empty = Checkpoint {
            config: String::new(),
            sections: BTreeMap::new(),
        };
        for checkpoint in [small(), empty] {
            checkpoint.save(&path).unwrap();
            assert_eq!(Checkpoint::load(&path).unwrap(), checkpoint);
        }
    }

    #[test]
    fn every_truncation_and_trailing_bytes_are_errors() {
        let bytes = small().encode();
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
        let bytes = small().encode();
        for bit in 0..8 * bytes.len() {
            let mut bytes = bytes.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            fault(&bytes);
        }
    }

    #[test]
    fn other_formats_and_files_are_told_apart_from_damage() {
        for (found, advice) in [(FORMAT + 1, "update drape"), (FORMAT - 1, "train again")] {
            let fault = fault(&sealed(found, &[]));
            assert_eq!(fault, Fault::Format { found });
            assert!(fault.to_string().ends_with(advice), "{fault}");
        }
        assert_eq!(fault(b"solid cube"), Fault::Magic);
        assert!(matches!(fault(&sealed(FORMAT, &[])), Fault::Content(_)));
    }

    /// Lengths far beyond the file must neither be allocated nor overflow.
    #[test]
    fn absurd_lengths_are_errors() {
        let mut bytes = small().encode();
        bytes[12..20].fill(0xff);
        let (found, expected) = (bytes.len() as u64, u64::MAX);
        assert_eq!(fault(&bytes), Fault::Length { found, expected });
        // No text, then a section of 2^63 bytes without a name.
        let content = [&[0, 1, 0][..], &[0xff; 9], &[0x01]].concat();
        assert!(matches!(
            fault(&sealed(FORMAT, &content)),
            Fault::Content(_)
        ));
    }
}
