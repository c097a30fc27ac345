//! What is seen of environments and may be done there, see [`super::super::view`]: one workgroup an
//! environment.

use cubecl::prelude::*;

use super::super::state::{ALLOWED, DRAPED, STENCIL, TOUCHED};
use super::super::view::Mask;
use super::cloth::{ClothBuffers, SheetBuffers};
use super::own::{FIELDS, VIEW, tool_of};
use super::plan::{MOST_UNITS, NEIGHBORS, NOTHING, Plan};
use super::tool::distance;
use super::transfer::astray;
use super::vector::Vec3g;

/// Shows distances [m] and marks `[environment, pixel]`, and tells how many vertices of the view are left to be
/// pressed and how many coordinates are astray `[environment, 2]`.
#[cube(launch_unchecked)]
pub(super) fn look(
    cloth: &ClothBuffers,
    sheet: &SheetBuffers,
    marks: &[u32],
    shown_distance: &mut [f32],
    shown_marks: &mut [u32],
    told: &mut [u32],
    #[comptime] plan: Plan,
) {
    let environment = CUBE_POS_X as usize;
    let unit = UNIT_POS_X as usize;
    let units = CUBE_DIM_X as usize;
    let n = comptime!(plan.vertices);
    let look = comptime!(plan.look.expect("a world with views"));
    let pixels = comptime!(look.pixels);
    let touched = comptime!(TOUCHED as u32);
    let shown = comptime!((TOUCHED | DRAPED | STENCIL) as u32);
    let allowed = comptime!(ALLOWED as u32);
    let view = u32::cast_from(cloth.own[environment * FIELDS + VIEW]) as usize;
    let seen = comptime!(look.seen) + view * pixels;
    let tool = tool_of(&cloth.own, environment, comptime!(plan.grid));
    // Of this thread's pixels: those left to be pressed, and untouched ones beside the stencil.
    let mut left = 0u32;
    let mut beside = 0u32;
    for pixel in range_stepped(unit, pixels, units) {
        let vertex = sheet.numbers[seen + pixel];
        let mut mark = 0u32;
        let mut above = 0.0f32;
        if vertex != NOTHING {
            let v = vertex as usize;
            let x = Vec3g::load(&cloth.position, 3 * environment * n, n, v);
            let (phi, _normal) = distance(sheet, x, tool, comptime!(plan.grid));
            // What is no number is shown as 0.
            above = select(phi > 0.0f32, phi, 0.0f32);
            mark = marks[environment * n + v] & shown;
            if mark & touched == 0 {
                // The last press, or any.
                let mut is_beside = false;
                let bit = comptime!(match look.mask {
                    Mask::Stroke => STENCIL as u32,
                    Mask::Free => TOUCHED as u32,
                });
                #[unroll]
                for i in 0..NEIGHBORS {
                    let other = sheet.numbers[comptime!(look.near + i * n) + v];
                    if other != NOTHING {
                        let near = marks[environment * n + other as usize];
                        is_beside = is_beside || near & bit != 0;
                    }
                }
                if comptime!(look.mask == Mask::Free) {
                    mark |= allowed;
                    left += select(is_beside, 0u32, 1u32);
                } else {
                    left += 1;
                    if is_beside {
                        beside += 1;
                        mark |= allowed;
                    }
                }
            }
        }
        shown_distance[environment * pixels + pixel] = above;
        shown_marks[environment * pixels + pixel] = mark;
    }
    let mut counts = Shared::<[u32]>::new_slice(comptime!(3 * MOST_UNITS));
    counts[unit] = left;
    counts[MOST_UNITS + unit] = beside;
    counts[comptime!(2 * MOST_UNITS) + unit] = astray(cloth, n);
    sync_cube();
    let mut all_left = 0u32;
    let mut all_beside = 0u32;
    let mut all_astray = 0u32;
    for other in 0..units {
        all_left += counts[other];
        all_beside += counts[MOST_UNITS + other];
        all_astray += counts[comptime!(2 * MOST_UNITS) + other];
    }
    if unit == 0 {
        told[2 * environment] = all_left;
        told[2 * environment + 1] = all_astray;
    }
    if all_beside == 0 {
        // No stroke is to be gone on with.
        for pixel in range_stepped(unit, pixels, units) {
            let at = environment * pixels + pixel;
            if sheet.numbers[seen + pixel] != NOTHING && shown_marks[at] & touched == 0 {
                shown_marks[at] |= allowed;
            }
        }
    }
}
