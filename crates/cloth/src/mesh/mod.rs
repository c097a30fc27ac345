//! Triangle meshes: tools, laminae and what is measured on them.

mod border;
pub mod compare;
mod crossing;
mod patches;
mod ply;
mod polygon;
mod read;
mod stl;

pub use border::{OrientationFault, border};
pub(crate) use patches::patches;
pub use read::{mesh_points, read_mesh};
#[cfg(test)]
pub(crate) use stl::to_stl_bytes;
pub use stl::{MeshFile, write_stl};

use std::ops::AddAssign;

use serde::{Deserialize, Serialize};

use crate::math::Vec3;

/// Most facets of a mesh that is read or made: with what a tool keeps of them, 2 GiB.
pub(crate) const MOST_FACETS: usize = 1 << 22;

/// Refuses more facets than [`MOST_FACETS`].
fn check_facet_count(found: usize) -> Result<(), String> {
    match found <= MOST_FACETS {
        true => Ok(()),
        false => Err(format!(
            "{found} facets or more, expected at most {MOST_FACETS}"
        )),
    }
}

/// A triangle mesh with shared vertices.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriMesh {
    /// Positions [m].
    pub vertices: Vec<Vec3>,
    /// Vertex indices, counter-clockwise when seen from outside (for an open mesh: from
    /// its upper side).
    pub triangles: Vec<[u32; 3]>,
}

impl TriMesh {
    /// The mesh of `triangles` with its vertices at `position` [m].
    pub fn new(position: &[[f64; 3]], triangles: &[[u32; 3]]) -> Self {
        Self {
            vertices: position.iter().map(|&x| Vec3::from(x)).collect(),
            triangles: triangles.to_vec(),
        }
    }

    /// Area-weighted vertex normals, unit length; zero where a vertex has no area.
    pub fn vertex_normals(&self) -> Vec<Vec3> {
        let sums = self.at_vertices(Vec3::zeros(), |area| area).into_iter();
        sums.map(|sum| sum.try_normalize(0.0).unwrap_or_default())
            .collect()
    }

    /// Smallest and largest coordinate along each axis [m]; infinite and reversed for an
    /// empty mesh.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let inf = Vec3::repeat(f64::INFINITY);
        self.vertices
            .iter()
            .fold((inf, -inf), |(low, high), v| (low.inf(v), high.sup(v)))
    }

    /// Corners of one triangle [m].
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|i| self.vertices[i as usize])
    }

    /// Sum of the area vectors [m²]: zero for a closed mesh, the upper side's direction for
    /// an open one.
    pub fn area_vector(&self) -> Vec3 {
        self.area_vectors().sum()
    }

    /// Surface area [m²].
    pub fn area(&self) -> f64 {
        self.area_vectors().map(|a| a.norm()).sum()
    }

    /// Enclosed volume [m³], positive when the triangles face outwards. Meaningful for
    /// closed meshes only.
    pub fn signed_volume(&self) -> f64 {
        // Measured from a point of the mesh: far from the origin the terms would cancel.
        let Some(&origin) = self.vertices.first() else {
            return 0.0;
        };
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t).map(|p| p - origin);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum()
    }

    /// Turns every triangle over.
    pub fn flip(&mut self) {
        for triangle in &mut self.triangles {
            triangle.swap(1, 2);
        }
    }

    /// A third of the area of every triangle at each vertex [m²].
    pub fn vertex_areas(&self) -> Vec<f64> {
        self.at_vertices(0.0, |area| area.norm() / 3.0)
    }

    /// Sums at each vertex what is made of the area vector of every triangle around it.
    fn at_vertices<T: Copy + AddAssign>(&self, zero: T, of: impl Fn(Vec3) -> T) -> Vec<T> {
        let mut sums = vec![zero; self.vertices.len()];
        for (triangle, area) in self.triangles.iter().zip(self.area_vectors()) {
            for &v in triangle {
                sums[v as usize] += of(area);
            }
        }
        sums
    }

    fn area_vectors(&self) -> impl Iterator<Item = Vec3> {
        (0..self.triangles.len()).map(|t| {
            let [a, b, c] = self.corners(t);
            (b - a).cross(&(c - a)) * 0.5
        })
    }
}
