use std::io::{self, Write};
use std::path::Path;

use super::{DrapingPoint, Frame};
use drape_cloth::file::{WriteError, write_atomic};

/// What a reader has to know; each line of it is a comment of the file.
const HEADER: &str = "\
# drape draping path, one point a line in the order of draping
# x, y, z: position [mm]
# i, j, k: outward unit normal of the tool
# tx, ty, tz: unit direction of travel along the surface; empty where there is none
# robot frame at a point: z = -(i, j, k), into the surface; x = (tx, ty, tz); y = z cross x,
#   along the axis of the roller; origin on the roller's line of contact
# kind: stroke (travel in contact) or press (no travel); starts_stroke: 1 after a jump
";
const COLUMNS: &str = "\
index,vertex,x,y,z,i,j,k,tx,ty,tz,kind,stroke,starts_stroke
";

/// Writes a path of the scene in `frame` as comma-separated values in millimetres, to the nearest
/// nanometre; comment lines at the top begin with `#` and state units, frame and the tool's pose.
pub fn write_csv(path: &Path, points: &[DrapingPoint], frame: &Frame) -> Result<(), WriteError> {
    write_atomic(path, |file| write(file, points, frame))
}

fn write(out: &mut impl Write, points: &[DrapingPoint], frame: &Frame) -> io::Result<()> {
    out.write_all(HEADER.as_bytes())?;
    for remark in frame.remarks() {
        writeln!(out, "# {remark}")?;
    }
    out.write_all(COLUMNS.as_bytes())?;
    for point in frame.path(points) {
        write!(out, "{},{}", point.index, point.vertex)?;
        let millimetres = point.position * 1e3;
        for coordinate in millimetres.iter().chain(&point.normal) {
            write!(out, ",{}", decimal(*coordinate))?;
        }
        match point.travel {
            Some(travel) => {
                for coordinate in &travel {
                    write!(out, ",{}", decimal(*coordinate))?;
                }
            }
            None => write!(out, ",,,")?,
        }
        let starts = u8::from(point.starts_stroke);
        let kind = format!("{:?}", point.kind).to_lowercase();
        writeln!(out, ",{kind},{},{starts}", point.stroke)?;
    }
    Ok(())
}

/// Six decimals, without a sign on zero.
fn decimal(value: f64) -> String {
    let text = format!("{value:.6}");
    match text.strip_prefix('-') {
        Some(zero) if zero.bytes().all(|c| matches!(c, b'0' | b'.')) => zero.into(),
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::{PressedPoint, Rolling, strokes};
    use drape_cloth::math::Vec3;
    use drape_cloth::tool::Pose;

    fn text(points: &[DrapingPoint]) -> String {
        let mut bytes = Vec::new();
        write(&mut bytes, points, &Frame::tool(&Pose::default())).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    fn pressed(vertex: u32, position: [f64; 3], normal: [f64; 3]) -> PressedPoint {
        PressedPoint {
            vertex,
            position: position.into(),
            normal: normal.into(),
        }
    }

    #[test]
    fn file_has_comments_names_and_rows_in_millimetres() {
        let points = [
            pressed(5, [0.0, 0.0, 0.02], [0.0, 0.0, 1.0]),
            pressed(6, [0.004, 0.003, 0.02], [0.0, 0.0, 1.0]),
            pressed(90, [-0.1234567894, -1e-12, 0.5], [0.0, -1.0, 0.0]),
        ];
        let text = text(&strokes(&points, Rolling::joining(0.01)).unwrap());
        let (comments, rows): (Vec<_>, Vec<_>) =
            text.lines().partition(|line| line.starts_with('#'));
        assert!(comments[1].contains("[mm]"));
        assert_eq!(
            rows,
            [
                "index,vertex,x,y,z,i,j,k,tx,ty,tz,kind,stroke,starts_stroke",
                "0,5,0.000000,0.000000,20.000000,0.000000,0.000000,1.000000,\
                 0.800000,0.600000,0.000000,stroke,0,1",
                "1,6,4.000000,3.000000,20.000000,0.000000,0.000000,1.000000,\
                 0.800000,0.600000,0.000000,stroke,0,0",
                "2,90,-123.456789,0.000000,500.000000,0.000000,-1.000000,0.000000,\
                 ,,,press,1,1",
            ]
        );
    }

    #[test]
    fn columns_read_back_to_the_last_decimal() {
        let points: Vec<_> = (0..40)
            .map(|i| {
                let (sin, cos) = (0.1 * f64::from(i)).sin_cos();
                pressed(i as u32, [0.3 * cos, 0.3 * sin, 0.01], [cos, sin, 0.5])
            })
            .collect();
        let points = strokes(&points, Rolling::joining(0.1)).unwrap();
        let text = text(&points);
        let rows = text.lines().filter(|line| !line.starts_with('#')).skip(1);
        let mut count = 0;
        for (row, point) in rows.zip(&points) {
            let cells: Vec<_> = row.split(',').collect();
            assert_eq!(cells.len(), 14);
            let vector = |i: usize| {
                let cell = |i: usize| cells[i].parse::<f64>().unwrap();
                Vec3::new(cell(i), cell(i + 1), cell(i + 2))
            };
            assert!((vector(2) * 1e-3 - point.position).amax() <= 0.5001e-9);
            assert!((vector(5) - point.normal).amax() <= 0.5001e-6);
            assert!((vector(8) - point.travel.unwrap()).amax() <= 0.5001e-6);
            count += 1;
        }
        assert_eq!(count, 40);
    }

    #[test]
    fn empty_path_is_a_file_with_names_only() {
        let text = text(&[]);
        let rows: Vec<_> = text.lines().filter(|line| !line.starts_with('#')).collect();
        assert_eq!(rows, [COLUMNS.trim_end()]);
    }
}
