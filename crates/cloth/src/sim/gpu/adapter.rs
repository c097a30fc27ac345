use cubecl::Device;
use cubecl::client::Client;
use cubecl::device::{WgpuDevice, WgpuDeviceKind};

use crate::sim::device_error::DeviceError;

/// A device that computes cloth: a GPU, or a processor that stands in for one.
#[derive(Clone, Debug, PartialEq)]
pub struct Adapter {
    device: WgpuDevice,
    kind: AdapterKind,
}

/// Kind of an adapter and its number among those.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AdapterKind {
    Discrete(usize),
    Integrated(usize),
    Virtual(usize),
    /// Software.
    Processor,
}

impl Adapter {
    /// All that this machine has, in the order of their numbers: discrete GPUs first.
    pub fn all() -> Vec<Self> {
        let known = |device| match device {
            Device::Wgpu(device) => Self::new(device),
            _ => None,
        };
        let mut all: Vec<Self> = (Device::enumerate_all().into_iter())
            .filter_map(known)
            .collect();
        all.sort_by_key(|adapter| adapter.kind);
        all
    }

    fn new(device: WgpuDevice) -> Option<Self> {
        let kind = match device.kind {
            WgpuDeviceKind::DiscreteGpu(number) => AdapterKind::Discrete(number),
            WgpuDeviceKind::IntegratedGpu(number) => AdapterKind::Integrated(number),
            WgpuDeviceKind::VirtualGpu(number) => AdapterKind::Virtual(number),
            WgpuDeviceKind::Cpu => AdapterKind::Processor,
            _ => return None,
        };
        Some(Self { device, kind })
    }

    /// The adapter of a number.
    ///
    /// # Errors
    /// There is none.
    pub fn number(number: usize) -> Result<Self, DeviceError> {
        let all = Self::all();
        let found = all.len();
        match all.into_iter().nth(number) {
            Some(adapter) => Ok(adapter),
            None if found == 0 => Err(DeviceError::NoAdapter),
            None => Err(DeviceError::NoSuchAdapter { found }),
        }
    }

    /// What kind of device it is.
    pub fn kind(&self) -> AdapterKind {
        self.kind
    }

    /// As its driver calls it.
    pub fn name(&self) -> String {
        self.client().properties().identity.name.to_string()
    }

    /// Largest buffer [bytes].
    pub fn largest_buffer(&self) -> u64 {
        self.client().properties().memory.max_page_size
    }

    /// The device, for other kernels and for networks that share its memory.
    pub fn device(&self) -> Device {
        Device::Wgpu(self.device.clone())
    }

    pub(super) fn client(&self) -> Client {
        self.device().client()
    }
}
