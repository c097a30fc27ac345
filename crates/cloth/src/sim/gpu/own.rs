//! What an environment has of its own, as kernels see it: numbers that its laws are multiplied by, and which
//! tool and view it has.

use cubecl::prelude::*;

use super::super::parameters::Own;
use super::super::stencil::Stencil;
use super::plan::GridPlan;

/// On compliances of warps, wefts and diagonals, pulled and pushed.
pub(super) const COMPLIANCE: usize = 0;
/// On the bending stiffness of warps and wefts.
pub(super) const BENDING: usize = 6;
/// On static and dynamic friction.
pub(super) const FRICTION: usize = 8;
/// On the roller's pressure.
pub(super) const PRESSURE: usize = 10;
/// Half of the stencil's side [m], and how far to look for vertices under it.
pub(super) const HALF: usize = 11;
pub(super) const REACH: usize = 12;
/// The speed at which the roller comes down [m/s].
pub(super) const SPEED: usize = 13;
/// Numbers of tool and view.
pub(super) const TOOL: usize = 14;
pub(super) const VIEW: usize = 15;
/// How many fields there are.
pub(super) const FIELDS: usize = 16;

/// The fields of an environment, pressed with `stencil` if it is.
pub(super) fn fields(of: &Own, stencil: Option<&Stencil>) -> [f32; FIELDS] {
    let own = &of.parameters;
    let mut fields = [1.0; FIELDS];
    for k in 0..2 {
        for (field, factor) in [
            (COMPLIANCE + 2 * k, 1.0 / own.tension[k]),
            (COMPLIANCE + 2 * k + 1, 1.0 / own.compression[k]),
            (COMPLIANCE + 4 + k, 1.0 / own.shear[k]),
            (BENDING + k, own.bending[k]),
            (FRICTION + k, own.friction[k]),
        ] {
            fields[field] = factor as f32;
        }
    }
    if let Some(stencil) = stencil {
        let side = stencil.side * own.stencil;
        fields[HALF] = Stencil::half(side) as f32;
        fields[REACH] = (Stencil::reach(side, 0.0) * (1.0 + 1e-6)) as f32;
        fields[SPEED] = stencil.roller.speed as f32;
    }
    fields[PRESSURE] = own.pressure as f32;
    fields[TOOL] = of.tool.into();
    fields[VIEW] = of.view.into();
    fields
}

/// The number of the tool of an environment.
#[cube]
pub(super) fn tool_of(own: &[f32], environment: usize, #[comptime] grid: GridPlan) -> usize {
    let mut tool = 0usize;
    if comptime!(grid.tools > 1) {
        tool = u32::cast_from(own[environment * FIELDS + TOOL]) as usize;
    }
    tool
}
