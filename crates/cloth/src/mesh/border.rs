use super::TriMesh;

/// A mesh whose triangles do not agree on which side is out, or up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OrientationFault {
    /// A triangle that is there twice uses its edges twice, and disagrees with nobody.
    #[error("{count} triangles are there more than once, expected each once")]
    Duplicate { count: usize },
    #[error(
        "its triangles disagree on which side is out: {edge_count} edges are used more often in \
         one direction than in the other"
    )]
    Misoriented { edge_count: usize },
}

/// The border of a mesh: edges with a triangle on one side only, directed as in that triangle.
/// None of a mesh that encloses a volume. Edges with more than two triangles are allowed.
///
/// In O(n log n); the result does not depend on the order of the triangles.
///
/// # Errors
/// If an even number of triangles at an edge uses it more often in one direction.
pub fn border(mesh: &TriMesh) -> Result<Vec<[u32; 2]>, OrientationFault> {
    // Directed edges as (low, high, runs upwards), sorted so that twins are neighbours.
    let mut edges: Vec<(u32, u32, bool)> = (mesh.triangles.iter())
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .map(|(from, to)| (from.min(to), from.max(to), from < to))
        .collect();
    edges.sort_unstable();
    let mut border = Vec::new();
    let mut edge_count = 0;
    for twins in edges.chunk_by(|e, f| (e.0, e.1) == (f.0, f.1)) {
        let (low, high, _) = twins[0];
        let upward = twins.iter().filter(|e| e.2).count();
        let downward = twins.len() - upward;
        if upward == downward {
            continue;
        }
        if twins.len().is_multiple_of(2) {
            edge_count += 1;
        } else if upward > downward {
            border.push([low, high]);
        } else {
            border.push([high, low]);
        }
    }
    match (edge_count, duplicate_count(mesh)) {
        (0, _) => Ok(border),
        (_, 0) => Err(OrientationFault::Misoriented { edge_count }),
        (_, count) => Err(OrientationFault::Duplicate { count }),
    }
}

/// How many triangles have the corners of an earlier one, in whatever order.
fn duplicate_count(mesh: &TriMesh) -> usize {
    let mut sorted = mesh.triangles.clone();
    for triangle in &mut sorted {
        triangle.sort_unstable();
    }
    sorted.sort_unstable();
    sorted.windows(2).filter(|pair| pair[0] == pair[1]).count()
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
    fn cube_is_closed_and_of_unit_volume() {
        let mut mesh = cube();
        assert_eq!(border(&mesh), Ok(Vec::new()));
        assert!((mesh.signed_volume() - 1.0).abs() < 1e-15);
        assert!((mesh.area() - 6.0).abs() < 1e-14);
        assert!(mesh.area_vector().norm() < 1e-15);
        mesh.flip();
        assert!((mesh.signed_volume() + 1.0).abs() < 1e-15);
    }

    #[test]
    fn missing_lid_and_floor_leave_their_edges() {
        let mut mesh = cube();
        mesh.triangles.drain(0..4);
        let border = border(&mesh).unwrap();
        assert_eq!(border.len(), 8);
        // The border of the lid runs as its walls run: against the lid's own edges.
        assert!(border.contains(&[5, 4]));
    }

    #[test]
    fn turned_and_doubled_triangles_are_noticed() {
        let mut mesh = cube();
        mesh.triangles[5].swap(0, 1);
        let edge_count = 3;
        assert_eq!(
            border(&mesh),
            Err(OrientationFault::Misoriented { edge_count })
        );
        let mut mesh = cube();
        mesh.triangles.drain(0..4);
        mesh.triangles.push(mesh.triangles[0]);
        assert_eq!(border(&mesh), Err(OrientationFault::Duplicate { count: 1 }));
    }

    #[test]
    fn boxes_that_share_an_edge_are_closed() {
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
        assert_eq!(border(&mesh), Ok(Vec::new()));
    }
}
