//! The fibre field of a run in every format, read back, and the flat pattern.

use super::run::*;
use super::*;

const FORMATS: [(&str, &str); 5] = [
    ("vtu", "field.vtu"),
    ("abaqus-orientation", "field.inp"),
    ("radioss", "field.rad"),
    ("hdf5", "field.h5"),
    ("csv-elements", "field.csv"),
];

/// Numbers apart by `apart`.
fn numbers(line: &str, apart: char) -> Vec<f64> {
    let parts = line.split(apart).filter(|part| !part.trim().is_empty());
    parts.map(|x| x.trim().parse().unwrap()).collect()
}

/// Rows of the array `name` of a VTU file.
fn array(vtu: &str, name: &str) -> Vec<Vec<f64>> {
    let (_, rest) = vtu.split_once(&format!("Name=\"{name}\"")).unwrap();
    let (rows, _) = rest.split_once("</DataArray>").unwrap();
    rows.lines().skip(1).map(|row| numbers(row, ' ')).collect()
}

/// Data lines after the first card that begins with `card`.
fn elements(text: &str, card: &str, ends: char, apart: char) -> Vec<Vec<f64>> {
    let (_, rest) = text.split_once(&format!("\n{card}")).unwrap();
    let lines = rest
        .lines()
        .skip(1)
        .take_while(|line| !line.starts_with(ends));
    let words = lines.map(|line| line.replace("SH3N", "    "));
    words.map(|line| numbers(&line, apart)).collect()
}

/// Of a group in an HDF5 file names and addresses of what is below, of an array its number of rows.
#[derive(Debug)]
enum Found {
    Group(Vec<(String, u64)>),
    Array(u64),
}

fn object(file: &[u8], at: u64) -> Found {
    let word = |at: u64| {
        let at = at as usize;
        u64::from_le_bytes(file[at..at + 8].try_into().unwrap())
    };
    let short = |at: u64| {
        u64::from(u16::from_le_bytes([
            file[at as usize],
            file[at as usize + 1],
        ]))
    };
    let (count, mut message) = (short(at + 2), at + 16);
    for _ in 0..count {
        let (kind, data) = (short(message), message + 8);
        match kind {
            1 => return Found::Array(word(data + 8)),
            0x11 => {
                let (tree, names) = (word(data), word(word(data + 8) + 24));
                assert_eq!(&file[tree as usize..][..4], b"TREE");
                let table = word(tree + 32);
                assert_eq!(&file[table as usize..][..4], b"SNOD");
                let entry = |k: u64| {
                    let entry = table + 8 + 40 * k;
                    let name = &file[(names + word(entry)) as usize..];
                    let end = name.iter().position(|byte| *byte == 0).unwrap();
                    let name = String::from_utf8(name[..end].to_vec()).unwrap();
                    (name, word(entry + 8))
                };
                return Found::Group((0..short(table + 6)).map(entry).collect());
            }
            _ => message = data + short(message + 2),
        }
    }
    panic!("neither group nor array at {at}");
}

/// Rows of the array at `path`.
fn rows(file: &[u8], path: &str) -> u64 {
    assert_eq!(&file[..8], b"\x89HDF\r\n\x1a\n");
    let word = |at: usize| u64::from_le_bytes(file[at..at + 8].try_into().unwrap());
    assert_eq!(word(40), file.len() as u64);
    let mut at = word(64);
    for name in path.split('/') {
        let Found::Group(children) = object(file, at) else {
            panic!("{name} of {path} is below an array");
        };
        let names = children.iter().map(|(name, _)| name);
        assert!(names.is_sorted(), "{children:?}");
        at = children.iter().find(|(found, _)| found == name).unwrap().1;
    }
    match object(file, at) {
        Found::Array(rows) => rows,
        group => panic!("{group:?}"),
    }
}

/// All formats have the same elements with the same numbers, and the report says how many they are.
#[test]
fn every_format_has_the_same_fibres() {
    let folder = trained();
    let path = folder.path();
    let mut texts = Vec::new();
    for (format, name) in FORMATS {
        let report = json(path, &["export", "runs/a", "--format", format, "--json"]);
        assert_eq!(report["file"], format!("runs/a/{name}"));
        assert_eq!(report["picture"], "runs/a/field.shear.png");
        assert_eq!(
            (&report["elements"], &report["unmapped"]),
            (&512.into(), &0.into())
        );
        let number = |key: &str| report[key].as_f64().unwrap();
        assert!(
            number("mean_shear_deg") > 0.0 && number("max_shear_deg") >= number("mean_shear_deg")
        );
        assert!(
            (1.0..1.5).contains(&number("mean_thickness_factor")),
            "{report}"
        );
        assert!(report["points"].as_u64().unwrap() > 0 && report["score"].is_f64());
        let bytes = fs::read(path.join("runs/a").join(name)).unwrap();
        if format == "hdf5" {
            let data = "composite_cae/components/fabric/data_map";
            for name in [
                "matorient_0_angles",
                "thicknesses",
                "warp",
                "weft",
                "shear_deg",
            ] {
                assert_eq!(rows(&bytes, &format!("{data}/{name}")), 512);
            }
            assert_eq!(rows(&bytes, "composite_cae/meshes/fabric/nodes"), 289);
            assert_eq!(
                rows(&bytes, "composite_cae/meshes/fabric/element_nodes"),
                512
            );
        } else {
            texts.push(String::from_utf8(bytes).unwrap());
        }
    }
    assert!(
        fs::read(path.join("runs/a/field.shear.png"))
            .unwrap()
            .starts_with(b"\x89PNG")
    );
    let [vtu, abaqus, radioss, csv] = &texts[..] else {
        panic!("four are texts");
    };
    for text in [vtu, abaqus, radioss, csv] {
        assert!(
            text.contains("frame: tool: origin and axes of the tool's file"),
            "{text}"
        );
    }
    let table: Vec<Vec<f64>> = (csv
        .lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit())))
    .map(|line| numbers(line, ','))
    .collect();
    assert_eq!(table.len(), 512);
    let [warp, weft, shear] = ["warp", "weft", "shear_deg"].map(|name| array(vtu, name));
    let factor = array(vtu, "thickness_factor");
    let points = array(vtu, "Points");
    let corners = array(vtu, "connectivity");
    let [warps, wefts] = ["WARP", "WEFT"].map(|name| {
        elements(
            abaqus,
            &format!("*DISTRIBUTION, NAME={name}_DIRECTIONS"),
            '*',
            ',',
        )
    });
    let plies = ["1", "2"].map(|ply| elements(radioss, &format!("/DRAPE/{ply}\n"), '/', ' '));
    for (t, row) in table.iter().enumerate() {
        let near = |found: &[f64], expected: &[f64]| {
            assert_eq!(found.len(), expected.len());
            let pairs = found.iter().zip(expected);
            pairs.for_each(|(a, b)| assert!((a - b).abs() < 2e-9, "{t}: {found:?}, {expected:?}"));
        };
        assert_eq!(row[0], (t + 1) as f64);
        let corners = corners[t].iter().map(|v| &points[*v as usize]);
        let middle = |k: usize| 1e3 / 3.0 * corners.clone().map(|x| x[k]).sum::<f64>();
        let off = (0..3)
            .map(|k| (row[1 + k] - middle(k)).abs())
            .fold(0.0, f64::max);
        assert!(off < 1e-6, "{off}");
        near(&row[4..7], &warp[t]);
        near(&row[7..10], &weft[t]);
        near(&row[10..12], &[shear[t][0], factor[t][0]]);
        // The first line is what elements have that stand nowhere.
        near(&warps[t + 1], &[&row[..1], &row[4..10]].concat());
        near(&wefts[t + 1][..4], &[&row[..1], &row[7..10]].concat());
        for ply in &plies {
            assert_eq!(ply.len(), 512);
            near(&ply[t][..2], &[row[0], row[11]]);
        }
        // From warp to weft by what is left of a right angle.
        let turn = (plies[1][t][2] - plies[0][t][2]).rem_euclid(360.0);
        assert!((turn - 90.0 + row[10]).abs() < 1e-6, "{t}: {turn}, {row:?}");
    }
}

/// The field on the draped mesh itself, as another program would have it, is the field.
#[test]
fn a_field_is_mapped_on_to_a_mesh() {
    let folder = trained();
    let path = folder.path();
    let export = |more: &[&str]| {
        let args = [
            "export",
            "runs/a",
            "--format",
            "csv-elements",
            "--frame",
            "scene",
            "--json",
        ];
        json(path, &[&args[..], more].concat())
    };
    let own = export(&["--out", "own.csv"]);
    let vtu = [
        "export", "runs/a", "--format", "vtu", "--frame", "scene", "--out", "own.vtu",
    ];
    stdout(path, &vtu);
    let text = fs::read_to_string(path.join("own.vtu")).unwrap();
    let (points, corners) = (array(&text, "Points"), array(&text, "connectivity"));
    let mut stl = String::from("solid\n");
    for triangle in &corners {
        stl += "facet normal 0 0 0\nouter loop\n";
        for v in triangle {
            let [x, y, z] = [0, 1, 2].map(|k| 1e3 * points[*v as usize][k]);
            stl += &format!("vertex {x:?} {y:?} {z:?}\n");
        }
        stl += "endloop\nendfacet\n";
    }
    fs::write(path.join("part.stl"), stl + "endsolid\n").unwrap();
    let onto = export(&["--out", "onto.csv", "--onto", "part.stl"]);
    assert_eq!(onto["onto"], "part.stl");
    for key in ["elements", "unmapped", "max_shear_deg"] {
        assert_eq!(onto[key], own[key], "{key}");
    }
    let read = |name: &str| fs::read_to_string(path.join(name)).unwrap();
    let rows = |text: &str| -> Vec<Vec<f64>> {
        let rows = text
            .lines()
            .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()));
        rows.map(|line| numbers(line, ',')).collect()
    };
    let [own, onto] = ["own.csv", "onto.csv"].map(|name| rows(&read(name)));
    assert_eq!(own.len(), onto.len());
    for (a, b) in own.iter().zip(&onto) {
        assert!(
            a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5),
            "{a:?}, {b:?}"
        );
    }
    // The same file by wrong units, elsewhere and in a format that has no elements.
    let flat = "solid\nfacet\nouter loop\nvertex 0 0 0\nvertex 9 0 0\nvertex 18 0 0\nendloop\nendfacet\n\
                facet\nouter loop\nvertex 0 0 0\nvertex 9 0 0\nvertex 9 9 0\nendloop\nendfacet\nendsolid\n";
    fs::write(path.join("flat.stl"), flat).unwrap();
    let (_, far) = flat.split_once("endfacet\n").unwrap();
    let far = format!("solid\n{}", far.replace('9', "9000"));
    fs::write(path.join("far.stl"), far).unwrap();
    fs::write(path.join("empty.stl"), "solid\nendsolid\n").unwrap();
    for (more, words) in [
        (
            &["--onto", "part.stl", "--scale", "1"][..],
            &["part.stl: the mesh measures", "check --scale"][..],
        ),
        (
            &["--onto", "part.stl", "--scale", "1e-6"],
            &["part.stl: the mesh measures", "check --scale"],
        ),
        (
            &["--onto", "far.stl"],
            &["far.stl: none of its 1 elements has fabric within 5 mm, the nearest is"],
        ),
        (
            &["--onto", "flat.stl"],
            &["flat.stl: 1 facets have no area, expected none"],
        ),
        (&["--onto", "empty.stl"], &["empty.stl"]),
        (&["--onto", "none.stl"], &["none.stl"]),
        (
            &["--onto", "part.stl", "--format", "json"],
            &["`--onto`", "csv-elements"],
        ),
    ] {
        let mut args = vec![
            "export", "runs/a", "--json", "--frame", "scene", "--out", "bad",
        ];
        if !more.contains(&"--format") {
            args.extend(["--format", "vtu"]);
        }
        assert_failure(&drape(path, &[&args[..], more].concat()), 2, words);
    }
    assert!(!path.join("bad").exists() && !path.join("bad.shear.png").exists());
}

/// The outline of the blank, its yarns, clamps and strokes, in millimetres.
#[test]
fn the_pattern_has_outline_yarns_clamps_and_strokes() {
    let folder = trained();
    let path = folder.path();
    let report = json(path, &["export", "runs/a", "--format", "dxf", "--json"]);
    assert_eq!(report["file"], "runs/a/pattern.dxf");
    let text = fs::read_to_string(path.join("runs/a/pattern.dxf")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let pairs: Vec<[&str; 2]> = lines
        .chunks(2)
        .map(|pair| pair.try_into().unwrap())
        .collect();
    assert!(pairs.iter().all(|[code, _]| code.parse::<u32>().is_ok()));
    assert!(text.contains("9\n$INSUNITS\n70\n4\n") && text.ends_with("0\nEOF\n"));
    let count = |kind: &str, layer: &str| {
        let found = pairs
            .windows(2)
            .filter(|pair| *pair == [["0", kind], ["8", layer]]);
        found.count()
    };
    assert_eq!(
        (count("POLYLINE", "OUTLINE"), count("VERTEX", "OUTLINE")),
        (1, 64)
    );
    assert_eq!((count("VERTEX", "WARP"), count("VERTEX", "WEFT")), (2, 2));
    assert_eq!(count("POINT", "CLAMPS"), 2);
    let strokes = report["strokes"].as_f64().unwrap() as usize;
    assert_eq!(count("TEXT", "STROKES"), strokes);
    assert_eq!(
        count("POLYLINE", "STROKES") + count("POINT", "STROKES"),
        strokes
    );
    let points = report["points"].as_u64().unwrap() as usize;
    assert_eq!(
        count("VERTEX", "STROKES") + count("POINT", "STROKES"),
        points
    );
    let far = pairs
        .iter()
        .filter(|[code, _]| matches!(*code, "10" | "20"));
    let far = far
        .map(|[_, x]| x.parse::<f64>().unwrap().abs())
        .fold(0.0, f64::max);
    assert_eq!(far, 185.0);
}
