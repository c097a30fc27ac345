use std::io::{self, Write};
use std::path::Path;

use super::TriMesh;
use crate::file::{WriteError, write_atomic};

/// Numbers on a mesh: a name without spaces, at which the format ends names, and a value each.
type Fields<'a> = [(&'a str, Vec<f64>)];

/// Writes the mesh as a legacy VTK file (ASCII, polydata), lengths in metres, for `ParaView` and
/// its like, by [`write_atomic`]. `points` and `triangles` are fields with a value for each of
/// them. What is no number becomes `nan`.
///
/// # Panics
/// If a field has not one value a point or a triangle.
pub fn write_vtk(
    path: impl AsRef<Path>,
    mesh: &TriMesh,
    title: &str,
    points: &Fields,
    triangles: &Fields,
) -> Result<(), WriteError> {
    write_atomic(path.as_ref(), |file| {
        write(file, mesh, title, points, triangles)
    })
}

fn write(
    out: &mut impl Write,
    mesh: &TriMesh,
    title: &str,
    points: &Fields,
    triangles: &Fields,
) -> io::Result<()> {
    let (n, m) = (mesh.vertices.len(), mesh.triangles.len());
    writeln!(out, "# vtk DataFile Version 3.0\ndrape: {title}\nASCII")?;
    writeln!(out, "DATASET POLYDATA\nPOINTS {n} double")?;
    for x in &mesh.vertices {
        let [x, y, z] = [x.x, x.y, x.z].map(number);
        writeln!(out, "{x} {y} {z}")?;
    }
    writeln!(out, "POLYGONS {m} {}", 4 * m)?;
    for [a, b, c] in &mesh.triangles {
        writeln!(out, "3 {a} {b} {c}")?;
    }
    for (what, count, fields) in [("POINT_DATA", n, points), ("CELL_DATA", m, triangles)] {
        writeln!(out, "{what} {count}")?;
        for (name, values) in fields {
            assert_eq!(values.len(), count, "one value each");
            writeln!(out, "SCALARS {name} double 1\nLOOKUP_TABLE default")?;
            for &value in values {
                writeln!(out, "{}", number(value))?;
            }
        }
    }
    Ok(())
}

/// Rust writes `NaN` and `inf` with letters that older readers do not take.
fn number(x: f64) -> String {
    match x.is_finite() {
        true => format!("{x:e}"),
        false => "nan".into(),
    }
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
        let points = [("distance", vec![0.0, 1.5, f64::NAN])];
        let cells = [("shear", vec![-0.125])];
        let expected = "# vtk DataFile Version 3.0\ndrape: twin\nASCII\nDATASET POLYDATA\n\
            POINTS 3 double\n0e0 0e0 0e0\n2.5e-1 0e0 0e0\n0e0 1e-9 -2e0\n\
            POLYGONS 1 4\n3 0 1 2\n\
            POINT_DATA 3\nSCALARS distance double 1\nLOOKUP_TABLE default\n\
            0e0\n1.5e0\nnan\n\
            CELL_DATA 1\nSCALARS shear double 1\nLOOKUP_TABLE default\n-1.25e-1\n";
        let mut found = Vec::new();
        write(&mut found, &mesh, "twin", &points, &cells).unwrap();
        assert_eq!(String::from_utf8(found).unwrap(), expected);
    }
}
