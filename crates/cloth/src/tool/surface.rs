use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::BvhNode;
use parry3d_f64::query::{PointQuery, PointQueryWithLocation, Ray, RayCast};
use parry3d_f64::shape;
use rayon::prelude::*;

use crate::math::{Vec3, from_parry, to_parry};
use crate::mesh::{TriMesh, border};

use super::error::ToolError;

/// Below this share of the surface area, the sum of the area vectors counts as zero: the
/// mesh encloses a volume but for cracks between facets that were not welded.
pub(super) const CLOSURE_DEFECT: f64 = 1e-3;

/// Where a ray starts behind a facet [m].
const ON_THE_WAY: f64 = 1e-9;

/// Share of the mesh's diagonal that counts as a step off its surface: more than rounding and welding.
const STEP: f64 = 3e-6;

/// Nearer to the surface than this [m] the direction to the nearest point is rounding.
const ON_SURFACE: f64 = 1e-12;

/// Exact distances to a triangle mesh, seen as the boundary of a solid.
///
/// A closed mesh is its own solid. An open mesh is the upper face of a block: its border, but for
/// cracks, is extended straight down without end. So the distance stays continuous where cloth hangs over
/// the border; a sign from the nearest facet's normal would jump there.
///
/// A point is inside when the facets above it wind round it. Each edge votes the same way for both
/// of its triangles, so no ray slips through. Bodies that touch or overlap are one solid.
///
/// Takes for granted that the mesh bounds a solid: see `solidity.rs`.
#[derive(Clone, Debug)]
pub struct Surface {
    /// What bounds the solid.
    pub(super) facets: shape::TriMesh,
    /// All facets as given, where some of them lie inside another body.
    pub(super) overlapping: Option<shape::TriMesh>,
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
}

impl Surface {
    /// Takes a mesh whose triangles face outwards (upwards if it is open).
    ///
    /// # Errors
    /// Empty meshes, and those whose neighbouring triangles disagree on which side is out.
    pub fn new(mesh: &TriMesh) -> Result<Self, ToolError> {
        let border = border(mesh)?;
        let vertices: Vec<Vector> = mesh.vertices.iter().map(to_parry).collect();
        let facets =
            shape::TriMesh::new(vertices, mesh.triangles.clone()).map_err(|_| ToolError::Empty)?;
        let mut surface = Self {
            facets,
            overlapping: None,
            walls: None,
        };
        let gaps = surface.gaps(mesh, border);
        surface.walls = (!gaps.is_empty()).then(|| walls(mesh, &gaps));
        Ok(surface)
    }

    /// The edges of a `border` that are no cracks between facets that were not welded: these have
    /// another facet at hand.
    pub(super) fn gaps(&self, mesh: &TriMesh, border: Vec<[u32; 2]>) -> Vec<[u32; 2]> {
        let crack = 10.0 * step(mesh);
        let is_gap = |[a, b]: &[u32; 2]| {
            let middle = 0.5 * (mesh.vertices[*a as usize] + mesh.vertices[*b as usize]);
            let near = self.near(middle, crack);
            near.iter().filter(|(facet, ..)| facet.is_some()).count() < 2
        };
        border.into_par_iter().filter(is_gap).collect()
    }

    /// Signed distance [m], negative inside the solid, at the point `x` [m].
    pub fn signed_distance(&self, x: Vec3) -> f64 {
        self.contact(x, f64::MAX).0
    }

    /// Signed distance [m] at the point `x` [m], expected to be less than `bound` [m], and the
    /// outward unit normal there: away from the nearest point or, on the surface, that of a facet.
    pub(super) fn contact(&self, x: Vec3, bound: f64) -> (f64, Vec3) {
        let (distance, point, facet) = self.closest(x, bound);
        let inside = self.is_inside(x);
        let phi = if inside { -distance } else { distance };
        let normal = match facet {
            Some(facet) if distance < ON_SURFACE => from_parry(facet.scaled_normal()),
            _ => (x - point) / phi,
        };
        (phi, unit_or_up(normal))
    }

    /// The nearest point of the mesh itself (not of its downward extension). On an edge,
    /// the normal is that of one of its facets, always the same one.
    pub fn project(&self, x: Vec3) -> SurfacePoint {
        let (nearest, (triangle, _)) = self
            .facets
            .project_local_point_and_get_location(to_parry(&x), false);
        let normal = self.facets.triangle(triangle).scaled_normal();
        SurfacePoint {
            position: from_parry(nearest.point),
            normal: unit_or_up(from_parry(normal)),
        }
    }

    /// The nearest point of the solid's boundary and its distance [m], which is expected to
    /// be less than `bound` [m]. A bound that does not hold costs time, nothing else.
    pub fn nearest(&self, x: Vec3, bound: f64) -> (f64, Vec3) {
        let (distance, point, _) = self.closest(x, bound);
        (distance, point)
    }

    /// Distance, nearest point, and the facet or wall on which the point lies.
    fn closest(&self, x: Vec3, bound: f64) -> (f64, Vec3, Option<shape::Triangle>) {
        let target = to_parry(&x);
        let within = |mesh: &shape::TriMesh, bound: f64| {
            let found =
                mesh.project_local_point_and_get_location_with_max_dist(target, false, bound);
            found.map(|(nearest, (facet, _))| {
                let distance = (nearest.point - target).length();
                (distance, nearest.point, mesh.triangle(facet))
            })
        };
        let facet = within(&self.facets, bound);
        let closer = facet.as_ref().map_or(bound, |(distance, ..)| *distance);
        let wall = self.walls.as_ref().and_then(|walls| within(walls, closer));
        match wall.or(facet) {
            Some((distance, point, facet)) => (distance, from_parry(point), Some(facet)),
            None if bound < f64::MAX => self.closest(x, f64::MAX),
            // Only for coordinates that are not finite.
            None => (f64::INFINITY, x, None),
        }
    }

    /// The facets within `reach` [m] of `x` [m], with their numbers, and walls, without; and how far
    /// they are [m].
    pub(super) fn near(&self, x: Vec3, reach: f64) -> Vec<(Option<u32>, f64, [Vec3; 3])> {
        let target = to_parry(&x);
        let mut found = Vec::new();
        for (mesh, is_numbered) in [(Some(&self.facets), true), (self.walls.as_ref(), false)] {
            let Some(mesh) = mesh else { continue };
            let leaves = (mesh.bvh())
                .leaves(|node| node.aabb().distance_to_local_point(target, true) <= reach);
            for leaf in leaves {
                let facet = mesh.triangle(leaf);
                let distance = facet.distance_to_local_point(target, true);
                if distance <= reach {
                    let corners = [facet.a, facet.b, facet.c].map(from_parry);
                    found.push((is_numbered.then_some(leaf), distance, corners));
                }
            }
        }
        found.sort_unstable_by_key(|(number, ..)| *number);
        found
    }

    /// [`Surface::contact`] with the nearest of some facets. In the middle of one its side tells
    /// whether the point is inside.
    pub(super) fn contact_among(&self, facets: &[u32], x: Vec3) -> (f64, Vec3) {
        let target = to_parry(&x);
        let mut nearest = (f64::INFINITY, Vector::ZERO, 0, false);
        for &number in facets {
            let facet = self.facets.triangle(number);
            let (found, location) = facet.project_local_point_and_get_location(target, false);
            let distance = (found.point - target).length();
            if distance < nearest.0 {
                let is_face = matches!(location, shape::TrianglePointLocation::OnFace(..));
                nearest = (distance, found.point, number, is_face);
            }
        }
        let (distance, point, number, is_face) = nearest;
        let away = target - point;
        let normal = || self.facets.triangle(number).scaled_normal();
        let inside = match is_face {
            true => normal().dot(away) < 0.0,
            false => self.is_inside(x),
        };
        let phi = if inside { -distance } else { distance };
        let normal = match distance < ON_SURFACE {
            true => normal(),
            false => away / phi,
        };
        (phi, unit_or_up(from_parry(normal)))
    }

    /// Whether the facets above a point wind round it: what [`winding`] tells from all crossings.
    pub(super) fn is_inside(&self, x: Vec3) -> bool {
        let above = |node: &BvhNode| {
            let (low, high) = (node.mins(), node.maxs());
            low.x <= x.x && x.x <= high.x && low.y <= x.y && x.y <= high.y && x.z < high.z
        };
        let all = self.overlapping.as_ref().unwrap_or(&self.facets);
        let sign = |leaf| {
            let found = crossing(all.triangle(leaf), x.x, x.y);
            found.map_or(0, |(z, sign)| if z > x.z { sign } else { 0 })
        };
        all.bvh().leaves(above).map(sign).sum::<i32>() > 0
    }

    /// Whether this is the upper face of a block rather than a closed body.
    pub fn is_open(&self) -> bool {
        self.walls.is_some()
    }

    /// How thick the solid is behind a point of a facet [m], if the face there is parallel to this
    /// one to 25 degrees; none where the facet lies inside another body.
    pub(super) fn thickness(&self, x: Vec3, normal: Vec3) -> Option<f64> {
        if self.overlapping.is_some() && self.is_inside(x + normal * (1e3 * ON_THE_WAY)) {
            return None;
        }
        let ray = Ray::new(to_parry(&(x - normal * ON_THE_WAY)), to_parry(&-normal));
        let meshes = [Some(&self.facets), self.walls.as_ref()];
        let hits = meshes
            .into_iter()
            .flatten()
            .filter_map(|mesh| mesh.cast_local_ray_and_get_normal(&ray, f64::MAX, false));
        let hit = hits.min_by(|a, b| a.time_of_impact.total_cmp(&b.time_of_impact))?;
        let is_parallel = hit.normal.dot(ray.dir).abs() > 0.9;
        is_parallel.then_some(hit.time_of_impact + ON_THE_WAY)
    }

    /// Where the vertical line through (`x`, `y`) meets the facets: heights [m], ascending,
    /// with +1 for a facet that faces up and −1 for one that faces down.
    pub(crate) fn crossings(&self, x: f64, y: f64) -> Vec<(f64, i32)> {
        let on_line = |node: &BvhNode| {
            let (low, high) = (node.mins(), node.maxs());
            low.x <= x && x <= high.x && low.y <= y && y <= high.y
        };
        let all = self.overlapping.as_ref().unwrap_or(&self.facets);
        let meeting = |leaf| crossing(all.triangle(leaf), x, y);
        let leaves = all.bvh().leaves(on_line);
        let mut crossings: Vec<(f64, i32)> = leaves.filter_map(meeting).collect();
        crossings.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        crossings
    }
}

/// The direction of a normal; up where it has none.
fn unit_or_up(normal: Vec3) -> Vec3 {
    normal.try_normalize(0.0).unwrap_or_else(Vec3::z)
}

/// A step off the surface of a mesh that is more than rounding and welding [m].
pub(super) fn step(mesh: &TriMesh) -> f64 {
    let (low, high) = mesh.bounds();
    STEP * (high - low).norm()
}

/// How often the facets above height `z` wind round the point: sum of their signs.
pub(super) fn winding(crossings: &[(f64, i32)], z: f64) -> i32 {
    let above = crossings.iter().rev().take_while(|c| c.0 > z);
    above.map(|c| c.1).sum()
}

/// Whether the mesh leaves out a part of its boundary, beyond cracks between facets.
pub(super) fn is_open(mesh: &TriMesh) -> bool {
    mesh.area_vector().norm() > CLOSURE_DEFECT * mesh.area()
}

/// Meeting of a vertical line with a triangle: its height and the winding number of the
/// projected triangle round the line.
fn crossing(facet: shape::Triangle, x: f64, y: f64) -> Option<(f64, i32)> {
    let shape::Triangle { a, b, c } = facet;
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
        let [c, d] = [a, b].map(|v| Vector::new(v.x, v.y, bottom));
        vertices.extend([a, b, c, d]);
        triangles.extend([[first, first + 2, first + 3], [first, first + 3, first + 1]]);
    }
    shape::TriMesh::new(vertices, triangles).expect("an open mesh has a border")
}

#[cfg(test)]
pub(super) mod tests {
    use parry3d_f64::query::PointQuery;

    use super::*;
    use crate::math::{Purpose, Stream};
    use crate::mesh::OrientationFault;
    use crate::tool::{Hemisphere, Rib, Shape};

    fn random(stream: &mut Stream, low: Vec3, high: Vec3) -> Vec3 {
        low.zip_map(&high, |l, h| l + (h - l) * stream.uniform())
    }

    /// The square [−1, 1]² at height 0, facing up.
    pub fn sheet() -> TriMesh {
        TriMesh {
            vertices: [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(|[x, y]| Vec3::new(x, y, 0.0))
                .to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    #[test]
    fn sign_agrees_with_pseudo_normals() {
        for shape in [
            Shape::Rib(Rib::default()),
            Shape::Hemisphere(Hemisphere::default()),
        ] {
            let mesh = shape.mesh().unwrap();
            let surface = Surface::new(&mesh).unwrap();
            let oracle = shape::TriMesh::with_flags(
                mesh.vertices.iter().map(to_parry).collect(),
                mesh.triangles.clone(),
                shape::TriMeshFlags::ORIENTED,
            )
            .unwrap();
            let (low, high) = mesh.bounds();
            let margin = Vec3::repeat(0.03);
            let mut stream = Stream::new(1, Purpose::Evaluation, 0);
            let mut inside = 0;
            for _ in 0..5000 {
                let x = random(&mut stream, low - margin, high + margin);
                let phi = surface.signed_distance(x);
                let nearest = oracle.project_local_point(to_parry(&x), false);
                let distance = (nearest.point - to_parry(&x)).length();
                assert!((phi.abs() - distance).abs() < 1e-12);
                assert_eq!(phi < 0.0, nearest.is_inside, "{shape:?} at {x:?}");
                inside += usize::from(phi < 0.0);
            }
            assert!(inside > 500);
        }
    }

    #[test]
    fn bounded_search_finds_the_same_distance() {
        let mesh = Shape::default().mesh().unwrap();
        let surface = Surface::new(&mesh).unwrap();
        let x = Vec3::new(0.01, 0.05, 0.09);
        let (distance, _) = surface.nearest(x, f64::MAX);
        for bound in [1.0, distance * 1.001, distance, distance * 0.5, 0.0] {
            assert_eq!(surface.nearest(x, bound).0, distance);
        }
    }

    #[test]
    fn open_mesh_is_the_top_of_a_block() {
        let surface = Surface::new(&sheet()).unwrap();
        for (x, exact) in [
            ([0.3, 0.2, 0.5], 0.5),
            ([0.3, 0.2, -0.5], -0.5),
            // Deep down, the side walls are nearer than the sheet.
            ([0.3, 0.2, -5.0], -0.7),
            // Beyond the border: above, level and below.
            ([1.3, 0.0, 0.4], 0.5),
            ([1.3, 0.0, 0.0], 0.3),
            ([1.3, 0.0, -0.4], 0.3),
        ] {
            let phi = surface.signed_distance(Vec3::from(x));
            assert!((phi - exact).abs() < 1e-12, "{phi} for {exact} at {x:?}");
        }
    }

    #[test]
    fn lines_through_edges_and_vertices_cross_once() {
        let surface = Surface::new(&sheet()).unwrap();
        // The shared diagonal, and corners and sides: each belongs to the sheet or does not.
        for (x, y) in [(0.0, 0.0), (0.5, 0.5), (-0.25, -0.25), (-1.0, 0.5)] {
            let winding = winding(&surface.crossings(x, y), -1.0);
            assert!(winding == 0 || winding == 1, "{winding}");
        }
        assert_eq!(surface.crossings(0.0, 0.0), [(0.0, 1)]);
        // Right through the vertices of a closed body.
        let mesh = Shape::default().mesh().unwrap();
        let surface = Surface::new(&mesh).unwrap();
        for v in &mesh.vertices {
            let crossings = surface.crossings(v.x, v.y);
            assert_eq!(winding(&crossings, f64::MIN), 0, "{crossings:?}");
        }
    }

    #[test]
    fn overlapping_and_touching_bodies_are_inside_once() {
        let plate = |low: f64| {
            let mut mesh = Shape::Plate(crate::tool::Plate {
                plate_mm: [2000.0, 2000.0],
                base_mm: 1000.0,
            })
            .mesh()
            .unwrap();
            for v in &mut mesh.vertices {
                v.z += low;
            }
            mesh
        };
        for (offset, inside, outside) in [(0.5, 0.25, 0.75), (1.0, 0.5, 1.25)] {
            let mut mesh = plate(0.0);
            let other = plate(offset);
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(&other.vertices);
            mesh.triangles
                .extend(other.triangles.iter().map(|t| t.map(|i| i + first)));
            let surface = Surface::new(&mesh).unwrap();
            let phi = |z| surface.signed_distance(Vec3::new(0.1, 0.2, z));
            assert!(phi(inside) < 0.0 && phi(-0.3) < 0.0 && phi(outside) > -1.0);
            assert!((phi(offset + 0.25) - 0.25).abs() < 1e-12);
        }
    }

    #[test]
    fn cracked_body_keeps_its_sign_and_distance() {
        // Every facet with its own three vertices, each moved a little: nothing is shared.
        let whole = Shape::default().mesh().unwrap();
        let mut stream = Stream::new(4, Purpose::Evaluation, 0);
        let mut cracked = TriMesh::default();
        for t in 0..whole.triangles.len() {
            let first = cracked.vertices.len() as u32;
            let noise = Vec3::repeat(1e-6);
            cracked.vertices.extend(
                whole
                    .corners(t)
                    .map(|v| v + random(&mut stream, -noise, noise)),
            );
            cracked.triangles.push([first, first + 1, first + 2]);
        }
        let [exact, noisy] = [&whole, &cracked].map(|mesh| Surface::new(mesh).unwrap());
        let (low, high) = whole.bounds();
        for _ in 0..3000 {
            let x = random(&mut stream, low, high);
            let (phi, found) = (exact.signed_distance(x), noisy.signed_distance(x));
            assert!((phi - found).abs() < 3e-6, "{found} for {phi} at {x:?}");
        }
    }

    #[test]
    fn projection_lies_on_the_mesh_and_faces_out() {
        let mesh = Shape::default().mesh().unwrap();
        let surface = Surface::new(&mesh).unwrap();
        let x = Vec3::new(0.02, 0.05, 0.08);
        let nearest = surface.project(x);
        let n = nearest.normal;
        assert!((n.norm() - 1.0).abs() < 1e-12);
        let away = x - nearest.position;
        assert!((away.norm() - surface.signed_distance(x)).abs() < 1e-12);
        assert!(away.normalize().dot(&n) > 0.99);
    }

    #[test]
    fn disagreeing_facets_are_refused() {
        let mut mesh = sheet();
        mesh.triangles[1].swap(1, 2);
        assert!(matches!(
            Surface::new(&mesh),
            Err(ToolError::Orientation(OrientationFault::Misoriented {
                edge_count: 1
            }))
        ));
        // A border edge of a facet that is there twice is used twice in one direction.
        let mut mesh = sheet();
        mesh.triangles.push(mesh.triangles[1]);
        assert!(matches!(
            Surface::new(&mesh),
            Err(ToolError::Orientation(OrientationFault::Duplicate {
                count: 1
            }))
        ));
        assert!(matches!(
            Surface::new(&TriMesh::default()),
            Err(ToolError::Empty)
        ));
    }
}
