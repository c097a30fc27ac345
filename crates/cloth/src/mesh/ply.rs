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

/// Names of a vertex's coordinates.
const AXES: [&str; 3] = ["x", "y", "z"];

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

/// Vertices of a PLY file and corners of its facets, as it has them. Polygons and triangle strips are cut into
/// triangles; what is no vertex, face or strip is skipped. Memory grows with the file, not with the
/// counts it declares.
pub(super) fn parse(bytes: &[u8]) -> Result<(Vec<Vec3>, Vec<Facet>), String> {
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
    for axis in AXES {
        let has = |of: &Property| of.name == axis && of.length.is_none();
        let mut all = elements.iter().filter(|element| element.name == "vertex");
        if !all.all(|element| element.properties.iter().any(has)) {
            return Err(format!("its vertices have no {axis}, expected x, y and z"));
        }
    }
    let (mut vertices, mut list) = (Vec::new(), Vec::new());
    // Faces may stand before their vertices: the corners of all, the number of each and where it ends.
    let (mut corners, mut faces) = (Vec::<usize>::new(), Vec::new());
    for element in &elements {
        let is_strip = element.name.starts_with("tristrip");
        for i in 1..=element.count {
            let at = |fault: String| format!("{} {i} of {}: {fault}", element.name, element.count);
            let vertex = |number: &f64| {
                let index = whole(*number).filter(|index| *index < vertex_count);
                let expected = || format!("expected one of its {vertex_count} vertices");
                index.ok_or_else(|| at(format!("vertex {number}, {}", expected())))
            };
            let mut place = Vec3::zeros();
            for property in &element.properties {
                let Some(length) = property.length else {
                    let number = body.number(property.kind).map_err(at)?;
                    if let Some(axis) = AXES.iter().position(|axis| *axis == property.name) {
                        place[axis] = number;
                    }
                    continue;
                };
                body.list(length, property.kind, &mut list).map_err(at)?;
                if !property.name.starts_with("vertex_ind") {
                } else if element.name == "face" {
                    for number in &list {
                        corners.push(vertex(number)?);
                    }
                    faces.push((i, corners.len()));
                } else if is_strip {
                    // A -1 ends a strip, also where its type has no sign.
                    let last = 2f64.powi(8 * KINDS[property.kind].2 as i32) - 1.0;
                    let is_end = |n: &f64| *n == -1.0 || (*n == last && vertex(n).is_err());
                    for strip in list.split(is_end) {
                        let strip: Vec<usize> =
                            strip.iter().map(vertex).collect::<Result<_, _>>()?;
                        for (k, three) in strip.windows(3).enumerate() {
                            let [a, b, c] = [three[k % 2], three[1 - k % 2], three[2]];
                            // One with a vertex twice leads from a part of the strip to the next.
                            if a != b && b != c && c != a {
                                corners.extend([a, b, c]);
                                faces.push((i, corners.len()));
                            }
                        }
                    }
                }
            }
            if element.name == "vertex" {
                vertices.push(place);
            }
            check_facet_count(faces.len())?;
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
    Ok((vertices, facets))
}

/// A number that is whole and not negative.
fn whole(number: f64) -> Option<usize> {
    (number >= 0.0 && number.fract() == 0.0).then_some(number as usize)
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
            ["format", name, ..] => format = name.into(),
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

    /// Puts the numbers of a list that follows into `list`.
    fn list(&mut self, length: Kind, of: Kind, list: &mut Vec<f64>) -> Result<(), String> {
        list.clear();
        let length = self.number(length)?;
        let fault = || format!("a list of {length}, expected a whole number >= 0");
        for _ in 0..whole(length).ok_or_else(fault)? {
            list.push(self.number(of)?);
        }
        Ok(())
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

    fn facets(bytes: &[u8]) -> Result<Vec<Facet>, String> {
        Ok(parse(bytes)?.1)
    }

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

    /// Facets by the numbers of their vertices, which lie at x = number.
    fn numbered(header: &str, rest: &[u8]) -> Result<Vec<[f64; 3]>, String> {
        let bytes = [header.as_bytes(), b"\nend_header\n", rest].concat();
        let facets = facets(&bytes)?;
        Ok(facets.iter().map(|facet| facet.map(|x| x.x)).collect())
    }

    /// Strips turn every other triangle over, end at -1 in any type, and pass over a vertex that is
    /// there twice; faces may stand before vertices that have lists of their own.
    #[test]
    fn strips_and_faces_before_vertices_are_understood() {
        let vertices = "element vertex 5\nproperty list uchar int near\nproperty char x\n\
             property char y\nproperty char z\nproperty list uchar int seen\n";
        let places = [0, 1, 2, 3, 4].map(|x| [1, 0, 0, 0, 7, x, x * x, 0, 0]);
        let expected = [
            [0., 1., 2.],
            [2., 1., 3.],
            [4., 3., 1.],
            [0., 1., 4.],
            [2., 4., 3.],
        ];
        let indices = [0, 1, 2, 3, -1, 4, 3, 1, 1, -1, 0, 1, 4, 4, 2, 3];
        let kinds = [
            ("int", 4, true),
            ("int", 4, false),
            ("ushort", 2, true),
            ("uchar", 1, false),
        ];
        for (kind, size, is_big) in kinds {
            let order = if is_big { "big" } else { "little" };
            let header = format!(
                "ply\nformat binary_{order}_endian 1.0\nelement tristrips 1\n\
                 property list uchar {kind} vertex_indices\n{vertices}"
            );
            let mut rest = vec![indices.len() as u8];
            for index in indices {
                let mut number = i32::to_be_bytes(index)[4 - size..].to_vec();
                if !is_big {
                    number.reverse();
                }
                rest.extend(number);
            }
            rest.extend(places.iter().flat_map(|place| {
                let [count, list @ .., x, y, z, none] = *place;
                let mut list = list.map(|byte| byte as u8);
                if !is_big {
                    list.reverse();
                }
                [
                    &[count as u8][..],
                    &list,
                    &[x as u8, y as u8, z as u8, none as u8],
                ]
                .concat()
            }));
            let found = numbered(header.trim_end(), &rest);
            assert_eq!(found.unwrap(), expected, "{kind} {is_big}");
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
            "face 1 of 2: vertex 4, expected one of its 4 vertices"
        );
        assert_eq!(
            fault("3  0  1  2", "3 0 1 -1"),
            "face 1 of 2: vertex -1, expected one of its 4 vertices"
        );
        assert_eq!(
            fault("3  0  1  2", "3 0 1 2.5"),
            "face 1 of 2: vertex 2.5, expected one of its 4 vertices"
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
        assert_eq!(
            fault("short z", "short w"),
            "its vertices have no z, expected x, y and z"
        );
        assert_eq!(
            fault("3  0  1  2", "-3 0 1 2"),
            "face 1 of 2: a list of -3, expected a whole number >= 0"
        );
        assert_eq!(
            fault("3  0  1  2", "6 0 1 2 0 1 2"),
            "face 1: its border of 6 corners crosses or touches itself, expected a polygon that can be \
             cut into triangles"
        );
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
