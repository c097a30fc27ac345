/// What stands in the way of cloth on a device.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DeviceError {
    /// A part of a scene that only the CPU computes.
    #[error("the GPU does not compute {0}")]
    Missing(&'static str),
    #[error("this build computes on no GPU: rebuild with `--features gpu`")]
    NotBuilt,
    #[error("there is no GPU with that number among {found}: see `drape devices`")]
    NoSuchAdapter { found: usize },
    #[error("there is no GPU with a driver for Vulkan, Metal or DirectX 12")]
    NoAdapter,
    #[error(
        "{environments} environments need {mib:.0} MiB in one buffer, and {name} allows {limit_mib:.0}"
    )]
    TooMany {
        environments: usize,
        mib: f64,
        limit_mib: f64,
        name: String,
    },
}
