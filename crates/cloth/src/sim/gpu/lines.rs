//! Solves along whole lines, one thread a line: see [`super::super::line`] and
//! [`super::super::bend`].

use cubecl::prelude::*;

use super::super::shear::{MAX_SINE, POWERS};
use super::cloth::{ClothBuffers, SheetBuffers};
use super::own::{BENDING, COMPLIANCE, FIELDS};
use super::plan::{Answer, LinePlan, Plan};
use super::vector::Vec3g;

const LARGEST_SINE: f32 = MAX_SINE as f32;

/// Compliance of a diagonal over that at rest, see [`super::super::shear::Trellis::share`].
#[cube]
pub(super) fn share(
    sheet: &SheetBuffers,
    square: f32,
    inverse_rest: f32,
    #[comptime] first: usize,
) -> f32 {
    let per_growth = sheet.values[first];
    let growth = square * (inverse_rest * inverse_rest * per_growth) - per_growth;
    let sine = growth.clamp(-LARGEST_SINE, LARGEST_SINE);
    let mut sum = sheet.values[first + POWERS];
    #[unroll]
    for k in 1..POWERS {
        sum = sum * sine + sheet.values[first + POWERS - k];
    }
    sum * sine + 1.0f32
}

/// How far beyond locking a diagonal is, over its length at rest, and the compliance of that over
/// its own at rest; `stretch` is its length over that at rest. See [`super::super::locking`].
#[cube]
pub(super) fn locked(sheet: &SheetBuffers, stretch: f32, #[comptime] first: usize) -> (f32, f32) {
    let low = sheet.values[first];
    let high = sheet.values[first + 1];
    let onset_sine = sheet.values[first + 5];
    let beyond = (stretch - high).max(0.0f32) - (low - stretch).max(0.0f32);
    let onset = select(beyond < 0.0f32, low, high);
    let stretch = stretch.max(sheet.values[first + 4]);
    let sine = (stretch * stretch - 1.0f32) * sheet.values[first + 8];
    let size = sine.abs().min(LARGEST_SINE).max(onset_sine);
    let part = (size - onset_sine) * sheet.values[first + 6];
    let mut sum = sheet.values[first + 8 + POWERS];
    #[unroll]
    for k in 1..POWERS {
        sum = sum * part + sheet.values[first + 8 + POWERS - k];
    }
    let share = (sum * part + 1.0f32) * sheet.values[first + 7];
    (beyond, share * 2.0f32 / (stretch * (stretch + onset)))
}

/// More than 0 where a diagonal is locked, from the square of its length.
#[cube]
pub(super) fn excess(
    sheet: &SheetBuffers,
    square: f32,
    inverse_rest: f32,
    #[comptime] first: usize,
) -> f32 {
    let square = square * (inverse_rest * inverse_rest);
    (square - sheet.values[first + 3]).max(0.0f32) + (sheet.values[first + 2] - square).max(0.0f32)
}

/// Pushes back the diagonals of a row that are locked, together.
#[cube]
pub(super) fn lock(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    environment: usize,
    line: usize,
    #[comptime] plan: &Plan,
    #[comptime] of: LinePlan,
) {
    let n = comptime!(plan.vertices);
    let lines = comptime!(of.lines);
    let places = comptime!(of.places) + line;
    let size = sheet.numbers[comptime!(of.sizes) + line] as usize;
    let inverse_rest = sheet.values[comptime!(of.laws) + lines + line];
    let first = comptime!(plan.locking.unwrap_or(0));
    let mut sum = 0.0f32;
    for j in 0..size - 1 {
        let v0 = sheet.numbers[places + j * lines] as usize;
        let v1 = sheet.numbers[places + (j + 1) * lines] as usize;
        let x0 = Vec3g::load(&cloth.position, 3 * environment * n, n, v0);
        let d = Vec3g::load(&cloth.position, 3 * environment * n, n, v1).minus(x0);
        sum += excess(sheet, d.dot(d), inverse_rest, first);
    }
    if sum > 0.0f32 {
        let of = comptime!(LinePlan {
            answer: Answer::Locking,
            ..of
        });
        stretch(cloth, sheet, environment, line, plan, of);
    }
}

/// Solves the lengths of a line together and moves its vertices. A row of diagonals starts
/// from no forces; those of a yarn last.
#[cube]
pub(super) fn stretch(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    environment: usize,
    line: usize,
    #[comptime] plan: &Plan,
    #[comptime] of: LinePlan,
) {
    let n = comptime!(plan.vertices);
    let lines = comptime!(of.lines);
    let scalars = environment * n;
    let vectors = 3 * scalars;
    let places = comptime!(of.places) + line;
    let size = sheet.numbers[comptime!(of.sizes) + line] as usize;
    let laws = comptime!(of.laws) + line;
    let rest = sheet.values[laws];
    let inverse_rest = sheet.values[laws + lines];
    let own = environment * FIELDS;
    let pulled = cloth.own[own + comptime!(COMPLIANCE + 2 * of.direction)];
    let pushed = cloth.own[own + comptime!(COMPLIANCE + 2 * of.direction + 1)];
    let tension = sheet.values[laws + 2 * lines] * pulled;
    let compression = sheet.values[laws + 3 * lines] * pushed;
    let mut min_warm = 0.0f32;
    if comptime!(of.answer == Answer::Length) {
        min_warm =
            sheet.values[laws + 4 * lines] * cloth.own[own + comptime!(BENDING + of.direction)];
    }
    let densities = environment * comptime!(plan.slots) + comptime!(of.slots) + line;
    let rights = environment * comptime!(plan.scratch) + line;
    let uppers = rights + comptime!(of.lines * of.longest);

    let v0 = sheet.numbers[places] as usize;
    let mut x0 = Vec3g::load(&cloth.position, vectors, n, v0);
    let mut w0 = cloth.mobility[scalars + v0];
    let mut previous = Vec3g::zero();
    let mut previous_inverse = 0.0f32;
    let mut previous_right = 0.0f32;
    for j in 0..size - 1 {
        let v1 = sheet.numbers[places + (j + 1) * lines] as usize;
        let x1 = Vec3g::load(&cloth.position, vectors, n, v1);
        let w1 = cloth.mobility[scalars + v1];
        let d = x1.minus(x0);
        let square = d.dot(d);
        let length = square.sqrt();
        let mut residual = length - rest;
        let mut compliance = select(residual < 0.0f32, compression, tension);
        let mut is_free = false;
        if comptime!(of.answer == Answer::Locking) {
            let first = comptime!(plan.locking.unwrap_or(0));
            let (beyond, share) = locked(sheet, length * inverse_rest, first);
            is_free = excess(sheet, square, inverse_rest, first) <= 0.0f32;
            compliance = select(beyond < 0.0f32, compression, tension) * share;
            residual = select(is_free, 0.0f32, beyond * rest);
        } else if comptime!(of.answer == Answer::Shear) {
            compliance *= share(sheet, square, inverse_rest, comptime!(plan.trellis));
        } else {
            let density = cloth.density[densities + j * lines];
            compliance = select(density < 0.0f32, compression, tension);
            let force = density.max(min_warm) * length;
            if comptime!(of.is_limited) {
                let beyond = force > sheet.values[laws + 6 * lines] / pulled;
                compliance = select(beyond, sheet.values[laws + 7 * lines] * pulled, compliance);
                residual -= select(beyond, sheet.values[laws + 8 * lines], 0.0f32);
            }
            residual -= compliance * force;
        }
        let coupling = w0 * previous.dot(d);
        let upper = coupling * previous_inverse;
        let diagonal = ((w0 + w1 + compliance) * square - coupling * upper).max(1e-28f32);
        // Without force where nothing is locked, as if the compliance were infinite.
        let inverse = select(is_free, 0.0f32, 1.0f32 / diagonal);
        let right = (residual * length + coupling * previous_right) * inverse;
        if j > 0 {
            cloth.scratch[uppers + (j - 1) * lines] = upper;
        }
        cloth.scratch[rights + j * lines] = right;
        x0 = x1;
        w0 = w1;
        previous = d;
        previous_inverse = inverse;
        previous_right = right;
    }

    // Back from the far end; a vertex moves once both its edges are known. What the edges were is
    // told by the vertices, as those before have not moved yet.
    let mut after = Vec3g::zero();
    let mut change_after = 0.0f32;
    let mut far = size - 1;
    let mut v1 = sheet.numbers[places + far * lines] as usize;
    let mut x1 = Vec3g::load(&cloth.position, vectors, n, v1);
    while far > 0 {
        let j = far - 1;
        let v = sheet.numbers[places + j * lines] as usize;
        let x = Vec3g::load(&cloth.position, vectors, n, v);
        let mut change = cloth.scratch[rights + j * lines];
        if far < size - 1 {
            change += cloth.scratch[uppers + j * lines] * change_after;
        }
        if comptime!(of.answer == Answer::Length) {
            let density = cloth.density[densities + j * lines];
            cloth.density[densities + j * lines] = density.max(min_warm) + change;
        }
        let moved = x1.minus(x).scale(change);
        let w1 = cloth.mobility[scalars + v1];
        x1.plus(after.minus(moved).scale(w1))
            .store(&mut cloth.position, vectors, n, v1);
        after = moved;
        change_after = change;
        v1 = v;
        x1 = x;
        far = j;
    }
    let w1 = cloth.mobility[scalars + v1];
    x1.plus(after.scale(w1))
        .store(&mut cloth.position, vectors, n, v1);
}

/// Solves the bending of a yarn as a whole.
#[cube]
pub(super) fn bend(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    environment: usize,
    line: usize,
    #[comptime] plan: &Plan,
    #[comptime] of: LinePlan,
) {
    let n = comptime!(plan.vertices);
    let lines = comptime!(of.lines);
    let scalars = environment * n;
    let vectors = 3 * scalars;
    let places = comptime!(of.places) + line;
    let size = sheet.numbers[comptime!(of.sizes) + line] as usize;
    let bending = cloth.own[environment * FIELDS + comptime!(BENDING + of.direction)];
    let stiffness = sheet.values[comptime!(of.laws) + 5 * lines + line] * bending;
    let rows = comptime!(of.lines * of.longest);
    let firsts = environment * comptime!(plan.scratch) + line;
    let seconds = firsts + rows;
    let rights = seconds + rows;
    if stiffness > 0.0f32 && size >= 3 {
        let v0 = sheet.numbers[places] as usize;
        let v1 = sheet.numbers[places + lines] as usize;
        let mut x0 = Vec3g::load(&cloth.position, vectors, n, v0);
        let mut x1 = Vec3g::load(&cloth.position, vectors, n, v1);
        let mut before = Vec3g::zero();
        let mut around = Vec3g::zero();
        // Of the last two rows: upper diagonals and right side.
        let mut first0 = 0.0f32;
        let mut first1 = 0.0f32;
        let mut second0 = 0.0f32;
        let mut second1 = 0.0f32;
        let mut right0 = Vec3g::zero();
        let mut right1 = Vec3g::zero();
        for i in 0..size {
            let mut after = Vec3g::zero();
            if i + 2 < size {
                let v2 = sheet.numbers[places + (i + 2) * lines] as usize;
                let x2 = Vec3g::load(&cloth.position, vectors, n, v2);
                after = x0.plus(x2).minus(x1.scale(2.0f32));
                x0 = x1;
                x1 = x2;
            }
            // Whether the vertex is the last of a triple, the middle of one, the first of one.
            let l = select(i >= 2, 1.0f32, 0.0f32);
            let m = select(i >= 1 && i + 1 < size, 1.0f32, 0.0f32);
            let r = select(i + 2 < size, 1.0f32, 0.0f32);
            let v = sheet.numbers[places + i * lines] as usize;
            let wk = cloth.mobility[scalars + v] * stiffness;
            let kx = before.plus(after).minus(around.scale(2.0f32));
            let lower2 = wk * l;
            let lower1 = wk * (-2.0f32 * (l + m)) - lower2 * first0;
            let diagonal = 1.0f32 + wk * (l + 4.0f32 * m + r);
            let pivot = diagonal - lower2 * second0 - lower1 * first1;
            let inverse = 1.0f32 / pivot;
            let first = (wk * (-2.0f32 * (m + r)) - lower1 * second1) * inverse;
            let second = wk * r * inverse;
            let sum = kx
                .scale(wk)
                .plus(right0.scale(lower2))
                .plus(right1.scale(lower1));
            let right = sum.scale(-inverse);
            cloth.scratch[firsts + i * lines] = first;
            cloth.scratch[seconds + i * lines] = second;
            right.store(&mut cloth.scratch, rights, rows, i * lines);
            before = around;
            around = after;
            first0 = first1;
            first1 = first;
            second0 = second1;
            second1 = second;
            right0 = right1;
            right1 = right;
        }
        let mut d1 = Vec3g::zero();
        let mut d2 = Vec3g::zero();
        let mut left = size;
        while left > 0 {
            let i = left - 1;
            let z = Vec3g::load(&cloth.scratch, rights, rows, i * lines);
            let first = cloth.scratch[firsts + i * lines];
            let second = cloth.scratch[seconds + i * lines];
            let d = z.minus(d1.scale(first)).minus(d2.scale(second));
            let v = sheet.numbers[places + i * lines] as usize;
            let x = Vec3g::load(&cloth.position, vectors, n, v);
            x.plus(d).store(&mut cloth.position, vectors, n, v);
            d2 = d1;
            d1 = d;
            left = i;
        }
    }
}
