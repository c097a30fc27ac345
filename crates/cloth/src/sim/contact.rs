//! Contact with the tool: tangent planes, push, tack and friction, and the velocity they leave.

use super::cloth::{Cloth, Plane};
use super::frame::Frame;
use crate::math::{Lanes, Vec3x};
use crate::tool::Tools;

/// Gap over which the tool's tack pulls [m]: a film of resin, thinner than a layer of cloth, so
/// that only what lies on the tool is held.
pub(super) const TACK_RANGE: f64 = 2e-4;

/// Looks up the tangent plane of the tool under every vertex.
#[inline(always)]
pub(super) fn refresh<V: Lanes>(tools: &Tools<V>, cloth: &mut Cloth<V>) {
    for (x, plane) in cloth.position.iter().zip(&mut cloth.plane) {
        let (phi, normal) = tools.distance(x.0);
        let normal = Vec3x(normal);
        let offset = normal.dot(*x) - phi;
        *plane = Plane { normal, offset };
    }
}

/// Pushes a vertex out of the tool, and holds or slows what slides on it (Coulomb): the
/// tangential motion of the substep is taken back wholly while it is below the static
/// coefficient times the push, else by the dynamic coefficient times the push. Then
/// v = (x - p) / h, damped and capped; fixed vertices keep theirs. If there is a `next` substep,
/// its prediction follows, and the velocity is not stored.
///
/// Within its range `tack` [N] draws the vertex towards the tool first. It lasts in contact, so
/// the push, and with it friction, is that of a load greater by it (Derjaguin's law). `tack` is
/// a constant where this is inlined without it, so that it costs nothing there.
#[inline(always)]
pub(super) fn conclude<V: Lanes>(
    v: usize,
    frame: &Frame<V>,
    tack: Option<V>,
    next: bool,
    cloth: &mut Cloth<V>,
) {
    let (mut x, plane) = (cloth.position[v], &cloth.plane[v]);
    let free = V::zero().lt(cloth.inverse_mass[v]);
    let mut phi = plane.normal.dot(x) - plane.offset;
    if let Some(tack) = tack {
        let near = phi.lt(V::of(TACK_RANGE));
        let drawn = V::select(near, tack * cloth.mobility[v], V::zero());
        x = x - plane.normal.scale(drawn);
        phi = phi - drawn;
    }
    let depth = V::select(free, (-phi).max(V::zero()), V::zero());
    let x = x + plane.normal.scale(depth);
    let mut moved = x - cloth.previous[v];
    let mut out = x;
    if let Some([stick, slide]) = frame.friction
        && V::any(V::zero().lt(depth))
    {
        let tangential = moved - plane.normal.scale(plane.normal.dot(moved));
        let square = tangential.dot(tangential);
        let hold = stick * depth;
        let slides = (hold * hold).lt(square);
        // Without contact the depth is 0, and so is the share that is taken back.
        let touches = V::zero().lt(depth);
        let mut share = V::select(touches, V::of(1.0), V::zero());
        if V::any(slides) {
            let taken = slide * depth / square.sqrt();
            share = V::select(slides, taken.min(V::of(1.0)), share);
        }
        out = x - tangential.scale(share);
        moved = out - cloth.previous[v];
    }
    let mut velocity = moved.scale(V::of(frame.rate));
    if frame.speed_cap > 0.0 {
        let cap = V::of(frame.speed_cap);
        let square = velocity.dot(velocity);
        let fast = (cap * cap).lt(square);
        if V::any(fast) {
            velocity = Vec3x::select(fast, velocity.scale(cap / square.sqrt()), velocity);
        }
    }
    let velocity = Vec3x::select(free, velocity, cloth.velocity[v]);
    if next {
        cloth.previous[v] = out;
        cloth.predicted[v] = out + velocity.scale(V::of(frame.h));
    } else {
        cloth.position[v] = out;
        cloth.velocity[v] = velocity;
    }
}
