//! Checked serde form of a bit set, for `#[serde(with)]`: the one of `fixedbitset` panics on
//! bytes that are not its own.

use fixedbitset::FixedBitSet;
use serde::de::{Deserialize, Deserializer, Error};
use serde::ser::{Serialize, Serializer};

/// Stores the length and 64 bits a word.
///
/// # Errors
/// Those of the format.
pub fn serialize<S: Serializer>(set: &FixedBitSet, serializer: S) -> Result<S::Ok, S::Error> {
    let mut words = vec![0u64; set.len().div_ceil(64)];
    set.ones().for_each(|i| words[i / 64] |= 1 << (i % 64));
    (set.len(), words).serialize(serializer)
}

/// Reads what [`serialize`] stored.
///
/// # Errors
/// Those of the format, and words that do not fit the length.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<FixedBitSet, D::Error> {
    let (length, words) = <(usize, Vec<u64>)>::deserialize(deserializer)?;
    let tail = words
        .last()
        .map_or(0, |word| word.checked_shr(length as u32 % 64).unwrap_or(0));
    if words.len() != length.div_ceil(64) || (length % 64 != 0 && tail != 0) {
        return Err(D::Error::custom("words do not fit the number of bits"));
    }
    let is_one = |i: &usize| words[i / 64] >> (i % 64) & 1 == 1;
    Ok(set(length, (0..length).filter(is_one)))
}

/// So many bits, and which of them are set.
pub fn set(length: usize, ones: impl Iterator<Item = usize>) -> FixedBitSet {
    let mut set = FixedBitSet::with_capacity(length);
    set.extend(ones);
    set
}
