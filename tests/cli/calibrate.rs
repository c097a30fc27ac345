use super::run::number;
use super::*;

/// Tests of everything, two specimens each, of a fabric of one slope.
const TESTS: [(&str, &str); 5] = [
    (
        "tension.csv",
        "direction,specimen,strain_percent,force_n_per_mm\n\
         warp,a,0,0\nwarp,a,0.5,1.0\nwarp,a,1,2.0\nwarp,b,0.5,1.1\nwarp,b,1,2.2\n\
         weft,a,0.5,2.0\nweft,a,1,4.0\nweft,b,0.5,2.2\nweft,b,1,4.4\n",
    ),
    (
        "bias.csv",
        "specimen,displacement_mm,force_n,length_mm,width_mm\n\
         1,5,1,300,100\n1,10,2.2,300,100\n2,5,1.1,300,100\n2,10,2.4,300,100\n",
    ),
    (
        "friction.csv",
        "static_angle_deg,dynamic_angle_deg\n15,14\n16,14.5\n",
    ),
    (
        "sheet.csv",
        "thickness_mm;areal_mass_g_m2\n0,35;280\n0,36;284\n",
    ),
    (
        "cantilever.csv",
        "direction,overhang_mm\nwarp,56\nwarp,58\nweft,40\nweft,41\n",
    ),
];

fn written(folder: &Path) -> Vec<&'static str> {
    for (name, text) in TESTS {
        fs::write(folder.join(name), text).unwrap();
    }
    TESTS.iter().map(|(name, _)| *name).collect()
}

#[test]
fn tests_become_a_material_that_scenes_read() {
    let folder = folder();
    let path = folder.path();
    let tests = written(path);
    let all = [&["calibrate", "--test"], &tests[..], &["--out", "m.toml"]].concat();
    let more = ["--picture", "fit.png", "--json"];
    let report = json(path, &[&all[..], &more].concat());
    let names: Vec<&str> = report["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["name"].as_str().unwrap())
        .collect();
    for name in [
        "thickness_mm",
        "warp bending [N m]",
        "shear.negative slope 1 [MPa]",
    ] {
        assert!(names.contains(&name), "{names:?}");
    }
    for parameter in report["parameters"].as_array().unwrap() {
        let [low, value, high] = ["low", "value", "high"].map(|key| number(&parameter[key]));
        assert!(low <= value && value <= high, "{parameter}");
        assert_eq!(parameter["specimens"], 2);
    }
    for quantity in ["friction", "bending", "shear", "tension", "areal_mass"] {
        assert!(number(&report["scatter"][quantity]) > 0.0, "{quantity}");
    }
    let png = fs::read(path.join("fit.png")).unwrap();
    assert!(png.starts_with(b"\x89PNG"));
    let written = fs::read(path.join("m.toml")).unwrap();
    let text = stdout(path, &all);
    assert!(text.contains("[scatter]\nfriction = "), "{text}");
    assert!(text.ends_with("material in m.toml\n"), "{text}");
    assert_eq!(fs::read(path.join("m.toml")).unwrap(), written);

    let text = format!("material = \"m.toml\"\n{}", scene(RIB));
    let output = set_up(path, &text);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );

    // Kept from what was written, but for what is measured again.
    let args = [
        "calibrate",
        "--test",
        "friction.csv",
        "--material",
        "m.toml",
        "--out",
        "n.toml",
    ];
    let report = json(path, &[&args[..], &["--json"]].concat());
    let kept = report["kept"].to_string();
    assert!(
        kept.contains("warp.tension") && !kept.contains("friction"),
        "{kept}"
    );
    let lines = |name: &str| -> Vec<String> {
        let text = fs::read_to_string(path.join(name)).unwrap();
        let of_table = text
            .lines()
            .filter(|line| !line.starts_with('#') && !line.starts_with("name"));
        of_table.map(Into::into).collect()
    };
    assert_eq!(lines("m.toml"), lines("n.toml"));
}

#[test]
fn what_tests_cannot_tell_is_said_or_refused() {
    let folder = folder();
    let path = folder.path();
    written(path);
    let fails = |file: &str, text: &str, words: &[&str]| {
        fs::write(path.join(file), text).unwrap();
        let output = drape(path, &["calibrate", "--test", file, "--out", "m.toml"]);
        assert_failure(&output, 2, words);
        assert!(!path.join("m.toml").exists());
    };
    fails("a.csv", "", &["a.csv: is empty", "expected a header"]);
    fails(
        "a.csv",
        "92,warp\n95,warp\n",
        &["a.csv: line 1: column 1 is \"92\""],
    );
    let expected = "expected overhang_mm or overhang_cm";
    fails(
        "a.csv",
        "overhang_inch,direction\n4,warp\n",
        &["overhang_inch", expected],
    );
    let text = "direction,strain,force_n_per_mm\nwarp,0.01,-2\n";
    fails(
        "a.csv",
        text,
        &[
            "a.csv: line 2",
            "`force_n_per_mm` is \"-2\"",
            "expected a number >= 0",
        ],
    );
    fails(
        "friction.csv",
        TESTS[2].1,
        &["nothing tells thickness_mm", "warp.tension"],
    );
    let flat = "direction,strain,stress_mpa\nwarp,0.01,0\nwarp,0.02,0\n";
    fails(
        "a.csv",
        flat,
        &["a.csv: warp.tension: specimen 1 has no two points"],
    );
    let output = drape(path, &["calibrate", "--out", "m.toml"]);
    assert_eq!(output.status.code(), Some(2));

    fs::write(
        path.join("base.toml"),
        include_str!("../../configs/materials/interglas-92125.toml"),
    )
    .unwrap();
    fs::write(path.join("one.csv"), "direction,overhang_mm\nwarp,56\n").unwrap();
    let args = [
        "calibrate",
        "--test",
        "one.csv",
        "--material",
        "base.toml",
        "--out",
        "m.toml",
    ];
    let text = stdout(path, &args);
    for words in [
        "the spread of bending is unknown: there is one specimen of it",
        "interval unknown  1 specimen",
        "kept: thickness_mm",
    ] {
        assert!(text.contains(words), "no `{words}` in {text}");
    }
    assert!(!text.contains("[scatter]"), "{text}");
}

/// A strip over a cylinder.
fn strip(bending: f64) -> String {
    format!(
        "[tool.source.shape]\nkind = \"cylinder\"\nradius_mm = 30\nlength_mm = 100\n\
         [tool.grid]\nspacing_mm = 4\n\
         [blank]\nsize_mm = [140, 30]\nvertices = [15, 4]\n\
         [placement]\nover = \"tool\"\nheight_mm = 1\ntilt_deg = 0\n\
         [fall]\nfall_s = 0.4\nsettle_s = 0.5\nsubstep_rate = 3000\ncontact_rate = 600\n\
         [physics]\nbending_stiffness = {{ newton_metre = {bending} }}\n"
    )
}

#[test]
fn scan_of_a_strip_tells_its_bending() {
    let folder = folder();
    let path = folder.path();
    let truth = 1.6;
    fs::write(path.join("truth.toml"), strip(truth * 2e-4)).unwrap();
    stdout(
        path,
        &[
            "scene",
            "truth.toml",
            "--out",
            "seen",
            "--state",
            "seen.json",
        ],
    );
    fs::write(path.join("strip.toml"), strip(2e-4)).unwrap();
    let args = [
        "calibrate",
        "strip.toml",
        "--scan",
        "seen/lamina.stl",
        "--out",
        "m.toml",
        "--json",
    ];
    let report = json(path, &args);
    let parameter = |name: &str| {
        let all = report["parameters"].as_array().unwrap();
        all.iter().find(|p| p["name"] == name).unwrap().clone()
    };
    let bending = parameter("bending");
    let value = number(&bending["value"]);
    assert!((value / truth - 1.0).abs() < 0.05, "{report:#}");
    assert!(number(&bending["low"]) <= truth && truth <= number(&bending["high"]));
    assert_eq!(bending["told"], true);
    assert!(number(&report["scatter"]["bending"]) > 0.0);
    // Nothing slides or stretches there.
    for name in ["friction", "tension"] {
        assert_eq!(parameter(name)["told"], false, "{report:#}");
    }
    assert!(number(&report["rms_mm"]) < 0.1, "{report:#}");
    let text = fs::read_to_string(path.join("m.toml")).unwrap();
    assert!(
        text.contains("physics.bending_stiffness = { newton_metre = 0.0003"),
        "{text}"
    );

    let fails = |args: &[&str], words: &[&str]| {
        assert_failure(&drape(path, &[&["calibrate"], args].concat()), 2, words);
    };
    let two = ["strip.toml", "truth.toml", "--scan", "seen.json"];
    fails(&two, &["2 scenes and 1 scans"]);
    let metres = [
        "strip.toml",
        "--scan",
        "seen/lamina.stl",
        "--scale",
        "1",
        "--out",
        "none.toml",
    ];
    fails(&metres, &["seen/lamina.stl", "check --scale"]);
    assert!(!path.join("none.toml").exists());
    let run = [".", "--scan", "seen.json", "--presses", "points.json"];
    fails(&run, &["`--presses` is for scenes"]);
    // Beside one that lies on the cloth one that does not would say nothing, and the same twice too much.
    let far = "0 0 90000\n1 0 90000\n0 1 90000\n";
    fs::write(path.join("far.xyz"), far).unwrap();
    // Without progress, as this takes its time.
    let both = [
        "strip.toml",
        "--json",
        "--scan",
        "seen/lamina.stl",
        "far.xyz",
    ];
    fails(&both, &["far.xyz: 0 % of its points"]);
    let twice = ["strip.toml", "--scan", "seen/lamina.stl", "seen/lamina.stl"];
    fails(&twice, &["expected scans of several blanks"]);
    let over = ["strip.toml", "--scan", "seen.json", "--out", "seen.json"];
    fails(&over, &["seen.json would be replaced"]);
    fs::write(path.join("scan.stl"), "solid\n").unwrap();
    fails(&["strip.toml", "--scan", "scan.stl"], &["scan.stl"]);
}
