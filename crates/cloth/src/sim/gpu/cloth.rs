//! What a kernel works on.

use cubecl::prelude::*;

/// All that moves, environment by environment: vectors as [component][vertex].
#[derive(CubeType, CubeLaunch)]
pub(super) struct ClothBuffers {
    /// [m]
    pub position: Box<[f32]>,
    /// [m/s]
    pub velocity: Box<[f32]>,
    /// Positions at the start of the substep [m].
    pub previous: Box<[f32]>,
    /// Where their velocities take the vertices in the substep [m].
    pub predicted: Box<[f32]>,
    /// [1/kg], 0 of a fixed vertex.
    pub inverse_mass: Box<[f32]>,
    /// How far a vertex gives way within a substep [m/N].
    pub mobility: Box<[f32]>,
    /// Tangent plane of the tool under each vertex: normal, then offset [m].
    pub plane: Box<[f32]>,
    /// Force density of each yarn edge [N/m] in its slot, [number along the yarn][yarn].
    pub density: Box<[f32]>,
    /// Eliminated rows of the systems of lines.
    pub scratch: Box<[f32]>,
    /// What a roller presses each vertex with [N], 0 for not at all.
    pub force: Box<[f32]>,
    /// What an environment has of its own, [environment][field]: see [`super::own`].
    pub own: Box<[f32]>,
}

/// What is the same for all environments.
#[derive(CubeType, CubeLaunch)]
pub(super) struct SheetBuffers {
    /// Whole numbers of the [`super::plan::Plan`].
    pub numbers: Box<[u32]>,
    /// Its other numbers.
    pub values: Box<[f32]>,
    /// Signed distances [m] at the nodes of the grids of all tools, one after the other.
    pub samples: Box<[f32]>,
}

/// What is the same for all vertices in a substep, see [`super::super::frame::Frame`].
#[derive(CubeType, CubeLaunch, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(super) struct GpuFrame {
    pub h: f32,
    pub fall: f32,
    pub rate: f32,
    pub speed_cap: f32,
    pub stick: f32,
    pub slide: f32,
}
