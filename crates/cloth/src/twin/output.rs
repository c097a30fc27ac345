use std::path::Path;

use super::twin::Twin;
use crate::file::WriteError;
use crate::math::Vec3;
use crate::mesh::{TriMesh, VtkField, write_stl, write_vtk};
use crate::tool::Tool;

impl Twin {
    /// The lamina as it is now.
    pub fn mesh(&self) -> TriMesh {
        TriMesh {
            vertices: self.positions().into_iter().map(Vec3::from).collect(),
            triangles: self.triangles.clone(),
        }
    }

    /// Writes the lamina as an STL file, in millimetres.
    pub fn write_stl(&self, path: impl AsRef<Path>) -> Result<(), WriteError> {
        write_stl(path, &self.mesh(), "twin")
    }

    /// Writes the lamina as a legacy VTK file, in metres: per point its speed [m/s] and, with
    /// a tool, its distance to that [m]; per triangle the strains of warp and weft [-] and the
    /// shear angle [degrees].
    pub fn write_vtk(&self, path: impl AsRef<Path>, tool: Option<&Tool>) -> Result<(), WriteError> {
        let speed = self.velocities().into_iter().map(|v| Vec3::from(v).norm());
        let mut points = vec![VtkField::new("speed", speed.collect())];
        if let Some(tool) = tool {
            let distance = self.positions().into_iter().map(|x| tool.distance(x).0);
            points.push(VtkField::new("distance", distance.collect()));
        }
        let strains = self.strains();
        let yarn = |family: usize| strains.iter().map(|s| s.yarns[family]).collect();
        let shear = strains.iter().map(|s| s.shear.to_degrees()).collect();
        let triangles = [
            VtkField::new("warp_strain", yarn(0)),
            VtkField::new("weft_strain", yarn(1)),
            VtkField::new("shear_deg", shear),
        ];
        write_vtk(path, &self.mesh(), "twin", &points, &triangles)
    }
}
