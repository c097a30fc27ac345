use std::fmt;
use std::str::FromStr;

use burn::tensor::Device;
use drape_cloth::sim;
use serde::{Deserialize, Serialize};

/// Where the networks are computed: `flex`, `gpu` or `gpu:N`. The simulation has a device of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum DeviceKind {
    /// burn's `flex` backend on the CPU, with convolutions of ours: always there, the same bits for any
    /// thread count.
    #[default]
    Flex,
    /// The graphics card of this number in `drape devices`; cargo feature `gpu`.
    Gpu(usize),
}

/// A device that this build or machine cannot offer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NetworkDeviceError {
    #[error("device `gpu` is not in this build: rebuild with `--features gpu`")]
    NotBuilt,
    #[error("device `{device}`: {error}")]
    Absent {
        device: DeviceKind,
        error: sim::DeviceError,
    },
}

impl DeviceKind {
    /// Where the cloth of a training on this device is computed, unless it is told otherwise.
    pub fn of_cloth(self) -> sim::Device {
        match self {
            Self::Flex => sim::Device::Cpu,
            Self::Gpu(number) => sim::Device::Gpu(number),
        }
    }

    /// Whether observations are encoded there.
    pub(crate) fn encodes_there(self) -> bool {
        matches!(self, Self::Gpu(_))
    }

    /// The device, without gradients.
    ///
    /// # Errors
    /// The cargo feature that it needs is off, or this machine has none.
    pub fn open(self) -> Result<Device, NetworkDeviceError> {
        match self {
            Self::Flex => Ok(Device::flex()),
            #[cfg(feature = "gpu")]
            Self::Gpu(number) => match sim::Adapter::number(number) {
                Ok(adapter) => Ok(of_burn(&adapter)),
                Err(error) => Err(NetworkDeviceError::Absent {
                    device: self,
                    error,
                }),
            },
            #[cfg(not(feature = "gpu"))]
            Self::Gpu(_) => Err(NetworkDeviceError::NotBuilt),
        }
    }
}

/// The cloth's device, so that both share its memory.
#[cfg(feature = "gpu")]
pub(super) fn of_burn(adapter: &sim::Adapter) -> Device {
    Device::new(burn::backend::DispatchDevice::Cube(adapter.device()))
}

impl fmt::Display for DeviceKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Flex => f.write_str("flex"),
            Self::Gpu(_) => self.of_cloth().fmt(f),
        }
    }
}

impl From<DeviceKind> for String {
    fn from(device: DeviceKind) -> Self {
        device.to_string()
    }
}

impl FromStr for DeviceKind {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match name {
            "flex" => Ok(Self::Flex),
            _ => match name.parse() {
                Ok(sim::Device::Gpu(number)) => Ok(Self::Gpu(number)),
                _ => Err(format!("device {name:?}, expected flex, gpu or gpu:N")),
            },
        }
    }
}

impl TryFrom<String> for DeviceKind {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        name.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flex_opens_and_an_absent_device_says_what_to_build() {
        assert!(DeviceKind::Flex.open().is_ok());
        #[cfg(not(feature = "gpu"))]
        assert_eq!(
            DeviceKind::Gpu(0).open().unwrap_err().to_string(),
            "device `gpu` is not in this build: rebuild with `--features gpu`"
        );
        #[cfg(feature = "gpu")]
        assert!(DeviceKind::Gpu(99).open().is_err());
    }

    #[test]
    fn names_are_read_as_they_are_written() {
        for name in ["flex", "gpu", "gpu:1"] {
            assert_eq!(name.parse::<DeviceKind>().unwrap().to_string(), name);
        }
        for name in ["cpu", "", "gpu:", "Flex"] {
            assert!(name.parse::<DeviceKind>().is_err(), "{name}");
        }
    }
}
