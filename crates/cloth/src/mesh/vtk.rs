use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use super::TriMesh;
use crate::file::{WriteError, write_atomic};

/// Numbers on a mesh, one a point or one a triangle.
#[derive(Clone, Debug, PartialEq)]
pub struct VtkField {
    /// Spaces become underscores: the format ends names at them.
    pub name: String,
    pub values: Vec<f64>,
}

impl VtkField {
    /// A field of that name.
    pub fn new(name: &str, values: Vec<f64>) -> Self {
        Self {
            name: name.into(),
            values,
        }
    }
}

/// The mesh as a legacy VTK file (ASCII, polydata), lengths in metres, for `ParaView` and its
/// like. What is no number becomes `nan`.
///
/// # Panics
/// If a field has not one value a point or a triangle.
pub fn to_vtk(mesh: &TriMesh, name: &str, points: &[VtkField], triangles: &[VtkField]) -> String {
    let title: String = name
        .lines()
        .next()
        .unwrap_or("")
        .chars()
        .take(200)
        .collect();
    let mut text = format!("# vtk DataFile Version 3.0\ndrape: {title}\nASCII\nDATASET POLYDATA\n");
    let (n, m) = (mesh.vertices.len(), mesh.triangles.len());
    let mut line = |line: std::fmt::Arguments| {
        text.write_fmt(line)
            .expect("strings take all that is written");
        text.push('\n');
    };
    line(format_args!("POINTS {n} double"));
    for x in &mesh.vertices {
        line(format_args!(
            "{} {} {}",
            number(x.x),
            number(x.y),
            number(x.z)
        ));
    }
    line(format_args!("POLYGONS {m} {}", 4 * m));
    for [a, b, c] in &mesh.triangles {
        line(format_args!("3 {a} {b} {c}"));
    }
    for (what, count, fields) in [("POINT_DATA", n, points), ("CELL_DATA", m, triangles)] {
        if fields.is_empty() {
            continue;
        }
        line(format_args!("{what} {count}"));
        for field in fields {
            assert_eq!(field.values.len(), count, "one value each");
            let name = field.name.replace(char::is_whitespace, "_");
            line(format_args!(
                "SCALARS {name} double 1\nLOOKUP_TABLE default"
            ));
            for value in &field.values {
                line(format_args!("{}", number(*value)));
            }
        }
    }
    text
}

/// Rust writes `NaN` and `inf` with letters that older readers do not take.
fn number(x: f64) -> String {
    if x.is_finite() {
        format!("{x:e}")
    } else {
        "nan".into()
    }
}

/// Writes the mesh as [`to_vtk`] has it, by [`write_atomic`].
pub fn write_vtk(
    path: impl AsRef<Path>,
    mesh: &TriMesh,
    name: &str,
    points: &[VtkField],
    triangles: &[VtkField],
) -> Result<(), WriteError> {
    let text = to_vtk(mesh, name, points, triangles);
    write_atomic(path.as_ref(), |file| file.write_all(text.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn file_is_as_the_format_wants_it() {
        let mesh = TriMesh {
            vertices: vec![Vec3::zeros(), Vec3::x() * 0.25, Vec3::new(0.0, 1e-9, -2.0)],
            triangles: vec![[0, 1, 2]],
        };
        let points = [VtkField::new("distance to tool", vec![0.0, 1.5, f64::NAN])];
        let cells = [VtkField::new("shear", vec![-0.125])];
        let expected = "# vtk DataFile Version 3.0\ndrape: twin\nASCII\nDATASET POLYDATA\n\
            POINTS 3 double\n0e0 0e0 0e0\n2.5e-1 0e0 0e0\n0e0 1e-9 -2e0\n\
            POLYGONS 1 4\n3 0 1 2\n\
            POINT_DATA 3\nSCALARS distance_to_tool double 1\nLOOKUP_TABLE default\n\
            0e0\n1.5e0\nnan\n\
            CELL_DATA 1\nSCALARS shear double 1\nLOOKUP_TABLE default\n-1.25e-1\n";
        assert_eq!(
            to_vtk(&mesh, "twin\nsecond line", &points, &cells),
            expected
        );
    }
}
