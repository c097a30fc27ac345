//! The GPU: one workgroup an environment, through wgpu (Vulkan, Metal, DirectX 12), in single
//! precision.
//!
//! Kernels are written in Rust and compiled for the device when a world first runs on it; what is
//! the same for a world is compiled in. Their constants are those of the stages beside this module, and
//! their tables come from the same [`super::Model`]. `tests/conformance.rs` holds them against the CPU.

mod adapter;
mod backend;
mod cloth;
mod edges;
mod lines;
mod plan;
mod press;
mod substep;
mod tool;
mod transfer;
mod vector;
mod vertices;

pub use adapter::Adapter;
pub use backend::Gpu;

/// What stands in the way of cloth on a GPU.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GpuError {
    /// A part of a scene that only the CPU computes.
    #[error("the GPU does not compute {0}: use the CPU for this scene")]
    Missing(&'static str),
    #[error("no GPU number {index}, found {}: `drape devices` lists them", count(*.found))]
    NoSuchAdapter { index: usize, found: usize },
    #[error("no GPU found, expected one with Vulkan, Metal or DirectX 12 and its driver")]
    NoAdapter,
    #[error(
        "{environments} environments need {mib:.0} MiB in one buffer, expected at most {limit_mib:.0} on {name}: use fewer of them"
    )]
    TooMany {
        environments: usize,
        mib: f64,
        limit_mib: f64,
        name: String,
    },
}

fn count(found: usize) -> String {
    match found {
        1 => "one, number 0".into(),
        _ => format!("{found}"),
    }
}
