use burn::tensor::Device;
use serde::{Deserialize, Serialize};

/// Where the networks are computed. The simulation does not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeviceKind {
    /// burn's `flex` backend on the CPU, with convolutions of ours: always there, the same bits for any
    /// thread count.
    #[default]
    Flex,
    /// burn's deprecated `ndarray` backend on the CPU; cargo feature `ndarray`.
    Ndarray,
    /// The best graphics card that wgpu finds; cargo feature `gpu`.
    Gpu,
}

/// A device that this build cannot offer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("device `{kind}` is not in this build: rebuild with `--features {kind}`")]
pub struct DeviceError {
    kind: &'static str,
}

impl DeviceKind {
    /// The device, without gradients. Fails if the cargo feature that it needs is off.
    pub fn open(self) -> Result<Device, DeviceError> {
        match self {
            Self::Flex => Ok(Device::flex()),
            // Kept for comparison, although burn has deprecated it.
            #[cfg(feature = "ndarray")]
            #[allow(deprecated)]
            Self::Ndarray => Ok(Device::ndarray()),
            #[cfg(not(feature = "ndarray"))]
            Self::Ndarray => Err(DeviceError { kind: "ndarray" }),
            #[cfg(feature = "gpu")]
            Self::Gpu => Ok(Device::wgpu(burn::tensor::DeviceKind::DefaultDevice)),
            #[cfg(not(feature = "gpu"))]
            Self::Gpu => Err(DeviceError { kind: "gpu" }),
        }
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
            DeviceKind::Gpu.open().unwrap_err().to_string(),
            "device `gpu` is not in this build: rebuild with `--features gpu`"
        );
    }
}
