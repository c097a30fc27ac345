use std::path::Path;

use super::ply;
use super::stl::{self, MeshFile};
use crate::file::{ReadError, read_bytes, unmarked};
use crate::math::Vec3;

/// How files begin that are no meshes we read, and what they are.
const OTHERS: [(&[u8], &str); 11] = [
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"PK\x03\x04", "a zip archive, such as 3MF"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"ISO-10303-21", "a STEP file"),
    (b"glTF", "a glTF file"),
    (b"%PDF", "a PDF file"),
    (b"\x7fELF", "a program"),
    (b"OFF", "an OFF file"),
    (b"<", "an XML or HTML file"),
    (b"{", "a JSON file"),
];

/// First words of the lines of an OBJ file, but for comments.
const OBJ: [&str; 8] = ["v", "vn", "vt", "f", "o", "g", "mtllib", "usemtl"];

/// Reads an STL or PLY file whose unit is `scale` metres (0.001 for millimetres). What it is, its
/// content tells.
///
/// # Errors
/// Says which file, and which facet, vertex or line; all count from 1. A file of another kind is
/// called by its kind.
pub fn read_mesh(path: &Path, scale: f64) -> Result<MeshFile, ReadError> {
    parse(&read_bytes(path, 2048)?, scale).map_err(|fault| ReadError::fault(path, fault))
}

fn parse(bytes: &[u8], scale: f64) -> Result<MeshFile, String> {
    if stl::is_binary(bytes) {
        return stl::parse(bytes, scale);
    }
    let bytes = unmarked(bytes)?;
    if ply::is_ply(bytes) {
        return stl::weld_scaled(ply::parse(bytes)?.1, scale);
    }
    match other(bytes) {
        Some(kind) => Err(format!("{kind}, expected an STL or PLY file")),
        None => stl::parse(bytes, scale),
    }
}

/// The points of an STL or PLY file whose unit is `scale` metres, those of a PLY file without faces too
/// and whether they are numbers or not [m]; none of text of another kind, which may be points by themselves.
///
/// # Errors
/// As for [`read_mesh`], without the path.
pub fn mesh_points(bytes: &[u8], scale: f64) -> Result<Option<Vec<Vec3>>, String> {
    let of_stl = |bytes: &[u8]| Ok(Some(stl::parse(bytes, scale)?.mesh.vertices));
    if stl::is_binary(bytes) {
        return of_stl(bytes);
    }
    let bytes = unmarked(bytes)?;
    if ply::is_ply(bytes) {
        let (vertices, _) = ply::parse(bytes)?;
        return Ok(Some(vertices.into_iter().map(|x| x * scale).collect()));
    }
    if let Some(kind) = other(bytes) {
        return Err(format!("{kind}, expected an STL, PLY or text file"));
    }
    match bytes.is_empty() || stl::is_text(bytes, b"solid") || !stl::is_text(bytes, b"") {
        true => of_stl(bytes),
        false => Ok(None),
    }
}

/// What a file is that is known to be neither STL nor PLY.
fn other(bytes: &[u8]) -> Option<&'static str> {
    let start = bytes.trim_ascii_start();
    if let Some((_, kind)) = OTHERS.iter().find(|(magic, _)| start.starts_with(magic)) {
        return Some(kind);
    }
    let text = String::from_utf8_lossy(&start[..start.len().min(4096)]);
    let is_said = |line: &&str| !line.trim().is_empty() && !line.starts_with('#');
    let first = text.lines().find(is_said)?.split_ascii_whitespace().next();
    if OBJ.contains(&first?) {
        return Some("an OBJ file");
    }
    // The first section of an IGES file has an S in column 73.
    (bytes.is_ascii() && bytes.get(72) == Some(&b'S')).then_some("an IGES file")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_other_kinds_are_called_by_their_kind() {
        let obj = b"# Blender\nmtllib a.mtl\no Cube\nv 1 1 1\n";
        let iges = format!("{:72}S      1\n", "");
        for (bytes, kind) in [
            (&b"\x89PNG\r\n\x1a\n"[..], "a PNG picture"),
            (b"PK\x03\x04....", "a zip archive, such as 3MF"),
            (b"\x1f\x8b\x08", "a gzip archive"),
            (b"ISO-10303-21;\nHEADER;\n", "a STEP file"),
            (obj, "an OBJ file"),
            (b"v 0 0 0\nv 1 0 0\n", "an OBJ file"),
            (iges.as_bytes(), "an IGES file"),
        ] {
            let fault = parse(bytes, 1.0).unwrap_err();
            assert_eq!(fault, format!("{kind}, expected an STL or PLY file"));
        }
        assert_eq!(parse(b"", 1.0).unwrap_err(), "file is empty");
    }

    const PLY: &str = "ply\nformat ascii 1.0\ncomment by hand\nobj_info 3\nelement vertex 4\n\
        property float x\nproperty float y\nproperty float z\nelement face 2\n\
        property list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n1 1e0 0\n0 1 0\n3 0 1 2\n\
        3 0 2 3\n";
    const STL: &str = "solid by hand\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
        vertex 1 1e0 0\nendloop\nendfacet\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 1 0\n\
        vertex 0 1 0\nendloop\nendfacet\nendsolid by hand\n";

    type Dialect<'a> = (&'static str, &'a dyn Fn(&str) -> Vec<u8>);

    /// Whatever editors, systems and other programs make of the same text.
    #[test]
    fn dialects_are_read_alike() {
        let mark = |text: &str| [b"\xef\xbb\xbf", text.as_bytes()].concat();
        let latin = |text: &str| {
            let text: Vec<char> = text.replacen("by hand", "für 1 µm", 1).chars().collect();
            text.into_iter().map(|c| c as u8).collect()
        };
        let dialects: [Dialect; 9] = [
            ("line feeds", &|text| text.into()),
            ("mark", &mark),
            ("both", &|text| text.replace('\n', "\r\n").into()),
            ("returns", &|text| text.replace('\n', "\r").into()),
            ("mark and returns", &|text| mark(&text.replace('\n', "\r"))),
            ("blank lines", &|text| {
                format!("\n \r\n{}", text.replace('\n', " \n")).into()
            }),
            ("capitals", &|text| text.to_ascii_uppercase().into()),
            ("blanks", &|text| text.replace(' ', "\t \u{b}").into()),
            ("Latin-1", &latin),
        ];
        for text in [PLY, STL] {
            let expected = parse(text.as_bytes(), 1.0).unwrap();
            assert_eq!(expected.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
            for (name, dialect) in dialects {
                let found = parse(&dialect(text), 1.0);
                assert_eq!(found.as_ref(), Ok(&expected), "{name}: {}", &text[..5]);
            }
            let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
            for bytes in [wide.clone(), [b"\xff\xfe", &*wide].concat()] {
                assert_eq!(
                    parse(&bytes, 1.0),
                    Err("text in UTF-16, expected UTF-8".into())
                );
            }
        }
        // One facet a line, all of it on one, and a number a line.
        let lines = STL
            .replace("\nouter", " outer")
            .replace("\nvertex", " vertex");
        let lines = lines
            .replace("\nend", " end")
            .replace(" endsolid", "\nendsolid");
        assert_eq!(lines.lines().count(), 4);
        for text in [
            lines,
            STL.replace('\n', " "),
            STL.replace("vertex ", "vertex\n"),
        ] {
            assert_eq!(
                parse(text.as_bytes(), 1.0),
                parse(STL.as_bytes(), 1.0),
                "{text}"
            );
        }
    }

    /// After a header whose lines end with carriage returns, a line feed is the body's.
    #[test]
    fn binary_bodies_begin_where_the_header_ends() {
        let header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty char x\n\
            property char y\nproperty char z\nelement face 1\nproperty list uchar char vertex_index\n\
            end_header\n";
        for ends in ["\n", "\r\n", "\r"] {
            let header = header.replace('\n', ends);
            let bytes = [
                header.as_bytes(),
                &[10, 0, 0, 0, 10, 0, 0, 0, 10, 3, 0, 1, 2],
            ]
            .concat();
            let mesh = parse(&bytes, 1.0).unwrap().mesh;
            assert_eq!(mesh.vertices[0], crate::math::Vec3::x() * 10.0);
        }
    }

    #[test]
    fn a_binary_stl_may_begin_with_anything() {
        let mut bytes = vec![0; 84 + 50];
        bytes[..4].copy_from_slice(b"PK\x03\x04");
        bytes[80] = 1;
        for (k, at) in [(1.0f32, 96 + 12), (1.0, 96 + 28)] {
            bytes[at..at + 4].copy_from_slice(&k.to_le_bytes());
        }
        assert_eq!(parse(&bytes, 1.0).unwrap().mesh.triangles.len(), 1);
    }
}
