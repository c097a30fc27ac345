//! Constraints of one colour, one thread a constraint: see [`super::super::edges`] and
//! [`super::super::bend`].

use cubecl::prelude::*;

use super::super::law::MIN_SQUARE;
use super::cloth::{ClothBuffers, SheetBuffers};
use super::lines::{excess, locked, share};
use super::own::{BENDING, COMPLIANCE, FIELDS};
use super::plan::{DIRECTION, PassKind, PassPlan, Plan, VERTEX};
use super::vector::Vec3g;

const MIN_SQUARE_F32: f32 = MIN_SQUARE as f32;

/// Projects constraint `i` of a pass.
#[cube]
pub(super) fn project(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    environment: usize,
    i: usize,
    #[comptime] plan: &Plan,
    #[comptime] pass: PassPlan,
) {
    if comptime!(pass.kind == PassKind::Triples) {
        triple(cloth, sheet, environment, i, plan, pass);
    } else {
        edge(cloth, sheet, environment, i, plan, pass);
    }
}

/// An edge of a yarn or a diagonal.
#[cube]
fn edge(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    environment: usize,
    i: usize,
    #[comptime] plan: &Plan,
    #[comptime] pass: PassPlan,
) {
    let n = comptime!(plan.vertices);
    let count = comptime!(pass.count);
    let scalars = environment * n;
    let vectors = 3 * scalars;
    let first = sheet.numbers[comptime!(pass.places) + i];
    let a = (first & VERTEX) as usize;
    let b = sheet.numbers[comptime!(pass.places) + count + i] as usize;
    let own = environment * FIELDS + COMPLIANCE + 2 * (first >> DIRECTION) as usize;
    let pulled = cloth.own[own];
    let laws = comptime!(pass.laws) + i;
    let wa = cloth.mobility[scalars + a];
    let wb = cloth.mobility[scalars + b];
    let xa = Vec3g::load(&cloth.position, vectors, n, a);
    let xb = Vec3g::load(&cloth.position, vectors, n, b);
    let d = xb.minus(xa);
    let square = d.dot(d).max(MIN_SQUARE_F32);
    let length = square.sqrt();
    let gives = wa + wb;
    let mut c = length - sheet.values[laws];
    let tension = sheet.values[laws + 2 * count] * pulled;
    let compression = sheet.values[laws + 3 * count] * cloth.own[own + 1];
    let mut compliance = select(c < 0.0f32, compression, tension);
    if comptime!(pass.kind == PassKind::Diagonals) {
        let inverse_rest = sheet.values[laws + count];
        compliance *= share(sheet, square, inverse_rest, comptime!(plan.trellis));
    }
    if comptime!(pass.kind == PassKind::LimitedEdges) {
        let beyond = sheet.values[laws + 4 * count] / pulled * (gives + compliance) < c;
        compliance = select(beyond, sheet.values[laws + 5 * count] * pulled, compliance);
        c -= select(beyond, sheet.values[laws + 6 * count], 0.0f32);
    }
    if comptime!(pass.kind == PassKind::LockingDiagonals) {
        let first = comptime!(plan.locking.unwrap_or(0));
        let (rest, inverse_rest) = (sheet.values[laws], sheet.values[laws + count]);
        let is_idle = excess(sheet, square, inverse_rest, first) <= 0.0f32;
        let (beyond, share) = locked(sheet, c * inverse_rest + 1.0f32, first);
        compliance *= share;
        c = select(is_idle, 0.0f32, beyond * rest);
    }
    let pull = d.scale(c / ((gives + compliance) * length).max(1e-28f32));
    xa.plus(pull.scale(wa))
        .store(&mut cloth.position, vectors, n, a);
    xb.minus(pull.scale(wb))
        .store(&mut cloth.position, vectors, n, b);
}

/// Three-node bending.
#[cube]
fn triple(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    environment: usize,
    i: usize,
    #[comptime] plan: &Plan,
    #[comptime] pass: PassPlan,
) {
    let n = comptime!(plan.vertices);
    let count = comptime!(pass.count);
    let scalars = environment * n;
    let vectors = 3 * scalars;
    let first = sheet.numbers[comptime!(pass.places) + i];
    let a = (first & VERTEX) as usize;
    let bending = cloth.own[environment * FIELDS + BENDING + (first >> DIRECTION) as usize];
    let b = sheet.numbers[comptime!(pass.places) + count + i] as usize;
    let c = sheet.numbers[comptime!(pass.places) + 2 * count + i] as usize;
    let wa = cloth.mobility[scalars + a];
    let wb = cloth.mobility[scalars + b];
    let wc = cloth.mobility[scalars + c];
    let sum = wa + wc + 4.0f32 * wb + sheet.values[comptime!(pass.laws) + i] / bending;
    let xa = Vec3g::load(&cloth.position, vectors, n, a);
    let xb = Vec3g::load(&cloth.position, vectors, n, b);
    let xc = Vec3g::load(&cloth.position, vectors, n, c);
    let pull = xa.plus(xc).minus(xb.scale(2.0f32)).scale(1.0f32 / sum);
    xa.minus(pull.scale(wa))
        .store(&mut cloth.position, vectors, n, a);
    xb.plus(pull.scale(wb + wb))
        .store(&mut cloth.position, vectors, n, b);
    xc.minus(pull.scale(wc))
        .store(&mut cloth.position, vectors, n, c);
}
