//! The GPU: one workgroup an environment, through wgpu (Vulkan, Metal, DirectX 12), in single
//! precision.
//!
//! Kernels are written in Rust and compiled for the device when a world first runs on it; what is
//! the same for a world is compiled in. Their constants are those of the stages beside this module, and
//! their tables come from the same [`super::Model`]. `tests/conformance.rs` holds them against the CPU.

// What is compiled in is asked by itself, so that the compiler of kernels can leave it out.
#![allow(clippy::collapsible_if)]

/// Launches a kernel over so many workgroups, with the cloth before its arguments and the plan after.
macro_rules! launch {
    ($gpu:expr, $groups:expr, $kernel:ident($($argument:expr),*)) => {
        // SAFETY: the plan and the sizes of the buffers belong together.
        unsafe {
            $kernel::launch_unchecked(
                &$gpu.client,
                CubeCount::Static($groups as u32, 1, 1),
                CubeDim::new_1d($gpu.units),
                $gpu.cloth(),
                $($argument,)*
                $gpu.plan.clone(),
            )
        }
    };
}

mod adapter;
mod backend;
mod buffer;
mod cloth;
mod edges;
mod lines;
mod look;
mod measure;
mod own;
mod plan;
mod press;
mod substep;
mod tool;
mod traffic;
mod transfer;
mod vector;
mod vertices;

pub use adapter::{Adapter, AdapterKind};
pub use backend::Gpu;
pub use buffer::Buffer;
pub use traffic::Traffic;
