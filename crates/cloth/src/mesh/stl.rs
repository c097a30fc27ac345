use std::collections::HashMap;
use std::io::Write;
use std::path::Path;

use super::{TriMesh, check_facet_count};
use crate::file::{WriteError, plain, write_atomic};
use crate::math::Vec3;

/// Bytes before the first facet of a binary file: 80 free ones, then the facet count.
const HEADER: usize = 84;
/// Bytes of a binary facet: normal and three corners as f32, then two unused.
const FACET: usize = 50;
/// Corners closer than this share of the mesh's diagonal are the same vertex. Covers the f32
/// rounding of exporters (6e-8 of the coordinate); half a micrometre on a tool of half a metre.
const WELD: f64 = 1e-6;
/// Facets flatter than this (height over longest edge) have no usable normal.
const FLAT: f64 = 1e-12;
/// Units of a written file per metre: STL knows no units, but readers expect millimetres.
const MM_PER_M: f64 = 1e3;
/// Farthest that a coordinate lies from the origin [m]: a single one beyond belief would weld all
/// others together.
const FAR: f64 = 1e3;
/// Words with which the parts of an ASCII file begin and end.
const KEYWORDS: [&str; 9] = [
    "solid", "facet", "normal", "outer", "loop", "vertex", "endloop", "endfacet", "endsolid",
];

/// A mesh as read from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshFile {
    /// Equal corners are welded; the normals in the file are ignored.
    pub mesh: TriMesh,
    /// Facets without area, left out of the mesh.
    pub dropped_facet_count: usize,
}

/// Corners of a facet [m].
pub(super) type Facet = [Vec3; 3];

/// Whether a facet has a usable normal.
pub(super) fn has_area([a, b, c]: &Facet) -> bool {
    let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
    (b - a).cross(&(c - a)).norm() > FLAT * longest * longest
}

/// The mesh as a binary STL file in millimetres; the same bytes for the same mesh.
///
/// The header says `drape: ` (never `solid`, which some readers take for ASCII) and then as
/// much of `name` as fits.
pub fn to_stl_bytes(mesh: &TriMesh, name: &str) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER + FACET * mesh.triangles.len());
    bytes.extend(b"drape: ".iter().chain(name.as_bytes()).take(80));
    bytes.resize(80, 0);
    bytes.extend((mesh.triangles.len() as u32).to_le_bytes());
    for triangle in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(triangle);
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0);
        let corners = [a, b, c].map(|p| p * MM_PER_M);
        for vector in [normal.unwrap_or_default()].iter().chain(&corners) {
            for coordinate in vector {
                bytes.extend((*coordinate as f32).to_le_bytes());
            }
        }
        bytes.extend([0; 2]);
    }
    bytes
}

/// Writes the mesh as `to_stl_bytes` has it, by [`write_atomic`].
pub fn write_stl(path: impl AsRef<Path>, mesh: &TriMesh, name: &str) -> Result<(), WriteError> {
    write_atomic(path.as_ref(), |file| {
        file.write_all(&to_stl_bytes(mesh, name))
    })
}

/// Reads a binary or ASCII STL file whose unit is `scale` metres.
///
/// Binary files are known by their length, so that one whose header begins with `solid` is
/// read as well. Memory grows with the file, not
/// with the facet count it declares. Several solids in one ASCII file become one mesh.
pub(super) fn parse(bytes: &[u8], scale: f64) -> Result<MeshFile, String> {
    if bytes.is_empty() {
        return Err("file is empty".into());
    }
    let facets = match declared(bytes) {
        Some(declared) if is_binary(bytes) => binary_facets(bytes, declared)?,
        _ if is_text(bytes, b"solid") => text_facets(bytes)?,
        Some(declared) if !is_text(bytes, b"") => binary_facets(bytes, declared)?,
        _ => return Err("neither a binary nor an ASCII STL file".into()),
    };
    weld_scaled(facets, scale)
}

/// The facet count in the header of a binary file.
fn declared(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER - 4..HEADER)?;
    Some(u32::from_le_bytes(count.try_into().expect("four bytes")) as usize)
}

/// Whether a file has just the length that a binary file declares.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    let length = declared(bytes).and_then(|count| count.checked_mul(FACET)?.checked_add(HEADER));
    length == Some(bytes.len())
}

/// The mesh of facets in units of `scale` metres.
pub(super) fn weld_scaled(mut facets: Vec<Facet>, scale: f64) -> Result<MeshFile, String> {
    for (i, facet) in facets.iter_mut().enumerate() {
        for (k, corner) in facet.iter_mut().enumerate() {
            let found = *corner;
            *corner *= scale;
            if !corner.iter().all(|c| c.abs() <= FAR) {
                let (corner, facet, found) = (k + 1, i + 1, found.as_slice());
                let expected = format!("within +-{FAR} m, {} in units of the file", FAR / scale);
                return Err(format!(
                    "corner {corner} of facet {facet} is at {found:?}, expected coordinates {expected}"
                ));
            }
        }
    }
    weld(&facets)
}

/// Begins with `word` and holds no control characters (at first) but white space. A binary
/// file that is not empty never passes: its facet count has a byte below 9, or says 150 million.
pub(super) fn is_text(bytes: &[u8], word: &[u8]) -> bool {
    let start = bytes.trim_ascii_start().get(..word.len());
    let is_shown = |b: &u8| matches!(b, 9..=13 | b' '..);
    start.is_some_and(|start| start.eq_ignore_ascii_case(word))
        && bytes.iter().take(1024).all(is_shown)
}

fn binary_facets(bytes: &[u8], declared: usize) -> Result<Vec<Facet>, String> {
    let body = &bytes[HEADER..];
    let complete = body.len() / FACET;
    if complete < declared {
        return Err(format!("truncated after facet {complete} of {declared}"));
    }
    check_facet_count(declared)?;
    let rest = body.len() - declared * FACET;
    if rest > 0 {
        return Err(format!(
            "{rest} bytes after the last of {declared} facets, expected none"
        ));
    }
    let float = |b: &[u8]| f64::from(f32::from_le_bytes(b.try_into().expect("four bytes")));
    let corner = |b: &[u8]| Vec3::new(float(&b[..4]), float(&b[4..8]), float(&b[8..12]));
    let facets = body.chunks_exact(FACET).take(declared);
    let facet = |b: &[u8]| [12, 24, 36].map(|at| corner(&b[at..]));
    Ok(facets.map(facet).collect())
}

/// Words count, wherever lines end. Names, and what is left of the lines of `facet`, `normal`, `outer` and `loop` as far
/// as the next keyword, say nothing (some exporters write nan for a normal, which follows from the corners anyway).
fn text_facets(bytes: &[u8]) -> Result<Vec<Facet>, String> {
    let (mut facets, mut corners, mut is_complete) = (Vec::new(), Vec::new(), true);
    let bytes = plain(bytes)?;
    let text = String::from_utf8_lossy(&bytes);
    let words = |(number, line)| str::split_whitespace(line).map(move |word| (number, word));
    let mut words = (1..).zip(text.lines()).flat_map(words).peekable();
    let keyword = |word: &str| KEYWORDS.into_iter().find(|k| word.eq_ignore_ascii_case(k));
    let fault_at = |line, expected, found: &str| {
        let found: String = found.chars().take(40).collect();
        format!("line {line}: expected {expected}, found {found:?}")
    };
    while let Some((line, word)) = words.next() {
        let fault = |expected, found: &str| fault_at(line, expected, found);
        let found = keyword(word).unwrap_or_default();
        match found {
            "solid" if is_complete => is_complete = false,
            "solid" => return Err(fault("endsolid first", word)),
            _ if is_complete => return Err(fault("solid", word)),
            "facet" | "endsolid" if !corners.is_empty() => {
                return Err(fault("endfacet first", word));
            }
            "endsolid" => is_complete = true,
            "facet" | "outer" | "loop" | "endloop" => {}
            "normal" => (0..3).for_each(|_| {
                words.next_if(|(_, word)| keyword(word).is_none());
            }),
            "vertex" if corners.len() == 3 => return Err(fault("endfacet first", word)),
            "vertex" => {
                let mut corner = Vec3::zeros();
                for coordinate in corner.iter_mut() {
                    let (at, number) = words.next().unwrap_or((line, ""));
                    let number_fault = |_| fault_at(at, "a number", number);
                    *coordinate = number.parse().map_err(number_fault)?;
                }
                corners.push(corner);
            }
            "endfacet" => {
                let facet = Facet::try_from(std::mem::take(&mut corners));
                facets.push(facet.map_err(|_| fault("three vertices before", word))?);
                check_facet_count(facets.len())?;
            }
            _ => {
                let expected = "facet, outer, vertex, endloop, endfacet or endsolid";
                return Err(fault(expected, word));
            }
        }
        let is_named = found.ends_with("solid");
        let is_alone = words.peek().is_some_and(|&(at, _)| at != line);
        while let Some(&(at, next)) = words.peek()
            && (is_named || ["facet", "normal", "outer", "loop"].contains(&found))
        {
            let left = words.clone().take_while(|&(at, _)| at == line);
            let is_facet = |a, b| [a, b].map(keyword) == [Some("facet"), Some("normal")];
            let mut pairs = left
                .zip(words.clone().skip(1))
                .map(|(a, b)| is_facet(a.1, b.1));
            let ends = match keyword(next) {
                None => at != line && !(is_named && is_alone),
                Some(_) if !is_named || at != line => true,
                // Names may have keywords in them, but not how a facet begins, be it that of the next solid.
                Some("facet") => pairs.next() == Some(true),
                Some("solid") => is_complete && pairs.any(|is_facet| is_facet),
                Some(_) => false,
            };
            if ends {
                break;
            }
            words.next();
        }
    }
    if !is_complete {
        let count = facets.len();
        return Err(format!(
            "truncated after facet {count}, endsolid is missing"
        ));
    }
    Ok(facets)
}

/// Joins corners within [`WELD`] of one another into shared vertices, in the order in which
/// the file names them, and drops facets without area.
fn weld(facets: &[Facet]) -> Result<MeshFile, String> {
    if facets.is_empty() {
        return Err("no facets".into());
    }
    let mut welder = Welder::new(facets);
    let mut triangles = Vec::with_capacity(facets.len());
    for facet in facets {
        let triangle = facet.map(|corner| welder.index(corner));
        if has_area(&triangle.map(|i| welder.vertices[i as usize])) {
            triangles.push(triangle);
        }
    }
    if triangles.is_empty() {
        let count = facets.len();
        return Err(format!("all {count} facets have zero area"));
    }
    Ok(MeshFile {
        dropped_facet_count: facets.len() - triangles.len(),
        mesh: TriMesh {
            vertices: welder.vertices,
            triangles,
        },
    })
}

/// Finds earlier vertices by a hash of cells as wide as the tolerance: corners in the same
/// cell, or within the tolerance of each other along every axis, are one vertex.
struct Welder {
    origin: Vec3,
    tolerance: f64,
    cells: HashMap<[i64; 3], u32>,
    vertices: Vec<Vec3>,
}

impl Welder {
    fn new(facets: &[Facet]) -> Self {
        let corners = || facets.iter().flatten();
        let low = corners().fold(Vec3::repeat(f64::INFINITY), |low, p| low.inf(p));
        let high = corners().fold(Vec3::repeat(f64::NEG_INFINITY), |high, p| high.sup(p));
        Self {
            origin: low,
            // Not 0, even if all corners agree.
            tolerance: (WELD * (high - low).norm()).max(f64::MIN_POSITIVE),
            cells: HashMap::new(),
            vertices: Vec::new(),
        }
    }

    fn index(&mut self, corner: Vec3) -> u32 {
        let cell = ((corner - self.origin) / self.tolerance).map(|c| c.floor() as i64);
        // The cell itself first: most corners agree to the last bit.
        for n in [13].into_iter().chain(0..27) {
            let neighbour = [n % 3, n / 3 % 3, n / 9];
            let neighbour = std::array::from_fn(|a| cell[a].saturating_add(neighbour[a] - 1));
            if let Some(&index) = self.cells.get(&neighbour)
                && (self.vertices[index as usize] - corner).amax() <= self.tolerance
            {
                return index;
            }
        }
        let index = self.vertices.len() as u32;
        self.vertices.push(corner);
        self.cells.insert(cell.into(), index);
        index
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::mesh::read_mesh;

    /// A tetrahedron with legs of 1 mm.
    fn tetrahedron() -> TriMesh {
        let mm = 1e-3;
        TriMesh {
            vertices: vec![
                Vec3::zeros(),
                Vec3::x() * mm,
                Vec3::y() * mm,
                Vec3::z() * mm,
            ],
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        }
    }

    fn text(mesh: &TriMesh) -> String {
        let mut text = String::from("solid a facet of vertex\n");
        for t in 0..mesh.triangles.len() {
            text += " facet normal 0 0 nan\n  outer loop\n";
            for c in mesh.corners(t) {
                text += &format!("   vertex {:e} {} {}\n", c.x * 1e3, c.y * 1e3, c.z * 1e3);
            }
            text += "  endloop\n endfacet\n";
        }
        text + "endsolid a facet of vertex\n"
    }

    fn fault(bytes: &[u8]) -> String {
        parse(bytes, 1.0).unwrap_err()
    }

    #[test]
    fn binary_and_text_come_back_as_they_were() {
        let mesh = tetrahedron();
        let mut binary = to_stl_bytes(&mesh, "tetrahedron");
        assert_eq!(binary.len(), 284);
        assert!(binary.starts_with(b"drape: tetrahedron\0"));
        let upper = text(&mesh).to_ascii_uppercase().replace("NAN", "nan");
        let windows = text(&mesh).replace('\n', "\r\n");
        // Vertices are numbered as the file names them.
        let order = [0, 2, 1, 3];
        let welded = |bytes: &[u8]| {
            let stl = parse(bytes, 1e-3).unwrap();
            assert_eq!(stl.dropped_facet_count, 0);
            assert_eq!(stl.mesh.triangles[0], [0, 1, 2]);
            for (v, &i) in stl.mesh.vertices.iter().zip(&order) {
                assert!((v - mesh.vertices[i]).norm() < 1e-12);
            }
            assert_eq!(stl.mesh.vertices.len(), 4);
            assert!((stl.mesh.signed_volume() * 6e9 - 1.0).abs() < 1e-6);
        };
        welded(&binary);
        for text in [text(&mesh), upper, windows] {
            welded(text.as_bytes());
        }
        // A header that pretends to be text, and bytes after the end.
        binary[..6].copy_from_slice(b"solid ");
        welded(&binary);
        // With a word on each line, and a name that could begin another solid.
        let named = |name| text(&mesh).replace("a facet of vertex", name);
        let words = named("the punch").replace([' ', '\n'], "\n");
        for text in [&*words, &named("my solid")] {
            welded(text.as_bytes());
        }
        assert_eq!(
            fault(words.replacen("0e0", "0,0", 1).as_bytes()),
            "line 18: expected a number, found \"0,0\""
        );
        // Two solids in one file, here the same, and all on one line.
        let twice = text(&mesh).repeat(2);
        for text in [&twice, &twice.replace('\n', " ")] {
            let mesh = parse(text.as_bytes(), 1e-3).unwrap().mesh;
            assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (4, 8));
        }
    }

    #[test]
    fn every_truncation_is_an_error() {
        let mesh = tetrahedron();
        let binary = to_stl_bytes(&mesh, "tetrahedron");
        for end in 0..binary.len() {
            assert!(parse(&binary[..end], 1.0).is_err(), "{end}");
        }
        let text = text(&mesh);
        let complete = text.find("endsolid").unwrap() + "endsolid".len();
        for end in 0..complete {
            assert!(parse(&text.as_bytes()[..end], 1.0).is_err(), "{end}");
        }
        assert_eq!(fault(&binary[..200]), "truncated after facet 2 of 4");
        let cut = text.match_indices("vertex").nth(7).unwrap().0;
        assert_eq!(
            fault(&text.as_bytes()[..cut]),
            "truncated after facet 2, endsolid is missing"
        );
    }

    #[test]
    fn every_damaged_byte_is_survived() {
        let mesh = tetrahedron();
        for bytes in [to_stl_bytes(&mesh, "tetrahedron"), text(&mesh).into_bytes()] {
            for i in 0..bytes.len() {
                for value in [0, b' ', b'e', 0x7f, 0xff] {
                    let mut damaged = bytes.clone();
                    damaged[i] = value;
                    // Either an error or a mesh whose indices are valid.
                    if let Ok(stl) = parse(&damaged, 1e-3) {
                        let count = stl.mesh.vertices.len() as u32;
                        assert!(stl.mesh.triangles.iter().flatten().all(|&v| v < count));
                    }
                }
            }
        }
    }

    #[test]
    fn faults_are_located() {
        let mesh = tetrahedron();
        let mut binary = to_stl_bytes(&mesh, "tetrahedron");
        // The x of the second corner of facet 3.
        let at = HEADER + 2 * FACET + 24;
        binary[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(fault(&binary).starts_with("corner 2 of facet 3 is at [NaN, "));
        // A count of 4 billion neither allocates nor passes.
        binary[80..84].fill(0xff);
        assert_eq!(fault(&binary), "truncated after facet 4 of 4294967295");
        binary[80..84].fill(0);
        assert_eq!(fault(&binary[..HEADER]), "no facets");
        // Neither is what stands behind the facets dropped, be it facets or text.
        assert_eq!(
            fault(&binary),
            "200 bytes after the last of 0 facets, expected none"
        );

        let text = text(&mesh);
        assert_eq!(
            fault(text.replacen("outer", "inner", 1).as_bytes()),
            "line 3: expected facet, outer, vertex, endloop, endfacet or endsolid, found \"inner\""
        );
        assert_eq!(
            fault(text.replacen("0e0", "0,0", 1).as_bytes()),
            "line 4: expected a number, found \"0,0\""
        );
        assert_eq!(
            parse(text.replacen("0e0", "1e10", 1).as_bytes(), 1e-3).unwrap_err(),
            "corner 1 of facet 1 is at [10000000000.0, 0.0, 0.0], expected coordinates within \
             +-1000 m, 1000000 in units of the file"
        );
        for (from, to, expected) in [
            (
                "endsolid",
                "solid",
                "line 30: expected endsolid first, found \"solid\"",
            ),
            (
                "endloop\n endfacet",
                "endloop",
                "line 8: expected endfacet first, found \"facet\"",
            ),
            (
                "0e0 0 0",
                "0e0 0 0 0",
                "line 4: expected facet, outer, vertex, endloop, endfacet or endsolid, found \"0\"",
            ),
        ] {
            assert_eq!(fault(text.replacen(from, to, 1).as_bytes()), expected);
        }
        let facet = text[..text.rfind("endsolid").unwrap()].lines().skip(1);
        let facets: String = facet.map(|line| format!("{line}\n")).collect();
        let endless = format!("solid\n{}endsolid", facets.replace("endfacet", ""));
        assert!(fault(endless.as_bytes()).contains("expected endfacet first"));
        assert_eq!(fault(b"solid nothing\nendsolid nothing"), "no facets");
        assert_eq!(fault(b""), "file is empty");
        let prose = "It was a dark and stormy night. ".repeat(20);
        for bytes in [prose.as_bytes(), b"x", &[0; 40]] {
            assert_eq!(fault(bytes), "neither a binary nor an ASCII STL file");
        }
    }

    #[test]
    fn near_corners_are_welded_and_flat_facets_dropped() {
        let mut mesh = tetrahedron();
        // A second copy of each facet's corners, off by less than the tolerance of 1.7 nm.
        let corners: Vec<Facet> = (0..4)
            .map(|t| mesh.corners(t).map(|c| c.add_scalar(5e-10 * t as f64)))
            .collect();
        let stl = weld(&corners).unwrap();
        assert_eq!(stl.mesh.vertices.len(), 4);
        assert!(crate::mesh::border(&stl.mesh).unwrap().is_empty());

        // One facet with two equal corners, and one whose corners lie on a line.
        mesh.vertices.push(Vec3::x() * 5e-4);
        mesh.triangles.extend([[0, 0, 1], [0, 4, 1]]);
        let stl = parse(&to_stl_bytes(&mesh, ""), 1e-3).unwrap();
        assert_eq!(stl.dropped_facet_count, 2);
        assert_eq!(stl.mesh.triangles.len(), 4);
        mesh.triangles.drain(..4);
        assert_eq!(
            fault(&to_stl_bytes(&mesh, "")),
            "all 2 facets have zero area"
        );
    }

    #[test]
    fn files_are_written_whole_and_errors_name_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("punch.stl");
        fs::write(&path, "an older file").unwrap();
        let mesh = tetrahedron();
        write_stl(&path, &mesh, "punch").unwrap();
        assert_eq!(fs::read(&path).unwrap(), to_stl_bytes(&mesh, "punch"));
        assert_eq!(read_mesh(&path, 1e-3).unwrap().mesh.vertices.len(), 4);
        // Nothing else is left behind.
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);

        let missing = folder.path().join("missing/punch.stl");
        let error = read_mesh(&missing, 1.0).unwrap_err().to_string();
        assert_eq!(error, format!("cannot read {}", missing.display()));
        let error = write_stl(&missing, &mesh, "").unwrap_err();
        assert!(matches!(error, WriteError::FolderMissing { .. }), "{error}");
        fs::write(&path, "").unwrap();
        let error = read_mesh(&path, 1.0).unwrap_err().to_string();
        assert_eq!(error, format!("{}: file is empty", path.display()));
    }
}
