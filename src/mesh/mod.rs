//! Triangle meshes: tools, laminae and what is measured on them.

use crate::math::Vec3;

/// A triangle mesh with shared vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Positions [m].
    pub vertices: Vec<Vec3>,
    /// Vertex indices, counter-clockwise when seen from outside (for an open mesh: from
    /// its upper side).
    pub triangles: Vec<[u32; 3]>,
}

impl TriMesh {
    /// Area-weighted vertex normals, unit length; zero where a vertex has no area.
    pub fn vertex_normals(&self) -> Vec<Vec3> {
        let mut normals = vec![Vec3::zeros(); self.vertices.len()];
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|i| self.vertices[i as usize]);
            let twice_area = (b - a).cross(&(c - a));
            for &i in triangle {
                normals[i as usize] += twice_area;
            }
        }
        for normal in &mut normals {
            *normal = normal.try_normalize(0.0).unwrap_or_default();
        }
        normals
    }

    /// Smallest and largest coordinate along each axis [m]; infinite and reversed for an
    /// empty mesh.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let inf = Vec3::repeat(f64::INFINITY);
        self.vertices
            .iter()
            .fold((inf, -inf), |(low, high), v| (low.inf(v), high.sup(v)))
    }
}
