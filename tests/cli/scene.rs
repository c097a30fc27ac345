use std::fmt::Write as _;

use super::*;

const SCENE_FILES: [&str; 5] = [
    "isometric.png",
    "lamina.stl",
    "summary.json",
    "tool.stl",
    "top.png",
];

#[test]
fn scene_writes_its_files_and_replaces_them() {
    let folder = folder();
    fs::write(folder.path().join("scene.toml"), scene(RIB)).unwrap();
    let args = ["scene", "scene.toml", "--out", "new/out"];
    let text = stdout(folder.path(), &args);
    assert!(
        text.starts_with("lamina       289 vertices, 512 triangles\n"),
        "{text}"
    );
    assert!(text.ends_with("written to new/out\n"), "{text}");

    let out = folder.path().join("new/out");
    let read = || SCENE_FILES.map(|name| fs::read(out.join(name)).unwrap());
    let first = read();
    for name in SCENE_FILES {
        fs::write(out.join(name), "old").unwrap();
    }
    let report = json(folder.path(), &[&args[..], &["--json"]].concat());
    assert!(read() == first);
    assert_eq!(names(&out), SCENE_FILES);

    let [isometric, _, summary, _, top] = first;
    assert!(isometric.starts_with(b"\x89PNG") && top.starts_with(b"\x89PNG"));
    let summary: Value = serde_json::from_slice(&summary).unwrap();
    for (key, value) in summary.as_object().unwrap() {
        assert_eq!(report[key], *value, "{key}");
    }
    for key in [
        "distance_m",
        "strain_p95",
        "strain_max",
        "penetration_mm",
        "v_rms_mm_s",
        "seconds",
    ] {
        assert!(report[key].as_f64().unwrap() >= 0.0, "{key}");
    }
    assert!(report["wrinkles"].is_u64());
}

/// Facets of a binary STL file, in its unit.
fn facets(bytes: &[u8]) -> Vec<[[f64; 3]; 3]> {
    let number = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()).into();
    let facet = |at: usize| {
        std::array::from_fn(|v| std::array::from_fn(|c| number(at + 12 + 12 * v + 4 * c)))
    };
    (84..bytes.len()).step_by(50).map(facet).collect()
}

/// The same tool as a formula, as a binary file in millimetres and as an ASCII file in
/// metres that is turned and moved into place, gives the same drape.
#[test]
fn own_stl_files_do_as_the_formula_does() {
    let folder = folder();
    let path = folder.path();
    stdout(path, &["tool", "rib", "--out", "rib.stl"]);
    let mut ascii = String::from("solid rib of mine\n");
    for facet in facets(&fs::read(path.join("rib.stl")).unwrap()) {
        ascii += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in facet.map(|corner| corner.map(|c| c * 1e-3)) {
            // Turned by -90 degrees about z.
            let _ = writeln!(ascii, "vertex {} {} {}", y - 0.02, 0.01 - x, z - 0.5);
        }
        ascii += "endloop\nendfacet\n";
    }
    fs::create_dir(path.join("tools")).unwrap();
    fs::write(path.join("tools/mine.stl"), ascii + "endsolid\n").unwrap();

    let mut reports = Vec::new();
    for tool in [
        RIB,
        "[tool.source.stl]\npath = \"rib.stl\"\n",
        "[tool.source.stl]\npath = \"tools/mine.stl\"\nscale = 1\n\
         [tool.pose]\nrotation_deg = [0, 0, 90]\ntranslation_mm = [10, 20, 500]\n",
    ] {
        let output = set_up(path, &scene(tool));
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{stderr}");
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        let tool = facets(&fs::read(path.join("out/tool.stl")).unwrap());
        assert_eq!(tool.len(), 9146);
        let size = |axis: usize| {
            let values = tool.iter().flatten().map(|corner| corner[axis]);
            values.fold([f64::MAX, f64::MIN], |[l, h], v| [l.min(v), h.max(v)])
        };
        for (axis, expected) in [[-240.0, 240.0], [-220.0, 220.0], [-20.0, 59.7]]
            .iter()
            .enumerate()
        {
            let found = size(axis);
            assert!(
                (found[0] - expected[0]).abs() < 0.1 && (found[1] - expected[1]).abs() < 0.1,
                "{found:?}"
            );
        }
        reports.push(report);
    }
    let distance = |report: &Value| report["distance_m"].as_f64().unwrap();
    let expected = distance(&reports[0]);
    assert!(expected > 0.1, "{expected}");
    for report in &reports[1..] {
        assert!(
            (distance(report) - expected).abs() < 1e-2 * expected,
            "{reports:?}"
        );
    }
}

#[test]
fn invalid_scenes_are_refused_before_anything_is_written() {
    let folder = folder();
    let path = folder.path();
    let args = ["scene", "none.toml", "--out", "out"];
    assert_failure(
        &drape(path, &args),
        2,
        &["cannot read none.toml", "No such file"],
    );
    let args = ["scene", ".", "--out", "out"];
    assert_failure(&drape(path, &args), 2, &["cannot read ."]);
    fs::write(path.join("latin.toml"), b"# \xfc\n").unwrap();
    let args = ["scene", "latin.toml", "--out", "out"];
    assert_failure(&drape(path, &args), 2, &["latin.toml", "UTF-8"]);

    for (text, words) in [
        ("", &["scene.toml:1:1: missing field `tool`"][..]),
        ("[tool", &["scene.toml:1:6: "]),
        (
            "[tool]\n[fall]\nfal_s = 1",
            &["scene.toml:3:1: unknown field `fal_s`", "`fall_s`"],
        ),
        (
            "[tool]\n[fall]\nfall_s = \"1\"",
            &["scene.toml:3:10: ", "string \"1\"", "`fall_s = "],
        ),
        (
            "[tool]\n[blank]\nvertices = [1.5, 2]",
            &["scene.toml:3:13: ", "1.5", "`vertices = "],
        ),
        (
            "[tool]\n[blank]\nmass = \"much\"",
            &["scene.toml:3:8: ", "`much`", "`paper`"],
        ),
        (
            "[tool.source.shape]\nkind = \"cube\"",
            &["scene.toml:", "`cube`", "`rib`"],
        ),
        (
            "[tool.source.shape]\nkind = \"rib\"\nhight_mm = 1",
            &["scene.toml:", "`hight_mm`", "`height_mm`"],
        ),
        (
            "[tool]\n[[physics]]\nsolver = \"yarn\"",
            &["scene.toml: `physics` is a list, expected a table"],
        ),
        (
            "[tool]\npose.rotation_deg = [1, 2, 3, 4, 5]",
            &["scene.toml:2:21: `tool.pose.rotation_deg` is a list of 5, expected 3"],
        ),
        (
            "[tool]\n[blank]\nsize_mm = [-370, 370]\n[[clamps]]\nat_mm = [0, -185]",
            &["scene.toml: `blank.size_mm` is [-370.0, 370.0], expected two lengths"],
        ),
        (
            "[tool]\nsource.shape = { kind = \"rib\", vertex_counts = [4096, 4096] }",
            &[
                "`tool.source.shape.vertex_counts` is 4096 x 4096 = 16777216 vertices, expected at most",
            ],
        ),
        (
            "clamps = [[[0, 0], 1.0, [0, 0, 1e9]]]\n[tool]",
            &["scene.toml: `clamps[]` is a list, expected a table"],
        ),
        (
            "[tool.source.shape]\nkind = \"hemisphere\"\n[placement]\nheight_mm = 10\ntilt_deg = 0",
            &[
                "scene.toml: `placement.height_mm` is 10, expected",
                "mm inside",
            ],
        ),
        (
            "[tool.source.file]\n",
            &["scene.toml:1:", "`file`", "`stl`"],
        ),
    ] {
        assert_failure(&set_up(path, text), 2, words);
    }
    assert_eq!(names(path), ["latin.toml", "scene.toml"]);
}

#[test]
fn values_out_of_range_are_located() {
    let folder = folder();
    for (text, words) in [
        (
            "[tool]\n[fall]\nfall_s = nan",
            &["`fall.fall_s` is NaN", "from 0 to 600"][..],
        ),
        (
            "[tool]\n[fall]\nsettle_damping = inf",
            &["`fall.settle_damping` is inf"],
        ),
        (
            "[tool]\n[fall]\nsubstep_rate = 1",
            &["`fall.substep_rate` is 1,", "60"],
        ),
        (
            "[tool]\n[blank]\nvertices = [1, 9]",
            &["`blank.vertices` is [1, 9]", "2 to 1025"],
        ),
        (
            "[tool]\n[blank]\nsize_mm = [nan, 9]",
            &["`blank.size_mm` is [NaN, 9.0]"],
        ),
        (
            "[tool]\n[placement]\ntilt_deg = 90",
            &["`placement.tilt_deg` is 90"],
        ),
        (
            "[tool]\n[placement]\nheight_mm = -inf",
            &["`placement.height_mm` is -inf"],
        ),
        (
            "[tool]\n[fall]\ncontact_rate = 0",
            &["`fall.contact_rate` is 0"],
        ),
        (
            "[tool]\n[physics]\ngravity = nan",
            &["`physics.gravity` is NaN"],
        ),
        (
            "[tool]\n[[clamps]]\nat_mm = [nan, 0]",
            &["`clamps[0].at_mm` is [NaN, 0.0]"],
        ),
        (
            "[tool]\n[[clamps]]\nat_mm = [0, 900]",
            &["`clamps[0].at_mm` is [0.0, 900.0]"],
        ),
        (
            "[tool.pose]\nrotation_deg = [0, 0, nan]",
            &["`tool.pose.rotation_deg` is NaN"],
        ),
        (
            "[tool.grid]\nspacing_mm = 0",
            &["`tool.grid.spacing_mm` is 0"],
        ),
        (
            "[tool.grid]\nspacing_mm = 0.01",
            &["grid of", " MiB", "set `tool.grid.spacing_mm` to 1 or more"],
        ),
        (
            "[tool.source.shape]\nkind = \"plate\"\nbase_mm = inf",
            &["`tool.source.shape.base_mm` is inf"],
        ),
        (
            "[tool.source.mesh]\npath = \"a.stl\"\nscale = -1",
            &["`tool.source.mesh.scale` is -1"],
        ),
    ] {
        let output = set_up(folder.path(), text);
        assert_failure(&output, 2, words);
        assert_failure(&output, 2, &["error: scene.toml: "]);
    }
}

#[test]
fn sizes_of_another_unit_are_told() {
    let folder = folder();
    let path = folder.path();
    stdout(path, &["tool", "rib", "--out", "a.stl"]);
    let text = |scale: &str| {
        let tool = format!("[tool.source.stl]\npath = \"a.stl\"\nscale = {scale}\n");
        scene(&tool)
    };
    // Metres that are read as millimetres.
    let output = set_up(path, &text("1e-6"));
    assert!(output.status.success());
    let stderr = String::from_utf8(output.stderr).unwrap();
    let warning = "warning: scene.toml: the tool measures 0.480 mm, expected 1 mm to 50 m";
    assert!(stderr.starts_with(warning), "{stderr}");
    // And the other way round.
    let words = ["scene.toml: a grid of", "check the size of the tool"];
    assert_failure(&set_up(path, &text("1.0")), 2, &words);
    let args = ["compare", "a.stl", "a.stl", "--scale", "1", "--json"];
    let stderr = String::from_utf8(drape(path, &args).stderr).unwrap();
    assert!(
        stderr.starts_with("warning: a.stl measures 480000.000 mm"),
        "{stderr}"
    );

    let args = [
        "scene",
        "scene.toml",
        "--out",
        "b",
        "--state",
        "none/a.json",
    ];
    fs::write(path.join("scene.toml"), scene(RIB)).unwrap();
    assert_failure(&drape(path, &args), 1, &["folder none does not exist"]);
    assert!(!path.join("b").exists());
}

#[test]
fn materials_are_read_from_the_folder_of_the_scene() {
    let folder = folder();
    let path = folder.path();
    let text = format!("material = \"cloth.toml\"\n{}", scene(RIB));
    assert_failure(
        &set_up(path, &text),
        2,
        &["scene.toml: ", "cannot read cloth.toml"],
    );

    let cloth = include_str!("../../configs/materials/interglas-92125.toml");
    fs::create_dir(path.join("sub")).unwrap();
    fs::write(path.join("sub/cloth.toml"), cloth).unwrap();
    fs::write(path.join("sub/scene.toml"), &text).unwrap();
    json(path, &["scene", "sub/scene.toml", "--out", "out", "--json"]);

    for (from, to, words) in [
        (
            "thickness_mm = 0.35",
            "thickness_mm = nan",
            &["`thickness_mm` is NaN"][..],
        ),
        (
            "thickness_mm = 0.35",
            "thick_mm = 0.35",
            &["cloth.toml:", "`thick_mm`"],
        ),
        ("thickness_mm = 0.35", "thickness_mm = [", &["cloth.toml:"]),
    ] {
        fs::write(path.join("cloth.toml"), cloth.replace(from, to)).unwrap();
        assert_failure(&set_up(path, &text), 2, words);
    }
}

#[test]
fn broken_stl_files_are_refused() {
    let folder = folder();
    let path = folder.path();
    let whole = include_bytes!("../../assets/rib.stl");
    let mut infinite = whole[..84 + 50].to_vec();
    infinite[80..84].copy_from_slice(&1_u32.to_le_bytes());
    infinite[84 + 12..84 + 16].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let flat = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 1 1\nvertex 2 2 2\n\
                endloop\nendfacet\nendsolid\n";
    let cut = flat.replace("endsolid\n", "");
    let word = flat.replace("1 1 1", "1 x 1");
    let text = scene("[tool.source.stl]\npath = \"mine.stl\"\n");
    assert_failure(
        &set_up(path, &text),
        2,
        &["scene.toml: cannot read the tool", "mine.stl"],
    );
    for (content, words) in [
        (&b""[..], &["mine.stl: file is empty"][..]),
        (
            b"what is this?",
            &["neither a binary nor an ASCII STL file"],
        ),
        (&whole[..5000], &["truncated after facet 98 of 9146"]),
        (&infinite, &["corner 1 of facet 1 is at [inf, "]),
        (b"solid\nendsolid\n", &["no facets"]),
        (flat.as_bytes(), &["all 1 facets have zero area"]),
        (cut.as_bytes(), &["truncated after facet 1", "endsolid"]),
        (word.as_bytes(), &["line 5: expected a number, found \"x\""]),
    ] {
        fs::write(path.join("mine.stl"), content).unwrap();
        assert_failure(&set_up(path, &text), 2, words);
        assert_failure(&set_up(path, &text), 2, &["scene.toml: ", "mine.stl: "]);
    }
    assert!(!path.join("out").exists());
    // What was there stays.
    fs::create_dir(path.join("out")).unwrap();
    assert_failure(&set_up(path, &text), 2, &[]);
    assert_eq!(names(&path.join("out")), [""; 0]);
}

#[test]
fn diverging_fall_is_a_failure_at_work() {
    let folder = folder();
    let text = scene(RIB) + "[physics]\ngravity = 1e9\nspeed_cap = 0\n";
    assert_failure(
        &set_up(folder.path(), &text),
        1,
        &["scene.toml: the fall diverged after "],
    );
    assert!(!folder.path().join("out").exists());
}

#[test]
fn output_folders_that_cannot_be_used_are_named() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("scene.toml"), scene(RIB)).unwrap();
    fs::write(path.join("file"), "").unwrap();
    for out in ["file", "file/out"] {
        let output = drape(path, &["scene", "scene.toml", "--out", out]);
        assert_failure(&output, 1, &["cannot create folder file"]);
    }
    fs::create_dir_all(path.join("out/top.png")).unwrap();
    let output = drape(path, &["scene", "scene.toml", "--out", "out"]);
    assert_failure(&output, 1, &["cannot write out/top.png"]);
    assert_eq!(names(&path.join("out")), ["top.png"]);
}

/// A state that is not at rest is told, not taken for a drape.
#[test]
fn a_blank_that_still_moves_is_noticed() {
    let folder = folder();
    let path = folder.path();
    let stderr = |text: &str| {
        let output = set_up(path, text);
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let moving = stderr(&scene(RIB).replace("settle_s = 0.5", "settle_s = 0.1"));
    let start = "warning: scene.toml: after the fall the blank still moves at ";
    assert!(moving.starts_with(start), "{moving}");
    assert!(moving.contains("`fall.settle_s`"), "{moving}");
    assert_eq!(stderr(&scene(RIB)), "");
}

/// Where the blank is not over the tool, and where clamps hold it over it.
#[test]
fn misplaced_blanks_are_told() {
    let folder = folder();
    let path = folder.path();
    let output = set_up(path, &(scene(RIB) + "[placement]\ncentre_mm = [500, 0]\n"));
    let words = [
        "scene.toml: `placement.centre_mm` is [500.0, 0.0], expected one at which the blank is over \
         the tool, whose middle is at [",
    ];
    assert_failure(&output, 2, &words);
    let warning = "warning: scene.toml: `clamps[0]` holds the blank 158.4 mm off the tool, expected at most 15";
    let text = scene(RIB).replace("at_mm = [0, -185]", "at_mm = [0, 185]");
    let output = set_up(path, &text);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{stderr}");
    assert!(stderr.starts_with(warning), "{stderr}");
}

/// Training refuses what a scene warns of.
#[test]
fn a_blank_that_misses_the_tool_is_noticed() {
    let folder = folder();
    let path = folder.path();
    let text = scene(RIB) + "[placement]\nheight_mm = 2000\n";
    let output = set_up(path, &text);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{stderr}");
    assert!(
        stderr.starts_with("warning: scene.toml: after the fall the blank is "),
        "{stderr}"
    );
    fs::write(path.join("run.toml"), "scene_file = \"scene.toml\"\n").unwrap();
    let output = drape(path, &["train", "run.toml", "--name", "a"]);
    let words = [
        "run.toml: after the fall the blank is ",
        "expected at most 50 mm",
    ];
    assert_failure(&output, 2, &words);
    assert!(!path.join("runs").exists());
}
