//! The stencil: a plate that comes down on the cloth and keeps it near the tool.

use super::cloth::Cloth;
use crate::math::Lanes;

/// A plate that comes down on some vertices of one environment during a control step.
///
/// Its height over the tool falls evenly from `height` to 0 over the first `descent` substeps and
/// stays there; no vertex of the list may be above it.
#[derive(Clone, Debug, PartialEq)]
pub struct Press {
    pub environment: usize,
    pub vertices: Vec<u32>,
    /// Height over the tool at the start [m].
    pub height: f64,
    /// Substeps until the plate is down, > 0.
    pub descent: usize,
}

/// Height of a plate over the tool in a substep [m].
pub(super) fn height(plate: &Press, substep: usize) -> f64 {
    let left = 1.0 - (substep + 1) as f64 / plate.descent as f64;
    plate.height * left.max(0.0)
}

/// Keeps one lane of a place below `height` [m] over the tool: C = phi - height <= 0 [m], with the
/// `compliance` of the roller's skin [m/N].
#[inline(always)]
pub(super) fn hold_down<V: Lanes>(
    [place, lane]: [usize; 2],
    height: f64,
    compliance: f64,
    cloth: &mut Cloth<V>,
) {
    let mobility = cloth.mobility[place].get(lane);
    let n = cloth.plane[place].normal.get(lane);
    let offset = cloth.plane[place].offset.get(lane);
    let mut x = cloth.position[place].get(lane);
    let c = n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - offset - height;
    if c > 0.0 && mobility > 0.0 {
        let depth = c * mobility / (mobility + compliance);
        for k in 0..3 {
            x[k] -= n[k] * depth;
        }
        cloth.position[place].set(lane, x);
    }
}
