//! Points as text: XYZ, ASC, PTS, CSV and what else has x, y and z on each line.

use drape_cloth::file::plain;
use drape_cloth::math::Vec3;

/// How lines begin that say nothing.
const COMMENTS: [&str; 4] = ["#", "//", ";", "%"];

/// The points of a text whose unit is `scale` metres, also those that are no numbers.
///
/// Columns are separated by blanks, tabs, commas or semicolons. What stands above the first point is
/// a header.
pub(super) fn points(bytes: &[u8], scale: f64) -> Result<Vec<Vec3>, String> {
    let bytes = plain(bytes)?;
    let text = String::from_utf8_lossy(&bytes);
    let mut points = Vec::new();
    for (line, said) in (1..).zip(text.lines()) {
        let said = said.trim();
        if said.is_empty() || COMMENTS.iter().any(|mark| said.starts_with(mark)) {
            continue;
        }
        let found = || said.chars().take(40).collect::<String>();
        if has_decimal_commas(said) {
            return Err(format!(
                "line {line}: expected numbers with decimal points, found {:?}",
                found()
            ));
        }
        let columns = said.split([' ', '\t', ',', ';']);
        let mut columns = columns.filter(|column| !column.is_empty());
        let mut number = || columns.next()?.trim_matches('"').parse::<f64>().ok();
        match (number(), number(), number()) {
            (Some(x), Some(y), Some(z)) => points.push(Vec3::new(x, y, z) * scale),
            _ if points.is_empty() => {}
            _ => {
                return Err(format!(
                    "line {line}: expected three numbers, found {:?}",
                    found()
                ));
            }
        }
    }
    if points.is_empty() {
        return Err("no line begins with three numbers, expected x, y and z of a point".into());
    }
    Ok(points)
}

/// Whether the first of several columns that no comma separates has a comma between its digits.
fn has_decimal_commas(line: &str) -> bool {
    let mut columns = line.split([' ', '\t', ';']).filter(|c| !c.is_empty());
    let is_whole = |part: &str| part.bytes().all(|b| b.is_ascii_digit()) && !part.is_empty();
    let has_comma = |column: &str| {
        let number = column.trim_start_matches(['-', '+']);
        let mut parts = number.split(',');
        matches!((parts.next(), parts.next(), parts.next()),
            (Some(a), Some(b), None) if is_whole(a) && is_whole(b))
    };
    let [first, second] = [columns.next(), columns.next()];
    first.is_some_and(has_comma) && second.is_some_and(has_comma)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_headers_and_comments_are_understood() {
        let expected = [Vec3::new(1.0, -2.5, 3.0), Vec3::new(0.0, 1e-3, 4.0)];
        for text in [
            "1 -2.5 3\n0 1e-3 4\n",
            "# made by hand\n1 -2.5 3 255 0 0\n\n// more\n0\t1e-3\t4\n",
            "X,Y,Z\r\n1,-2.5,3\r\n0,0.001,4",
            "\u{feff}2\n1.0; -2.5; 3.0\n0.0; 0.001; 4.0\n",
            "\"x\" \"y\"\n1, -2.5, 3, 9\r0, 0.001, 4, 9",
        ] {
            assert_eq!(points(text.as_bytes(), 1.0).unwrap(), expected, "{text}");
        }
        let millimetres = points(b"1 -2.5 3\nnan 1 inf\n", 1e-3).unwrap();
        assert_eq!(millimetres[0], Vec3::new(1e-3, -2.5e-3, 3e-3));
        assert_eq!(millimetres.len(), 2);
        assert!(millimetres[1].x.is_nan());
    }

    #[test]
    fn faults_name_their_line() {
        for (text, fault) in [
            (
                "1,5 2,5 3,5\n",
                "line 1: expected numbers with decimal points, found \"1,5 2,5 3,5\"",
            ),
            (
                "x;y;z\n-1,5;2,25;3,0\n",
                "line 2: expected numbers with decimal points, found \"-1,5;2,25;3,0\"",
            ),
            (
                "1 2 3\n4 5\n",
                "line 2: expected three numbers, found \"4 5\"",
            ),
            (
                "1 2 3\n4 5 six\n",
                "line 2: expected three numbers, found \"4 5 six\"",
            ),
            (
                "hello\nworld\n",
                "no line begins with three numbers, expected x, y and z of a point",
            ),
        ] {
            assert_eq!(points(text.as_bytes(), 1.0).unwrap_err(), fault);
        }
    }
}
