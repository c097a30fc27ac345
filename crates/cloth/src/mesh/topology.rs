use super::TriMesh;

/// How the triangles of a mesh hang together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topology {
    /// Vertices that a triangle uses.
    pub vertex_count: usize,
    /// Undirected edges.
    pub edge_count: usize,
    /// Triangles.
    pub face_count: usize,
    /// The border: edges with a triangle on one side only, directed as in that triangle.
    pub border: Vec<[u32; 2]>,
    /// Connected pieces of the border.
    pub border_loop_count: usize,
    /// Edges with more than two triangles.
    pub nonmanifold_edge_count: usize,
    /// Edges whose triangles disagree on which side is out: used more often in one
    /// direction than in the other although their number is even.
    pub misoriented_edge_count: usize,
}

impl Topology {
    /// Counts in O(n log n); the result does not depend on the order of the triangles.
    pub fn new(mesh: &TriMesh) -> Self {
        // Directed edges as (low, high, runs upwards), sorted so that twins are neighbours.
        let mut edges: Vec<(u32, u32, bool)> = mesh
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
            .map(|(from, to)| (from.min(to), from.max(to), from < to))
            .collect();
        edges.sort_unstable();

        let mut topology = Self {
            vertex_count: 0,
            edge_count: 0,
            face_count: mesh.triangles.len(),
            border: Vec::new(),
            border_loop_count: 0,
            nonmanifold_edge_count: 0,
            misoriented_edge_count: 0,
        };
        for twins in edges.chunk_by(|e, f| (e.0, e.1) == (f.0, f.1)) {
            let (low, high, _) = twins[0];
            let upward = twins.iter().filter(|e| e.2).count();
            let downward = twins.len() - upward;
            topology.edge_count += 1;
            topology.nonmanifold_edge_count += usize::from(twins.len() > 2);
            if upward == downward {
                continue;
            }
            if twins.len().is_multiple_of(2) {
                topology.misoriented_edge_count += 1;
            } else if upward > downward {
                topology.border.push([low, high]);
            } else {
                topology.border.push([high, low]);
            }
        }
        let mut used = vec![false; mesh.vertices.len()];
        for &i in mesh.triangles.iter().flatten() {
            used[i as usize] = true;
        }
        topology.vertex_count = used.iter().filter(|&&u| u).count();
        topology.border_loop_count = piece_count(&topology.border, mesh.vertices.len());
        topology
    }

    /// The mesh encloses a volume: it has no border, and its triangles agree on which side
    /// is out.
    pub fn is_closed(&self) -> bool {
        self.face_count > 0 && self.border.is_empty() && self.misoriented_edge_count == 0
    }

    /// V − E + F: 2 for a sphere, 1 for a disc, 0 for a torus.
    pub fn euler_characteristic(&self) -> i64 {
        self.vertex_count as i64 - self.edge_count as i64 + self.face_count as i64
    }
}

/// Connected pieces of the graph `edges` on `vertex_count` vertices; lone vertices do not
/// count. Union-find with path halving.
fn piece_count(edges: &[[u32; 2]], vertex_count: usize) -> usize {
    let mut parent: Vec<u32> = (0..vertex_count as u32).collect();
    let mut touched = vec![false; vertex_count];
    let mut pieces = 0;
    for edge in edges {
        for &v in edge {
            pieces += usize::from(!std::mem::replace(&mut touched[v as usize], true));
        }
        let [a, b] = edge.map(|mut v| {
            while parent[v as usize] != v {
                parent[v as usize] = parent[parent[v as usize] as usize];
                v = parent[v as usize];
            }
            v
        });
        if a != b {
            parent[a as usize] = b;
            pieces -= 1;
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    /// The unit cube, facing outwards.
    fn cube() -> TriMesh {
        let vertices = (0..8)
            .map(|i| Vec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64))
            .collect();
        let triangles = vec![
            [0, 2, 1],
            [1, 2, 3],
            [4, 5, 6],
            [5, 7, 6],
            [0, 1, 4],
            [1, 5, 4],
            [2, 6, 3],
            [3, 6, 7],
            [0, 4, 2],
            [2, 4, 6],
            [1, 3, 5],
            [3, 7, 5],
        ];
        TriMesh {
            vertices,
            triangles,
        }
    }

    #[test]
    fn cube_is_a_closed_sphere_of_unit_volume() {
        let mut mesh = cube();
        let topology = Topology::new(&mesh);
        assert!(topology.is_closed());
        assert_eq!(topology.euler_characteristic(), 2);
        assert_eq!(topology.edge_count, 18);
        assert!((mesh.signed_volume() - 1.0).abs() < 1e-15);
        assert!((mesh.area() - 6.0).abs() < 1e-14);
        assert!(mesh.area_vector().norm() < 1e-15);
        mesh.flip();
        assert!((mesh.signed_volume() + 1.0).abs() < 1e-15);
    }

    #[test]
    fn missing_lid_and_floor_leave_two_loops() {
        let mut mesh = cube();
        mesh.triangles.drain(0..4);
        let topology = Topology::new(&mesh);
        assert!(!topology.is_closed());
        assert_eq!((topology.border.len(), topology.border_loop_count), (8, 2));
        assert_eq!(topology.euler_characteristic(), 0);
        // The border of the lid runs as its walls run: against the lid's own edges.
        assert!(topology.border.contains(&[5, 4]));
    }

    #[test]
    fn turned_triangle_is_noticed() {
        let mut mesh = cube();
        mesh.triangles[5].swap(0, 1);
        let topology = Topology::new(&mesh);
        assert_eq!(topology.misoriented_edge_count, 3);
        assert!(!topology.is_closed() && topology.border.is_empty());
    }

    #[test]
    fn boxes_that_share_an_edge_are_closed_but_not_manifold() {
        let mut mesh = cube();
        let other = cube();
        // The second cube touches the first along the edge from (1, 1, 0) to (1, 1, 1).
        let renamed = |i: u32| match i {
            0 => 3,
            4 => 7,
            i => i + 8,
        };
        mesh.vertices
            .extend(other.vertices.iter().map(|v| v + Vec3::new(1.0, 1.0, 0.0)));
        mesh.triangles
            .extend(other.triangles.iter().map(|t| t.map(renamed)));
        let topology = Topology::new(&mesh);
        assert!(topology.is_closed());
        assert_eq!(topology.nonmanifold_edge_count, 1);
        assert_eq!(topology.vertex_count, 14);
    }
}
