use std::path::Path;

use anyhow::{Result, anyhow};
use serde::{Deserialize, Serialize};

use super::checkpoint::Checkpoint;
use drape_cloth::file::{Sealed, WriteError};
use drape_learn::policy::{DeviceKind, PolicyConfig};
use drape_learn::ppo::{Agent, NETWORK, read_section};
use drape_task::env::{Draping, ImageShape, Tasks, Terrain};

const FILE: Sealed = Sealed {
    name: "a policy",
    kind: 2,
    format: 1,
};

/// A policy apart from the run that taught it: what its network is, and its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weights {
    pub policy: PolicyConfig,
    network: Vec<u8>,
}

impl Weights {
    /// Of a checkpoint of a run with that policy.
    pub fn of(policy: &PolicyConfig, checkpoint: &Checkpoint) -> Result<Self> {
        Ok(Self {
            policy: policy.clone(),
            network: read_section(&checkpoint.sections, NETWORK, |bytes| Ok(bytes.to_vec()))?,
        })
    }

    /// Reads a file that [`Weights::write`] wrote.
    pub fn read(path: &Path) -> Result<Self> {
        Ok(FILE.read(path)?)
    }

    /// Writes the file whole or not at all.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        FILE.write(path, self)
    }

    /// The parameters, as [`Agent::save`] gives them.
    pub fn network(&self) -> &[u8] {
        &self.network
    }

    /// Refuses images that its network does not take.
    ///
    /// # Errors
    /// If it is of images of another size.
    pub fn check(&self, shape: ImageShape) -> Result<()> {
        self.seeing((shape, &[]), DeviceKind::Flex).map(drop)
    }

    /// The policy, for tasks that look like these.
    ///
    /// # Errors
    /// If its network is of images of another size, or cannot be on the device.
    pub fn agent(&self, draping: &Draping, device: DeviceKind) -> Result<Agent> {
        self.seeing((draping.shape(), &draping.terrains()), device)
    }

    fn seeing(&self, seen: (ImageShape, &[&Terrain]), device: DeviceKind) -> Result<Agent> {
        let mut agent = Agent::new(&self.policy, seen, 0, device)?;
        agent.load(&self.network).map_err(|fault| {
            let ImageShape { rows, columns } = seen.0;
            anyhow!(
                "`policy.network` does not play on {rows} x {columns} pixels, expected a `unet` or what has \
                 learned on as many: {fault}"
            )
        })?;
        Ok(agent)
    }
}
