use std::fmt::Write as _;

use super::{Fibre, Field};
use drape_cloth::math::Vec3;

/// The field for OpenRadioss and Radioss, in mm: mesh, and for each yarn family a `/DRAPE` with thinning and angle of every
/// element that has fabric.
///
/// A ply of Radioss has one angle between its material directions for all elements, so sheared fabric is two plies of half
/// its thickness: one with `/DRAPE/1`, along the warp, one with `/DRAPE/2`, along the weft. The angle counts from the
/// element's first side (`def_orth` = 1 of the ply, whose own angle is 0); thinning is what the thickness of the ply is
/// multiplied by.
pub fn radioss(field: &Field, remarks: &[String]) -> String {
    let mut text = String::from(
        "#RADIOSS STARTER\n# drape fibre field; mm, degrees\n\
         # /DRAPE/1 is along the warp, /DRAPE/2 along the weft: two plies of half the thickness, def_orth = 1\n",
    );
    for remark in remarks {
        let _ = writeln!(text, "# {remark}");
    }
    text += "/NODE\n";
    for (v, position) in field.mesh.vertices.iter().enumerate() {
        let [x, y, z] = (position * 1e3).into();
        let _ = writeln!(text, "{:10}{x:20.9}{y:20.9}{z:20.9}", v + 1);
    }
    text += "/SH3N/1\n";
    for (t, triangle) in field.mesh.triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|v| v + 1);
        let _ = writeln!(text, "{:10}{a:10}{b:10}{c:10}", t + 1);
    }
    type Along = fn(&Fibre) -> Vec3;
    let families: [(&str, Along); 2] = [
        ("/DRAPE/1\nwarp\n", |fibre| fibre.warp),
        ("/DRAPE/2\nweft\n", |fibre| fibre.weft),
    ];
    for (head, along) in families {
        text += head;
        for (element, fibre) in field.elements() {
            let angle = field.angle_deg(element, &along(fibre));
            let (number, factor) = (element + 1, fibre.thickness_factor);
            let _ = writeln!(text, "SH3N      {number:10}{factor:20.9}{angle:20.9}");
        }
    }
    text += "/END\n";
    text
}
