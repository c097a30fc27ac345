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
