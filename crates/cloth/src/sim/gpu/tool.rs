//! Distance to the tool, see [`crate::tool::DistanceGrid::sample`].

use cubecl::prelude::*;

use super::cloth::SheetBuffers;
use super::plan::GridPlan;
use super::vector::Vec3g;

/// Farthest coordinate that is looked at [m].
const HORIZON: f32 = 1e15;

/// Place of a coordinate on an axis of the grid: cell, part of the cell, and how far beyond the
/// grid it is [m].
#[cube]
fn along(x: f32, origin: f32, spacing: f32, per_metre: f32, nodes: u32) -> (u32, f32, f32) {
    let last = f32::cast_from(nodes - 1);
    let offset = x.clamp(-HORIZON, HORIZON) - origin;
    let u = (offset * per_metre).max(0.0f32).min(last);
    // The last cell goes up to its far node; whole numbers also bound what is no number.
    let cell = u32::cast_from(u.floor()).min(nodes - 2);
    let beyond = offset - offset.max(0.0f32).min(last * spacing);
    (cell, u - f32::cast_from(cell), beyond)
}

#[cube]
fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// Distance to a tool [m], negative inside, and its outward unit normal.
#[cube]
pub(super) fn distance(
    sheet: &SheetBuffers,
    x: Vec3g,
    tool: usize,
    #[comptime] grid: GridPlan,
) -> (f32, Vec3g) {
    let first = comptime!(grid.values) + 5 * tool;
    let [nx, ny, nz] = comptime!(grid.nodes);
    let mut nx = nx.runtime();
    let mut ny = ny.runtime();
    let mut nz = nz.runtime();
    let mut samples = 0usize;
    // Compiled in where it is the same for all.
    if comptime!(grid.tools > 1) {
        let header = comptime!(grid.headers) + 4 * tool;
        nx = sheet.numbers[header];
        ny = sheet.numbers[header + 1];
        nz = sheet.numbers[header + 2];
        samples = sheet.numbers[header + 3] as usize;
    }
    let spacing = sheet.values[first + 3];
    let per_metre = sheet.values[first + 4];
    let (i, tx, bx) = along(x.x, sheet.values[first], spacing, per_metre, nx);
    let (j, ty, by) = along(x.y, sheet.values[first + 1], spacing, per_metre, ny);
    let (k, tz, bz) = along(x.z, sheet.values[first + 2], spacing, per_metre, nz);
    let row = nx as usize;
    let layer = (nx * ny) as usize;
    let at = samples + i as usize + j as usize * row + k as usize * layer;
    // Along x on four edges, then along y on two faces, then along z.
    let n0 = sheet.samples[at];
    let n1 = sheet.samples[at + row];
    let n2 = sheet.samples[at + layer];
    let n3 = sheet.samples[at + layer + row];
    let d0 = sheet.samples[at + 1] - n0;
    let d1 = sheet.samples[at + row + 1] - n1;
    let d2 = sheet.samples[at + layer + 1] - n2;
    let d3 = sheet.samples[at + layer + row + 1] - n3;
    let e0 = n0 + d0 * tx;
    let e1 = n1 + d1 * tx;
    let e2 = n2 + d2 * tx;
    let e3 = n3 + d3 * tx;
    let f0 = lerp(e0, e1, ty);
    let f1 = lerp(e2, e3, ty);
    let inside = lerp(f0, f1, tz);
    let mut gx = lerp(lerp(d0, d1, ty), lerp(d2, d3, ty), tz) * per_metre;
    let mut gy = lerp(e1 - e0, e3 - e2, tz) * per_metre;
    let mut gz = (f1 - f0) * per_metre;
    let square = bx * bx + by * by + bz * bz;
    let mut phi = inside + square;
    if square > 0.0f32 {
        let beyond = square.sqrt();
        let inverse = 1.0f32 / beyond;
        gx = select(bx * bx > 0.0f32, bx * inverse, gx);
        gy = select(by * by > 0.0f32, by * inverse, gy);
        gz = select(bz * bz > 0.0f32, bz * inverse, gz);
        phi = inside + beyond;
    }
    let norm = (gx * gx + gy * gy + gz * gz).sqrt();
    let mut normal = Vec3g::new(0.0f32, 0.0f32, 1.0f32);
    if norm >= 1e-9f32 {
        let inverse = 1.0f32 / norm;
        normal = Vec3g::new(gx * inverse, gy * inverse, gz * inverse);
    }
    (phi, normal)
}
