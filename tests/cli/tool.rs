use super::*;

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
    for (shape, set, top) in [
        ("rib", "height_mm=41", 41.0),
        ("hemisphere", "radius_mm=33", 33.0),
        ("double-dome", "plate_mm=[500, 400]", 60.0),
        ("plate", "base_mm=7.5", 0.0),
        ("cylinder", "radius_mm = 55", 55.0),
        ("incline", "angle_deg=45", 200.0),
    ] {
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
