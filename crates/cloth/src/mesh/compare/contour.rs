use std::collections::HashMap;

use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::Polyline;
use serde::Serialize;

use crate::math::{Vec3, to_parry};
use crate::mesh::{TriMesh, border, patches};

use super::wrinkles::neighbors_of;

/// Samples of the contour lie no farther apart than this share of its length: 0.5 mm on a
/// blank of 370 mm.
const STEP: f64 = 1.0 / 3000.0;

/// Distance of one surface's contour from another's [m].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ContourDeviation {
    /// Mean over the length of the contour.
    pub mean: f64,
    pub max: f64,
}

/// Holes of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Holes {
    pub count: usize,
    /// Of all of them together, in the plane in which each has most [m²].
    pub area: f64,
}

/// The outer contour of a surface, and what else has a border.
#[derive(Clone, Debug)]
pub struct Contour<'a> {
    mesh: &'a TriMesh,
    /// Of its largest piece.
    edges: Vec<[u32; 2]>,
    /// Those in its largest piece.
    pub holes: Holes,
    /// Pieces that do not hang together.
    pub piece_count: usize,
}

impl<'a> Contour<'a> {
    /// Finds the contour: of all loops of the border the one that encloses most. None where there is
    /// no border, or triangles do not agree on which side is up.
    pub fn new(mesh: &'a TriMesh) -> Option<Self> {
        let area = |edges: &Vec<[u32; 2]>| {
            let origin = mesh.vertices[edges[0][0] as usize];
            let ends = |edge: &[u32; 2]| edge.map(|v| mesh.vertices[v as usize] - origin);
            let sectors = edges.iter().map(ends).map(|[p, q]| 0.5 * p.cross(&q));
            sectors.sum::<Vec3>().norm()
        };
        let loops = loops(border(mesh).ok()?, mesh.vertices.len());
        let loops: Vec<(f64, Vec<[u32; 2]>)> = loops.into_iter().map(|l| (area(&l), l)).collect();
        let (_, outer) = loops.iter().reduce(|a, b| if b.0 > a.0 { b } else { a })?;
        let neighbors = neighbors_of(mesh);
        let mut open: Vec<bool> = neighbors.iter().map(|near| !near.is_empty()).collect();
        let pieces = patches(&mut open, |v| neighbors[v].iter().copied());
        let mut piece_of = vec![0; mesh.vertices.len()];
        for (k, piece) in pieces.iter().enumerate() {
            piece.iter().for_each(|&v| piece_of[v] = k);
        }
        let piece = |edges: &[[u32; 2]]| piece_of[edges[0][0] as usize];
        let is_hole = |l: &&(f64, Vec<[u32; 2]>)| l.1 != *outer && piece(&l.1) == piece(outer);
        let holes = loops.iter().filter(is_hole);
        Some(Self {
            mesh,
            edges: outer.clone(),
            holes: holes.fold(Holes::default(), |sum, (area, _)| Holes {
                count: sum.count + 1,
                area: sum.area + area,
            }),
            piece_count: pieces.len(),
        })
    }

    /// Distance of this contour, sampled evenly along its length, from another (its edges, not its
    /// vertices alone). None of a contour without a length.
    pub fn deviation(&self, other: &Self) -> Option<ContourDeviation> {
        let vertices = other.mesh.vertices.iter().map(to_parry).collect();
        let other = Polyline::new(vertices, Some(other.edges.clone()));
        let distance = |x: Vec3| {
            let x = to_parry(&x);
            (other.project_local_point(x, false).point - x).length()
        };
        let ends = |edge: &[u32; 2]| edge.map(|v| self.mesh.vertices[v as usize]);
        let edges: Vec<[Vec3; 2]> = self.edges.iter().map(ends).collect();
        let length: f64 = edges.iter().map(|[p, q]| (q - p).norm()).sum();
        if length.is_nan() || length <= 0.0 {
            return None;
        }
        let (mut sum, mut max) = (0.0, 0.0f64);
        for [p, q] in edges {
            let side = (q - p).norm();
            let count = (side / (STEP * length)).ceil().max(1.0);
            for k in 0..count as usize {
                let found = distance(p + (q - p) * ((k as f64 + 0.5) / count));
                sum += found * side / count;
                max = max.max(found);
            }
            // The greatest distance is often that of a corner.
            max = max.max(distance(p));
        }
        Some(ContourDeviation {
            mean: sum / length,
            max,
        })
    }
}

/// Directed edges in loops that have no vertex twice; of loops that touch each other at a vertex each
/// is its own.
fn loops(edges: Vec<[u32; 2]>, vertex_count: usize) -> Vec<Vec<[u32; 2]>> {
    let mut next: HashMap<u32, Vec<u32>> = HashMap::new();
    for &[from, to] in &edges {
        next.entry(from).or_default().push(to);
    }
    let mut loops = Vec::new();
    // Where in the path a vertex stands.
    let mut places = vec![usize::MAX; vertex_count];
    for [start, _] in edges {
        let (mut path, mut from) = (Vec::new(), start);
        while let Some(to) = next.get_mut(&from).and_then(Vec::pop) {
            places[from as usize] = path.len();
            path.push([from, to]);
            let place = places[to as usize];
            if place < path.len() {
                let closed = path.split_off(place);
                closed
                    .iter()
                    .for_each(|[v, _]| places[*v as usize] = usize::MAX);
                loops.push(closed);
            }
            from = to;
        }
        // What is left does not close, where facets cross each other along an edge.
        path.iter()
            .for_each(|[v, _]| places[*v as usize] = usize::MAX);
        loops.extend((!path.is_empty()).then_some(path));
    }
    loops
}
