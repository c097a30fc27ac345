use parry3d_f64::partitioning::BvhNode;
use parry3d_f64::shape;
use rayon::prelude::*;
use robust::{Coord3D, orient3d};

use super::TriMesh;
use crate::math::{Vec3, to_parry};

impl TriMesh {
    /// Number of places where an edge of the mesh passes through one of its triangles, counting
    /// edges and triangles that share no vertex.
    ///
    /// What touches or lies in the plane does not count, nor do coordinates that are no numbers.
    pub fn self_intersection_count(&self) -> usize {
        let at = |v: u32| self.vertices[v as usize];
        let mut edges: Vec<[u32; 2]> = (self.triangles.iter())
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let is_finite = |t: &&[u32; 3]| t.map(at).iter().all(|x| x.sum().is_finite());
        let triangles: Vec<[u32; 3]> = self.triangles.iter().filter(is_finite).copied().collect();
        let vertices = self.vertices.iter().map(to_parry).collect();
        let Ok(facets) = shape::TriMesh::new(vertices, triangles) else {
            return 0;
        };
        let crossed = |edge: &[u32; 2]| {
            let [p, q] = edge.map(at);
            let (low, high) = (to_parry(&p.inf(&q)), to_parry(&p.sup(&q)));
            let near = |node: &BvhNode| {
                let (start, end) = (node.mins(), node.maxs());
                start.cmple(high).all() && low.cmple(end).all()
            };
            let passed = |&facet: &u32| {
                let triangle = facets.indices()[facet as usize];
                edge.iter().all(|v| !triangle.contains(v)) && passes([p, q], triangle.map(at))
            };
            facets.bvh().leaves(near).filter(passed).count()
        };
        edges.par_iter().map(crossed).sum()
    }
}

/// Whether the segment from `p` to `q` passes through the inside of a triangle.
fn passes([p, q]: [Vec3; 2], [a, b, c]: [Vec3; 3]) -> bool {
    let ends = [side([a, b, c], p), side([a, b, c], q)];
    if !(ends[0].min(ends[1]) < 0.0 && ends[0].max(ends[1]) > 0.0) {
        return false;
    }
    let turns = [side([a, b, p], q), side([b, c, p], q), side([c, a, p], q)];
    turns.iter().all(|&turn| turn > 0.0) || turns.iter().all(|&turn| turn < 0.0)
}

/// On which side of the plane of three points `x` is, exactly: positive, negative, or 0 for neither.
fn side(plane: [Vec3; 3], x: Vec3) -> f64 {
    let [a, b, c, x] = [plane[0], plane[1], plane[2], x].map(|p| Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    });
    orient3d(a, b, c, x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> TriMesh {
        TriMesh {
            vertices: points.iter().map(|&x| Vec3::from(x)).collect(),
            triangles: triangles.to_vec(),
        }
    }

    /// Two triangles, the second one upright in the plane x = 0.25 and lowered by `depth`.
    fn upright(depth: f64) -> usize {
        let points = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.25, 0.2, -depth],
            [0.25, 0.2, 1.0],
            [0.25, 5.0, 1.0],
        ];
        mesh(&points, &[[0, 1, 2], [3, 4, 5]]).self_intersection_count()
    }

    #[test]
    fn edges_that_pass_through_count_and_touching_does_not() {
        // Both edges from the lowered corner pass through.
        assert_eq!(upright(0.01), 2);
        assert_eq!(upright(1e-12), 2);
        assert_eq!(upright(0.0), 0);
        assert_eq!(upright(-1e-12), 0);
        // Far down, one of them passes beside the triangle, the edges of which go through
        // the other one instead.
        assert_eq!(upright(3.0), 2);
    }

    #[test]
    fn layers_on_each_other_and_coordinates_that_are_no_numbers_do_not_count() {
        let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let twice = [flat, flat].concat();
        assert_eq!(
            mesh(&twice, &[[0, 1, 2], [3, 4, 5]]).self_intersection_count(),
            0
        );
        let nowhere = [[f64::NAN; 3]; 6];
        assert_eq!(
            mesh(&nowhere, &[[0, 1, 2], [3, 4, 5]]).self_intersection_count(),
            0
        );
        assert_eq!(mesh(&[], &[]).self_intersection_count(), 0);
    }
}
