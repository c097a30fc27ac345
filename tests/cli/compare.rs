use super::run::{CONFIG, number, train, trained};
use super::*;

/// Sets the coarse rib up and leaves its state in `name`.
fn state(folder: &Path, name: &str) {
    fs::write(folder.join("scene.toml"), scene(RIB)).unwrap();
    let args = ["scene", "scene.toml", "--out", "out", "--state", name];
    stdout(folder, &args);
}

fn check_null(report: &Value, keys: &[&str]) {
    for key in keys {
        assert!(report[key].is_null(), "{key}: {}", report[key]);
    }
}

#[test]
fn state_file_against_itself_and_moved() {
    let folder = folder();
    let path = folder.path();
    state(path, "a.json");
    // A state file is complete: it needs neither scene nor tool.
    let mut moved: Value = serde_json::from_slice(&fs::read(path.join("a.json")).unwrap()).unwrap();
    for x in moved["position"].as_array_mut().unwrap() {
        x[0] = (number(&x[0]) + 0.003).into();
        x[2] = (number(&x[2]) + 0.002).into();
    }
    fs::write(path.join("b.json"), moved.to_string()).unwrap();

    let same = json(path, &["compare", "a.json", "a.json", "--json"]);
    assert_eq!(same["a_source"]["kind"], "state");
    assert!(number(&same["hausdorff_mm"]) < 1e-9);
    assert!(number(&same["contour_a_to_b_mm"]["max"]) < 1e-9);
    check_null(&same, &["inside", "outside", "tool_source", "picture"]);
    assert_eq!(same["a"], same["b"]);
    check_null(&same["a"], &["tool"]);
    assert_eq!(same["not_applicable"][0]["metrics"][0], "tool");

    let args = ["compare", "b.json", "a.json", "--config", "scene.toml"];
    let more = ["--region", "-100,-100,100,100", "--out", "b.png", "--json"];
    let report = json(path, &[&args[..], &more].concat());
    let distance = number(&report["material_points_mm"]["mean"]);
    assert!((distance - 13f64.sqrt()).abs() < 1e-6, "{distance}");
    for part in ["inside", "outside"] {
        let distance = number(&report[part]["material_points_mm"]["max"]);
        assert!((distance - 13f64.sqrt()).abs() < 1e-6, "{part}: {distance}");
        assert_eq!(report[part]["fibre_angle_deg"][0]["share_below"], 1.0);
    }
    assert!(number(&report["topology_a_to_b_mm"]["mean"]) > 1.0);
    assert!(number(&report["topology_b_to_a_mm"]["mean"]) < -1.0);
    assert_eq!(report["not_applicable"].as_array().unwrap().len(), 0);
    let summary: Value =
        serde_json::from_slice(&fs::read(path.join("out/summary.json")).unwrap()).unwrap();
    let strain = number(&report["b"]["strain"]["tension_max"]);
    assert!((strain / number(&summary["tension_max"]) - 1.0).abs() < 1e-6);
    let bridged = |k: &str| number(&report[k]["tool"]["bridged_share"]);
    assert!(bridged("a") > bridged("b") && bridged("b") > 0.0);
    let png = fs::read(path.join("b.png")).unwrap();
    assert!(png.starts_with(b"\x89PNG"));

    let text = stdout(path, &args);
    assert!(
        text.starts_with("A  b.json\nB  a.json (reference)\ntool of scene.toml\n"),
        "{text}"
    );
    assert!(text.contains("\nall   warp angle "), "{text}");
    assert!(!text.contains("not applicable"), "{text}");
}

/// A mesh has no yarns; what is left agrees with the state it was made from.
#[test]
fn stl_gives_the_surface_figures_only() {
    let folder = folder();
    let path = folder.path();
    state(path, "a.json");
    let args = ["compare", "out/lamina.stl", "a.json", "--region", "0,0,9,9"];
    let report = json(path, &[&args[..], &["--json"]].concat());
    assert_eq!(report["a_source"]["kind"], "stl");
    assert!(number(&report["hausdorff_mm"]) < 1e-4);
    check_null(
        &report,
        &["material_points_mm", "fibre_angle_deg", "inside", "outside"],
    );
    check_null(&report["a"], &["shear_deg", "strain"]);
    assert!(report["b"]["strain"].is_object());
    let wrinkles = |k: &str| report[k]["wrinkles_mm"]["amplitude"].clone();
    assert!((number(&wrinkles("a")) - number(&wrinkles("b"))).abs() < 1e-3);
    let reasons = report["not_applicable"].as_array().unwrap();
    assert_eq!(reasons.len(), 4);
    assert_eq!(
        reasons[0]["why"],
        "no material coordinates: A is a mesh only"
    );
    let text = stdout(path, &args);
    assert!(
        text.contains("not applicable: material_points_mm, fibre_angle_deg (no"),
        "{text}"
    );
}

/// Equal but for the last digits that a file may change.
fn same_measures(a: &Value, b: &Value) {
    for (key, value) in a.as_object().unwrap() {
        match value.as_f64() {
            Some(value) => assert!((value - number(&b[key])).abs() < 1e-6, "{key}: {a} {b}"),
            None => same_measures(value, &b[key]),
        }
    }
}

/// A run is the path it has proved, pressed in fine steps, and before that its best sequence in its
/// own: the states that `eval` leaves.
#[test]
fn run_is_the_state_of_its_path() {
    let folder = trained();
    let path = folder.path();
    let [proof, best] = ["runs/a/proof.json", "runs/a/best_sequence.json"].map(|f| path.join(f));
    let read = |file| serde_json::from_str::<Value>(&fs::read_to_string(file).unwrap()).unwrap();
    let own = fs::read(&best).unwrap();
    let mut proved = read(&best);
    proved["vertices"] = read(&proof)["path"]["vertices"].clone();
    fs::write(&best, proved.to_string()).unwrap();
    let args = ["eval", "runs/a", "--sequence", "--episodes", "1", "--json"];
    let finely = ["--accuracy", "accurate", "--state", "fine.json"];
    json(path, &[&args[..], &finely].concat());
    let report = json(path, &["compare", "runs/a", "fine.json", "--json"]);
    assert!(number(&report["material_points_mm"]["max"]) < 1e-9);
    fs::write(&best, own).unwrap();
    fs::remove_file(&proof).unwrap();
    let played = json(path, &[&args[..], &["--state", "a.json"]].concat());
    let report = json(path, &["compare", "runs/a", "a.json", "--json"]);
    // The one by the tool itself, the other by its grid of 12 mm.
    let surplus = 1e-3 * number(&report["a"]["tool"]["surplus_mm"]);
    let expected = number(&played["episode"]["sheet_surplus_final_m"]);
    assert!(
        (surplus / expected - 1.0).abs() < 0.1,
        "{surplus}, {expected}"
    );
    assert_eq!(report["a_source"]["kind"], "run");
    assert_eq!(report["tool_source"], "runs/a");
    assert!(number(&report["material_points_mm"]["max"]) < 1e-9);
    same_measures(&report["a"], &report["b"]);
    assert!(number(&report["a"]["tool"]["bridged_share"]) > 0.0);
    let args = [
        "compare",
        "a.json",
        "a.json",
        "--config",
        "runs/a/config.toml",
    ];
    let again = json(path, &[&args[..], &["--json"]].concat());
    same_measures(&again["a"], &report["a"]);
}

#[test]
fn runs_with_different_tools_need_one_to_be_chosen() {
    let folder = trained();
    let path = folder.path();
    let other = CONFIG
        .replace("steps = 240", "steps = 80")
        .replace("kind = \"rib\"", "kind = \"rib\"\nheight_mm = 50");
    train(path, &other, "b");
    let args = ["compare", "runs/a", "runs/b"];
    assert_failure(
        &drape(path, &args),
        2,
        &["runs/a and runs/b have different tools", "--config"],
    );
    let more = ["--config", "runs/a/config.toml", "--json"];
    let report = json(path, &[&args[..], &more].concat());
    assert_eq!(report["tool_source"], "runs/a/config.toml");
    assert!(report["b"]["tool"].is_object());
}

#[test]
fn what_cannot_be_compared_is_refused_in_one_line() {
    let folder = folder();
    let path = folder.path();
    state(path, "a.json");
    fs::write(path.join("text.json"), "{}").unwrap();
    fs::write(path.join("bad.stl"), "solid\nfacet\n").unwrap();
    fs::write(path.join("bad.toml"), "[tool\n").unwrap();
    fs::create_dir(path.join("empty")).unwrap();
    for (args, words) in [
        (&["none.json", "a.json"][..], &["there is no none.json"][..]),
        (
            &["a.json", "text.json"],
            &["text.json: not a state file", "format"],
        ),
        (&["a.json", "bad.stl"], &["bad.stl: truncated"]),
        (&["empty", "a.json"], &["empty is not a run folder"]),
        (
            &["a.json", "a.json", "--scale", "7"],
            &["--scale is for STL files, found none"],
        ),
        (
            &["a.json", "a.json", "--config", "none.toml"],
            &["cannot read none.toml"],
        ),
        (
            &["a.json", "a.json", "--config", "bad.toml"],
            &["bad.toml:1:6"],
        ),
    ] {
        let args = [&["compare"], args].concat();
        assert_failure(&drape(path, &args), 2, words);
    }
    let far = "--region=500,0,1001.1,1001";
    assert_failure(
        &drape(path, &["compare", "a.json", "a.json", far]),
        2,
        &[
            "--region 500,0,1001.1,1001 has no vertex of a.json",
            "x -185.0 to 185.0 mm, y -185.0 to 185.0 mm",
        ],
    );
    for (option, value) in [
        ("--region", "1,2,3"),
        ("--region", "3,2,1,4"),
        ("--region", "0,0,nan,4"),
        ("--range", "0"),
        // Of a picture that nobody asked for.
        ("--range", "3"),
    ] {
        let output = drape(path, &["compare", "a.json", "a.json", option, value]);
        assert_eq!(output.status.code(), Some(2), "{option} {value}");
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(
            stderr.contains(option) && output.stdout.is_empty(),
            "{stderr}"
        );
    }
    let args = ["compare", "a.json", "a.json", "--out", "none/a.png"];
    assert_failure(&drape(path, &args), 1, &["none does not exist"]);
}
