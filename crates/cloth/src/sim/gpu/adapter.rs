use cubecl::Device;
use cubecl::client::Client;

use super::GpuError;

/// A device that computes cloth: a GPU, or a processor that stands in for one.
#[derive(Clone, Debug, PartialEq)]
pub struct Adapter {
    pub(super) device: Device,
}

impl Adapter {
    /// All that this machine has, in the order of their numbers: GPUs first.
    pub fn all() -> Vec<Self> {
        let mut devices = Device::enumerate_all();
        devices.sort_by_key(|device| device.to_id().type_id);
        devices.into_iter().map(|device| Self { device }).collect()
    }

    /// Number `index` of them.
    ///
    /// # Errors
    /// There is none.
    pub fn number(index: usize) -> Result<Self, GpuError> {
        let all = Self::all();
        let found = all.len();
        match all.into_iter().nth(index) {
            Some(adapter) => Ok(adapter),
            None if found == 0 => Err(GpuError::NoAdapter),
            None => Err(GpuError::NoSuchAdapter { index, found }),
        }
    }

    /// As its driver calls it.
    pub fn name(&self) -> String {
        self.client().properties().identity.name.to_string()
    }

    /// Largest buffer [bytes].
    pub fn largest_buffer(&self) -> u64 {
        self.client().properties().memory.max_page_size
    }

    pub(super) fn client(&self) -> Client {
        self.device.client()
    }
}
