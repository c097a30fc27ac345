//! The substep of both solvers, see [`super::super::step`]: one workgroup an environment, as many
//! substeps of a control step in one launch as [`per_launch`] says.

use cubecl::prelude::*;

use super::cloth::{ClothBuffers, GpuFrame, SheetBuffers};
use super::edges::project;
use super::lines::{bend, lock, stretch};
use super::plan::Plan;
use super::vertices::{conclude, fall, give_way, grip, push, refresh};

/// Loops of a thread in one launch. Software Vulkan ends all loops after 65535 without a word, and
/// drivers reset a GPU whose screen stands still for seconds.
const MOST_LOOPS: usize = 30_000;

/// Substeps of a launch, each with so many `sweeps`, on workgroups of so many `units`.
pub(super) fn per_launch(plan: &Plan, sweeps: usize, units: usize) -> usize {
    let mut loops = 1 + (4 + sweeps) * plan.vertices.div_ceil(units);
    for line in plan.lines.iter().flatten() {
        // Forwards and backwards, for lengths and for bending or locking, which looks first.
        loops += line.lines.div_ceil(units) * (sweeps + 1) * (1 + 3 * line.longest);
    }
    let passes = plan.passes.iter();
    loops += passes.map(|pass| pass.count.div_ceil(units)).sum::<usize>();
    (MOST_LOOPS / loops).max(1)
}

/// Moves every environment by those of the `substeps` of a control step from `first` to `end`, with the
/// forces of a roller if `pressed`. All that moves is in memory between them.
#[cube(launch_unchecked)]
pub(super) fn advance(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    frame: GpuFrame,
    first: u32,
    end: u32,
    substeps: u32,
    interval: u32,
    sweeps: u32,
    #[comptime] pressed: bool,
    #[comptime] plan: Plan,
) {
    let environment = CUBE_POS_X as usize;
    let unit = UNIT_POS_X as usize;
    let units = CUBE_DIM_X as usize;
    let n = comptime!(plan.vertices);
    for substep in first..end {
        // Every thread goes on with the vertices that it has concluded.
        if substep % interval == 0 {
            for v in range_stepped(unit, n, units) {
                refresh(cloth, sheet, frame, environment, v, comptime!(&plan));
            }
        }
        if comptime!(plan.lines.is_some()) {
            along_lines(cloth, sheet, frame, sweeps, comptime!(&plan), pressed);
        } else {
            for v in range_stepped(unit, n, units) {
                fall(cloth, frame, environment, v, comptime!(&plan));
                if comptime!(pressed) {
                    push(cloth, frame, environment, v, comptime!(&plan));
                }
            }
            sync_storage();
            #[unroll]
            for p in 0..comptime!(plan.passes.len()) {
                let pass = comptime!(plan.passes[p]);
                for i in range_stepped(unit, comptime!(pass.count), units) {
                    project(cloth, sheet, environment, i, comptime!(&plan), pass);
                }
                sync_storage();
            }
        }
        let goes_on = (substep + 1) % interval != 0 && substep + 1 < substeps;
        for v in range_stepped(unit, n, units) {
            conclude(
                cloth,
                sheet,
                frame,
                environment,
                v,
                goes_on,
                comptime!(&plan),
            );
        }
    }
}

/// The stages of the yarn solver, the vertices' own at the start of a substep to the last before
/// contact.
#[cube]
fn along_lines(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    frame: GpuFrame,
    sweeps: u32,
    #[comptime] plan: &Plan,
    #[comptime] pressed: bool,
) {
    let environment = CUBE_POS_X as usize;
    let unit = UNIT_POS_X as usize;
    let units = CUBE_DIM_X as usize;
    let n = comptime!(plan.vertices);
    let [warps, wefts, diagonals] = comptime!(plan.lines.expect("the yarn solver"));
    sync_storage();
    for v in range_stepped(unit, n, units) {
        give_way(cloth, sheet, frame, environment, v, plan);
    }
    sync_storage();
    if comptime!(warps.is_bent) {
        for line in range_stepped(unit, comptime!(warps.lines), units) {
            bend(cloth, sheet, environment, line, plan, warps);
        }
        sync_storage();
    }
    if comptime!(pressed && plan.has_friction) {
        for v in range_stepped(unit, n, units) {
            grip(cloth, frame, environment, v, plan);
        }
        sync_storage();
    }
    if comptime!(diagonals.lines > 0) {
        for line in range_stepped(unit, comptime!(diagonals.lines), units) {
            stretch(cloth, sheet, environment, line, plan, diagonals);
            if comptime!(plan.locking.is_some()) {
                lock(cloth, sheet, environment, line, plan, diagonals);
            }
        }
        sync_storage();
    }
    for sweep in 0..sweeps {
        if comptime!(pressed) {
            for v in range_stepped(unit, n, units) {
                push(cloth, frame, environment, v, plan);
            }
            sync_storage();
        }
        for line in range_stepped(unit, comptime!(wefts.lines), units) {
            if comptime!(wefts.is_bent) {
                if sweep == 0 {
                    bend(cloth, sheet, environment, line, plan, wefts);
                }
            }
            stretch(cloth, sheet, environment, line, plan, wefts);
        }
        sync_storage();
        for line in range_stepped(unit, comptime!(warps.lines), units) {
            stretch(cloth, sheet, environment, line, plan, warps);
        }
        sync_storage();
    }
}
