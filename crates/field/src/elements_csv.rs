use std::fmt::Write as _;

use super::Field;

/// What a reader has to know; each line of it is a comment of the file.
const HEADER: &str = "\
# drape fibre field, one element a line; elements without fabric are left out
# element: number from 1; x_mm, y_mm, z_mm: its middle [mm]
# warp_*, weft_*: unit vectors along the yarns, in the element's plane
# shear_deg: by how much the angle between the yarns has closed [degrees]
# thickness_factor: over the flat fabric; surplus_m: yarn too long over a cell of the fabric [m]
";
const COLUMNS: &str = "element,x_mm,y_mm,z_mm,warp_x,warp_y,warp_z,weft_x,weft_y,weft_z,\
                       shear_deg,thickness_factor,surplus_m\n";

/// The field as comma-separated values, to nine decimals; `remarks` and what the columns are stand above as comments.
pub fn elements_csv(field: &Field, remarks: &[String]) -> String {
    let mut text = String::from(HEADER);
    for remark in remarks {
        let _ = writeln!(text, "# {remark}");
    }
    text += COLUMNS;
    for (element, fibre) in field.elements() {
        let middle = field.middle(element) * 1e3;
        let _ = write!(text, "{}", element + 1);
        let vectors = middle.iter().chain(&fibre.warp).chain(&fibre.weft);
        let numbers = [fibre.shear_deg, fibre.thickness_factor, fibre.surplus];
        for number in vectors.chain(&numbers) {
            let _ = write!(text, ",{number:.9}");
        }
        text.push('\n');
    }
    text
}
