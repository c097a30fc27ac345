//! What episodes are judged by, see [`crate::measure::Measures`]: one workgroup an environment.

use cubecl::prelude::*;

use super::cloth::{ClothBuffers, SheetBuffers};
use super::own::{FIELDS, VIEW, tool_of};
use super::plan::{MOST_UNITS, Plan};
use super::tool::distance;
use super::vector::Vec3g;

/// Numbers of an environment, the sums first: distance and surplus, each of its view's region and of the sheet,
/// then strain and depth.
pub(super) const NUMBERS: usize = 6;
const SUMS: usize = 4;

/// How each vertex lies off the point of the tool that is nearest to it goes where predictions are kept within a
/// control step.
#[cube(launch_unchecked)]
pub(super) fn weigh(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    environments: &[u32],
    found: &mut [f32],
    #[comptime] plan: Plan,
) {
    let n = comptime!(plan.vertices);
    let look = comptime!(plan.look.expect("a world with views"));
    let edge_count = comptime!(look.edge_count);
    let unit = UNIT_POS_X as usize;
    let environment = environments[CUBE_POS_X as usize] as usize;
    let vectors = 3 * n * environment;
    let view = u32::cast_from(cloth.own[environment * FIELDS + VIEW]) as usize;
    let inside = comptime!(look.inside) + view * n;
    let tool = tool_of(&cloth.own, environment, comptime!(plan.grid));
    let mut distance_inside = 0.0f32;
    let mut distance_of_all = 0.0f32;
    let mut surplus_inside = 0.0f32;
    let mut surplus_of_all = 0.0f32;
    let mut strain = f32::new(-1.0);
    let mut depth = f32::new(-1.0e9);
    for v in range_stepped(unit, n, CUBE_DIM_X as usize) {
        let x = Vec3g::load(&cloth.position, vectors, n, v);
        let (phi, normal) = distance(sheet, x, tool, comptime!(plan.grid));
        normal.scale(phi).store(&mut cloth.predicted, vectors, n, v);
        let above = phi.max(0.0f32);
        distance_of_all += above;
        distance_inside += select(sheet.numbers[inside + v] == 1u32, above, 0.0f32);
        depth = depth.max(-phi);
    }
    sync_storage();
    for e in range_stepped(unit, edge_count, CUBE_DIM_X as usize) {
        let a = sheet.numbers[comptime!(look.edges) + e] as usize;
        let b = sheet.numbers[comptime!(look.edges + look.edge_count) + e] as usize;
        let rest = sheet.values[comptime!(look.rest) + e];
        let x = Vec3g::load(&cloth.position, vectors, n, a);
        let edge = Vec3g::load(&cloth.position, vectors, n, b).minus(x);
        // Short differences first: feet would be rounded as places are, by more than a trace may be off.
        let above = Vec3g::load(&cloth.predicted, vectors, n, a);
        let turned = Vec3g::load(&cloth.predicted, vectors, n, b).minus(above);
        let trace = edge.minus(turned);
        let excess = (rest - trace.dot(trace).sqrt()).max(0.0f32);
        surplus_of_all += excess;
        let is_inside = sheet.numbers[inside + a] + sheet.numbers[inside + b] == 2u32;
        surplus_inside += select(is_inside, excess, 0.0f32);
        strain = strain.max(edge.dot(edge).sqrt() / rest - 1.0f32);
    }
    let mut all = Shared::<[f32]>::new_slice(comptime!(NUMBERS * MOST_UNITS));
    all[unit] = distance_inside;
    all[MOST_UNITS + unit] = distance_of_all;
    all[comptime!(2 * MOST_UNITS) + unit] = surplus_inside;
    all[comptime!(3 * MOST_UNITS) + unit] = surplus_of_all;
    all[comptime!(4 * MOST_UNITS) + unit] = strain;
    all[comptime!(5 * MOST_UNITS) + unit] = depth;
    sync_cube();
    if unit < comptime!(NUMBERS) {
        let first = unit * comptime!(MOST_UNITS);
        let mut total = all[first];
        for other in 1..CUBE_DIM_X as usize {
            let one = all[first + other];
            total = select(unit < comptime!(SUMS), total + one, total.max(one));
        }
        found[CUBE_POS_X as usize * comptime!(NUMBERS) + unit] = total;
    }
}
