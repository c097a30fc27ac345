use std::fmt::Write as _;

use super::{Fibre, Field};

/// The field as an unstructured grid of VTK, in XML as text: positions [m], and for each cell `warp`, `weft`, `shear_deg`
/// [degrees], `thickness_factor`, `surplus_m` [m] and `mapped`, which is 0 where there is no fabric and all others are zero.
pub fn vtu(field: &Field, remarks: &[String]) -> String {
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\">\n\
         <!-- drape fibre field; positions [m], shear_deg [degrees], surplus_m [m]; mapped is 0 where there is no fabric\n",
    );
    for remark in remarks {
        let _ = writeln!(text, "{remark}");
    }
    let (points, cells) = (&field.mesh.vertices, &field.mesh.triangles);
    let _ = writeln!(
        text,
        "-->\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n<Points>",
        points.len(),
        cells.len()
    );
    array(
        &mut text,
        "Points",
        "Float64",
        points.iter().map(|p| [p.x, p.y, p.z]),
    );
    text += "</Points>\n<Cells>\n";
    array(&mut text, "connectivity", "Int64", cells.iter().copied());
    array(
        &mut text,
        "offsets",
        "Int64",
        (1..=cells.len()).map(|k| [3 * k]),
    );
    array(
        &mut text,
        "types",
        "UInt8",
        cells.iter().map(|_| [TRIANGLE]),
    );
    text += "</Cells>\n<CellData>\n";
    let mut vectors = |name, of: fn(&Fibre) -> [f64; 3]| {
        let values = field.fibres.iter().map(|f| f.as_ref().map_or([0.0; 3], of));
        array(&mut text, name, "Float64", values);
    };
    vectors("warp", |fibre| fibre.warp.into());
    vectors("weft", |fibre| fibre.weft.into());
    let mut numbers = |name, of: fn(&Fibre) -> f64| {
        let values = field.fibres.iter().map(|f| [f.as_ref().map_or(0.0, of)]);
        array(&mut text, name, "Float64", values);
    };
    numbers("shear_deg", |fibre| fibre.shear_deg);
    numbers("thickness_factor", |fibre| fibre.thickness_factor);
    numbers("surplus_m", |fibre| fibre.surplus);
    let mapped = field.fibres.iter().map(|f| [u8::from(f.is_some())]);
    array(&mut text, "mapped", "UInt8", mapped);
    text += "</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
    text
}

/// What VTK calls a triangle.
const TRIANGLE: u8 = 5;

/// Numbers are written so that they read back to the same bits.
fn array<T: std::fmt::Debug, const N: usize>(
    text: &mut String,
    name: &str,
    kind: &str,
    rows: impl Iterator<Item = [T; N]>,
) {
    let _ = writeln!(
        text,
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{N}\" format=\"ascii\">"
    );
    for row in rows {
        let row = row.map(|x| format!("{x:?}"));
        let _ = writeln!(text, "{}", row.join(" "));
    }
    text.push_str("</DataArray>\n");
}
