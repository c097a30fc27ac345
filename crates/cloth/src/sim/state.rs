use fixedbitset::FixedBitSet;
use serde::{Deserialize, Serialize};

use super::parameters::Own;

/// The moving state of one environment. f64, so that it holds the bits of any backend.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// [m]
    pub position: Vec<[f64; 3]>,
    /// [m/s]. A fixed vertex moves with the velocity it has, whatever pulls at it.
    pub velocity: Vec<[f64; 3]>,
    /// Vertices that no force moves: clamped or draped.
    #[serde(with = "crate::math::bits")]
    pub fixed: FixedBitSet,
    /// Force density, force / length, of every yarn edge [N/m], yarn by yarn as in the lamina, > 0 in
    /// tension: what the solve along yarns starts from. Missing ones are 0; without that solve all
    /// are missing.
    pub force_density: Vec<f64>,
    /// Sides on which layers of the cloth lie to each other, ascending, as self-collision
    /// remembers them; empty without it.
    pub sides: Vec<u64>,
    /// What presses have done so far.
    pub pressed: Pressed,
    /// What the environment has of its own.
    pub own: Own,
}

/// What presses have done to an environment; empty where nobody presses. Bits are one a vertex.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pressed {
    /// Vertices that have been under the stencil.
    #[serde(with = "crate::math::bits")]
    pub touched: FixedBitSet,
    /// Those of them that are fixed to the tool.
    #[serde(with = "crate::math::bits")]
    pub draped: FixedBitSet,
    /// The vertices under the stencil in the last press, ascending.
    pub stencil: Vec<u32>,
    /// Presses so far.
    pub count: u32,
}

/// Vertices that have been pressed, in order, and where they were then [m].
pub type Presses = Vec<(u32, [f64; 3])>;

/// Bits of a mark of a vertex: it was under a stencil.
pub const TOUCHED: u8 = 1;
/// It stays on the tool.
pub const DRAPED: u8 = 2;
/// It was under the stencil of the last press.
pub const STENCIL: u8 = 4;
/// A press on it is allowed by the rules of the task.
pub const ALLOWED: u8 = 8;

impl Snapshot {
    /// A state at rest with nothing fixed.
    pub fn at_rest(position: Vec<[f64; 3]>) -> Self {
        let count = position.len();
        Self {
            position,
            velocity: vec![[0.0; 3]; count],
            fixed: FixedBitSet::with_capacity(count),
            ..Self::default()
        }
    }

    /// Root mean square speed of all vertices [m/s].
    pub fn v_rms(&self) -> f64 {
        let sum: f64 = self.velocity.iter().flatten().map(|v| v * v).sum();
        (sum / self.velocity.len() as f64).sqrt()
    }

    /// Positions, velocities and force densities are numbers.
    pub fn is_finite(&self) -> bool {
        let all = self.position.iter().chain(&self.velocity);
        all.flatten()
            .chain(&self.force_density)
            .all(|x| x.is_finite())
    }
}
