//! Kernels that carry states to and from the host, and what is asked about them.

use cubecl::prelude::*;

use super::cloth::ClothBuffers;
use super::plan::{MOST_UNITS, Plan};

/// Farthest from the origin that a position may be [m].
const FARTHEST: f32 = 100.0;

/// Numbers of a state that travels: positions, velocities, inverse masses, marks, force densities.
pub(super) fn packed(plan: &Plan) -> usize {
    8 * plan.vertices + plan.slots
}

/// Copies a packed state into an environment, whose masses it multiplies, or `BACK` out of it.
#[cube(launch_unchecked)]
pub(super) fn carry(
    cloth: &mut ClothBuffers,
    marks: &mut [u32],
    state: &mut [f32],
    environment: u32,
    mass: f32,
    #[comptime] back: bool,
    #[comptime] plan: Plan,
) {
    let n = comptime!(plan.vertices);
    let slots = comptime!(plan.slots);
    let environment = environment as usize;
    for i in range_stepped(UNIT_POS_X as usize, 3 * n, CUBE_DIM_X as usize) {
        let at = 3 * n * environment + i;
        if comptime!(back) {
            state[i] = cloth.position[at];
            state[3 * n + i] = cloth.velocity[at];
        } else {
            cloth.position[at] = state[i];
            cloth.velocity[at] = state[3 * n + i];
        }
    }
    for i in range_stepped(UNIT_POS_X as usize, n, CUBE_DIM_X as usize) {
        let at = n * environment + i;
        if comptime!(back) {
            state[6 * n + i] = cloth.inverse_mass[at];
            state[7 * n + i] = f32::cast_from(marks[at]);
        } else {
            cloth.inverse_mass[at] = state[6 * n + i] / mass;
            marks[at] = u32::cast_from(state[7 * n + i]);
        }
    }
    for i in range_stepped(UNIT_POS_X as usize, slots, CUBE_DIM_X as usize) {
        let at = slots * environment + i;
        if comptime!(back) {
            state[8 * n + i] = cloth.density[at];
        } else {
            cloth.density[at] = state[8 * n + i];
        }
    }
}

/// How many coordinates of the vertices of this thread are no numbers or too far off.
#[cube]
pub(super) fn astray(cloth: &ClothBuffers, #[comptime] n: usize) -> u32 {
    let first = 3 * n * CUBE_POS_X as usize;
    let mut count = 0u32;
    for i in range_stepped(UNIT_POS_X as usize, 3 * n, CUBE_DIM_X as usize) {
        let inside = cloth.position[first + i].abs() < FARTHEST;
        if !inside {
            count += 1;
        }
    }
    count
}

/// Counts the coordinates of each environment that are no numbers or too far off.
#[cube(launch_unchecked)]
pub(super) fn count_diverged(cloth: &ClothBuffers, diverged: &mut [u32], #[comptime] plan: Plan) {
    let unit = UNIT_POS_X as usize;
    let mut counts = Shared::<[u32]>::new_slice(MOST_UNITS);
    let mut count = astray(cloth, comptime!(plan.vertices));
    counts[unit] = count;
    sync_cube();
    if unit == 0 {
        for other in 1..CUBE_DIM_X as usize {
            count += counts[other];
        }
        diverged[CUBE_POS_X as usize] = count;
    }
}
