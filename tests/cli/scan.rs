//! Scenes that start from what a scanner saw.

use super::run::*;
use super::*;

/// A coarse blank on the rib whose scan is `keys` of its placement.
fn scanned(keys: &str) -> String {
    format!("{}[placement]\n{keys}\n", scene(RIB))
}

/// Corners of the facets of `out/lamina.stl` [mm].
fn lamina(folder: &Path) -> Vec<[f64; 3]> {
    let bytes = fs::read(folder.join("out/lamina.stl")).unwrap();
    let number = |at: usize| f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()));
    let corners = (84..bytes.len())
        .step_by(50)
        .flat_map(|at| [12, 24, 36].map(|k| at + k));
    corners
        .map(|at| [0, 4, 8].map(|k| number(at + k)))
        .collect()
}

fn text(points: impl IntoIterator<Item = [f64; 3]>) -> String {
    let lines = points.into_iter().map(|[x, y, z]| format!("{x},{y},{z}\n"));
    lines.collect()
}

/// What a scene leaves is scanned where it lies, and found again; a scan from elsewhere is found by marks.
#[test]
fn a_scene_starts_from_its_own_scan() {
    let folder = folder();
    let path = folder.path();
    let fallen = set_up(path, &scene(RIB));
    assert!(fallen.status.success());
    let points = lamina(path);
    fs::copy(path.join("out/lamina.stl"), path.join("scan.stl")).unwrap();
    let keys = "scan = \"scan.stl\"\nscan_unit = \"mm\"\nscan_frame = \"scene\"";
    fs::write(path.join("scene.toml"), scanned(keys)).unwrap();
    let args = [
        "scene",
        "scene.toml",
        "--out",
        "out",
        "--state",
        "a.json",
        "--json",
    ];
    let report = json(path, &args);
    let fit = |key: &str| report["fit"][key].as_f64().unwrap();
    assert!(
        fit("pulled_mean_mm") < 0.5 && fit("mean_mm") < 1.0,
        "{report}"
    );
    assert!(
        fit("p95_mm") < 3.0 && fit("spring_back_mm") < 2.0,
        "{report}"
    );
    assert_eq!((fit("unseen_share"), fit("stray_share")), (0.0, 0.0));
    let first = fs::read(path.join("a.json")).unwrap();
    let shown = stdout(
        path,
        &["scene", "scene.toml", "--out", "out", "--state", "a.json"],
    );
    assert!(
        shown.contains("\nscan         ") && shown.contains("\nlet go       sprang back by "),
        "{shown}"
    );
    assert!(fs::read(path.join("a.json")).unwrap() == first);

    // Turned by a quarter about z, moved, in centimetres.
    let moved = |[x, y, z]: [f64; 3]| [(100.0 - y) / 10.0, (x + 30.0) / 10.0, (z + 7.0) / 10.0];
    fs::write(
        path.join("scan.csv"),
        "x,y,z\n".to_owned() + &text(points.into_iter().map(moved)),
    )
    .unwrap();
    let mut keys = "scan = \"scan.csv\"\nscan_unit = \"cm\"\n".to_owned();
    for at in [[0.0, 0.0, 60.0], [200.0, 0.0, 0.0], [0.0, 150.0, 30.0]] {
        keys += &format!(
            "[[placement.scan_marks]]\nscene_mm = {at:?}\nseen = {:?}\n",
            moved(at)
        );
    }
    let output = set_up(path, &scanned(&keys));
    let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
    assert!(
        report["fit"]["pulled_mean_mm"].as_f64().unwrap() < 0.5,
        "{report}"
    );
}

#[test]
fn scans_that_cannot_be_are_refused_in_one_line() {
    let folder = folder();
    let path = folder.path();
    assert!(set_up(path, &scene(RIB)).status.success());
    let points = lamina(path);
    let all = text(points.iter().copied());
    let known = "scan_frame = \"scene\"\nscan_unit = \"mm\"";
    let half = text(points.iter().copied().filter(|x| x[0] < -40.0));
    let two = all.clone() + &text(points.iter().map(|&[x, y, z]| [x, y, z + 60.0]));
    for (scan, keys, words) in [
        ("", known, &["scene.toml: scan.xyz: file is empty"][..]),
        (
            "1 2 3\n",
            known,
            &["scan.xyz: has 1 points, expected those of a blank"],
        ),
        (
            &all,
            "",
            &[
                "`placement.scan_unit` is missing",
                "in \"mm\" it would have the size",
            ],
        ),
        (
            &all,
            "scan_unit = \"m\"",
            &["`placement.scan_unit` is \"m\"", "in \"mm\" it would have"],
        ),
        (
            &all,
            "scan_unit = \"yd\"",
            &["scene.toml:", "unknown name `yd`, expected one of `mm`"],
        ),
        (
            &half,
            known,
            &[
                "scan.xyz: no point is within",
                "expected at most 40 % unseen",
            ],
        ),
        (
            &two,
            known,
            &["scan.xyz: ", "off the blank that was pulled on to them"],
        ),
        (
            &all,
            "scan_unit = \"mm\"\nscan_marks = [{ seen = [0, 0, 0] }]",
            &["`placement.scan_marks[0].at_mm` is neither, expected one of `at_mm` and `scene_mm`"],
        ),
        (
            &all,
            "scan_unit = \"mm\"\nscan_marks = [{ seen = [0, 0, 0], at_mm = [0, 0] }]",
            &["scan.xyz: `placement.scan_marks`: 1 marks, expected at least 3"],
        ),
    ] {
        fs::write(path.join("scan.xyz"), scan).unwrap();
        let output = set_up(path, &scanned(&format!("scan = \"scan.xyz\"\n{keys}")));
        assert_failure(&output, 2, words);
    }
    let output = set_up(path, &scanned("scan_unit = \"mm\""));
    assert_failure(
        &output,
        2,
        &["`placement.scan` is missing, expected a file"],
    );
}

/// A run keeps the scan that it was made with. In scattered worlds blanks lie off where it has them.
#[test]
fn a_run_keeps_its_scan() {
    let folder = folder();
    let path = folder.path();
    let keys =
        "[scene.placement]\nscan = \"scan.stl\"\nscan_unit = \"mm\"\nscan_frame = \"scene\"\n";
    let config = |more: &str| format!("{CONFIG}\n{more}");
    // The blank of the run, as it falls.
    let (_, tables) = CONFIG.split_once("[scene.blank]").unwrap();
    let fallen = set_up(path, &format!("[blank]{}", tables.replace("[scene.", "[")));
    assert!(fallen.status.success());
    fs::copy(path.join("out/lamina.stl"), path.join("scan.stl")).unwrap();
    train(path, &config(keys), "a");
    assert_eq!(names(&path.join("runs/a/inputs")), ["scan.stl"]);
    fs::remove_file(path.join("scan.stl")).unwrap();
    json(
        path,
        &["eval", "runs/a", "--sequence", "--episodes", "1", "--json"],
    );

    fs::copy(path.join("runs/a/inputs/scan.stl"), path.join("scan.stl")).unwrap();
    let scatter = "[scatter]\nfriction = 0.1\nsubstep_rates = [600.0]\n";
    fs::write(path.join("task.toml"), config(&format!("{keys}{scatter}"))).unwrap();
    let args = ["baseline", "task.toml", "--policy", "outwards"];
    let more = ["--steps", "120", "--name", "scattered", "--json"];
    let outcome = json(path, &[&args[..], &more].concat());
    let row = &outcome["proof"][0];
    assert_eq!(row["worlds"], 24);
    assert!(number(&row["worst_score"]) < number(&row["score"]), "{row}");
}
