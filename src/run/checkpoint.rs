use std::path::Path;

use anyhow::{Result, bail};
use serde::{Deserialize, Serialize};

use super::folder::{RunError, RunFolder};
use drape_cloth::file::{Sealed, WriteError};
use drape_learn::ppo::Sections;

/// Its files. Newest formats:
/// 8: observations are without the last presses;
/// 9: states have parameters, and of its configuration a checkpoint has the digest only;
/// 10: episodes are numbered, as what their worlds are drawn by;
/// 12: the digest is of what may not change in a configuration.
const FILE: Sealed = Sealed {
    name: "a checkpoint",
    kind: 0,
    format: 12,
};

/// What a run goes on from exactly where it was, or is played by, in one file.
///
/// It knows names and bytes, not what they mean: whoever owns a network, optimiser or random
/// stream turns it into a section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// See [`RunFolder::config_digest`].
    pub config_digest: String,
    /// Binary content by name.
    pub sections: Sections,
}

impl Checkpoint {
    /// Reads a checkpoint of the run in `folder`.
    pub fn of_run(path: &Path, folder: &RunFolder) -> Result<Self> {
        let checkpoint: Self = FILE.read(path)?;
        if checkpoint.config_digest != folder.config_digest()? {
            bail!(RunError::OtherConfig(path.into(), folder.config.clone()));
        }
        Ok(checkpoint)
    }

    /// Writes the file whole or not at all.
    pub fn save(&self, path: &Path) -> Result<(), WriteError> {
        FILE.write(path, self)
    }
}
