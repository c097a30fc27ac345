use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::container::{Decoder, Encoder, FORMAT, Fault, text};
use drape_cloth::file::{WriteError, write_atomic};

const KIND: &str = "drape checkpoint";

/// Sections every checkpoint begins with; the others carry the prefix.
const HEADER_COUNT: u32 = 4;
const DATA_PREFIX: &str = "data.";

/// Everything a run needs to go on exactly where it was, in one file.
///
/// The container knows names and bytes, not what they mean: whoever owns a network,
/// optimiser or random stream turns it into a section.
///
/// The first sections are `kind`, `version`, `config` and `counters` (JSON); then come
/// those of [`Checkpoint::sections`], their names prefixed by `data.`.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Version of drape that wrote it.
    pub version: String,
    /// Resolved configuration of the run, TOML.
    pub config: String,
    /// Whole numbers by name, for a reader who has no network: the environment steps.
    pub counters: BTreeMap<String, u64>,
    /// Binary content by name.
    pub sections: BTreeMap<String, Vec<u8>>,
}

/// Why a checkpoint could not be read.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    #[error("cannot read {}", path.display())]
    Read {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    #[error("{}: {fault}", path.display())]
    Content { path: PathBuf, fault: Fault },
}

/// The checkpoint is sound but lacks something; it may come from another drape.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error("checkpoint has no {kind} `{name}`, only {present}")]
pub struct MissingPart {
    /// `section` or `counter`.
    kind: &'static str,
    name: String,
    /// Names of those that are there.
    present: String,
}

impl MissingPart {
    fn new<'a>(kind: &'static str, name: &str, keys: impl Iterator<Item = &'a String>) -> Self {
        let present: Vec<_> = keys.map(String::as_str).collect();
        Self {
            kind,
            name: name.into(),
            present: match present[..] {
                [] => "none at all".into(),
                _ => present.join(", "),
            },
        }
    }
}

impl Checkpoint {
    /// A checkpoint of this drape without content.
    pub fn new(config: String) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").into(),
            config,
            counters: BTreeMap::new(),
            sections: BTreeMap::new(),
        }
    }

    /// Writes the file whole or not at all.
    ///
    /// # Panics
    ///
    /// If a section name is empty or longer than 59 bytes.
    pub fn save(&self, path: &Path) -> Result<(), WriteError> {
        write_atomic(path, |file| self.encode(file))
    }

    /// Reads and checks a whole file. Nothing in it is trusted: memory use is bounded by
    /// the file's size whatever lengths it claims.
    pub fn load(path: &Path) -> Result<Self, CheckpointError> {
        let bytes = fs::read(path).map_err(|source| CheckpointError::Read {
            path: path.into(),
            source,
        })?;
        Self::decode(&bytes).map_err(|fault| CheckpointError::Content {
            path: path.into(),
            fault,
        })
    }

    /// The section called `name`.
    pub fn section(&self, name: &str) -> Result<&[u8], MissingPart> {
        match self.sections.get(name) {
            Some(data) => Ok(data),
            None => Err(MissingPart::new("section", name, self.sections.keys())),
        }
    }

    fn encode(&self, file: &mut impl Write) -> io::Result<()> {
        let counters = serde_json::to_vec(&self.counters).expect("numbers under string keys");
        let mut out = Encoder::new(file);
        out.put_preamble(FORMAT, HEADER_COUNT + self.sections.len() as u32)?;
        out.put_section("kind", KIND.as_bytes())?;
        out.put_section("version", self.version.as_bytes())?;
        out.put_section("config", self.config.as_bytes())?;
        out.put_section("counters", &counters)?;
        for (name, data) in &self.sections {
            assert!(!name.is_empty(), "a section needs a name");
            out.put_section(&format!("{DATA_PREFIX}{name}"), data)?;
        }
        out.put_file_checksum()
    }

    fn decode(bytes: &[u8]) -> Result<Self, Fault> {
        let mut input = Decoder::new(bytes);
        let count = input.preamble()?;
        let kind = text(input.header("kind")?)?;
        if kind != KIND {
            return Err(Fault::Kind {
                found: kind,
                expected: KIND,
            });
        }
        let version = text(input.header("version")?)?;
        let config = text(input.header("config")?)?;
        let counters = input.header("counters")?;
        let counters = serde_json::from_slice(counters.data)
            .map_err(|error| counters.unexpected(error.to_string(), "named whole numbers"))?;
        let mut sections = BTreeMap::new();
        for _ in HEADER_COUNT..count {
            let section = input.section()?;
            let Some(name) = section.name.strip_prefix(DATA_PREFIX) else {
                return Err(section.unexpected("a name without `data.`".into(), "one with it"));
            };
            let earlier = sections.insert(name.to_string(), section.data.to_vec());
            if earlier.is_some() {
                return Err(section.unexpected("a second one".into(), "one of each name"));
            }
        }
        input.end()?;
        Ok(Self {
            version,
            config,
            counters,
            sections,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> Checkpoint {
        let mut checkpoint = Checkpoint::new("[train]\nseed = 7\n".into());
        checkpoint.counters = BTreeMap::from([("steps".into(), u64::MAX), ("updates".into(), 3)]);
        checkpoint.sections = BTreeMap::from([
            ("empty".into(), vec![]),
            ("network".into(), vec![0, 1, 254, 255]),
            ("optimiser".into(), b"drape\n".to_vec()),
        ]);
        checkpoint
    }

    fn encoded(checkpoint: &Checkpoint) -> Vec<u8> {
        let mut bytes = Vec::new();
        checkpoint.encode(&mut bytes).unwrap();
        bytes
    }

    /// The fault of damaged `bytes`, checked to be one readable line.
    fn fault(bytes: &[u8]) -> Fault {
        let fault = Checkpoint::decode(bytes).expect_err("damaged");
        let message = fault.to_string();
        assert!(!message.contains(char::is_control), "{message:?}");
        fault
    }

    /// A file with sound checksums around the given parts.
    fn forged(format: u32, count: u32, sections: &[(&str, &[u8])]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut out = Encoder::new(&mut bytes);
        out.put_preamble(format, count).unwrap();
        for (name, data) in sections {
            out.put_section(name, data).unwrap();
        }
        out.put_file_checksum().unwrap();
        bytes
    }

    const SOUND_HEADER: [(&str, &[u8]); 4] = [
        ("kind", KIND.as_bytes()),
        ("version", b"1"),
        ("config", b""),
        ("counters", b"{}"),
    ];

    #[test]
    fn saved_checkpoint_loads_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("last.drape");
        for checkpoint in [small(), Checkpoint::new(String::new())] {
            checkpoint.save(&path).unwrap();
            assert_eq!(Checkpoint::load(&path).unwrap(), checkpoint);
        }
    }

    #[test]
    fn every_truncation_is_an_error() {
        let bytes = encoded(&small());
        for length in 0..bytes.len() {
            let fault = fault(&bytes[..length]);
            match fault {
                Fault::Truncated { needed, left, .. } => assert!(needed > left as u64),
                other => panic!("{length} bytes: {other}"),
            }
        }
    }

    #[test]
    fn every_bit_flip_is_an_error() {
        let bytes = encoded(&small());
        for bit in 0..8 * bytes.len() {
            let mut bytes = bytes.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            fault(&bytes);
        }
    }

    /// Flips within the data of one section are blamed on that section.
    #[test]
    fn damage_is_located() {
        let bytes = encoded(&small());
        let data = bytes.windows(6).position(|w| w == b"drape\n").unwrap();
        let section = data - "data.optimiser".len() - 12;
        let sound = crc32fast::hash(&bytes[section..data + 6]);
        for bit in 0..48 {
            let mut bytes = bytes.clone();
            bytes[data + bit / 8] ^= 1 << (bit % 8);
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("last.drape");
            fs::write(&path, &bytes).unwrap();
            let found = crc32fast::hash(&bytes[section..data + 6]);
            assert_eq!(
                Checkpoint::load(&path).unwrap_err().to_string(),
                format!(
                    "{}: section `data.optimiser` at byte {section}: \
                     checksum is {found:08x}, expected {sound:08x}",
                    path.display()
                )
            );
        }
    }

    #[test]
    fn every_pair_of_swapped_sections_is_an_error() {
        let mut sections = SOUND_HEADER.to_vec();
        sections.push(("data.x", b"1"));
        Checkpoint::decode(&forged(FORMAT, 5, &sections)).expect("sound before swapping");
        for i in 0..5 {
            for j in 0..i {
                let mut swapped = sections.clone();
                swapped.swap(i, j);
                let fault = fault(&forged(FORMAT, 5, &swapped));
                assert!(matches!(fault, Fault::Unexpected { .. }), "{fault}");
            }
        }
    }

    #[test]
    fn trailing_bytes_are_an_error() {
        let mut bytes = encoded(&small());
        let offset = bytes.len();
        bytes.extend(encoded(&small()));
        let count = offset;
        assert_eq!(fault(&bytes), Fault::Trailing { offset, count });
    }

    #[test]
    fn other_formats_and_kinds_are_told_apart_from_damage() {
        for (found, advice) in [(FORMAT + 1, "update drape"), (FORMAT - 1, "train again")] {
            let fault = fault(&forged(found, 0, &[]));
            assert_eq!(fault, Fault::Format { found });
            assert!(fault.to_string().ends_with(advice), "{fault}");
        }
        let found = "drape\nmodel".to_string();
        assert_eq!(
            fault(&forged(FORMAT, 1, &[("kind", found.as_bytes())])),
            Fault::Kind {
                found,
                expected: KIND
            }
        );
        assert_eq!(fault(b"solid cube"), Fault::Magic);
    }

    #[test]
    fn content_that_no_drape_writes_is_an_error() {
        let with = |name: &'static str, data: &'static [u8]| {
            let mut sections = SOUND_HEADER.to_vec();
            match sections.iter().position(|(other, _)| *other == name) {
                Some(i) => sections[i].1 = data,
                None => sections.extend([(name, data); 2]),
            }
            fault(&forged(FORMAT, sections.len() as u32, &sections)).to_string()
        };
        assert!(with("config", b"\xff").ends_with("expected UTF-8 text"));
        assert!(with("counters", b"[1]").ends_with("expected named whole numbers"));
        assert!(with("stray", b"").ends_with("a name without `data.`, expected one with it"));
        assert!(with("data.x", b"").ends_with("a second one, expected one of each name"));
    }

    /// Lengths far beyond the file must neither be allocated nor overflow.
    #[test]
    fn absurd_lengths_are_errors() {
        let preamble = forged(FORMAT, u32::MAX, &[]);
        let preamble = &preamble[..preamble.len() - 4];
        let with = |name_length: u32, data_length: u64| {
            let mut bytes = preamble.to_vec();
            bytes.extend(name_length.to_le_bytes());
            bytes.extend(data_length.to_le_bytes());
            bytes.extend(b"kind");
            fault(&bytes)
        };
        for data_length in [1 << 40, u64::MAX - 1, u64::MAX] {
            assert_eq!(
                with(4, data_length),
                Fault::Truncated {
                    part: "section `kind`".into(),
                    offset: preamble.len() + 16,
                    needed: data_length,
                    left: 0
                }
            );
        }
        assert!(matches!(with(u32::MAX, 0), Fault::NameLength { .. }));
        let mut zeros = forged(FORMAT, u32::MAX, &SOUND_HEADER);
        zeros.truncate(zeros.len() - 4);
        zeros.extend([0; 64]);
        assert!(matches!(fault(&zeros), Fault::Checksum { .. }));
    }

    #[test]
    fn missing_parts_are_named_with_those_present() {
        let checkpoint = small();
        assert_eq!(checkpoint.section("network"), Ok(&[0, 1, 254, 255][..]));
        assert_eq!(checkpoint.counters["updates"], 3);
        assert_eq!(
            checkpoint.section("streams").unwrap_err().to_string(),
            "checkpoint has no section `streams`, only empty, network, optimiser"
        );
    }
}
