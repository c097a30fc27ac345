use super::run::number;
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

fn rows<'a>(report: &'a Value, table: &str) -> &'a Vec<Value> {
    report[table].as_array().unwrap()
}

#[test]
fn stability_writes_tables_and_heat_maps_and_counts_every_cell() {
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
    let counts = rows(&report, "counts");
    for of in counts {
        let sum: usize = outcomes.iter().map(|key| count(of, key)).sum();
        assert_eq!(sum, count(of, "cells"));
        assert_eq!(count(of, "non_finite") + count(of, "panicked"), 0);
    }
    // In the order of the study, not of the options.
    let sweeps: Vec<_> = counts.iter().map(|row| &row["sweep"]).collect();
    assert_eq!(sweeps, ["speed", "speed", "friction", "friction", "all"]);
    let all = &counts[4];
    assert!(count(all, "diverged") > 0 && count(all, "converged") > 0);
    assert!(report["seconds"].as_f64().unwrap() > 0.0);

    let out = path.join("new/out");
    assert_eq!(
        names(&out),
        [
            "cells.csv",
            "counts.csv",
            "friction-f32.png",
            "friction-f64.png",
            "speed-f32.png",
            "speed-f64.png",
            "stability.json",
            "stability.md",
        ]
    );
    let picture = fs::read(out.join("speed-f64.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG"));
    let table = fs::read_to_string(out.join("cells.csv")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 1 + count(all, "cells"));
    let columns = lines[0].split(',').count();
    assert!(lines.iter().all(|row| row.split(',').count() == columns));
    for outcome in ["converged", "wrong", "diverged"] {
        let marked = format!(",{outcome},");
        let found = lines.iter().filter(|row| row.contains(&marked)).count();
        assert_eq!(found, count(all, outcome), "{outcome}");
    }
}

#[test]
fn a_study_names_its_folder_and_prints_a_table() {
    let folder = folder();
    let args = ["study", "stability", "--quick", "--sweep", "friction"];
    let text = stdout(folder.path(), &args);
    assert!(text.contains("\nsweep     solver"), "{text}");
    let runs = names(&folder.path().join("runs"));
    assert!(
        runs.len() == 1 && runs[0].starts_with("study-stability-20"),
        "{runs:?}"
    );
    let end = format!("files in runs/{}\n", runs[0]);
    assert!(text.ends_with(&end), "{text}");
}

/// The tables of a study replace what stands in their places of a document, and nothing else.
#[test]
fn tables_go_into_a_document() {
    let folder = folder();
    let path = folder.path();
    let document = path.join("doc.md");
    let args = ["study", "stability", "--quick", "--sweep", "friction"];
    let more = ["--out", "out", "--into", "doc.md"];
    let args = [&args[..], &more].concat();
    assert_failure(&drape(path, &args), 2, &["cannot read doc.md"]);
    fs::write(&document, "<!-- table twin.runs -->\n<!-- end -->\n").unwrap();
    assert_failure(
        &drape(path, &args),
        2,
        &["doc.md: there is no `<!-- table stability.NAME -->`"],
    );
    fs::write(&document, "<!-- table stability.count -->\n").unwrap();
    assert_failure(
        &drape(path, &args),
        2,
        &["doc.md", "`<!-- table stability.count", "counts, cells"],
    );
    fs::write(&document, "<!-- table stability.counts -->\n").unwrap();
    assert_failure(&drape(path, &args), 2, &["doc.md", "not followed by"]);
    // All of it before the work.
    assert!(!path.join("out").exists());
    let places = "a\n<!-- table stability.counts -->\nold\n<!-- end -->\nb\n";
    fs::write(&document, places).unwrap();
    stdout(path, &args);
    let text = fs::read_to_string(&document).unwrap();
    let start = "a\n<!-- table stability.counts -->\n| sweep | solver | cells |";
    assert!(text.starts_with(start), "{text}");
    assert!(
        text.ends_with("\n<!-- end -->\nb\n") && !text.contains("old"),
        "{text}"
    );
}

#[test]
fn unknown_parts_are_refused_before_anything_is_written() {
    let folder = folder();
    for (args, words) in [
        (
            ["stability", "--sweep", "speeed"],
            ["there is no `speeed`", "time_step, catenary"],
        ),
        (
            ["verify", "--group", "bend"],
            ["there is no `bend`", "bending, length"],
        ),
    ] {
        let output = drape(folder.path(), &[&["study"], &args[..]].concat());
        assert_failure(&output, 2, &words);
        assert_eq!(names(folder.path()), [""; 0]);
    }
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
    let args = [&args[..], &["--out", "out"]].concat();
    let report = json(path, &[&args[..], &["--json"]].concat());
    let met = |solver: &str| {
        let own = rows(&report, "cases").iter();
        let own = own.filter(|case| case["solver"] == solver);
        own.filter(|case| number(&case["relative_error"]).abs() <= 0.01)
            .count() as u64
    };
    for solver in ["yarn", "gauss_seidel", "twin"] {
        let counts = rows(&report, "counts").iter();
        let own = counts.filter(|count| count["solver"] == solver);
        let sum: u64 = own.map(|count| count["met"].as_u64().unwrap()).sum();
        assert_eq!(sum, met(solver), "{solver}");
    }
    assert!(met("yarn") > 0);
    let errors = rows(&report, "errors");
    assert_eq!(errors.len(), 5);
    assert!(errors[0]["yarn_accurate"].is_number() && errors[0]["twin_reference"].is_null());
    let files = [
        "cases.csv",
        "counts.csv",
        "errors.csv",
        "verify.json",
        "verify.md",
    ];
    assert_eq!(names(&path.join("out")), files);
    let text = stdout(path, &args);
    assert!(text.contains("\nmotion "), "{text}");
}

/// A scene with a short fall of a coarse blank, and a region of a few vertices.
fn tiny(folder: &Path) {
    fs::write(folder.join("tiny.toml"), super::scene(RIB)).unwrap();
}

const TINY: [&str; 4] = [
    "tiny.toml",
    "--mesh=17",
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
    let runs = rows(&report, "runs");
    let models: Vec<_> = runs.iter().map(|row| &row["model"]).collect();
    assert_eq!(models, ["fast", "twin", "accelerated"]);
    let energy = rows(&report, "energy");
    assert_eq!(energy.len(), 4);
    assert!(number(&energy[1]["residual_of_the_greatest_amount_percent"]) < 5.0);
    assert!(!report["sequence"].as_array().unwrap().is_empty());
    let comparisons = rows(&report, "comparisons");
    assert_eq!(comparisons.len(), 4 * 3);
    for found in comparisons {
        assert!(found["warp_5_deg_percent"].is_number(), "{found}");
    }
    for name in ["initial-fast", "draped-fast", "draped-accelerated"] {
        let picture = fs::read(path.join(format!("out/{name}.png"))).unwrap();
        assert!(picture.starts_with(b"\x89PNG"));
    }
    let [half, pushed, coarse] = &rows(&report, "convergence")[..] else {
        panic!("{report}");
    };
    assert_eq!(half["variant"], "half step");
    let ratio = number(&half["step_us"]) / number(&runs[1]["step_us"]);
    assert!((ratio - 0.5).abs() < 0.02, "{ratio}");
    assert!(0.0 < number(&half["fall_mean_mm"]) && number(&half["fall_max_mm"]) < 1.0);
    // Normal distances in space have a mean of 1.6 deviations of a coordinate.
    assert_eq!(pushed["variant"], "pushed start");
    let ratio = number(&pushed["fall_mean_mm"]) / 1.6e-3;
    assert!((ratio - 1.0).abs() < 0.2, "{pushed}");
    assert!(0.0 < number(&pushed["presses_mean_mm"]));
    assert_eq!(coarse["variant"], "twice the cell");
    assert_eq!(coarse["vertices"], 81);
    assert!(number(&coarse["fall_mean_mm"]) < 10.0 && coarse["presses_mean_mm"].is_null());
    for extension in ["stl", "json"] {
        let state = format!("out/draped-accelerated.{extension}");
        assert!(path.join(state).exists());
    }
    let states = ["out/draped-fast.json", "out/draped-twin.json"];
    let again = json(path, &["compare", states[0], states[1], "--json"]);
    let of = |row: &&Value| row["moment"] == "draped" && row["model"] == "fast";
    let first = comparisons.iter().find(of).unwrap();
    let again = number(&again["topology_a_to_b_mm"]["max"]);
    assert!((again - number(&first["max_mm"])).abs() < 1e-6);
}

/// As `export` does: a damaged path is a failure at work, another configuration one of the input.
#[test]
fn twin_presses_no_path_of_a_run_that_is_not_as_it_was() {
    let folder = super::run::trained();
    let path = folder.path();
    let args = ["study", "twin", "--path=runs/a", "--out=out"];
    let change = |name: &str, [from, to]: [&str; 2], code: i32, place: &str| {
        let file = path.join("runs/a").join(name);
        let text = fs::read_to_string(&file).unwrap();
        fs::write(&file, text.replace(from, to)).unwrap();
        assert_failure(&drape(path, &args), code, &[place]);
        fs::write(&file, text).unwrap();
    };
    for place in ["proof.json", "best_sequence.json"] {
        change(place, ["\"vertices\"", "\"vertice\""], 1, place);
        change(
            "config.toml",
            ["height_mm = 60.0", "height_mm = 50.0"],
            2,
            place,
        );
        // Without a proof the path is the best sequence.
        let _ = fs::remove_file(path.join("runs/a/proof.json"));
    }
}

#[test]
fn studies_with_a_twin_refuse_what_it_cannot_do() {
    let folder = folder();
    let path = folder.path();
    let text = format!("{}[physics]\nshear = false\n", super::scene(RIB));
    fs::write(path.join("tiny.toml"), text).unwrap();
    let output = drape(path, &[&["study", "twin"], &TINY[..]].concat());
    let words = ["tiny.toml", "`physics.shear` is false", "expected true"];
    assert_failure(&output, 2, &words);
    assert_eq!(names(path), ["tiny.toml"]);
    tiny(path);
    let args = ["study", "twin", "tiny.toml", "--path=none.json"];
    assert_failure(&drape(path, &args), 2, &["none.json"]);
    let args = ["study", "twin", "tiny.toml", "--region=900,900,990,990"];
    assert_failure(&drape(path, &args), 2, &["`--region`"]);
}

/// Scene, mesh and focus region are those of the run.
#[test]
fn a_run_stands_for_its_scene() {
    let folder = super::run::trained();
    let path = folder.path();
    fs::write(path.join("scene.toml"), {
        let text = super::run::CONFIG;
        let scene = &text[text.find("[scene.").unwrap()..];
        scene.replace("scene.", "")
    })
    .unwrap();
    let run = |scene: &[&str]| {
        let args = [
            "study", "episodes", "--count", "2", "--out", "out", "--json",
        ];
        let mut report = json(path, &[&args[..], scene].concat());
        report.as_object_mut().unwrap().remove("seconds");
        report
    };
    let of_run = run(&["runs/a"]);
    assert_eq!(of_run, run(&["scene.toml", "--region=-186,-186,-80,-80"]));
    let other = ["runs/a", "--region=80,-186,186,-80"];
    assert_ne!(of_run, run(&other));

    let args = [
        "study", "episodes", "runs/a", "--count", "1", "--out", "out",
    ];
    let stderr = said(drape(path, &args).stderr);
    let line = "using the scene and the focus region of runs/a, not what it has learnt\n";
    assert_eq!(stderr, line);
    let args = ["study", "episodes", "runs", "--out", "out"];
    let words = ["runs is not a run folder: it has no run.json"];
    assert_failure(&drape(path, &args), 2, &words);
}
