use super::*;

const ARGS: [&str; 7] = [
    "study",
    "stability",
    "--quick",
    "--sweep",
    "speed",
    "--sweep",
    "friction",
];

#[test]
fn stability_writes_table_and_heat_maps_and_counts_every_cell() {
    let folder = folder();
    let path = folder.path();
    let report = json(path, &[&ARGS[..], &["--out", "new/out", "--json"]].concat());
    let count = |of: &Value, key: &str| of[key].as_u64().unwrap() as usize;
    let outcomes = [
        "converged",
        "wrong",
        "diverged",
        "refused",
        "non_finite",
        "panicked",
    ];
    let sweeps = report["sweeps"].as_array().unwrap();
    for of in sweeps.iter().chain([&report]) {
        let sum: usize = outcomes.iter().map(|key| count(of, key)).sum();
        assert_eq!(sum, count(of, "cells"));
        assert_eq!(count(of, "non_finite") + count(of, "panicked"), 0);
    }
    // In the order of the study, not of the options.
    let names_of = |key: &str| {
        sweeps
            .iter()
            .map(|sweep| sweep[key].clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(names_of("name"), ["speed", "friction"]);
    assert!(count(&report, "diverged") > 0 && count(&report, "converged") > 0);
    assert!(report["seconds"].as_f64().unwrap() > 0.0);

    let out = path.join("new/out");
    assert_eq!(
        names(&out),
        [
            "cells.csv",
            "friction-f32.png",
            "friction-f64.png",
            "speed-f32.png",
            "speed-f64.png"
        ]
    );
    assert!(
        fs::read(out.join("speed-f64.png"))
            .unwrap()
            .starts_with(b"\x89PNG")
    );
    let table = fs::read_to_string(out.join("cells.csv")).unwrap();
    let rows: Vec<&str> = table.lines().collect();
    assert_eq!(rows.len(), 1 + count(&report, "cells"));
    let columns = rows[0].split(',').count();
    assert!(rows.iter().all(|row| row.split(',').count() == columns));
    for outcome in ["converged", "wrong", "diverged"] {
        let marked = format!(",{outcome},");
        let found = rows.iter().filter(|row| row.contains(&marked)).count();
        assert_eq!(found, count(&report, outcome), "{outcome}");
    }
}

#[test]
fn stability_names_its_folder_and_prints_a_table() {
    let folder = folder();
    let args = ["study", "stability", "--quick", "--sweep", "friction"];
    let text = stdout(folder.path(), &args);
    assert!(text.starts_with("sweep "), "{text}");
    assert!(
        text.contains("non-finite numbers in sound states 0, panics 0"),
        "{text}"
    );
    let runs = names(&folder.path().join("runs"));
    assert!(
        runs.len() == 1 && runs[0].starts_with("study-stability-20"),
        "{runs:?}"
    );
    assert!(
        text.ends_with(&format!("heat maps in runs/{}\n", runs[0])),
        "{text}"
    );
}

#[test]
fn unknown_sweeps_are_refused_before_anything_is_written() {
    let folder = folder();
    let output = drape(folder.path(), &["study", "stability", "--sweep", "speeed"]);
    assert_failure(
        &output,
        2,
        &["there is no sweep `speeed`", "time_step, catenary"],
    );
    assert_eq!(names(folder.path()), [""; 0]);
}

/// A region is four numbers, which may be negative; anything else is refused before the work.
#[test]
fn regions_of_episodes_are_four_numbers() {
    let folder = folder();
    for region in ["-1,2,3", "1,2,3,x", "1,2,3,4,5", "nan,0,0,0"] {
        let region = format!("--region={region}");
        let output = drape(folder.path(), &["study", "episodes", &region]);
        assert_eq!(output.status.code(), Some(2), "{region}");
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(stderr.contains("four numbers between commas"), "{stderr}");
    }
}

#[test]
fn verify_writes_rows_and_counts_those_that_are_met() {
    let folder = folder();
    let path = folder.path();
    let args = ["study", "verify", "--quick", "--group", "motion"];
    let report = json(path, &[&args[..], &["--out", "out", "--json"]].concat());
    let cases = report["cases"].as_array().unwrap();
    let keys = [
        "case",
        "expected",
        "found",
        "preset",
        "relative_error",
        "solver",
        "unit",
    ];
    for case in cases {
        let mut found: Vec<_> = case.as_object().unwrap().keys().collect();
        found.sort();
        assert_eq!(found, keys);
    }
    let met = |solver: &str| {
        let own = cases.iter().filter(|case| case["solver"] == solver);
        own.filter(|case| case["relative_error"].as_f64().unwrap().abs() <= 0.01)
            .count() as u64
    };
    for solver in ["yarn", "gauss_seidel", "twin"] {
        let counts = report["counts"].as_array().unwrap().iter();
        let own = counts.filter(|count| count["solver"] == solver);
        let sum: u64 = own.map(|count| count["met"].as_u64().unwrap()).sum();
        assert_eq!(sum, met(solver), "{solver}");
    }
    assert!(met("yarn") > 0);
    assert_eq!(names(&path.join("out")), ["cases.json"]);
    let text = stdout(path, &args);
    assert!(
        text.starts_with("case ") && text.contains("\nmotion\n"),
        "{text}"
    );
}

#[test]
fn unknown_groups_are_refused_before_anything_is_written() {
    let folder = folder();
    let output = drape(folder.path(), &["study", "verify", "--group", "bend"]);
    assert_failure(&output, 2, &["there is no group `bend`", "bending, length"]);
    assert_eq!(names(folder.path()), [""; 0]);
}

/// A scene with a short fall of a coarse blank, and a region of a few vertices.
fn tiny(folder: &Path) {
    fs::write(folder.join("tiny.toml"), super::scene(RIB)).unwrap();
}

const TINY: [&str; 4] = [
    "tiny.toml",
    "--mesh=13",
    "--region=-186,-186,-90,-90",
    "--out=out",
];

#[test]
fn twin_writes_states_that_can_be_compared() {
    let folder = folder();
    let path = folder.path();
    tiny(path);
    let args = ["study", "twin", "--convergence", "--json"];
    let report = json(path, &[&args[..], &TINY[..]].concat());
    let runs = report["runs"].as_array().unwrap();
    let names_of: Vec<&str> = runs.iter().map(|r| r["name"].as_str().unwrap()).collect();
    assert_eq!(names_of, ["fast", "twin", "accelerated"]);
    assert!(runs[1]["energy"][1]["residual_share"].as_f64().unwrap() < 0.05);
    assert!(runs[0].get("energy").is_none());
    let sequence = report["sequence"].as_array().unwrap();
    assert!(!sequence.is_empty() && sequence.len() as u64 == report["presses"]);
    let comparisons = report["comparisons"].as_array().unwrap();
    assert_eq!(comparisons.len(), 4);
    for found in comparisons {
        assert!(found["inside"]["fibre_angle_deg"][0]["share_below"].is_number());
        let picture = path.join("out").join(found["picture"].as_str().unwrap());
        assert!(fs::read(picture).unwrap().starts_with(b"\x89PNG"));
    }
    let variants = report["convergence"].as_array().unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let [half, pushed, coarse] = &variants[..] else {
        panic!("{variants:?}");
    };
    assert_eq!(half["name"], "half_step");
    let ratio = number(&half["time_step_s"]) / number(&runs[1]["time_step_s"]);
    assert!((ratio - 0.5).abs() < 0.02, "{ratio}");
    assert!(0.0 < number(&half["initial_mm"][0]) && number(&half["initial_mm"][1]) < 1.0);
    // Normal distances in space have a mean of 1.6 deviations of a coordinate.
    assert_eq!(pushed["name"], "pushed_start");
    assert!(
        (number(&pushed["initial_mm"][0]) / 1.6e-3 - 1.0).abs() < 0.2,
        "{pushed}"
    );
    assert!(0.0 < number(&pushed["draped_mm"][0]));
    assert_eq!(
        [&coarse["name"], &coarse["vertices"]],
        [&Value::from("twice_the_cell"), &Value::from(49)]
    );
    assert!(number(&coarse["initial_mm"][0]) < 10.0 && coarse["draped_mm"].is_null());
    for extension in ["stl", "vtk", "json"] {
        assert!(
            path.join(format!("out/draped-accelerated.{extension}"))
                .exists()
        );
    }
    let args = [
        "compare",
        "out/draped-fast.json",
        "out/draped-twin.json",
        "--json",
    ];
    let again = json(path, &args);
    let of = |found: &Value| found["topology_a_to_b_mm"]["max"].as_f64().unwrap();
    let first = comparisons
        .iter()
        .find(|c| c["moment"] == "draped" && c["name"] == "fast");
    assert!((of(&again) - of(first.unwrap())).abs() < 1e-6);
}

#[test]
fn transfer_has_a_row_for_every_setting() {
    let folder = folder();
    let path = folder.path();
    tiny(path);
    let args = ["study", "transfer", "--count=4", "--json"];
    let report = json(path, &[&args[..], &TINY[..]].concat());
    let settings = report["settings"].as_array().unwrap();
    // Three presets, one without the rule of strain, two rates, Gauss-Seidel, four twins.
    assert_eq!(settings.len(), 11);
    let count = report["sequences"].as_array().unwrap().len();
    for row in settings {
        assert_eq!(row["left_m"].as_array().unwrap().len(), count);
        for key in ["mean_left_m", "lost_m", "inside_mm", "outside_mm", "cpu_s"] {
            assert!(row[key].as_f64().unwrap() >= 0.0, "{key}: {row}");
        }
        for key in ["rank_correlation_accurate", "rank_correlation_twin"] {
            let value = &row["halfway"][key];
            assert!(value.is_null() || value.as_f64().unwrap().abs() <= 1.0);
        }
    }
    let twin = settings.iter().find(|row| row["name"] == "twin").unwrap();
    assert_eq!(twin["inside_mm"], 0.0);
    assert_eq!(twin["lost_m"], 0.0);
    assert_eq!(names(&path.join("out")), ["scatter.png", "transfer.json"]);
}

#[test]
fn studies_with_a_twin_refuse_what_it_cannot_do() {
    let folder = folder();
    let path = folder.path();
    let text = format!("{}[physics]\nshear = false\n", super::scene(RIB));
    fs::write(path.join("tiny.toml"), text).unwrap();
    for study in ["twin", "transfer"] {
        let output = drape(path, &[&["study", study], &TINY[..]].concat());
        assert_failure(
            &output,
            2,
            &["tiny.toml", "`physics.shear` is false", "expected true"],
        );
        assert_eq!(names(path), ["tiny.toml"]);
    }
    tiny(path);
    let args = ["study", "twin", "tiny.toml", "--path=none.json"];
    assert_failure(&drape(path, &args), 2, &["none.json"]);
    let args = ["study", "twin", "tiny.toml", "--region=900,900,990,990"];
    assert_failure(&drape(path, &args), 2, &["`--region`"]);
}
