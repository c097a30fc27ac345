use drape_cloth::file::in_words;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;

/// The named parts of a saved training.
pub type Sections = BTreeMap<String, Vec<u8>>;

/// The section of the parameters: all that an agent needs.
pub const NETWORK: &str = "network";

/// A section of a saved training that cannot be taken up; whoever reads it is as before.
#[derive(Debug, thiserror::Error)]
#[error("section `{section}`: {reason}")]
pub struct SectionError {
    section: &'static str,
    reason: String,
}

/// What `read` makes of a section.
pub fn read_section<V>(
    sections: &Sections,
    section: &'static str,
    read: impl FnOnce(&[u8]) -> Result<V, String>,
) -> Result<V, SectionError> {
    let bytes = sections.get(section).ok_or("missing".to_owned());
    let read = bytes.and_then(|bytes| read(bytes));
    read.map_err(|reason| SectionError {
        section,
        reason: in_words(reason),
    })
}

/// Plain data as bytes.
pub fn encode(value: &impl Serialize) -> Vec<u8> {
    postcard::to_allocvec(value).expect("plain data can be written")
}

/// The data in the bytes of [`encode`], or why there are none.
pub fn decode<V: DeserializeOwned>(bytes: &[u8]) -> Result<V, String> {
    postcard::from_bytes(bytes).map_err(|error| error.to_string())
}
