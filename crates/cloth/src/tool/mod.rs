//! Rigid tools: parametric shapes, meshes from files, and the distance to them.
//!
//! Contact asks for the distance many million times a second, so the exact one ([`Surface`]) is
//! sampled once on a grid ([`DistanceGrid`]), and the solver interpolates.

mod accuracy;
mod config;
mod depth;
mod error;
mod features;
mod grid;
mod lanes;
mod patch;
mod shapes;
mod sharp;
mod solid;
mod solidity;
mod surface;
mod union;

pub use accuracy::{GridError, Thinnest};
pub use config::{GridConfig, MeshSource, Pose, Source, ToolConfig};
pub use depth::Deepest;
pub use error::ToolError;
pub(crate) use features::Features;
pub use features::SMOOTH;
pub use grid::DistanceGrid;
pub(crate) use lanes::{Atlas, Tools};
pub use shapes::{
    Cylinder, DoubleDome, Hemisphere, Hills, Incline, Plate, Rib, Saddle, Shape, Trough,
};
pub use solid::Tool;
pub use surface::{Surface, SurfacePoint};

#[cfg(test)]
pub(crate) mod tests {
    use crate::math::Vec3;
    use crate::mesh::TriMesh;

    /// Bodies between two corners each [m], which may overlap.
    pub(crate) fn blocks(all: &[[[f64; 3]; 2]]) -> TriMesh {
        let mut mesh = TriMesh::default();
        for corners in all {
            let first = mesh.vertices.len() as u32;
            let at = |n: usize| Vec3::from([0, 1, 2].map(|k| corners[n >> k & 1][k]));
            mesh.vertices.extend((0..8).map(at));
            for [a, b, c, d] in [
                [0, 2, 3, 1],
                [4, 5, 7, 6],
                [0, 1, 5, 4],
                [2, 6, 7, 3],
                [0, 4, 6, 2],
                [1, 3, 7, 5],
            ] {
                let triangles = [[a, b, c], [a, c, d]];
                mesh.triangles
                    .extend(triangles.map(|t| t.map(|v| v + first)));
            }
        }
        mesh
    }

    /// A cone with its tip over `at` [m], on a wider plate.
    pub(crate) fn cone(radius: f64, height: f64, at: [f64; 2]) -> TriMesh {
        let mut mesh = blocks(&[[[-0.1, -0.1, -0.02], [0.1, 0.1, 0.0]]]);
        let first = mesh.vertices.len() as u32;
        let ends = [height, -0.001].map(|z| Vec3::new(at[0], at[1], z));
        mesh.vertices.extend(ends);
        for k in 0..32 {
            let (sin, cos) = (f64::from(k) / 32.0 * std::f64::consts::TAU).sin_cos();
            mesh.vertices
                .push(ends[1] + Vec3::new(cos, sin, 0.0) * radius);
            let [a, b] = [k, (k + 1) % 32].map(|k| first + 2 + k);
            mesh.triangles.extend([[first, a, b], [first + 1, b, a]]);
        }
        mesh
    }

    /// A roof with its ridge along y at a height of 60 mm, open below [m].
    pub(crate) fn roof(slope_deg: f64) -> TriMesh {
        let half = 0.06 / slope_deg.to_radians().tan();
        let profile = [[-half, 0.0], [0.0, 0.06], [half, 0.0]];
        let mut mesh = TriMesh::default();
        for [x, z] in profile {
            mesh.vertices
                .extend([Vec3::new(x, -0.22, z), Vec3::new(x, 0.22, z)]);
        }
        for k in [0, 2] {
            mesh.triangles
                .extend([[k, k + 2, k + 3], [k, k + 3, k + 1]]);
        }
        mesh
    }
}
