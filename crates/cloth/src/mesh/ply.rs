//! PLY files (Turk 1994): ASCII, and binary in both byte orders.

use super::check_facet_count;
use super::polygon::cut;
use super::stl::Facet;
use crate::math::Vec3;

/// Types of numbers and how many bytes they take, by both of their names.
const KINDS: [(&str, &str, usize); 8] = [
    ("char", "int8", 1),
    ("uchar", "uint8", 1),
    ("short", "int16", 2),
    ("ushort", "uint16", 2),
    ("int", "int32", 4),
    ("uint", "uint32", 4),
    ("float", "float32", 4),
    ("double", "float64", 8),
];

/// Index of a type in [`KINDS`].
type Kind = usize;

struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

struct Property {
    name: String,
    kind: Kind,
    /// Type of the length, of a list.
    length: Option<Kind>,
}

/// What stands behind the header.
enum Body<'a> {
    Ascii(std::str::SplitWhitespace<'a>),
    Binary { rest: &'a [u8], is_big: bool },
}

/// Whether a file begins as PLY files do.
pub(super) fn is_ply(bytes: &[u8]) -> bool {
    let word = bytes.trim_ascii_start().first_chunk();
    word.is_some_and(|[p @ .., end]: &[u8; 4]| {
        p.eq_ignore_ascii_case(b"ply") && end.is_ascii_whitespace()
    })
}

/// Corners of the facets of a PLY file, as it has them. Polygons and triangle strips are cut into
/// triangles; what is no vertex, face or strip is skipped. Memory grows with the file, not with the
/// counts it declares.
pub(super) fn facets(bytes: &[u8]) -> Result<Vec<Facet>, String> {
    let text;
    let (format, elements, rest) = header(bytes.trim_ascii_start())?;
    let mut body = match &*format {
        "ascii" => {
            text = String::from_utf8_lossy(rest);
            Body::Ascii(text.split_whitespace())
        }
        "binary_little_endian" | "binary_big_endian" => Body::Binary {
            rest,
            is_big: format == "binary_big_endian",
        },
        other => return Err(format!("unknown format {other:?}")),
    };
    let all = elements.iter().filter(|element| element.name == "vertex");
    let vertex_count = all.fold(0, |sum: usize, all| sum.saturating_add(all.count));
    let mut vertices = Vec::new();
    // Faces may stand before their vertices: the corners of all, the number of each and where it ends.
    let (mut corners, mut faces) = (Vec::<usize>::new(), Vec::new());
    for element in &elements {
        let is_face = element.name == "face";
        let is_strip = element.name.starts_with("tristrip");
        for i in 1..=element.count {
            let at = |fault: String| format!("{} {i} of {}: {fault}", element.name, element.count);
            let mut place = Vec3::zeros();
            for property in &element.properties {
                let axis = ["x", "y", "z"].iter().position(|a| *a == property.name);
                let Some(kind) = property.length else {
                    let number = body.number(property.kind).map_err(at)?;
                    if let Some(axis) = axis {
                        place[axis] = number;
                    }
                    continue;
                };
                let length = body.number(kind).map_err(at)?;
                let Some(length) = whole(length) else {
                    return Err(at(format!(
                        "a list of {length}, expected a whole number >= 0"
                    )));
                };
                let is_indices = (is_face || is_strip) && property.name.starts_with("vertex_ind");
                // Of the strip that has begun last.
                let (mut strip, mut is_odd) = (Vec::new(), false);
                for _ in 0..length {
                    let number = body.number(property.kind).map_err(at)?;
                    if !is_indices {
                        continue;
                    }
                    let Some(vertex) = whole(number).filter(|v| *v < vertex_count) else {
                        if is_strip && is_restart(number, property.kind) {
                            (strip, is_odd) = (Vec::new(), false);
                            continue;
                        }
                        let expected = format!("expected one of its {vertex_count} vertices");
                        return Err(at(format!("vertex {number}, {expected}")));
                    };
                    if is_face {
                        corners.push(vertex);
                        continue;
                    }
                    strip.push(vertex);
                    if let [a, b, c] = strip[..] {
                        // A vertex that is there twice leads from one part of a strip to the next.
                        if a != b && b != c && c != a {
                            corners.extend(if is_odd { [b, a, c] } else { [a, b, c] });
                            faces.push((i, corners.len()));
                        }
                        strip.remove(0);
                        is_odd = !is_odd;
                    }
                }
                if is_indices && is_face {
                    faces.push((i, corners.len()));
                }
            }
            if element.name == "vertex" {
                vertices.push(place);
            }
        }
    }
    if !body.is_at_its_end() {
        return Err("more than the header declares".into());
    }
    let (mut facets, mut start) = (Vec::new(), 0);
    for (number, end) in faces {
        let of_face: Vec<Vec3> = corners[start..end].iter().map(|&v| vertices[v]).collect();
        let count = end - start;
        start = end;
        facets.extend(cut(&of_face).ok_or_else(|| {
            format!(
                "face {number}: its border of {count} corners crosses or touches itself, expected a \
                 polygon that can be cut into triangles"
            )
        })?);
        check_facet_count(facets.len())?;
    }
    Ok(facets)
}

/// A number that is whole and not negative.
fn whole(number: f64) -> Option<usize> {
    (number >= 0.0 && number.fract() == 0.0).then_some(number as usize)
}

/// Whether an index ends a triangle strip: -1, also where its type has no sign.
fn is_restart(number: f64, kind: Kind) -> bool {
    number == -1.0 || number == 2f64.powi(8 * KINDS[kind].2 as i32) - 1.0
}

/// Format, elements and what follows. Its words may be in capitals and its lines may end with line
/// feeds, carriage returns or both, as the first line does.
fn header(bytes: &[u8]) -> Result<(String, Vec<Element>, &[u8]), String> {
    let (mut rest, mut format, mut elements) = (bytes, String::new(), Vec::<Element>::new());
    let first = bytes.iter().position(|b| matches!(b, b'\n' | b'\r'));
    let is_alone = first.is_some_and(|at| bytes[at] == b'\r' && bytes.get(at + 1) != Some(&b'\n'));
    let end_of_line = if is_alone { b'\r' } else { b'\n' };
    for number in 1.. {
        let end = rest.iter().position(|b| *b == end_of_line);
        let Some(end) = end else {
            return Err("truncated in the header, end_header is missing".into());
        };
        // Comments may be in any encoding.
        let line = String::from_utf8_lossy(&rest[..end]).to_ascii_lowercase();
        rest = &rest[end + 1..];
        let fault = |what: &str| Err(format!("line {number} of the header: {what}"));
        let words: Vec<&str> = line.split_whitespace().collect();
        let kind = |word: &str| KINDS.iter().position(|k| k.0 == word || k.1 == word);
        match words[..] {
            ["format", name, _] => format = name.into(),
            ["element", name, count] => match count.parse() {
                Ok(count) => elements.push(Element {
                    name: name.into(),
                    count,
                    properties: Vec::new(),
                }),
                Err(_) => return fault(&format!("expected a count, found {count:?}")),
            },
            ["property", "list", length, of, name] | ["property", length @ of, name] => {
                let (Some(length), Some(of)) = (kind(length), kind(of)) else {
                    return fault(&format!("unknown type in {line:?}"));
                };
                let Some(element) = elements.last_mut() else {
                    return fault("a property before the first element");
                };
                element.properties.push(Property {
                    name: name.into(),
                    kind: of,
                    length: (words.len() == 5).then_some(length),
                });
            }
            ["end_header"] => break,
            ["ply"] | ["comment" | "obj_info", ..] | [] => {}
            _ => return fault(&format!("unexpected {line:?}")),
        }
    }
    // Nothing would be read for each of them.
    elements.retain(|element| !element.properties.is_empty());
    Ok((format, elements, rest))
}

impl Body<'_> {
    /// Whether nothing but white space follows.
    fn is_at_its_end(&self) -> bool {
        match self {
            Self::Ascii(words) => words.clone().next().is_none(),
            Self::Binary { rest, .. } => rest.trim_ascii().is_empty(),
        }
    }

    /// The next number.
    fn number(&mut self, kind: Kind) -> Result<f64, String> {
        match self {
            Self::Ascii(words) => {
                let word = words.next().ok_or("truncated")?;
                let number = word.parse();
                number.map_err(|_| format!("expected a number, found {word:?}"))
            }
            Self::Binary { rest, is_big } => {
                let size = KINDS[kind].2;
                let (number, after) = rest.split_at_checked(size).ok_or("truncated")?;
                *rest = after;
                let mut bytes = [0; 8];
                bytes[..size].copy_from_slice(number);
                if *is_big {
                    bytes[..size].reverse();
                }
                let bits = u64::from_le_bytes(bytes);
                Ok(match KINDS[kind].0 {
                    "char" => f64::from(bits as i8),
                    "short" => f64::from(bits as i16),
                    "int" => f64::from(bits as i32),
                    "float" => f64::from(f32::from_bits(bits as u32)),
                    "double" => f64::from_bits(bits),
                    _ => bits as f64,
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "ply\nformat FORMAT 1.0\ncomment by hand\nelement vertex 4\n\
         property float x\nproperty double y\nproperty short z\nproperty uchar red\n\
         element edge 1\nproperty int vertex1\n\
         element face 2\nproperty list uchar int vertex_indices\nend_header\n";

    /// A square of a triangle and a quad, in a format.
    fn file(format: &str) -> Vec<u8> {
        let mut bytes = HEADER.replace("FORMAT", format).into_bytes();
        let is_big = format == "binary_big_endian";
        for [x, y, z] in [[0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, -3]] {
            if format == "ascii" {
                bytes.extend(format!("{x} {y}.0 {z} 255\n").as_bytes());
                continue;
            }
            let numbers: [Vec<u8>; 3] = match is_big {
                true => [
                    (x as f32).to_be_bytes().to_vec(),
                    f64::from(y).to_be_bytes().to_vec(),
                    (z as i16).to_be_bytes().to_vec(),
                ],
                false => [
                    (x as f32).to_le_bytes().to_vec(),
                    f64::from(y).to_le_bytes().to_vec(),
                    (z as i16).to_le_bytes().to_vec(),
                ],
            };
            bytes.extend(numbers.concat());
            bytes.push(255);
        }
        let faces: [&[i32]; 3] = [&[7], &[0, 1, 2], &[0, 1, 2, 3]];
        for (i, face) in faces.iter().enumerate() {
            match (format, i) {
                ("ascii", 0) => bytes.extend(b"7\n"),
                ("ascii", _) => bytes.extend(
                    format!("{} {face:?}\n", face.len())
                        .replace(['[', ',', ']'], " ")
                        .as_bytes(),
                ),
                (_, i) => {
                    bytes.extend((i > 0).then_some(face.len() as u8));
                    let index = |i: &i32| {
                        if is_big {
                            i.to_be_bytes()
                        } else {
                            i.to_le_bytes()
                        }
                    };
                    bytes.extend(face.iter().flat_map(index));
                }
            }
        }
        bytes
    }

    const FORMATS: [&str; 3] = ["ascii", "binary_little_endian", "binary_big_endian"];

    #[test]
    fn every_format_gives_the_same_facets() {
        let at = |x, y, z| Vec3::new(x, y, z);
        let [a, b, c] = [at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0), at(1.0, 2.0, 0.0)];
        let d = at(0.0, 2.0, -3.0);
        for format in FORMATS {
            let file = file(format);
            assert!(is_ply(&file));
            assert_eq!(
                facets(&file).unwrap(),
                [[a, b, c], [a, b, c], [a, c, d]],
                "{format}"
            );
        }
    }

    #[test]
    fn truncations_and_damaged_bytes_are_survived() {
        for format in FORMATS {
            let file = file(format);
            for end in 0..file.trim_ascii_end().len() - 1 {
                assert!(facets(&file[..end]).is_err(), "{format} {end}");
            }
            for i in 0..file.len() {
                for value in [0, b' ', b'9', 0x7f, 0xff] {
                    let mut damaged = file.clone();
                    damaged[i] = value;
                    let _ = facets(&damaged);
                }
            }
        }
    }

    #[test]
    fn faults_are_located() {
        let ascii = String::from_utf8(file("ascii")).unwrap();
        let fault = |from: &str, to: &str| {
            let text = ascii.replacen(from, to, 1);
            assert_ne!(text, ascii);
            facets(text.as_bytes()).unwrap_err()
        };
        assert_eq!(
            fault("2.0", "2,0"),
            "vertex 3 of 4: expected a number, found \"2,0\""
        );
        assert_eq!(
            fault("3  0  1  2", "3 0 1 4"),
            "face 1 of 2: vertex 4, expected one of the 4 before it"
        );
        assert_eq!(
            fault("3  0  1  2", "3 0 1 -1"),
            "face 1 of 2: vertex -1, expected one of the 4 before it"
        );
        assert_eq!(
            fault("3  0  1  2", "3 0 1 2.5"),
            "face 1 of 2: vertex 2.5, expected one of the 4 before it"
        );
        assert_eq!(
            fault("vertex 4", "vertex x"),
            "line 4 of the header: expected a count, found \"x\""
        );
        assert_eq!(
            fault("short z", "long z"),
            "line 7 of the header: unknown type in \"property long z\""
        );
        // Nothing is allocated for what is declared.
        let found = fault("vertex 4", "vertex 4000000000");
        assert!(found.ends_with("of 4000000000: truncated"), "{found}");
        assert_eq!(fault("ascii", "ebcdic"), "unknown format \"ebcdic\"");
    }

    #[test]
    fn what_follows_the_last_element_is_refused() {
        for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
            let followed = |by: &str| facets(&[&file(format)[..], by.as_bytes()].concat());
            assert!(followed("\n").is_ok());
            let fault = "more than the header declares";
            assert_eq!(followed("\n9").unwrap_err(), fault);
        }
    }
}
