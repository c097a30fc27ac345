use std::io::{self, Write};

/// Binary at a glance, and broken by transfers that rewrite line ends.
const MAGIC: [u8; 8] = *b"\x89drape\r\n";
/// Newest format of the container.
/// 2: states of the simulation hold the forces of their yarns;
/// 3: force densities in place of forces.
pub(super) const FORMAT: u32 = 4;

/// Longest section name [bytes]. Ours are one word; a bound makes a damaged length readable
/// in the message.
const NAME_LIMIT: usize = 64;

/// What is wrong with the bytes of a checkpoint. Every message is one line; offsets count
/// from the start of the file.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum Fault {
    #[error("not a drape file: it does not begin with the signature of one")]
    Magic,
    #[error("format version is {found}, expected {FORMAT}: {advice}", advice = if *found > FORMAT { "update drape" } else { "an older drape wrote it, train again" })]
    Format { found: u32 },
    #[error("kind is {found:?}, expected {expected:?}")]
    Kind {
        found: String,
        expected: &'static str,
    },
    #[error("{part} at byte {offset}: needs {needed} bytes, the file has {left} left")]
    Truncated {
        part: String,
        offset: usize,
        needed: u64,
        left: usize,
    },
    #[error("{part} at byte {offset}: checksum is {found:08x}, expected {expected:08x}")]
    Checksum {
        part: String,
        offset: usize,
        found: u32,
        expected: u32,
    },
    #[error("{part} at byte {offset}: its name has {found} bytes, at most {NAME_LIMIT} expected")]
    NameLength {
        part: String,
        offset: usize,
        found: u32,
    },
    #[error("{part} at byte {offset}: found {found}, expected {expected}")]
    Unexpected {
        part: String,
        offset: usize,
        found: String,
        expected: &'static str,
    },
    #[error("{count} bytes too many from byte {offset} on, behind the end of the checkpoint")]
    Trailing { offset: usize, count: usize },
}

/// Writes a container: named byte sections under checksums. Layout, little-endian:
///
/// ```text
/// magic          8 bytes
/// format         u32
/// CRC-32         u32, of the 12 bytes before
/// section count  u32
/// sections       name length u32, data length u64, name, data,
///                CRC-32 u32 of all these
/// CRC-32         u32, of everything before
/// ```
///
/// Magic, format and their checksum stay as they are in all later formats, so that a newer
/// file is told from a damaged one. Section checksums say where a damage is; the last one
/// covers what lies between them.
pub(super) struct Encoder<'a, W> {
    file: &'a mut W,
    part: crc32fast::Hasher,
    whole: crc32fast::Hasher,
}

impl<'a, W: Write> Encoder<'a, W> {
    pub fn new(file: &'a mut W) -> Self {
        Self {
            file,
            part: crc32fast::Hasher::new(),
            whole: crc32fast::Hasher::new(),
        }
    }

    pub fn put_preamble(&mut self, format: u32, section_count: u32) -> io::Result<()> {
        self.put(&MAGIC)?;
        self.put(&format.to_le_bytes())?;
        self.put_checksum()?;
        self.put(&section_count.to_le_bytes())
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.part.update(bytes);
        self.whole.update(bytes);
        self.file.write_all(bytes)
    }

    /// Ends a part by its checksum.
    fn put_checksum(&mut self) -> io::Result<()> {
        let checksum = std::mem::take(&mut self.part).finalize();
        self.put(&checksum.to_le_bytes())
    }

    pub fn put_section(&mut self, name: &str, data: &[u8]) -> io::Result<()> {
        assert!(
            name.len() <= NAME_LIMIT,
            "section name `{name}` is too long"
        );
        self.part.reset();
        self.put(&(name.len() as u32).to_le_bytes())?;
        self.put(&(data.len() as u64).to_le_bytes())?;
        self.put(name.as_bytes())?;
        self.put(data)?;
        self.put_checksum()
    }

    pub fn put_file_checksum(self) -> io::Result<()> {
        self.file.write_all(&self.whole.finalize().to_le_bytes())
    }
}

/// One section, its checksum verified.
pub(super) struct Section<'a> {
    pub name: &'a str,
    pub data: &'a [u8],
    offset: usize,
}

impl Section<'_> {
    pub fn unexpected(&self, found: String, expected: &'static str) -> Fault {
        Fault::Unexpected {
            part: quoted(self.name),
            offset: self.offset,
            found,
            expected,
        }
    }
}

fn quoted(name: &str) -> String {
    format!("section `{}`", name.escape_debug())
}

pub(super) fn text(section: Section) -> Result<String, Fault> {
    match str::from_utf8(section.data) {
        Ok(text) => Ok(text.into()),
        Err(error) => Err(section.unexpected(error.to_string(), "UTF-8 text")),
    }
}

/// Walks through the bytes of a checkpoint.
pub(super) struct Decoder<'a> {
    bytes: &'a [u8],
    offset: usize,
}

impl<'a> Decoder<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, offset: 0 }
    }

    /// Magic, format and section count; returns the last.
    pub fn preamble(&mut self) -> Result<u32, Fault> {
        let start = &self.bytes[..self.bytes.len().min(MAGIC.len())];
        if !MAGIC.starts_with(start) {
            return Err(Fault::Magic);
        }
        let part = || "preamble".into();
        self.take(part, MAGIC.len() as u64)?;
        let format = u32::from_le_bytes(self.array(part)?);
        self.checksum(part, 0)?;
        if format != FORMAT {
            return Err(Fault::Format { found: format });
        }
        Ok(u32::from_le_bytes(self.array(|| "section count".into())?))
    }

    /// The next section, which must be called `name`.
    pub fn header(&mut self, name: &'static str) -> Result<Section<'a>, Fault> {
        let section = self.section()?;
        if section.name == name {
            Ok(section)
        } else {
            Err(Fault::Unexpected {
                part: "header".into(),
                offset: section.offset,
                found: quoted(section.name),
                expected: name,
            })
        }
    }

    pub fn section(&mut self) -> Result<Section<'a>, Fault> {
        let offset = self.offset;
        let nameless = || "section".to_string();
        let name_length = u32::from_le_bytes(self.array(nameless)?);
        let data_length = u64::from_le_bytes(self.array(nameless)?);
        if name_length as usize > NAME_LIMIT {
            return Err(Fault::NameLength {
                part: nameless(),
                offset,
                found: name_length,
            });
        }
        let name = self.take(nameless, u64::from(name_length))?;
        let part = || quoted(&String::from_utf8_lossy(name));
        let data = self.take(part, data_length)?;
        self.checksum(part, offset)?;
        let name = str::from_utf8(name).map_err(|error| Fault::Unexpected {
            part: part(),
            offset,
            found: error.to_string(),
            expected: "a name in UTF-8",
        })?;
        Ok(Section { name, data, offset })
    }

    /// The checksum of the whole file, and nothing behind it.
    pub fn end(&mut self) -> Result<(), Fault> {
        self.checksum(|| "whole file".into(), 0)?;
        match self.bytes.len() - self.offset {
            0 => Ok(()),
            count => Err(Fault::Trailing {
                offset: self.offset,
                count,
            }),
        }
    }

    /// Compares the checksum that comes next with that of all bytes since `start`.
    fn checksum(&mut self, part: impl Fn() -> String, start: usize) -> Result<(), Fault> {
        let found = crc32fast::hash(&self.bytes[start..self.offset]);
        let expected = u32::from_le_bytes(self.array(&part)?);
        if found == expected {
            return Ok(());
        }
        Err(Fault::Checksum {
            part: part(),
            offset: start,
            found,
            expected,
        })
    }

    fn array<const N: usize>(&mut self, part: impl Fn() -> String) -> Result<[u8; N], Fault> {
        let bytes = self.take(part, N as u64)?;
        Ok(bytes.try_into().expect("as many bytes as asked for"))
    }

    fn take(&mut self, part: impl Fn() -> String, count: u64) -> Result<&'a [u8], Fault> {
        let rest = &self.bytes[self.offset..];
        match usize::try_from(count) {
            Ok(count) if count <= rest.len() => {
                self.offset += count;
                Ok(&rest[..count])
            }
            _ => Err(Fault::Truncated {
                part: part(),
                offset: self.offset,
                needed: count,
                left: rest.len(),
            }),
        }
    }
}
