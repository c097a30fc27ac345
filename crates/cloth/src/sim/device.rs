use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::backend::{Backend, World};
use super::cpu::{Cpu, Precision};
use super::device_error::DeviceError;
#[cfg(feature = "gpu")]
use super::gpu::{Adapter, Gpu};

/// Where cloth is computed: `cpu`, `gpu` or `gpu:N`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Device {
    /// SIMD lanes over all threads.
    #[default]
    Cpu,
    /// The graphics card of this number in `drape devices`; cargo feature `gpu`.
    Gpu(usize),
}

impl Device {
    /// `count` > 0 environments, each at its start.
    ///
    /// # Errors
    /// This build or machine has no such device, or it does not compute all that the world lists.
    pub fn open(
        self,
        world: &World,
        count: usize,
        precision: Precision,
    ) -> Result<Box<dyn Backend>, DeviceError> {
        match self {
            Self::Cpu => Ok(Box::new(Cpu::new(world, count, precision))),
            #[cfg(feature = "gpu")]
            Self::Gpu(number) => match precision {
                Precision::F32 => {
                    let adapter = Adapter::number(number)?;
                    Ok(Box::new(Gpu::new(world, count, &adapter)?))
                }
                Precision::F64 => Err(DeviceError::Missing("`precision = \"f64\"`")),
            },
            #[cfg(not(feature = "gpu"))]
            Self::Gpu(_) => Err(DeviceError::NotBuilt),
        }
    }
}

impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Cpu => f.write_str("cpu"),
            Self::Gpu(0) => f.write_str("gpu"),
            Self::Gpu(number) => write!(f, "gpu:{number}"),
        }
    }
}

impl From<Device> for String {
    fn from(device: Device) -> Self {
        device.to_string()
    }
}

impl FromStr for Device {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match name.split_once(':') {
            None if name == "cpu" => Some(Self::Cpu),
            None if name == "gpu" => Some(Self::Gpu(0)),
            Some(("gpu", number)) => number.parse().ok().map(Self::Gpu),
            _ => None,
        }
        .ok_or_else(|| format!("device {name:?}, expected cpu, gpu or gpu:N"))
    }
}

impl TryFrom<String> for Device {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        name.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_they_are_written() {
        for (name, device) in [
            ("cpu", Device::Cpu),
            ("gpu", Device::Gpu(0)),
            ("gpu:12", Device::Gpu(12)),
        ] {
            assert_eq!(name.parse(), Ok(device));
            assert_eq!(device.to_string(), name);
        }
        assert_eq!("gpu:0".parse(), Ok(Device::Gpu(0)));
        for name in ["", "GPU", "gpu:", "gpu:-1", "gpu:x", "cpu:1", "flex"] {
            let expected = format!("device {name:?}, expected cpu, gpu or gpu:N");
            assert_eq!(name.parse::<Device>(), Err(expected));
        }
    }
}
