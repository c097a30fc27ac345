use super::run::*;
use super::*;

/// Checks that the fields of an episode agree with each other.
fn check_episode(episode: &Value) {
    let [score, initial, remaining, sheet] = [
        "score",
        "region_initial_m",
        "region_final_m",
        "sheet_initial_m",
    ]
    .map(|key| number(&episode[key]));
    assert!(
        (score - (1.0 - remaining / initial)).abs() < 1e-12,
        "{episode}"
    );
    assert!(
        0.0 < initial && initial < sheet && remaining >= 0.0,
        "{episode}"
    );
    assert!(number(&episode["strain_p95"]) <= number(&episode["strain_max"]));
    for key in ["undraped_inner", "steps", "jumps", "self_intersections"] {
        assert!(episode[key].is_u64(), "{key}");
    }
    assert!(number(&episode["jumps"]) < number(&episode["steps"]));
    for key in [
        "locked_share",
        "shear_max_deg",
        "sheet_final_m",
        "sheet_surplus_final_m",
        "v_rms_mm_s",
        "seconds",
        "surplus_final_m",
    ] {
        assert!(number(&episode[key]) >= 0.0, "{key}");
    }
    assert!(number(&episode["surplus_initial_m"]) > 0.0);
}

/// Checks mean, deviation and best score against the episodes beside them.
fn check_episodes(group: &Value, count: usize) {
    let episodes = group["episodes"].as_array().unwrap();
    assert_eq!(episodes.len(), count);
    episodes.iter().for_each(check_episode);
    let scores: Vec<f64> = episodes.iter().map(|e| number(&e["score"])).collect();
    let mean = scores.iter().sum::<f64>() / count as f64;
    let square: f64 = scores.iter().map(|s| (s - mean).powi(2)).sum();
    let deviation = (square / (count as f64 - 1.0)).sqrt();
    assert!((number(&group["mean_score"]) - mean).abs() < 1e-12);
    assert!((number(&group["deviation"]) - deviation).abs() < 1e-12);
    assert!(scores.contains(&number(&group["best_score"])));
}

fn eval(folder: &Path, more: &[&str]) -> Value {
    let args = [&["eval", "runs/a", "--json", "--episodes", "5"], more].concat();
    json(folder, &args)
}

/// Training adds up rewards in single precision.
const SCORE_TOLERANCE: f64 = 1e-6;

#[test]
fn checkpoints_play_as_they_did_in_training() {
    let folder = trained();
    let path = folder.path();
    let metrics = metrics(&path.join("runs/a"));
    let greedy: Vec<f64> = metrics.iter().map(|l| number(&l["greedy_score"])).collect();
    let best = greedy.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let default = eval(path, &[]);
    assert_eq!(default["played"], "best");
    for (name, expected) in [
        ("best", best),
        ("last", greedy[2]),
        ("runs/a/checkpoints/best.drape", best),
    ] {
        let report = eval(path, &["--checkpoint", name]);
        assert_eq!(report["played"], name);
        assert_eq!(report["run"], "runs/a");
        check_episode(&report["episode"]);
        check_episodes(&report["random"], 5);
        assert_eq!(
            report["random"]["mean_score"],
            default["random"]["mean_score"]
        );
        let random = &report["random"];
        let above = number(&report["episode"]["score"]) - number(&random["mean_score"]);
        let found = number(&report["deviations_above_random"]) * number(&random["deviation"]);
        // Each is read from text to its last bit but one.
        assert!(
            (found - above).abs() < 4.0 * f64::EPSILON,
            "{found} {above}"
        );
        assert!(report.get("sampled").is_none());
        let score = number(&report["episode"]["score"]);
        assert!(
            (score - expected).abs() < SCORE_TOLERANCE,
            "{name}: {score}, {expected}"
        );
    }
}

#[test]
fn best_sequence_replays_to_its_score_without_a_checkpoint() {
    let folder = trained();
    let path = folder.path();
    fs::remove_dir_all(path.join("runs/a/checkpoints")).unwrap();
    let report = eval(path, &["--sequence"]);
    assert_eq!(report["played"], "sequence");
    check_episode(&report["episode"]);
    let sequence = read_json(&path.join("runs/a/best_sequence.json"));
    let score = number(&report["episode"]["score"]);
    assert!((score - number(&sequence["score"])).abs() < SCORE_TOLERANCE);
    let count = sequence["vertices"].as_array().unwrap().len();
    assert_eq!(report["episode"]["steps"], count);
}

/// The same start and the same presses, stepped as finely as is asked for.
#[test]
fn sequence_is_replayed_with_another_accuracy() {
    let folder = trained();
    let path = folder.path();
    let own = eval(path, &["--sequence"]);
    assert!(own.get("accuracy").is_none());
    let replay = |accuracy: &str| eval(path, &["--sequence", "--accuracy", accuracy]);
    let accurate = replay("accurate");
    assert_eq!(accurate["accuracy"], "accurate");
    check_episode(&accurate["episode"]);
    check_episodes(&accurate["random"], 5);
    assert_eq!(accurate["episode"]["steps"], own["episode"]["steps"]);
    for key in ["region_initial_m", "sheet_initial_m"] {
        assert_eq!(accurate["episode"][key], own["episode"][key], "{key}");
    }
    for key in ["region_final_m", "sheet_final_m"] {
        assert_ne!(accurate["episode"][key], own["episode"][key], "{key}");
    }
    assert_ne!(
        accurate["random"]["mean_score"],
        own["random"]["mean_score"]
    );
    // What the run was trained with.
    let balanced = replay("balanced");
    assert_eq!(balanced["episode"]["score"], own["episode"]["score"]);
    // A checkpoint keeps its configuration, and plays with another.
    let args = ["--checkpoint", "last", "--accuracy", "fast"];
    assert_ne!(
        eval(path, &args)["episode"]["region_final_m"],
        eval(path, &args[..2])["episode"]["region_final_m"]
    );
    let args = ["eval", "runs/a", "--accuracy", "fast", "--episodes", "2"];
    let text = stdout(path, &args);
    assert!(
        text.starts_with("runs/a: best, fast steps; scores in %\n"),
        "{text}"
    );

    let args = ["eval", "runs/a", "--accuracy", "acurate"];
    let output = drape(path, &args);
    assert_eq!(output.status.code(), Some(2));
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(
        stderr.contains("'acurate' for '--accuracy <NAME>': expected fast, balanced or accurate"),
        "{stderr}"
    );
}

/// Where the stencil covers neighbours, steps of another length change what the masks allow; the
/// robot has the list all the same.
#[test]
fn whole_sequences_are_pressed_with_another_accuracy() {
    let folder = folder();
    let path = folder.path();
    let config = CONFIG.replace("[env]", "[env]\nstencil_mm = 30.0");
    train(path, &config, "b");
    let sequence = read_json(&path.join("runs/b/best_sequence.json"));
    let stored = sequence["vertices"].as_array().unwrap().len();
    for accuracy in ["fast", "accurate"] {
        let args = ["eval", "runs/b", "--sequence", "--episodes", "2", "--json"];
        let report = json(path, &[&args[..], &["--accuracy", accuracy]].concat());
        assert_eq!(report["episode"]["steps"], stored);
        assert!(number(&report["episode"]["score"]) > 0.0, "{report}");
    }
}

#[test]
fn pictures_of_the_run_stay() {
    let folder = trained();
    let path = folder.path();
    let before = files(path);
    let report = eval(path, &["--out", "b/c"]);
    assert_eq!(report["pictures"], "b/c");
    let drawn = [
        "after.png",
        "before.png",
        "crushed.png",
        "path.png",
        "recording.drape",
        "rollout.gif",
    ];
    assert_eq!(names(&path.join("b/c")), drawn);
    fs::remove_dir_all(path.join("b")).unwrap();
    assert!(files(path) == before);
    eval(path, &["--checkpoint", "last"]);
    assert_eq!(names(&path.join("runs/a/pictures/eval")), drawn);
    fs::remove_dir_all(path.join("runs/a/pictures/eval")).unwrap();
    assert!(files(path) == before);

    // What cannot be written is known before anything is played.
    let args = ["eval", "runs/a", "--state", "none/a.json"];
    assert_failure(&drape(path, &args), 1, &["folder none does not exist"]);
    // Nor do folders stay that were made for nothing, but those that were there do.
    fs::create_dir(path.join("n0")).unwrap();
    let more = ["--out", "n0/n1/n2/n3"];
    assert_failure(&drape(path, &[&args[..], &more].concat()), 1, &["none"]);
    assert_eq!(names(&path.join("n0")), [""; 0]);
    fs::remove_dir(path.join("n0")).unwrap();
    assert!(files(path) == before);
    assert_eq!(names(path), ["runs"]);

    // The folder of the pictures may be that of the state.
    eval(path, &["--out", "b/c", "--state", "b/c/a.json"]);
    assert!(path.join("b/c/a.json").is_file());
}

/// Where a file does not fit, what was there before stays, all of it.
#[cfg(unix)]
#[test]
fn full_disk_replaces_nothing() {
    let folder = trained();
    let path = folder.path();
    fs::create_dir(path.join("out")).unwrap();
    fs::write(path.join("out/before.png"), "old").unwrap();
    fs::write(
        path.join("page.md"),
        "<!-- table stability.counts -->\n<!-- end -->\n",
    )
    .unwrap();
    let before = files(path);
    let eval = ["eval", "runs/a", "--sequence", "--episodes", "1", "--json"];
    let to_out = [&eval[..], &["--out", "out"]].concat();
    // Some pictures are smaller.
    let output = drape_with_limit(110, path, &to_out);
    let words = ["error: cannot write out/recording.drape: File too large"];
    assert_failure(&output, 1, &words);
    assert!(files(path) == before);

    for (args, file) in [
        (&to_out[..], "out/recording.drape"),
        (
            &["eval", "runs/a", "--prove", "--episodes", "1", "--json"],
            "runs/a/proof.json",
        ),
        (&["export", "runs/a"], "runs/a/trajectory.json"),
        (
            &["export", "runs/a", "--format", "csv"],
            "runs/a/trajectory.csv",
        ),
        (
            &["export", "runs/a", "--format", "abaqus"],
            "runs/a/draping.inp",
        ),
        (&["compare", "runs/a", "runs/a", "--out", "d.png"], "d.png"),
        (&["tool", "rib", "--out", "a.stl"], "a.stl"),
        (
            &[
                "study",
                "stability",
                "--quick",
                "--sweep",
                "friction",
                "--into",
                "page.md",
                "--json",
            ],
            "runs/study-stability-",
        ),
    ] {
        let output = drape_with_limit(0, path, args);
        assert_failure(&output, 1, &[&format!("error: cannot write {file}")]);
        assert!(files(path) == before, "{args:?}");
    }
}

#[test]
fn sampled_episodes_are_told_apart_and_repeat() {
    let folder = trained();
    let report = eval(folder.path(), &["--sample"]);
    check_episodes(&report["sampled"], 5);
    let again = eval(folder.path(), &["--sample"]);
    for group in ["sampled", "random"] {
        for key in ["mean_score", "deviation", "best_score"] {
            assert_eq!(report[group][key], again[group][key]);
        }
    }
    assert_ne!(
        report["sampled"]["mean_score"],
        report["random"]["mean_score"]
    );
    let text = stdout(
        folder.path(),
        &["eval", "runs/a", "--sample", "--episodes", "2"],
    );
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], "runs/a: best; scores in %");
    assert!(lines[1].starts_with("order    count  score"), "{text}");
    for (line, begin) in [
        (2, "episode      1"),
        (3, "sampled      2"),
        (4, "random       2"),
    ] {
        assert!(lines[line].starts_with(begin), "{text}");
    }
    assert!(lines.iter().all(|line| line.len() <= 100), "{text}");
    let end = "pictures in runs/a/pictures/eval\nnext: drape robot runs/a\n";
    assert!(text.ends_with(end), "{text}");
}

#[test]
fn exported_points_are_the_sequence_in_metres_and_millimetres() {
    let folder = trained();
    let path = folder.path();
    let trajectory = fs::read(path.join("runs/a/trajectory.json")).unwrap();
    let report = json(path, &["export", "runs/a", "--json"]);
    assert_eq!(report["file"], "runs/a/trajectory.json");
    assert!(fs::read(path.join("runs/a/trajectory.json")).unwrap() == trajectory);
    json(path, &["export", "runs/a", "--format", "csv", "--json"]);
    let csv = fs::read_to_string(path.join("runs/a/trajectory.csv")).unwrap();

    let proved = read_json(&path.join("runs/a/proof.json"));
    let vertices = proved["path"]["vertices"].as_array().unwrap();
    let document: Value = serde_json::from_slice(&trajectory).unwrap();
    let points = document["points"].as_array().unwrap();
    assert_eq!(report["points"], vertices.len());
    assert_eq!(report["score"], proved["path"]["score"]);
    assert_eq!(report["proved"], "solver");

    let mut rows = csv.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = rows.next().unwrap().split(',').collect();
    assert_eq!(
        header[..8],
        ["index", "vertex", "x", "y", "z", "i", "j", "k"]
    );
    let rows: Vec<Vec<&str>> = rows.map(|row| row.split(',').collect()).collect();
    assert_eq!((rows.len(), points.len()), (vertices.len(), vertices.len()));
    let mut strokes = 0;
    for (index, (row, point)) in rows.iter().zip(points).enumerate() {
        assert_eq!(row.len(), header.len());
        assert_eq!(row[0], index.to_string());
        assert_eq!(point["index"], index);
        assert_eq!(point["vertex"], vertices[index]);
        assert_eq!(row[1], vertices[index].to_string());
        for axis in 0..3 {
            let millimetres: f64 = row[2 + axis].parse().unwrap();
            let metres = number(&point["position"][axis]);
            assert!((millimetres - 1e3 * metres).abs() <= 1e-6, "{row:?}");
            assert!(metres.abs() < 0.3);
        }
        let normal = [5, 6, 7].map(|column| row[column].parse::<f64>().unwrap());
        let length = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
        assert!((length - 1.0).abs() < 3e-6, "{row:?}");
        let starts = point["starts_stroke"].as_bool().unwrap();
        assert_eq!(*row.last().unwrap(), if starts { "1" } else { "0" });
        strokes += u64::from(starts);
    }
    assert_eq!(number(&report["strokes"]), strokes as f64);
}

/// Rows of the proof agree with each other and with the path that is kept for the robot.
#[test]
fn best_paths_are_proved_in_finer_physics() {
    let folder = trained();
    let path = folder.path();
    let run = path.join("runs/a");
    let trained = files(&run);
    fs::remove_file(run.join("proof.json")).unwrap();
    let report = json(path, &["export", "runs/a", "--json"]);
    let sequence = read_json(&run.join("best_sequence.json"));
    assert!(report["proved"].is_null());
    assert!((number(&report["score"]) - number(&sequence["score"])).abs() < SCORE_TOLERANCE);

    let args = ["eval", "runs/a", "--episodes", "4", "--json"];
    assert!(json(path, &args).get("proof").is_none());
    let report = json(path, &[&args[..], &["--prove"]].concat());
    let rows = report["proof"].as_array().unwrap();
    let orders = ["path", "random", "sweep", "outwards", "inwards"];
    for (row, order) in rows.iter().zip(orders) {
        assert_eq!(
            (&row["physics"], &row["order"]),
            (&"solver".into(), &order.into())
        );
        assert_eq!(row["diverged"], 0);
        assert_eq!(row["worlds"], 1);
        let score = number(&row["score"]);
        for key in ["worst_quarter_score", "worst_score", "nominal_score"] {
            assert_eq!(number(&row[key]), score, "{key}");
        }
        assert!(number(&row["distance_m"]) >= 0.0 && number(&row["robot_s"]) > 0.0);
        assert!(number(&row["path"]["presses"]) > 0.0);
    }
    let counts: Vec<_> = rows[1..].iter().map(|row| &row["count"]).collect();
    assert_eq!(counts, [4, 1, 2, 9]);
    // As training has proved it, with as many orders.
    assert!(fs::read(run.join("proof.json")).unwrap() == trained["proof.json"]);
    assert_eq!(
        rows[0]["score"],
        read_json(&run.join("proof.json"))["path"]["score"]
    );

    let report = json(path, &[&args[..], &["--prove", "--twin"]].concat());
    let rows = report["proof"].as_array().unwrap();
    let twin: Vec<_> = rows[5..].iter().map(|row| &row["count"]).collect();
    assert_eq!(twin[1..], [4, 1, 2, 9]);
    assert!(rows[5..].iter().all(|row| row["physics"] == "twin"));
    let proved = read_json(&run.join("proof.json"));
    assert_eq!(proved["path"]["score"], rows[5]["score"]);
    let export = || {
        let report = json(path, &["export", "runs/a", "--out", "a.json", "--json"]);
        let points = read_json(&path.join("a.json"));
        assert_eq!(points, read_json(&run.join("trajectory.json")));
        (report["proved"].clone(), report["score"].clone())
    };
    assert_eq!(export(), ("twin".into(), proved["path"]["score"].clone()));
    // What the twin has proved stays, also where a complete run is gone on with.
    let alone = ["eval", "runs/a", "--prove", "--episodes", "0", "--json"];
    let alone = json(path, &alone);
    assert!(alone.get("random").is_none());
    assert_eq!(alone["proof"].as_array().unwrap().len(), 1);
    json(path, &["train", "--resume", "runs/a", "--json"]);
    assert_eq!(read_json(&run.join("proof.json")), proved);
    let text = stdout(path, &["export", "runs/a"]);
    assert!(text.ends_with(" %, proved: twin\n"), "{text}");
    let args = ["eval", "runs/a", "--twin"];
    assert_eq!(drape(path, &args).status.code(), Some(2));
    let args = ["eval", "runs/a", "--json", "--recording"];
    let again = json(
        path,
        &[&args[..], &["runs/a/pictures/recording.drape"]].concat(),
    );
    assert_eq!(
        (&again["by_twin"], &again["same_bits"]),
        (&true.into(), &true.into())
    );
}

#[test]
fn recordings_are_pressed_again_to_the_same_bits() {
    let folder = trained();
    let path = folder.path();
    let own = "runs/a/pictures/recording.drape";
    let args = ["eval", "runs/a", "--recording", own];
    let again = json(path, &[&args[..], &["--json", "--out", "out"]].concat());
    assert_eq!(
        (&again["by_twin"], &again["same_bits"]),
        (&false.into(), &true.into())
    );
    assert_eq!(number(&again["apart_m"]), 0.0);
    let proof = read_json(&path.join("runs/a/proof.json"));
    let presses = proof["path"]["vertices"].as_array().unwrap().len();
    assert_eq!(number(&again["presses"]), presses as f64);
    let whole = fs::read(path.join(own)).unwrap();
    assert!(fs::read(path.join("out/recording.drape")).unwrap() == whole);
    assert!(stdout(path, &args).contains("the same bits"));

    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 4;
    let foreign = fs::read(path.join("runs/a/checkpoints/last.drape")).unwrap();
    fs::remove_dir_all(path.join("out")).unwrap();
    for (bytes, word) in [
        (&flipped[..], "bad.drape: checksum is "),
        (&whole[..whole.len() - 9], "bad.drape: has "),
        (
            &foreign,
            "bad.drape: not a recording: another kind of drape file",
        ),
        (b"solid", "bad.drape: not a drape file"),
    ] {
        fs::write(path.join("bad.drape"), bytes).unwrap();
        let args = ["eval", "runs/a", "--recording", "bad.drape", "--out", "out"];
        assert_failure(&drape(path, &args), 2, &[word]);
        assert!(!path.join("out").exists());
    }
    train(path, &CONFIG.replace("[17, 17]", "[16, 17]"), "b");
    let args = ["eval", "runs/b", "--recording", own];
    assert_failure(&drape(path, &args), 2, &[own, "another blank or tool"]);
}

#[test]
fn exports_go_where_they_are_told_and_nowhere_else() {
    let folder = trained();
    let path = folder.path();
    let before = files(&path.join("runs/a"));
    for (out, format) in [("a.json", "json"), ("a.csv", "csv")] {
        let text = stdout(
            path,
            &["export", "runs/a", "--format", format, "--out", out],
        );
        assert!(text.starts_with(&format!("{out}: ")), "{text}");
        assert!(path.join(out).is_file());
        let args = ["export", "runs/a", "--format", format, "--out", "none/a"];
        assert_failure(
            &drape(path, &args),
            1,
            &["none/a", "folder none does not exist"],
        );
        let args = ["export", "runs/a", "--format", format, "--out", "runs"];
        assert_failure(&drape(path, &args), 1, &["cannot write runs"]);
    }
    let report = json(
        path,
        &[
            "export",
            "runs/a",
            "--checkpoint",
            "best",
            "--out",
            "b",
            "--json",
        ],
    );
    let greedy = eval(path, &[]);
    assert_eq!(report["score"], greedy["episode"]["score"]);
    assert_eq!(report["points"], greedy["episode"]["steps"]);
    let after = files(&path.join("runs/a"));
    for (name, bytes) in before
        .iter()
        .filter(|(name, _)| !name.starts_with("pictures/"))
    {
        assert!(after[name] == *bytes, "{name}");
    }
}

#[test]
fn run_whose_configuration_was_edited_is_refused() {
    let folder = trained();
    let path = folder.path();
    let file = path.join("runs/a/config.toml");
    let text = fs::read_to_string(&file).unwrap();
    let edited = text.replace("stencil_mm = 18.0", "stencil_mm = 24.0");
    assert_ne!(edited, text);
    fs::write(&file, edited).unwrap();
    let before = files(path);
    for (args, word) in [
        (
            &["eval", "runs/a"][..],
            "checkpoints/best.drape: written for another configuration",
        ),
        (
            &["eval", "runs/a", "--sequence"],
            "best_sequence.json: found in the configuration",
        ),
        (
            &["export", "runs/a"],
            "proof.json: found in the configuration",
        ),
        (
            &["export", "runs/a", "--checkpoint", "last"],
            "last.drape: written for another",
        ),
        (
            &["train", "--resume", "runs/a", "--json"],
            "last.drape: written for another configuration than runs/a/config.toml",
        ),
    ] {
        assert_failure(&drape(path, args), 2, &[word]);
    }
    fs::write(&file, text.replace("stencil_mm", "stencil_m")).unwrap();
    let word = "runs/a/config.toml:15:1: unknown field `stencil_m`";
    assert_failure(&drape(path, &["eval", "runs/a"]), 2, &[word]);
    fs::write(
        &file,
        text.replace("stencil_mm = 18.0", "stencil_mm = 24.0"),
    )
    .unwrap();
    assert!(files(path) == before);
}
