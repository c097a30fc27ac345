//! Which facets of a mesh are neighbours.

use drape_cloth::math::Vec3;
use rayon::prelude::*;

/// An edge of more than two facets.
pub const MANY: usize = usize::MAX;

/// The edge in the other facet that has it, for each half-edge: itself at a border, or [`MANY`]. Half-edge
/// number 3 f + k is that of facet f from its corner k to the next.
pub fn twins(triangles: &[[u32; 3]]) -> Vec<usize> {
    let numbered = |half| (undirected(edge(triangles, half)), half);
    let halves = (0..3 * triangles.len()).into_par_iter();
    let mut edges: Vec<([u32; 2], usize)> = halves.map(numbered).collect();
    edges.par_sort_unstable();
    let mut twins = vec![MANY; edges.len()];
    for same in edges.chunk_by(|a, b| a.0 == b.0) {
        if let [(_, a)] | [(_, a), _] = same[..] {
            let b = same[same.len() - 1].1;
            (twins[a], twins[b]) = (b, a);
        }
    }
    twins
}

/// Where a half-edge begins and ends.
pub fn edge(triangles: &[[u32; 3]], half: usize) -> [u32; 2] {
    let (corners, k) = (triangles[half / 3], half % 3);
    [corners[k], corners[(k + 1) % 3]]
}

/// That for an edge in either direction.
pub fn undirected([from, to]: [u32; 2]) -> [u32; 2] {
    [from.min(to), from.max(to)]
}

/// Normal of a facet, as long as twice its area [m²].
pub fn doubled_area([a, b, c]: [Vec3; 3]) -> Vec3 {
    (b - a).cross(&(c - a))
}
