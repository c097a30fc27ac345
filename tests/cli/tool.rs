use std::fmt::Write as _;

use super::*;
use drape_cloth::tool::Shape;

#[test]
fn rib_is_the_one_in_the_assets() {
    let folder = folder();
    let text = stdout(folder.path(), &["tool", "rib", "--out", "rib.stl"]);
    assert!(
        text.starts_with("rib.stl: 4575 vertices, 9146 triangles\n"),
        "{text}"
    );
    let written = fs::read(folder.path().join("rib.stl")).unwrap();
    assert!(written == include_bytes!("../../assets/rib.stl"));
    assert_eq!(names(folder.path()), ["rib.stl"]);
}

#[test]
fn every_shape_is_written_with_its_values() {
    let folder = folder();
    let shapes = [
        ("rib", "height_mm=41", 41.0),
        ("hemisphere", "radius_mm=33", 33.0),
        ("double-dome", "plate_mm=[500, 400]", 60.0),
        ("plate", "base_mm=7.5", 0.0),
        ("cylinder", "radius_mm = 55", 55.0),
        ("incline", "angle_deg=45", 200.0),
        ("trough", "depth_mm=30", 0.0),
        ("saddle", "height_mm=25", 25.0),
        ("hills", "seed=3", 81.7),
    ];
    assert_eq!(shapes.map(|(shape, ..)| shape), Shape::KINDS);
    for (shape, set, top) in shapes {
        let report = json(
            folder.path(),
            &["tool", shape, "--set", set, "--out", "tool.stl", "--json"],
        );
        let found = report["bounds_mm"][1][2].as_f64().unwrap();
        assert!((found - top).abs() < 0.5, "{shape}: {found}");
        let triangles = report["triangles"].as_u64().unwrap();
        let length = fs::metadata(folder.path().join("tool.stl")).unwrap().len();
        assert_eq!(length, 84 + 50 * triangles, "{shape}");
        assert_eq!(report["shape"]["kind"], shape);
    }
}

#[test]
fn grid_error_is_a_table_or_an_object() {
    let folder = folder();
    let args = ["tool", "plate", "--out", "a.stl", "--grid-error", "--json"];
    let text = stdout(folder.path(), &args[..5]);
    assert!(text.contains("within 2 mm: mean "), "{text}");
    let report = json(folder.path(), &args);
    let error = &report["grid_error_mm"];
    let [mean, p95, max] = ["mean", "p95", "max"].map(|key| error[key].as_f64().unwrap());
    assert!(
        0.0 < mean && mean < max && p95 <= max && max < 4.0,
        "{report}"
    );
}

#[test]
fn impossible_values_are_refused_and_the_old_file_stays() {
    let folder = folder();
    fs::write(folder.path().join("a.stl"), "old").unwrap();
    for (set, words) in [
        (
            "hieght_mm=1",
            &["unknown field `hieght_mm`", "`height_mm`", "`crest_drop`"][..],
        ),
        ("kind='plate'", &["--set kind='plate': duplicate key"]),
        ("kind=plate", &["string values must be quoted"]),
        ("height_mm=nan", &["`height_mm` is NaN", "expected above 0"]),
        ("height_mm=inf", &["`height_mm` is inf", "expected above 0"]),
        ("height_mm=-1", &["`height_mm` is -1"]),
        (
            "height_mm='1'",
            &["--set height_mm='1': ", "string \"1\", expected a number"],
        ),
        ("height_mm=abc", &["string values must be quoted"]),
        ("height_mm=", &["height_mm="]),
        ("height_mm", &["--set height_mm", "expected KEY=VALUE"]),
        ("crest_drop=1", &["`crest_drop` is 1", "below 1"]),
        (
            "vertex_counts=[2, 5000]",
            &["`vertex_counts` is 5000", "4096"],
        ),
        ("vertex_counts=[2, -5]", &["vertex_counts"]),
        ("plate_mm=[1]", &["list of length 2", "plate_mm"]),
    ] {
        let args = ["tool", "rib", "--out", "a.stl", "--json", "--set", set];
        assert_failure(&drape(folder.path(), &args), 2, words);
    }
    let args = ["tool", "cube", "--out", "a.stl"];
    let words = ["there is no shape or file cube, expected a file or one of rib, hemisphere"];
    assert_failure(&drape(folder.path(), &args), 2, &words);
    let twice = ["--set", "base_mm=1", "--set", "base_mm=2"];
    let args = [&["tool", "rib", "--out", "a.stl"][..], &twice].concat();
    assert_failure(
        &drape(folder.path(), &args),
        2,
        &["--set base_mm=1 --set base_mm=2: duplicate key"],
    );
    assert_eq!(fs::read(folder.path().join("a.stl")).unwrap(), b"old");
    assert_eq!(names(folder.path()), ["a.stl"]);
}

#[test]
fn tool_files_that_cannot_be_written_are_named() {
    let folder = folder();
    fs::create_dir(folder.path().join("taken")).unwrap();
    fs::write(folder.path().join("file"), "").unwrap();
    for (out, words) in [
        (
            "none/a.stl",
            &["none/a.stl", "folder none does not exist"][..],
        ),
        ("taken", &["cannot write taken"]),
        ("file/a.stl", &["file/a.stl"]),
    ] {
        let output = drape(folder.path(), &["tool", "plate", "--out", out]);
        assert_failure(&output, 1, words);
    }
    assert_eq!(names(folder.path()), ["file", "taken"]);
}

#[test]
fn grid_error_above_its_bound_is_a_failure() {
    let folder = folder();
    let path = folder.path();
    let judged = |bound| drape(path, &["tool", "hemisphere", "--out", "a.stl", bound]);
    assert!(judged("--grid-error").status.success());
    let output = judged("--grid-error=0.001");
    assert_eq!(output.status.code(), Some(1));
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(
        stderr.starts_with("error: a.stl: the distance errs by 0.0"),
        "{stderr}"
    );
    assert!(
        stderr.ends_with("mm, expected at most 0.001 mm\n"),
        "{stderr}"
    );
}

/// A cube from 0 to `side` as ASCII PLY with quads, without its lid or with it.
fn cube(side: f64, lid: bool) -> String {
    let faces = [
        "0 2 3 1", "0 1 5 4", "2 6 7 3", "0 4 6 2", "1 3 7 5", "4 5 7 6",
    ];
    let faces = &faces[..5 + usize::from(lid)];
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\n\
         property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        faces.len()
    );
    for i in 0..8 {
        let at = |bit: usize| side * f64::from(u8::from(i >> bit & 1 == 1));
        let _ = writeln!(text, "{} {} {}", at(0), at(1), at(2));
    }
    for face in faces {
        let _ = writeln!(text, "4 {face}");
    }
    text
}

#[test]
fn files_are_examined() {
    let folder = folder();
    let path = folder.path();
    // The suffix says nothing.
    fs::write(path.join("cube.stl"), cube(8.0, true)).unwrap();
    let args = ["tool", "cube.stl", "--picture", "cube.png", "--json"];
    let report = json(path, &args);
    assert_eq!(report["triangles"], 12);
    assert_eq!(report["open"], false);
    let close = |key: &Value, exact: f64| (key.as_f64().unwrap() - exact).abs() < 1e-6;
    assert!(close(&report["volume_cm3"], 0.512), "{report}");
    assert!(close(&report["thinnest_mm"]["thickness"], 8.0), "{report}");
    assert!(report["grid_error_mm"]["max"].as_f64().unwrap() < 1e-3);
    let unit = report["unit"].as_str().unwrap();
    assert!(unit.contains("0.0254 (inches) makes it 203 mm"), "{unit}");
    assert!(
        fs::read(path.join("cube.png"))
            .unwrap()
            .starts_with(b"\x89PNG")
    );
    let text = stdout(path, &["tool", "cube.stl", "--scale", "0.0254"]);
    assert!(text.contains("\nclosed, 8390.2 cm3\n"), "{text}");
    assert!(!text.contains("longest side"), "{text}");

    for (file, bytes, words) in [
        (
            "a.stl",
            &b"\x89PNG\r\n\x1a\n"[..],
            "a.stl: a PNG picture, expected an STL or PLY file",
        ),
        (
            "a.obj",
            b"v 0 0 0\nv 1 0 0\n",
            "a.obj: an OBJ file, expected",
        ),
        (
            "lid.ply",
            cube(100.0, false).as_bytes(),
            "of its 10 facets have none behind them",
        ),
    ] {
        fs::write(path.join(file), bytes).unwrap();
        assert_failure(&drape(path, &["tool", file]), 2, &[words]);
    }
    assert_failure(&drape(path, &["tool", "none.stl"]), 2, &["none.stl"]);
    let args = ["tool", "cube.stl", "--set", "a=1"];
    assert_failure(&drape(path, &args), 2, &["--set a=1 is for shapes"]);
}

#[test]
fn thin_walls_are_seen_unless_a_spacing_is_given() {
    let folder = folder();
    let path = folder.path();
    let args = ["--set", "base_mm=3", "--set", "plate_mm=[300, 300]"];
    let args = [&["tool", "plate", "--out", "a.stl"][..], &args].concat();
    stdout(path, &args);
    let scene = |grid: &str| {
        format!(
            "[blank]\nsize_mm = [200, 200]\nvertices = [17, 17]\n[placement]\ntilt_deg = 0\n\
             height_mm = 16\n[fall]\nfall_s = 0.2\nsettle_s = 0.3\nsubstep_rate = 1200\n{grid}\
             [tool.pose]\nrotation_deg = [0, 8, 0]\n[tool.source.mesh]\npath = \"a.stl\"\n"
        )
    };
    let penetration = |grid| {
        let output = set_up(path, &scene(grid));
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        (report["penetration_mm"].as_f64().unwrap(), stderr)
    };
    let (depth, stderr) = penetration("");
    assert!(depth < 0.01 && stderr.is_empty(), "{depth} {stderr}");
    // On edge, it is thinner than the cells can hold.
    let upright = "[tool.pose]\nrotation_deg = [0, 90, 0]\n[blank]\nvertices = [9, 9]\n\
                   [placement]\nover = \"tool\"\nheight_mm = 1\n[fall]\nfall_s = 0.1\n\
                   settle_s = 0.1\nsubstep_rate = 1200\n[tool.source.mesh]\npath = \"a.stl\"\nscale = 1e-4\n";
    let stderr = String::from_utf8(set_up(path, upright).stderr).unwrap();
    assert!(
        stderr.contains("finer than cells of 46.2 mm, expected 2.4 mm or less"),
        "{stderr}"
    );
    let (depth, stderr) = penetration("[tool.grid]\nspacing_mm = 4\n");
    assert!(depth > 0.2, "{depth}");
    assert!(
        stderr.contains("leave out `tool.grid.spacing_mm`"),
        "{stderr}"
    );
}

/// A dome over a square as ASCII STL [mm] whose second facets face down in 20 columns but for one hole of two, and a stray
/// facet.
fn scanned_dome() -> String {
    let count = 61_i32;
    let at = |i: i32, j: i32| {
        let [x, y] = [i, j].map(|i| f64::from(i) * 2.0 - 60.0);
        format!(
            "vertex {x} {y} {}\n",
            (100.0 * 100.0 - x * x - y * y).sqrt()
        )
    };
    let facet = |corners: [String; 3]| {
        format!(
            "facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n",
            corners.concat()
        )
    };
    let mut text = String::from("solid\n");
    for (i, j) in (0..count - 1).flat_map(|j| (0..count - 1).map(move |i| (i, j))) {
        if [(20, 20), (40, 30)].contains(&(i, j)) {
            continue;
        }
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        let second = [[a.clone(), c.clone(), d.clone()], [a.clone(), d, c.clone()]];
        text += &facet([a, b, c]);
        text += &facet(second[usize::from(i % 3 == 1)].clone());
    }
    let stray = ["0 0 300", "1 0 300", "0 1 300"].map(|x| format!("vertex {x}\n"));
    text + &facet(stray) + "endsolid\n"
}

#[test]
fn scanned_tools_are_repaired_for_scenes() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("scan.stl"), scanned_dome()).unwrap();
    assert_failure(&drape(path, &["tool", "scan.stl"]), 2, &["repair the mesh"]);
    let args = ["tool", "scan.stl", "--repair", "--out", "a.stl", "--json"];
    let report = json(path, &args);
    let found = &report["repair"];
    for (key, count) in [
        ("stray_parts", 1),
        ("stray_facets", 1),
        ("closed_holes", 2),
        ("turned_facets", 1199),
    ] {
        assert_eq!(found[key], count, "{key}: {report}");
    }
    assert_eq!(report["open"], true);
    assert!(found["max_mm"].as_f64().unwrap() < 0.2, "{report}");
    assert!(report["triangles"].as_u64().unwrap() < 7000);

    // A second time nothing changes.
    let args = ["tool", "a.stl", "--repair", "--out", "b.stl"];
    let text = stdout(path, &args);
    assert!(text.contains("\nnothing to repair\n"), "{text}");
    let read = |file| fs::read(path.join(file)).unwrap();
    assert!(read("a.stl") == read("b.stl"));
    assert!(read("a.stl").starts_with(b"drape: repaired\0"));
    let finer = ["tool", "scan.stl", "--repair", "--tolerance", "0"];
    let text = stdout(path, &finer);
    assert!(
        text.contains("7200 triangles") && !text.contains("decimation"),
        "{text}"
    );

    let scene = "[blank]\nsize_mm = [60, 60]\nvertices = [9, 9]\n[fall]\nfall_s = 0.1\nsettle_s = 0.1\n\
                 substep_rate = 1200\n[placement]\nover = \"tool\"\nheight_mm = 2\n[tool.source.mesh]\npath = \"b.stl\"\n";
    let output = set_up(path, scene);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn what_no_repair_helps_is_refused() {
    let folder = folder();
    let path = folder.path();
    let points = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                  property float z\nend_header\n0 0 0\n1 0 0\n0 1 0\n";
    fs::write(path.join("points.ply"), points).unwrap();
    fs::write(path.join("empty.stl"), "").unwrap();
    fs::write(path.join("lid.ply"), cube(100.0, false)).unwrap();
    for (file, words) in [
        ("points.ply", &["points.ply: no facets"][..]),
        ("empty.stl", &["empty.stl: file is empty"]),
        (
            "lid.ply",
            &["lid.ply: cannot be repaired: the tool is no solid"],
        ),
        ("rib", &["no --scale or --repair"]),
    ] {
        let args = ["tool", file, "--repair", "--out", "a.stl"];
        assert_failure(&drape(path, &args), 2, words);
    }
    let args = ["tool", "lid.ply", "--repair", "--tolerance", "-1"];
    assert_eq!(drape(path, &args).status.code(), Some(2));
    assert_eq!(
        drape(path, &["tool", "lid.ply", "--tolerance", "1"])
            .status
            .code(),
        Some(2)
    );
    let over = ["tool", "lid.ply", "--repair", "--out", "lid.ply"];
    assert_failure(&drape(path, &over), 2, &["lid.ply would be replaced"]);
    let coarse = ["tool", "lid.ply", "--repair", "--tolerance", "50"];
    assert_failure(
        &drape(path, &coarse),
        2,
        &["lid.ply", "`--tolerance` is 50"],
    );
    let drawn = ["tool", "lid.ply", "--repair", "--picture", "a.png"];
    assert_failure(&drape(path, &drawn), 2, &["no solid"]);
    assert_eq!(names(path), ["empty.stl", "lid.ply", "points.ply"]);
}
