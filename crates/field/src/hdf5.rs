//! The part of HDF5 that a tree of arrays needs: superblock version 0, groups by symbol tables, contiguous arrays, and
//! attributes (HDF5 File Format Specification, version 3.0, sections II.A, III.A to III.D, IV.A). Proven libraries for Rust
//! bring the one for C.

use std::collections::BTreeMap;

/// Entries of a group, twice what the superblock calls the rank of a leaf.
const ENTRIES: usize = 16;
/// Children of a node of a B-tree, twice what the superblock calls the rank of an inner node; one of them is used.
const CHILDREN: usize = 32;
const SUPERBLOCK: usize = 96;
const NOWHERE: u64 = u64::MAX;

/// What stands in a file.
pub(crate) enum Node {
    Group(
        BTreeMap<&'static str, Node>,
        BTreeMap<&'static str, Attribute>,
    ),
    /// Its shape, and its numbers row by row.
    Array(Vec<usize>, Data),
}

pub(crate) enum Data {
    Floats(Vec<f64>),
    Integers(Vec<i32>),
}

pub(crate) enum Attribute {
    Text(String),
    /// An array of one.
    Float(f64),
    Integer(i32),
}

impl Node {
    /// A group of at most 16 others.
    pub fn group<const N: usize>(children: [(&'static str, Node); N]) -> Self {
        const { assert!(N <= ENTRIES) };
        Self::Group(children.into(), BTreeMap::new())
    }

    /// A group with one more attribute.
    pub fn with(mut self, name: &'static str, attribute: Attribute) -> Self {
        if let Self::Group(_, attributes) = &mut self {
            attributes.insert(name, attribute);
        }
        self
    }

    /// The file of which this is the root.
    pub fn file(&self) -> Vec<u8> {
        let mut file = vec![0; SUPERBLOCK];
        let root = self.put(&mut file);
        let mut head = b"\x89HDF\r\n\x1a\n".to_vec();
        // Versions, then sizes of addresses and lengths.
        head.extend([0, 0, 0, 0, 0, 8, 8, 0]);
        head.extend((ENTRIES as u16 / 2).to_le_bytes());
        head.extend((CHILDREN as u16 / 2).to_le_bytes());
        head.extend([0; 4]);
        for address in [0, NOWHERE, file.len() as u64, NOWHERE] {
            head.extend(address.to_le_bytes());
        }
        head.extend(entry(0, root));
        file[..SUPERBLOCK].copy_from_slice(&head);
        file
    }

    /// Adds this and all below; gives the address of its object header.
    fn put(&self, file: &mut Vec<u8>) -> u64 {
        let messages = match self {
            Self::Group(children, attributes) => {
                let (mut names, mut table) = (vec![0; 8], b"SNOD\x01\x00".to_vec());
                table.extend((children.len() as u16).to_le_bytes());
                let mut last = 0;
                for (name, child) in children {
                    let address = child.put(file);
                    last = names.len() as u64;
                    table.extend(entry(last, address));
                    names.extend(padded(format!("{name}\0").into_bytes()));
                }
                table.resize(8 + 40 * ENTRIES, 0);
                let table = block(file, &table);
                let size = names.len() as u64;
                let names = block(file, &names);
                // No free space in the heap, which is said by 1.
                let heap = [b"HEAP\0\0\0\0".to_vec(), words(&[size, 1, names])].concat();
                let heap = block(file, &heap);
                let mut tree = b"TREE\0\0\x01\0".to_vec();
                // Siblings; then keys, which are names, around the only child.
                tree.extend(words(&[NOWHERE, NOWHERE, 0, table, last]));
                tree.resize(24 + 8 * (2 * CHILDREN + 1), 0);
                let tree = block(file, &tree);
                let mut messages = vec![(0x11, words(&[tree, heap]))];
                let attributes = attributes.iter();
                messages.extend(attributes.map(|(name, value)| (0x0c, attribute(name, value))));
                messages
            }
            Self::Array(shape, data) => {
                let (kind, bytes) = match data {
                    Data::Floats(all) => {
                        (float(), all.iter().flat_map(|x| x.to_le_bytes()).collect())
                    }
                    Data::Integers(all) => {
                        let bytes: Vec<u8> = all.iter().flat_map(|x| x.to_le_bytes()).collect();
                        (integer(), bytes)
                    }
                };
                let at = if bytes.is_empty() {
                    NOWHERE
                } else {
                    block(file, &bytes)
                };
                // Contiguous, by version 3.
                let layout = [vec![3, 1], words(&[at, bytes.len() as u64])].concat();
                vec![(0x01, space(shape)), (0x03, kind), (0x08, layout)]
            }
        };
        let mut body = Vec::new();
        for (kind, message) in &messages {
            let message = padded(message.clone());
            body.extend(u16::to_le_bytes(*kind));
            body.extend((message.len() as u16).to_le_bytes());
            body.extend([0; 4]);
            body.extend(message);
        }
        let mut header = vec![1, 0];
        header.extend((messages.len() as u16).to_le_bytes());
        header.extend(1u32.to_le_bytes());
        header.extend((body.len() as u32).to_le_bytes());
        header.extend([0; 4]);
        header.extend(body);
        block(file, &header)
    }
}

/// Adds bytes to a file, at a multiple of eight, and gives their address.
fn block(file: &mut Vec<u8>, bytes: &[u8]) -> u64 {
    file.resize(file.len().next_multiple_of(8), 0);
    let address = file.len() as u64;
    file.extend(bytes);
    address
}

fn padded(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}

fn words(words: &[u64]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// What a symbol table has of an object: where in the heap its name is, and its address; nothing is cached.
fn entry(name: u64, address: u64) -> Vec<u8> {
    words(&[name, address, 0, 0, 0])
}

/// The message of a shape.
fn space(shape: &[usize]) -> Vec<u8> {
    let mut bytes = vec![1, shape.len() as u8, 0, 0, 0, 0, 0, 0];
    bytes.extend(shape.iter().flat_map(|n| (*n as u64).to_le_bytes()));
    bytes
}

/// The message of a double of the IEEE: 52 bits of mantissa, 11 of exponent, bias 1023, sign in bit 63.
fn float() -> Vec<u8> {
    let mut bytes = vec![0x11, 0x20, 63, 0, 8, 0, 0, 0, 0, 0, 64, 0, 52, 11, 0, 52];
    bytes.extend(1023u32.to_le_bytes());
    bytes
}

/// The message of an integer of 32 bits with sign.
fn integer() -> Vec<u8> {
    vec![0x10, 0x08, 0, 0, 4, 0, 0, 0, 0, 0, 32, 0]
}

/// The message of an attribute, version 1, whose parts are all padded.
fn attribute(name: &str, value: &Attribute) -> Vec<u8> {
    let (kind, shape, bytes) = match value {
        Attribute::Text(text) => {
            // In UTF-8, with a zero at the end.
            let mut kind = vec![0x13, 0x10, 0, 0];
            kind.extend((text.len() as u32 + 1).to_le_bytes());
            (kind, space(&[]), format!("{text}\0").into_bytes())
        }
        Attribute::Float(x) => (float(), space(&[1]), x.to_le_bytes().to_vec()),
        Attribute::Integer(n) => (integer(), space(&[1]), n.to_le_bytes().to_vec()),
    };
    let name = format!("{name}\0").into_bytes();
    let mut message = vec![1, 0];
    for part in [&name, &kind, &shape] {
        message.extend((part.len() as u16).to_le_bytes());
    }
    for part in [name, kind, shape] {
        message.extend(padded(part));
    }
    message.extend(bytes);
    message
}
