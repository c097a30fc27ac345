//! Bodies that overlap: what of their facets bounds all of them together.

use parry3d_f64::partitioning::BvhNode;
use parry3d_f64::shape;
use rayon::prelude::*;

use super::surface::{Surface, step};
use crate::math::{Vec3, to_parry};
use crate::mesh::TriMesh;

/// The part of a convex polygon where `side`, which is linear, is at least 0.
pub(super) fn clip(polygon: &[Vec3], side: impl Fn(&Vec3) -> f64) -> Vec<Vec3> {
    let mut part = Vec::with_capacity(polygon.len() + 1);
    for (k, a) in polygon.iter().enumerate() {
        let b = &polygon[(k + 1) % polygon.len()];
        let (s, t) = (side(a), side(b));
        if s >= 0.0 {
            part.push(*a);
        }
        if s.min(t) < 0.0 && s.max(t) > 0.0 {
            part.push(a + (b - a) * (s / (s - t)));
        }
    }
    part
}

/// Whether a mesh has several bodies, and an edge of one passes through a facet of another.
pub(super) fn has_crossing_bodies(mesh: &TriMesh) -> bool {
    let mut of: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    let find = |of: &mut [u32], mut v: u32| {
        while of[v as usize] != v {
            of[v as usize] = of[of[v as usize] as usize];
            v = of[v as usize];
        }
        v
    };
    for &[a, b, c] in &mesh.triangles {
        for [v, w] in [[a, b], [a, c]].map(|ends| ends.map(|v| find(&mut of, v))) {
            of[w as usize] = v;
        }
    }
    let mut used = mesh.triangles.iter().map(|t| find(&mut of, t[0]));
    let first = used.next();
    used.any(|body| Some(body) != first) && mesh.self_intersection_count() > 0
}

impl Surface {
    /// Takes away what of the facets of `mesh` lies inside another body, if anything does.
    pub(super) fn unite(&mut self, mesh: &TriMesh) {
        let bare = exposed(self, mesh);
        let vertices = bare.vertices.iter().map(to_parry).collect();
        if let Ok(facets) = shape::TriMesh::new(vertices, bare.triangles) {
            self.overlapping = Some(std::mem::replace(&mut self.facets, facets));
        }
    }
}

/// The parts of the facets of a mesh that lie in no other body: cut along the planes of the facets
/// that they meet, each part lies inside or outside as a whole.
fn exposed(surface: &Surface, mesh: &TriMesh) -> TriMesh {
    let step = step(mesh);
    let parts = |t: usize| {
        let corners = mesh.corners(t);
        let mut parts = vec![corners.to_vec()];
        let Some((normal, _)) = plane(corners) else {
            return Vec::new();
        };
        let (low, high) = bounds(&corners);
        let (start, end) = (to_parry(&low), to_parry(&high));
        let is_near =
            |node: &BvhNode| node.mins().cmple(end).all() && start.cmple(node.maxs()).all();
        for other in surface.facets.bvh().leaves(is_near) {
            let indices = mesh.triangles[other as usize];
            if indices.iter().any(|v| mesh.triangles[t].contains(v)) {
                continue;
            }
            let across = mesh.corners(other as usize);
            let Some((n, offset)) = plane(across) else {
                continue;
            };
            let over = across.map(|x| normal.dot(&(x - corners[0])));
            if over.iter().all(|h| *h > step) || over.iter().all(|h| *h < -step) {
                continue;
            }
            parts = parts
                .into_iter()
                .flat_map(|part| split(part, across, n, offset, step))
                .collect();
        }
        let is_bare = |part: &Vec<Vec3>| {
            let middle = part.iter().sum::<Vec3>() / part.len() as f64;
            !surface.is_inside(middle + normal * step)
        };
        parts.retain(is_bare);
        parts
    };
    let parts: Vec<Vec<Vec3>> = (0..mesh.triangles.len())
        .into_par_iter()
        .flat_map_iter(parts)
        .collect();
    let mut exposed = TriMesh::default();
    for part in parts {
        let first = exposed.vertices.len() as u32;
        let fan = (1..part.len() as u32 - 1).map(|k| [first, first + k, first + k + 1]);
        exposed.triangles.extend(fan);
        exposed.vertices.extend(part);
    }
    exposed
}

/// Both sides of a polygon along the plane of a facet, if that reaches it.
fn split(part: Vec<Vec3>, facet: [Vec3; 3], n: Vec3, offset: f64, step: f64) -> Vec<Vec<Vec3>> {
    let height = |x: &Vec3| n.dot(x) - offset;
    let is_beside = |k: usize| {
        let outwards = (facet[(k + 1) % 3] - facet[k]).cross(&n);
        part.iter().all(|x| outwards.dot(&(x - facet[k])) > 0.0)
    };
    let is_above = part.iter().all(|x| height(x) >= -step);
    if is_above || part.iter().all(|x| height(x) <= step) || (0..3).any(is_beside) {
        return vec![part];
    }
    let sides = [clip(&part, height), clip(&part, |x| -height(x))];
    sides.into_iter().filter(|side| side.len() > 2).collect()
}

fn plane([a, b, c]: [Vec3; 3]) -> Option<(Vec3, f64)> {
    let n = (b - a).cross(&(c - a)).try_normalize(0.0)?;
    Some((n, n.dot(&a)))
}

fn bounds(points: &[Vec3]) -> (Vec3, Vec3) {
    let first = (points[0], points[0]);
    points
        .iter()
        .fold(first, |(low, high), x| (low.inf(x), high.sup(x)))
}
