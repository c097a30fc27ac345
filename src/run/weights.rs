use std::path::Path;

use anyhow::{Result, anyhow, ensure};
use serde::{Deserialize, Serialize};

use super::checkpoint::Checkpoint;
use super::config::RunConfig;
use super::folder::digest;
use drape_cloth::file::{Sealed, WriteError};
use drape_cloth::sim::Mask;
use drape_learn::policy::{DeviceKind, NetworkConfig, PolicyConfig};
use drape_learn::ppo::{Agent, NETWORK, read_section};
use drape_task::env::{Draping, ImageShape, Tasks, Terrain};

const FILE: Sealed = Sealed {
    name: "a policy",
    kind: 2,
    format: 3,
};

/// A policy apart from the run that taught it: what its network is, and its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weights {
    pub policy: PolicyConfig,
    /// Where it has learned to press.
    pub mask: Mask,
    /// Rows and columns of the images that it has learned on.
    learned_on: [usize; 2],
    network: Vec<u8>,
}

impl Weights {
    /// Of a checkpoint of a run with that configuration and images.
    pub fn of(config: &RunConfig, shape: ImageShape, checkpoint: &Checkpoint) -> Result<Self> {
        Ok(Self {
            policy: config.policy.clone(),
            mask: config.env.mask,
            learned_on: [shape.rows, shape.columns],
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

    /// [`digest`] of the parameters.
    pub fn digest(&self) -> String {
        digest(&self.network)
    }

    /// The parameters, as [`Agent::save`] gives them.
    pub fn network(&self) -> &[u8] {
        &self.network
    }

    /// Refuses what could not play on such images, before a blank falls.
    ///
    /// # Errors
    /// If its weights belong to places, and it has learned on images of another size; or if they do not fit its network,
    /// or the network such images.
    pub fn check(&self, shape: ImageShape) -> Result<()> {
        let is_of_any_size = matches!(self.policy.network, NetworkConfig::Unet(_));
        let [rows, columns] = self.learned_on;
        let ImageShape {
            rows: r,
            columns: c,
        } = shape;
        ensure!(
            is_of_any_size || [r, c] == self.learned_on,
            "`policy.network` has learned on {rows} x {columns} pixels, expected {r} x {c}, or a `unet`"
        );
        self.load(shape, &[], DeviceKind::Flex).map(drop)
    }

    /// The policy, for tasks that look like these.
    ///
    /// # Errors
    /// If its weights or these images do not fit its network, or that cannot be on the device.
    pub fn agent(&self, draping: &Draping, device: DeviceKind) -> Result<Agent> {
        self.load(draping.shape(), &draping.terrains(), device)
    }

    fn load(&self, shape: ImageShape, terrains: &[&Terrain], device: DeviceKind) -> Result<Agent> {
        let mut agent = Agent::new(&self.policy, shape, terrains, 0, device)?;
        agent.load(&self.network).map_err(|fault| anyhow!(fault))?;
        Ok(agent)
    }
}
