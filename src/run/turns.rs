use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use super::folder::{RunFolder, write_json};
use drape_cloth::file::read_json;

/// One turn of the loop of pressing, scanning and improving, as `loop.json` lists them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Turn {
    /// The run whose path was pressed.
    pub from: String,
    pub scans: Vec<ScanFile>,
    /// Points that the fabric was found by, and how far they are off the simulated cloth in the end, root mean square.
    pub points: usize,
    pub rms_mm: f64,
    /// Factors on the fabric of that run.
    pub parameters: Vec<Parameter>,
    /// What has to be known beside them.
    pub notes: Vec<String>,
    /// Scores of the old path and of the new one in worlds of the new fabric [-]; none of what diverges there.
    pub score_before: Option<f64>,
    pub score_after: Option<f64>,
    /// Presses of either, and those of the old path that the new one makes in the same order.
    pub presses_before: usize,
    pub presses_after: usize,
    pub presses_kept: usize,
}

/// A scan that was used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScanFile {
    pub file: String,
    /// See [`digest`](super::digest).
    pub digest: String,
}

/// A quantity with the interval that holds it at 90 %.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    pub name: String,
    pub value: f64,
    pub low: Option<f64>,
    pub high: Option<f64>,
    /// Of tests.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub specimens: Option<usize>,
    /// Of scans: they say more of it than was known before.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub told: Option<bool>,
}

impl RunFolder {
    /// The turns that have led to this run, the first first; none where it was not improved.
    pub fn read_turns(&self) -> Result<Vec<Turn>> {
        let path = self.path.join("loop.json");
        let exists = path.try_exists();
        match exists.with_context(|| format!("cannot read {}", path.display()))? {
            true => Ok(read_json(&path, "a list of turns")?),
            false => Ok(Vec::new()),
        }
    }

    /// Keeps the turns that have led to this run.
    pub fn write_turns(&self, turns: &[Turn]) -> Result<()> {
        write_json(&self.path.join("loop.json"), &turns)
    }
}

/// How many presses of two paths are the same in the same order: the length of their longest common subsequence.
pub fn kept_presses(before: &[u32], after: &[u32]) -> usize {
    let mut row = vec![0; after.len() + 1];
    for old in before {
        let mut diagonal = 0;
        for (k, new) in after.iter().enumerate() {
            let above = row[k + 1];
            row[k + 1] = match old == new {
                true => diagonal + 1,
                false => above.max(row[k]),
            };
            diagonal = above;
        }
    }
    row[after.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_presses_are_those_in_the_same_order() {
        for (before, after, kept) in [
            (&[][..], &[][..], 0),
            (&[1, 2, 3], &[1, 2, 3], 3),
            (&[1, 2, 3], &[3, 2, 1], 1),
            (&[1, 2, 3, 4], &[9, 2, 4, 1], 2),
            (&[5, 5, 6], &[5, 6, 5], 2),
        ] {
            assert_eq!(kept_presses(before, after), kept, "{before:?} {after:?}");
            assert_eq!(kept_presses(after, before), kept, "{after:?} {before:?}");
        }
    }
}
