//! The robot from a run to a program.

use super::run::*;
use super::*;

/// A UR5e beside the rib.
const CELL: &str = r#"
robot = "ur5e"

[base]
at_mm = [-550, -150, 0]

[turntable]
step_deg = 90
"#;

/// From a run and a cell to a program: every point is pressed or listed, nothing is hit, and all formats are of one plan.
#[test]
fn a_run_becomes_a_program() {
    let folder = trained();
    let path = folder.path();
    fs::write(path.join("cell.toml"), CELL).unwrap();
    let args = ["robot", "runs/a", "--cell", "cell.toml", "--json"];
    let report = json(path, &args);
    let count = |key: &str| report[key].as_u64().unwrap();
    let failed = report["failed"].as_array().unwrap();
    assert_eq!(count("points"), count("reachable") + failed.len() as u64);
    assert!(count("reachable") > 0, "{report}");
    assert_eq!(report["collisions"], serde_json::json!([]));
    for point in failed {
        for key in ["check", "detail", "tried", "remedy"] {
            assert!(
                point[key].as_str().is_some_and(|text| !text.is_empty()),
                "{point}"
            );
        }
    }
    let reached = report["reached"].as_object().unwrap();
    let all: u64 = reached.values().map(|count| count.as_u64().unwrap()).sum();
    assert_eq!(all, count("points"));
    let left = names(&path.join("runs/a/robot"));
    assert!(
        left.contains(&"cell.toml".into()) && left.contains(&"program.gif".into()),
        "{left:?}"
    );
    // The same again, from the cell that the run keeps now.
    let again = json(path, &["robot", "runs/a", "--json"]);
    assert_eq!(again["failed"], report["failed"]);
    assert_eq!(again["program_s"], report["program_s"]);
    for (format, begins) in [
        ("rapid", "MODULE drape_a\n"),
        ("urscript", "def drape_program():"),
        ("trajectory", "# a: written by drape for a UR5e"),
        ("joints-json", "{"),
        ("joints-csv", "# drape robot points 1"),
    ] {
        let args = [
            "export", "runs/a", "--format", format, "--out", "program", "--json",
        ];
        let exported = json(path, &args);
        for key in ["points", "reachable", "strokes", "program_s"] {
            assert_eq!(exported[key], report[key], "{format}");
        }
        let text = fs::read_to_string(path.join("program")).unwrap();
        assert!(text.starts_with(begins), "{format}: {text}");
    }
}

#[test]
fn wrong_cells_are_one_line() {
    let folder = trained();
    let path = folder.path();
    for (cell, words) in [
        (
            "robot = \"r2d2\"",
            &["cell.toml", "`robot` is \"r2d2\"", "crb15000-5, ur5e"][..],
        ),
        (
            "robot = \"ur5e\"\nrobot_file = \"a\"",
            &["cell.toml", "expected one of the two"],
        ),
        ("wheels = 4", &["cell.toml:1", "wheels"]),
        (
            "[limits]\ntilt_deg = nan",
            &[
                "cell.toml",
                "limits.tilt_deg",
                "expected a number from 0 to 80",
            ],
        ),
        (
            "[base]\nat_mm = [0, 0, 0]",
            &["cell.toml", "`base.at_mm`", "into the tool"],
        ),
        (
            "[roller]\nwidth_mm = -1",
            &["cell.toml", "roller.width_mm", "-1"],
        ),
        ("robot_file = \"arm.urdf\"", &["arm.urdf", "No such file"]),
    ] {
        fs::write(path.join("cell.toml"), cell).unwrap();
        let output = drape(path, &["robot", "runs/a", "--cell", "cell.toml", "--json"]);
        assert_failure(&output, 2, words);
    }
    assert!(!path.join("runs/a/robot").exists());
    // An arm that can wait nowhere is refused before a training that ends with its plan, not after it.
    let folder = super::folder();
    let cell = format!("home_deg = [0, 120, 0, 0, 0, 0]\n{CELL}");
    fs::write(folder.path().join("cell.toml"), cell).unwrap();
    let config = format!("cell_file = \"cell.toml\"\n{CONFIG}");
    let output = refused(folder.path(), &config);
    assert_failure(&output, 2, &["config.toml", "cell", "`home_deg`"]);
    assert!(!folder.path().join("runs/a").exists());
}

/// A robot that reaches part of the region only: what it cannot press is not learned, and the proved path has none of it.
#[test]
fn what_a_robot_cannot_press_is_masked() {
    let folder = folder();
    let path = folder.path();
    // So far away that the arm ends over the region.
    let cell = CELL
        .replace("[-550, -150, 0]", "[-1150, -150, 0]")
        .replace("[turntable]\nstep_deg = 90\n", "");
    fs::write(
        path.join("cell.toml"),
        format!("{cell}\n[limits]\ndeviation_mm = 0\ndeviation_deg = 0\n"),
    )
    .unwrap();
    let with = format!("cell_file = \"cell.toml\"\n{CONFIG}");
    train(path, &with, "with");
    let report = json(path, &["robot", "runs/with", "--json"]);
    assert_eq!(report["failed"], serde_json::json!([]), "{report}");
    let without = trained();
    fs::write(
        without.path().join("cell.toml"),
        fs::read(path.join("cell.toml")).unwrap(),
    )
    .unwrap();
    let args = ["robot", "runs/a", "--cell", "cell.toml", "--json"];
    let other = json(without.path(), &args);
    let mut failed = other["failed"].as_array().unwrap().iter();
    assert!(failed.any(|point| point["check"] == "reach"), "{other}");
}
