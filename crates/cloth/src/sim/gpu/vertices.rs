//! What a substep does to each vertex by itself, one thread a vertex: see [`super::super::length`],
//! [`super::super::contact`] and [`super::super::press`].

use cubecl::prelude::*;

use super::super::contact::TACK_RANGE;
use super::super::length::{CROSSING, DRAG};
use super::super::press::TOUCHING;
use super::cloth::{ClothBuffers, GpuFrame, SheetBuffers};
use super::own::{BENDING, FIELDS, FRICTION, SPEED, tool_of};
use super::plan::{NOTHING, Plan};
use super::tool::distance;
use super::vector::Vec3g;

const CROSSING_F32: f32 = CROSSING as f32;
const DRAG_F32: f32 = DRAG as f32;
const TACK_RANGE_F32: f32 = TACK_RANGE as f32;
const TOUCHING_F32: f32 = TOUCHING as f32;

/// Looks up the tangent plane of the tool under a vertex, and where its velocity takes it.
#[cube]
pub(super) fn refresh(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    frame: GpuFrame,
    environment: usize,
    v: usize,
    #[comptime] plan: &Plan,
) {
    let n = comptime!(plan.vertices);
    let vectors = 3 * environment * n;
    let x = Vec3g::load(&cloth.position, vectors, n, v);
    let tool = tool_of(&cloth.own, environment, comptime!(plan.grid));
    let (phi, normal) = distance(sheet, x, tool, comptime!(plan.grid));
    let planes = 4 * environment * n;
    normal.store(&mut cloth.plane, planes, n, v);
    cloth.plane[planes + 3 * n + v] = normal.dot(x) - phi;
    let velocity = Vec3g::load(&cloth.velocity, vectors, n, v);
    x.store(&mut cloth.previous, vectors, n, v);
    x.plus(velocity.scale(frame.h))
        .store(&mut cloth.predicted, vectors, n, v);
}

/// What the edge between vertex `v`, predicted at `x`, and one beside it pulls at its start [N],
/// and its stress [N/m]; nothing where there is none. `field` is that of [`Plan::beside`].
#[cube]
fn pull(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    environment: usize,
    v: usize,
    x: Vec3g,
    #[comptime] field: usize,
    #[comptime] plan: &Plan,
) -> (Vec3g, f32) {
    let n = comptime!(plan.vertices);
    let beside = comptime!(plan.beside + 2 * field * plan.vertices);
    let other = sheet.numbers[beside + v];
    let mut force = Vec3g::zero();
    let mut stress = 0.0f32;
    if other != NOTHING {
        let slot = sheet.numbers[beside + n + v] as usize;
        let density = cloth.density[environment * comptime!(plan.slots) + slot];
        let bending = cloth.own[environment * FIELDS + comptime!(BENDING + field / 2)];
        let min_warm = sheet.values[comptime!(plan.min_warm + field / 2 * plan.vertices) + v];
        let y = Vec3g::load(&cloth.predicted, 3 * environment * n, n, other as usize);
        let mut edge = y.minus(x);
        if comptime!(field.is_multiple_of(2)) {
            edge = x.minus(y);
        }
        force = edge.scale(density.max(min_warm * bending));
        stress = density.max(-density);
    }
    (force, stress)
}

/// How far a vertex gives way in this substep, and where it goes under its weight and the pull of
/// its yarns, see [`super::super::length::give_way`].
#[cube]
pub(super) fn give_way(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    frame: GpuFrame,
    environment: usize,
    v: usize,
    #[comptime] plan: &Plan,
) {
    let n = comptime!(plan.vertices);
    let vectors = 3 * environment * n;
    let predicted = Vec3g::load(&cloth.predicted, vectors, n, v);
    let (weft_before, s0) = pull(cloth, sheet, environment, v, predicted, 2usize, plan);
    let (weft_after, s1) = pull(cloth, sheet, environment, v, predicted, 3usize, plan);
    let (warp_before, s2) = pull(cloth, sheet, environment, v, predicted, 0usize, plan);
    let (warp_after, s3) = pull(cloth, sheet, environment, v, predicted, 1usize, plan);
    let pulled = weft_after
        .minus(weft_before)
        .minus(warp_before)
        .plus(warp_after);
    let stress = s0 + s1 + s2 + s3;
    let free = cloth.inverse_mass[environment * n + v] * (frame.h * frame.h);
    let inertia = free * stress * CROSSING_F32;
    let mut fall = select(free > 0.0f32, frame.fall, 0.0f32);
    let mut mobility = free;
    let mut x = predicted;
    if inertia > 1.0f32 {
        let share = 1.0f32 / inertia;
        let kept = 1.0f32 - DRAG_F32 * (1.0f32 - share);
        let previous = Vec3g::load(&cloth.previous, vectors, n, v);
        x = previous.plus(x.minus(previous).scale(kept));
        mobility = free * share;
        fall *= share;
    }
    let d = pulled.scale(mobility);
    let step = Vec3g::new(d.x, d.y, d.z + fall);
    x.plus(step).store(&mut cloth.position, vectors, n, v);
    cloth.mobility[environment * n + v] = mobility;
}

/// Weight, by Gauss-Seidel.
#[cube]
pub(super) fn fall(
    cloth: &mut ClothBuffers,
    frame: GpuFrame,
    environment: usize,
    v: usize,
    #[comptime] plan: &Plan,
) {
    let n = comptime!(plan.vertices);
    let vectors = 3 * environment * n;
    let w = cloth.inverse_mass[environment * n + v];
    cloth.mobility[environment * n + v] = w * (frame.h * frame.h);
    let x = Vec3g::load(&cloth.predicted, vectors, n, v);
    let step = Vec3g::new(0.0f32, 0.0f32, select(w > 0.0f32, frame.fall, 0.0f32));
    x.plus(step).store(&mut cloth.position, vectors, n, v);
}

/// Coulomb friction of a vertex that a roller presses on to the tool, see
/// [`super::super::press::grip`].
#[cube]
pub(super) fn grip(
    cloth: &mut ClothBuffers,
    frame: GpuFrame,
    environment: usize,
    v: usize,
    #[comptime] plan: &Plan,
) {
    let n = comptime!(plan.vertices);
    let vectors = 3 * environment * n;
    let planes = 4 * environment * n;
    let force = cloth.force[environment * n + v];
    let mobility = cloth.mobility[environment * n + v];
    let normal = Vec3g::load(&cloth.plane, planes, n, v);
    let previous = Vec3g::load(&cloth.previous, vectors, n, v);
    let above = normal.dot(previous) - cloth.plane[planes + 3 * n + v];
    if force > 0.0f32 && mobility > 0.0f32 && above <= TOUCHING_F32 {
        let x = Vec3g::load(&cloth.position, vectors, n, v);
        let moved = x.minus(previous);
        let off = normal.dot(moved);
        let along = moved.minus(normal.scale(off));
        let load = (mobility * force - off).max(0.0f32);
        let slip = along.dot(along).sqrt();
        let mut left = 0.0f32;
        let own = environment * FIELDS + FRICTION;
        if slip > frame.stick * cloth.own[own] * load {
            left = (1.0f32 - frame.slide * cloth.own[own + 1] * load / slip).max(0.0f32);
        }
        if left == 0.0f32 {
            cloth.mobility[environment * n + v] = 0.0f32;
        }
        previous
            .plus(along.scale(left))
            .minus(normal.scale(above))
            .store(&mut cloth.position, vectors, n, v);
    }
}

/// Pushes a vertex that a roller presses towards the tool, see [`super::super::press::push`].
#[cube]
pub(super) fn push(
    cloth: &mut ClothBuffers,
    frame: GpuFrame,
    environment: usize,
    v: usize,
    #[comptime] plan: &Plan,
) {
    let n = comptime!(plan.vertices);
    let vectors = 3 * environment * n;
    let planes = 4 * environment * n;
    let gain = cloth.mobility[environment * n + v] * cloth.force[environment * n + v];
    if gain > 0.0f32 {
        let reach = frame.h * cloth.own[environment * FIELDS + SPEED];
        let normal = Vec3g::load(&cloth.plane, planes, n, v);
        let x = Vec3g::load(&cloth.position, vectors, n, v);
        let previous = Vec3g::load(&cloth.previous, vectors, n, v);
        let above = normal.dot(x) - cloth.plane[planes + 3 * n + v];
        let down = normal.dot(previous.minus(x));
        let pushed = ((down + gain) / (1.0f32 + gain / reach) - down).min(above);
        if pushed > 0.0f32 {
            x.minus(normal.scale(pushed))
                .store(&mut cloth.position, vectors, n, v);
        }
    }
}

/// Contact, friction and velocity of a vertex, and the prediction of the next substep if one
/// `goes_on`: see [`super::super::contact::conclude`].
#[cube]
pub(super) fn conclude(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    frame: GpuFrame,
    environment: usize,
    v: usize,
    goes_on: bool,
    #[comptime] plan: &Plan,
) {
    let n = comptime!(plan.vertices);
    let vectors = 3 * environment * n;
    let planes = 4 * environment * n;
    let mut x = Vec3g::load(&cloth.position, vectors, n, v);
    let normal = Vec3g::load(&cloth.plane, planes, n, v);
    let previous = Vec3g::load(&cloth.previous, vectors, n, v);
    let free = cloth.inverse_mass[environment * n + v] > 0.0f32;
    let mut phi = normal.dot(x) - cloth.plane[planes + 3 * n + v];
    if comptime!(plan.tack.is_some()) {
        if phi < TACK_RANGE_F32 {
            let tack = sheet.values[comptime!(plan.tack.unwrap_or(0)) + v];
            let drawn = tack * cloth.mobility[environment * n + v];
            x = x.minus(normal.scale(drawn));
            phi -= drawn;
        }
    }
    let depth = select(free, (-phi).max(0.0f32), 0.0f32);
    x = x.plus(normal.scale(depth));
    if comptime!(plan.has_friction) {
        if depth > 0.0f32 {
            let moved = x.minus(previous);
            let tangential = moved.minus(normal.scale(normal.dot(moved)));
            let square = tangential.dot(tangential);
            let own = environment * FIELDS + FRICTION;
            let hold = frame.stick * cloth.own[own] * depth;
            let mut share = 1.0f32;
            if hold * hold < square {
                share = (frame.slide * cloth.own[own + 1] * depth / square.sqrt()).min(1.0f32);
            }
            x = x.minus(tangential.scale(share));
        }
    }
    let mut velocity = x.minus(previous).scale(frame.rate);
    if comptime!(plan.has_cap) {
        let square = velocity.dot(velocity);
        if frame.speed_cap * frame.speed_cap < square {
            velocity = velocity.scale(frame.speed_cap / square.sqrt());
        }
    }
    if !free {
        velocity = Vec3g::load(&cloth.velocity, vectors, n, v);
    }
    if goes_on {
        x.store(&mut cloth.previous, vectors, n, v);
        x.plus(velocity.scale(frame.h))
            .store(&mut cloth.predicted, vectors, n, v);
    } else {
        x.store(&mut cloth.position, vectors, n, v);
        velocity.store(&mut cloth.velocity, vectors, n, v);
    }
}
