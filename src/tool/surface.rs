use parry3d_f64::math::Vector;
use parry3d_f64::query::{PointProjection, PointQueryWithLocation};
use parry3d_f64::shape;

use crate::math::Vec3;
use crate::mesh::{Topology, TriMesh};

use super::ToolError;

/// Below this share of the surface area, the sum of the area vectors counts as zero: the
/// mesh encloses a volume but for cracks between facets that were not welded.
const CLOSURE_DEFECT: f64 = 1e-3;

/// Exact distances to a triangle mesh, seen as the boundary of a solid.
///
/// A closed mesh is its own solid. An open mesh is the upper face of a block: its border is
/// extended straight down without end, and what lies below is inside. So the distance stays
/// continuous beyond the border, where a sign from the nearest facet's normal would jump on
/// the surface's imagined continuation, just where cloth hangs over.
///
/// A point is inside when the facets above it wind round it, counted along the vertical.
/// Each edge votes the same way for both of its triangles, so no ray slips through a shared
/// edge; bodies that touch or overlap are inside once. Inside an overlap the distance is
/// that to the nearest facet, not to the boundary of the union.
///
/// Does not model: an undercut open mesh whose border lies below other parts of itself (the
/// extension then cuts through what is there).
pub struct Surface {
    facets: shape::TriMesh,
    /// Downward extension of the border; absent for a closed mesh.
    walls: Option<shape::TriMesh>,
}

/// The point of a surface that is nearest to a query point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position on the mesh [m].
    pub position: Vec3,
    /// Outward unit normal of the facet.
    pub normal: Vec3,
    /// Index of the facet.
    pub triangle: usize,
}

impl Surface {
    /// Takes a mesh whose triangles face outwards (upwards if it is open).
    ///
    /// # Errors
    /// Empty meshes, and those whose neighbouring triangles disagree on which side is out.
    pub fn new(mesh: &TriMesh) -> Result<Self, ToolError> {
        let topology = Topology::new(mesh);
        if topology.misoriented_edge_count > 0 {
            return Err(ToolError::Misoriented {
                edge_count: topology.misoriented_edge_count,
            });
        }
        let vertices: Vec<Vector> = mesh.vertices.iter().map(to_parry).collect();
        let facets =
            shape::TriMesh::new(vertices, mesh.triangles.clone()).map_err(|_| ToolError::Empty)?;
        let walls = is_open(mesh).then(|| walls(mesh, &topology.border));
        Ok(Self { facets, walls })
    }

    /// Signed distance [m], negative inside the solid, at the point `x` [m].
    pub fn signed_distance(&self, x: Vec3) -> f64 {
        let distance = self.distance(x, f64::MAX);
        let inside = winding(&self.crossings(x.x, x.y), x.z) > 0;
        if inside { -distance } else { distance }
    }

    /// The nearest point of the mesh itself (not of its downward extension). On an edge,
    /// the normal is that of one of its facets, always the same one.
    pub fn project(&self, x: Vec3) -> SurfacePoint {
        let (nearest, (triangle, _)) = self
            .facets
            .project_local_point_and_get_location(to_parry(&x), false);
        let triangle = triangle as usize;
        let normal = self.facets.triangle(triangle as u32).scaled_normal();
        SurfacePoint {
            position: from_parry(nearest.point),
            normal: from_parry(normal)
                .try_normalize(0.0)
                .unwrap_or_else(Vec3::z),
            triangle,
        }
    }

    /// Distance [m] to the boundary of the solid, given that it is less than `bound` [m].
    /// A bound that does not hold costs time, nothing else.
    pub(super) fn distance(&self, x: Vec3, bound: f64) -> f64 {
        let x = to_parry(&x);
        let within = |mesh: &shape::TriMesh, bound: f64| {
            mesh.project_local_point_and_get_location_with_max_dist(x, false, bound)
                .map(|(nearest, _): (PointProjection, _)| (nearest.point - x).length())
        };
        let facets = within(&self.facets, bound);
        let walls = self
            .walls
            .as_ref()
            .and_then(|walls| within(walls, facets.unwrap_or(bound)));
        match walls.or(facets) {
            Some(distance) => distance,
            None if bound < f64::MAX => self.distance(from_parry(x), f64::MAX),
            // Only for coordinates that are not finite.
            None => f64::INFINITY,
        }
    }

    /// Where the vertical line through (`x`, `y`) meets the facets: heights [m], ascending,
    /// with +1 for a facet that faces up and −1 for one that faces down.
    pub(super) fn crossings(&self, x: f64, y: f64) -> Vec<(f64, i32)> {
        let on_line = |node: &parry3d_f64::partitioning::BvhNode| {
            let (low, high) = (node.mins(), node.maxs());
            low.x <= x && x <= high.x && low.y <= y && y <= high.y
        };
        let mut crossings: Vec<(f64, i32)> = self
            .facets
            .bvh()
            .leaves(on_line)
            .filter_map(|leaf| {
                let triangle = self.facets.triangle(leaf);
                crossing([triangle.a, triangle.b, triangle.c], x, y)
            })
            .collect();
        crossings.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        crossings
    }
}

/// How often the facets above height `z` wind round the point: sum of their signs.
pub(super) fn winding(crossings: &[(f64, i32)], z: f64) -> i32 {
    crossings
        .iter()
        .rev()
        .take_while(|c| c.0 > z)
        .map(|c| c.1)
        .sum()
}

/// Whether the mesh leaves out a part of its boundary, beyond cracks between facets.
pub(super) fn is_open(mesh: &TriMesh) -> bool {
    mesh.area_vector().norm() > CLOSURE_DEFECT * mesh.area()
}

/// Meeting of a vertical line with a triangle: its height and the winding number of the
/// projected triangle round the line.
fn crossing(corners: [Vector; 3], x: f64, y: f64) -> Option<(f64, i32)> {
    let [a, b, c] = corners;
    let sign = vote(a, b, x, y) + vote(b, c, x, y) + vote(c, a, x, y);
    if sign == 0 {
        return None;
    }
    let n = (b - a).cross(c - a);
    let z = a.z - (n.x * (x - a.x) + n.y * (y - a.y)) / n.z;
    // Nearly vertical facets: the quotient means nothing, but their extent bounds it.
    let (low, high) = (a.z.min(b.z).min(c.z), a.z.max(b.z).max(c.z));
    Some((if z.is_nan() { high } else { z.clamp(low, high) }, sign))
}

/// Winding contribution of one projected edge: ±1 if the ray from (`x`, `y`) towards +x
/// crosses it. Exactly the negative for the reversed edge.
fn vote(from: Vector, to: Vector, x: f64, y: f64) -> i32 {
    let (low, high, sign) = match (from.y <= y, to.y <= y) {
        (true, false) => (from, to, 1),
        (false, true) => (to, from, -1),
        _ => return 0,
    };
    let is_left = (high.x - low.x) * (y - low.y) - (x - low.x) * (high.y - low.y) > 0.0;
    if is_left { sign } else { 0 }
}

/// Vertical walls below the border, deep enough to reach below anything near the mesh.
fn walls(mesh: &TriMesh, border: &[[u32; 2]]) -> shape::TriMesh {
    let (low, high) = mesh.bounds();
    let bottom = low.z - 10.0 * (high - low).norm();
    let mut vertices = Vec::with_capacity(4 * border.len());
    let mut triangles = Vec::with_capacity(2 * border.len());
    for edge in border {
        let [a, b] = edge.map(|i| to_parry(&mesh.vertices[i as usize]));
        let first = vertices.len() as u32;
        vertices.extend([
            a,
            b,
            Vector::new(a.x, a.y, bottom),
            Vector::new(b.x, b.y, bottom),
        ]);
        triangles.extend([[first, first + 2, first + 3], [first, first + 3, first + 1]]);
    }
    shape::TriMesh::new(vertices, triangles).expect("an open mesh has a border")
}

fn to_parry(v: &Vec3) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

fn from_parry(v: Vector) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}
