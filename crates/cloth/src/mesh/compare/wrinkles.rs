use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;
use serde::Serialize;

use super::distances::Distances;
use crate::math::Vec3;
use crate::mesh::{TriMesh, patches};

/// Width of the weight of a Gaussian regression of second degree, per cutoff: a wave as long
/// as the cutoff passes by half (ISO 16610-31).
const WIDTH: f64 = 0.7309;
/// Weights beyond this many cutoffs, below 0.3 %, are left out.
const REACH: f64 = 1.0;
/// A wrinkle takes at least this share of the squared cutoff: smaller patches are noise of
/// single vertices.
const MIN_AREA: f64 = 0.01;

/// What counts as a wrinkle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrinkleFilter {
    /// Waves shorter than this stand out from the low-pass surface [m].
    pub cutoff: f64,
    /// A wrinkle rises above the low-pass surface by more than this [m].
    pub height: f64,
}

/// How a surface deviates from its own low-pass surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Wrinkles {
    /// Connected patches higher than the filter's height.
    pub count: usize,
    /// Greatest height above the low-pass surface [m].
    pub amplitude: f64,
    /// Root mean square of the deviation over the area [m].
    pub rms: f64,
}

/// Counts and measures the wrinkles of a surface; none if it has no area.
pub fn wrinkles(mesh: &TriMesh, filter: WrinkleFilter) -> Option<Wrinkles> {
    let deviation = high_pass(mesh, filter.cutoff);
    let areas = mesh.vertex_areas();
    let spread = Distances::new(deviation.iter().copied().zip(areas.iter().copied()))?;
    let neighbors = neighbors_of(mesh);
    let mut open: Vec<bool> = deviation.iter().map(|&d| d > filter.height).collect();
    let next = |v: usize| neighbors[v].iter().copied();
    let is_large = |patch: &Vec<usize>| {
        let area: f64 = patch.iter().map(|&v| areas[v]).sum();
        area >= MIN_AREA * filter.cutoff * filter.cutoff
    };
    let patches = patches(&mut open, next);
    Some(Wrinkles {
        count: patches.iter().filter(|patch| is_large(patch)).count(),
        amplitude: spread.max.max(0.0),
        rms: spread.rms,
    })
}

/// Height of every vertex above the low-pass surface [m], along that surface's normal.
///
/// The low-pass surface at a vertex is a paraboloid over the plane across the mean normal of its
/// neighbourhood, fitted to the vertices that hang together with it, weighed with a Gaussian of
/// their distance times their area. So a dome wider than `cutoff` [m] does not count, nor does a
/// border. Where fewer than six vertices are near enough for a fit, the height is 0.
pub(super) fn high_pass(mesh: &TriMesh, cutoff: f64) -> Vec<f64> {
    let neighbors = neighbors_of(mesh);
    let areas = mesh.vertex_areas();
    let normals = mesh.vertex_normals();
    let count = mesh.vertices.len();
    let height = |(seen, patch): &mut (Vec<usize>, Vec<usize>), v: usize| {
        // What hangs together with the vertex within reach; `seen` has the last one for each.
        patch.clear();
        patch.push(v);
        seen[v] = v;
        let mut next = 0;
        while let Some(&from) = patch.get(next) {
            for &w in &neighbors[from] {
                let distance = (mesh.vertices[w] - mesh.vertices[v]).norm();
                if distance <= REACH * cutoff && seen[w] != v {
                    seen[w] = v;
                    patch.push(w);
                }
            }
            next += 1;
        }
        let weight = |w: usize| {
            let r = (mesh.vertices[w] - mesh.vertices[v]).norm() / (WIDTH * cutoff);
            areas[w] * (-std::f64::consts::PI * r * r).exp()
        };
        let normal: Vec3 = patch.iter().map(|&w| normals[w] * weight(w)).sum();
        let Some(normal) = normal.try_normalize(0.0) else {
            return 0.0;
        };
        let across = normal.cross(&Vec3::ith(normal.iamin(), 1.0)).normalize();
        let along = normal.cross(&across);
        let (mut matrix, mut right) = (Matrix6::zeros(), Vector6::zeros());
        for &w in patch.iter() {
            // In cutoffs, so that all terms are of the same order.
            let x = (mesh.vertices[w] - mesh.vertices[v]) / cutoff;
            let (p, q, height) = (x.dot(&across), x.dot(&along), x.dot(&normal));
            let term = Vector6::new(1.0, p, q, p * p, p * q, q * q);
            matrix += term * term.transpose() * weight(w);
            right += term * (height * weight(w));
        }
        // The scale of the areas would make the factorisation's own limit meaningless.
        let scale = matrix[(0, 0)];
        if scale <= 0.0 || patch.len() < 6 {
            return 0.0;
        }
        let solved = (matrix / scale).cholesky();
        let fit = solved.map(|matrix| matrix.solve(&(right / scale))[0]);
        fit.filter(|fit| fit.is_finite())
            .map_or(0.0, |fit| -fit * cutoff)
    };
    (0..count)
        .into_par_iter()
        .map_init(|| (vec![usize::MAX; count], Vec::new()), height)
        .collect()
}

/// The vertices next to each vertex, ascending.
pub(super) fn neighbors_of(mesh: &TriMesh) -> Vec<Vec<usize>> {
    let mut neighbors = vec![Vec::new(); mesh.vertices.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| v as usize);
        for (v, beside) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
            neighbors[v].extend(beside);
        }
    }
    for beside in &mut neighbors {
        beside.sort_unstable();
        beside.dedup();
    }
    neighbors
}
