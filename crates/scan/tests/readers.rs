//! Files of scans, as they come from scanners, and as they should not.

use std::fs;
use std::path::Path;

use drape_cloth::math::Vec3;
use drape_scan::Cloud;

/// A file of a folder that is removed.
fn read(bytes: &[u8]) -> Result<Cloud, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan");
    fs::write(&path, bytes).unwrap();
    let place = format!("{}: ", path.display());
    Cloud::read(&path, 1e-3).map_err(|error| error.to_string().replace(&place, ""))
}

fn points() -> [[f32; 3]; 4] {
    [
        [0.0, 0.0, 0.0],
        [100.0, 0.0, 5.0],
        [100.0, 80.0, 0.0],
        [0.0, 80.0, -5.0],
    ]
}

const HEADER: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";

#[test]
fn every_format_gives_the_same_points() {
    let text: String = points()
        .iter()
        .map(|[x, y, z]| format!("{x} {y} {z}\n"))
        .collect();
    let binary: Vec<u8> = points()
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let head = |format: &str| format!("ply\nformat {format} 1.0\n{HEADER}end_header\n");
    let mut stl = vec![0; 84];
    stl[80] = 2;
    for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
        stl.extend([0; 12]);
        for corner in [a, b, c] {
            stl.extend(points()[corner].iter().flat_map(|x| x.to_le_bytes()));
        }
        stl.extend([0; 2]);
    }
    let faces = format!(
        "ply\nformat ascii 1.0\n{HEADER}element face 1\nproperty list uchar int vertex_indices\nend_header\n{text}4 0 1 2 3\n"
    );
    for (name, bytes) in [
        ("XYZ", text.clone().into_bytes()),
        ("PLY", [head("ascii").as_bytes(), text.as_bytes()].concat()),
        (
            "binary PLY",
            [head("binary_little_endian").as_bytes(), &binary].concat(),
        ),
        ("PLY with faces", faces.into_bytes()),
        ("STL", stl),
    ] {
        let cloud = read(&bytes).unwrap();
        let expected = points().map(|x| Vec3::from(x.map(f64::from)) * 1e-3);
        assert_eq!(cloud.points.len(), 4, "{name}");
        for (found, expected) in cloud.points.iter().zip(expected) {
            assert!((found - expected).norm() < 1e-12, "{name}");
        }
        assert_eq!(
            (cloud.dropped_count, cloud.source.file_name()),
            (0, Some("scan".as_ref()))
        );
    }
}

#[test]
fn points_that_are_no_numbers_are_counted() {
    let text = "0 0 0\nnan nan nan\n1 0 0\n0 1 inf\n0 1 0\n";
    assert_eq!(read(text.as_bytes()).unwrap().dropped_count, 2);
    let ply = format!("ply\nformat ascii 1.0\n{HEADER}end_header\n0 0 0\nnan 0 0\n1 0 0\n0 1 0\n");
    assert_eq!(read(ply.as_bytes()).unwrap().dropped_count, 1);
}

#[test]
fn what_is_no_scan_is_refused_in_words() {
    let line: String = (0..50).map(|k| format!("{k} {} 7\n", 2 * k)).collect();
    for (bytes, fault) in [
        (&b""[..], "file is empty"),
        (
            b"x y z\n",
            "no line begins with three numbers, expected x, y and z of a point",
        ),
        (b"1 2 3\n", "has 1 points, expected those of a blank"),
        (
            b"1 2 3\nnan 0 0\n",
            "has 1 points beside 1 whose coordinates are no numbers, expected those of a blank",
        ),
        (
            b"1 2 3\n1 2 3\n1 2 3\n1 2 3\n",
            "all 4 points are one and the same, expected those of a blank",
        ),
        (
            line.as_bytes(),
            "all 50 points lie on a line, expected those of a blank",
        ),
        (
            b"1,5 2,5 3,5\n",
            "line 1: expected numbers with decimal points, found \"1,5 2,5 3,5\"",
        ),
        (
            b"0 0 0\n1 0 0\n0 3e9 0\n",
            "a point is at [0.0, 3000000.0, 0.0] m, expected coordinates within +-1000 m: check its unit",
        ),
        (
            b"\x89PNG\r\n\x1a\n",
            "a PNG picture, expected an STL, PLY or text file",
        ),
        (
            b"PK\x03\x04....",
            "a zip archive, such as 3MF, expected an STL, PLY or text file",
        ),
        (
            b"\x01\x02\x03\x04",
            "neither a binary nor an ASCII STL file",
        ),
    ] {
        assert_eq!(read(bytes).unwrap_err(), fault);
    }
    let missing = Cloud::read(Path::new("no/such.xyz"), 1e-3).unwrap_err();
    assert_eq!(missing.to_string(), "cannot read no/such.xyz");
}
