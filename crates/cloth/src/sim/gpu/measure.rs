//! What episodes are judged by, see [`crate::scene::surplus`]: one workgroup an environment.

use cubecl::prelude::*;
use fixedbitset::FixedBitSet;

use super::backend::{Buffer, Gpu};
use super::cloth::{ClothBuffers, SheetBuffers};
use super::plan::{MOST_UNITS, Plan};
use super::tool::distance;
use super::vector::Vec3g;
use crate::fabric::Lamina;

/// A region of the sheet that is measured, as the kernel sees it.
pub struct GpuRegion {
    /// [end][yarn edge]: vertices.
    edges: Buffer,
    /// Rest length of each yarn edge [m].
    rest: Buffer,
    /// 1 of each vertex that belongs to it.
    inside: Buffer,
    edge_count: usize,
}

/// Sums and extremes of an environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Summed distance to the tool of the vertices above it, of the region and of the sheet [m].
    pub distance: [f64; 2],
    /// Summed surplus of yarn edges, of the region and of the sheet [m].
    pub surplus: [f64; 2],
    /// Greatest strain of a yarn edge [-].
    pub strain: f64,
    /// How deep the deepest vertex is in the tool, negative above it [m].
    pub depth: f64,
}

/// Numbers of a [`Measured`], the sums first.
const NUMBERS: usize = 6;
const SUMS: usize = 4;

impl Gpu {
    /// Tables of a region of its sheet.
    pub fn region(&self, lamina: &Lamina, region: &FixedBitSet) -> GpuRegion {
        let (mut ends, mut rest) = ([Vec::new(), Vec::new()], Vec::new());
        for yarn in &lamina.yarns {
            for pair in yarn.vertices.windows(2) {
                ends[0].push(pair[0]);
                ends[1].push(pair[1]);
                rest.push(yarn.rest_length as f32);
            }
        }
        let inside = (0..lamina.vertex_count()).map(|v| u32::from(region.contains(v)));
        GpuRegion {
            edges: self.upload(u32::as_bytes(&ends.concat())),
            rest: self.upload(f32::as_bytes(&rest)),
            inside: self.upload(u32::as_bytes(&inside.collect::<Vec<_>>())),
            edge_count: rest.len(),
        }
    }

    /// Measures some environments in a region. Sums are in single precision.
    pub fn measured(&self, region: &GpuRegion, environments: &[usize]) -> Vec<Measured> {
        if environments.is_empty() {
            return Vec::new();
        }
        let places: Vec<u32> = environments.iter().map(|&e| e as u32).collect();
        let found = self.room(environments.len() * NUMBERS);
        self.weigh(&self.upload(u32::as_bytes(&places)), region, &found);
        let found = self.read(&[&found]).swap_remove(0);
        let of = |numbers: &[f32; NUMBERS]| {
            let [inside, all, crushed, all_crushed, strain, depth] = numbers.map(f64::from);
            Measured {
                distance: [inside, all],
                surplus: [crushed, all_crushed],
                strain,
                depth,
            }
        };
        f32::from_bytes(&found)
            .as_chunks()
            .0
            .iter()
            .map(of)
            .collect()
    }

    fn weigh(&self, environments: &Buffer, region: &GpuRegion, found: &Buffer) {
        let GpuRegion {
            edges,
            rest,
            inside,
            edge_count,
        } = region;
        launch!(
            self,
            environments.len(),
            weigh(
                self.sheet(),
                environments.arg(),
                edges.arg(),
                rest.arg(),
                inside.arg(),
                found.arg(),
                *edge_count
            )
        );
    }
}

/// How each vertex lies off the point of the tool that is nearest to it goes where predictions are kept within a
/// control step.
#[cube(launch_unchecked)]
fn weigh(
    cloth: &mut ClothBuffers,
    sheet: &SheetBuffers,
    environments: &[u32],
    edges: &[u32],
    rest: &[f32],
    inside: &[u32],
    found: &mut [f32],
    #[comptime] edge_count: usize,
    #[comptime] plan: Plan,
) {
    let n = comptime!(plan.vertices);
    let unit = UNIT_POS_X as usize;
    let vectors = 3 * n * environments[CUBE_POS_X as usize] as usize;
    let mut distance_inside = 0.0f32;
    let mut distance_of_all = 0.0f32;
    let mut surplus_inside = 0.0f32;
    let mut surplus_of_all = 0.0f32;
    let mut strain = f32::new(-1.0);
    let mut depth = f32::new(-1.0e9);
    for v in range_stepped(unit, n, CUBE_DIM_X as usize) {
        let x = Vec3g::load(&cloth.position, vectors, n, v);
        let (phi, normal) = distance(sheet, x, comptime!(plan.grid));
        normal.scale(phi).store(&mut cloth.predicted, vectors, n, v);
        let above = phi.max(0.0f32);
        distance_of_all += above;
        distance_inside += select(inside[v] == 1u32, above, 0.0f32);
        depth = depth.max(-phi);
    }
    sync_storage();
    for e in range_stepped(unit, edge_count, CUBE_DIM_X as usize) {
        let a = edges[e] as usize;
        let b = edges[edge_count + e] as usize;
        let x = Vec3g::load(&cloth.position, vectors, n, a);
        let edge = Vec3g::load(&cloth.position, vectors, n, b).minus(x);
        // Short differences first: feet would be rounded as places are, by more than a trace may be off.
        let above = Vec3g::load(&cloth.predicted, vectors, n, a);
        let turned = Vec3g::load(&cloth.predicted, vectors, n, b).minus(above);
        let trace = edge.minus(turned);
        let excess = (rest[e] - trace.dot(trace).sqrt()).max(0.0f32);
        surplus_of_all += excess;
        surplus_inside += select(inside[a] + inside[b] == 2u32, excess, 0.0f32);
        strain = strain.max(edge.dot(edge).sqrt() / rest[e] - 1.0f32);
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
