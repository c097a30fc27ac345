//! Runs that cannot be begun, read or gone on with.

use super::run::*;
use super::*;

#[test]
fn folders_that_are_no_runs_are_refused() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("file"), "").unwrap();
    fs::create_dir(path.join("empty")).unwrap();
    for (run, word) in [
        ("none", "there is no run none"),
        ("empty", "empty is not a run folder: it has no run.json"),
        ("file", "file is not a run folder: it is a file"),
    ] {
        for args in [
            &["eval", run][..],
            &["export", run],
            &["train", "--resume", run],
        ] {
            assert_failure(&drape(path, args), 2, &[word]);
        }
    }
    assert_eq!(names(path), ["empty", "file"]);
    assert_eq!(names(&path.join("empty")), [""; 0]);
}

#[test]
fn mistakes_in_the_configuration_are_located_and_nothing_is_made() {
    let folder = folder();
    let path = folder.path();
    let args = ["train", "none.toml", "--json"];
    assert_failure(
        &drape(path, &args),
        2,
        &["cannot read none.toml", "No such file"],
    );
    // One for each place that finds them; the parser's own tests have the rest.
    for (text, words) in [
        (
            "seed = 1\nsteqs = 5",
            &["config.toml:2:1: unknown field `steqs`, expected one of"],
        ),
        (
            "[ppo]\ngamma = 2.0",
            &["config.toml: ppo: `gamma` is 2, expected a number from 0 to 1"],
        ),
        (
            "[env]\nstencil_mm = -1",
            &["config.toml: `env.stencil_mm` is -1, expected"],
        ),
        (
            "[policy.network.compact]\npatch = 0",
            &["config.toml: policy: `network.compact.patch` is [0], expected"],
        ),
        (
            "[scene.tool.source]\nshape.kind = \"rib\"\nstl.path = \"a.stl\"",
            &["config.toml:2:14: several kinds of what can be one only"],
        ),
        (
            "environments = 4096\nppo.rollout_steps = 1\n[scene.tool]\n[scene.blank]\nvertices = [1025, 1025]",
            &[
                "config.toml: `environments` is 4096 of 1050625 vertices, 1231201 MiB, expected at most",
            ],
        ),
        (
            "[env]\ncrop = false\n[scene.tool]\n[scene.blank]\nvertices = [1025, 1025]",
            &[
                "config.toml: `ppo.rollout_steps` is 3200 samples of 1050625 pixels, 28856 MiB, expected",
            ],
        ),
        (
            "[policy.network.compact]\nborder = 4095",
            &["config.toml: policy: `network` is 4834207578 parameters, expected at most"],
        ),
        #[cfg(unix)]
        (
            "scene_file = \"/dev/zero\"",
            &["/dev/zero: not a regular file"],
        ),
        (
            "scene_file = \"no.toml\"",
            &["cannot read no.toml: No such file"],
        ),
    ] {
        // A coarse scene, where it gets that far.
        let text = match text.contains("scene") {
            true => text.into(),
            false => format!("{text}\n{}", coarse()),
        };
        assert_failure(&refused(path, &text), 2, words);
    }
    fs::write(path.join("scene.toml"), "[tool]\n[fall]\nfal_s = 1").unwrap();
    let output = refused(path, "scene_file = \"scene.toml\"");
    assert_failure(&output, 2, &["scene.toml:3:1: unknown field `fal_s`"]);
    assert_eq!(names(path), ["config.toml", "scene.toml"]);
}

/// The scene of [`CONFIG`].
fn coarse() -> &'static str {
    &CONFIG[CONFIG.find("[scene.").unwrap()..]
}

#[test]
fn options_that_cannot_be_are_refused() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("config.toml"), CONFIG).unwrap();
    for name in ["", ".", "..", "a/b", "/a", "a/", ".drape-q.new", "a\u{1b}"] {
        let output = drape(path, &["train", "config.toml", "--json", "--name", name]);
        assert_failure(
            &output,
            2,
            &["cannot name a run: expected one name of a folder"],
        );
    }
    // Those that the parser of the command line finds.
    for args in [
        &["--steps", "0"][..],
        &["--steps", "1099511627777"],
        &["--seed", "x"],
        &["--seed", "9223372036854775808"],
        &["--device", "tpu"],
        &["--resume", "runs/a"],
    ] {
        let output = drape(path, &[&["train", "config.toml"], args].concat());
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(stderr.contains(args[0]), "{stderr}");
        assert!(output.stdout.is_empty());
    }
    for args in [
        &["eval", "a", "--episodes", "0"][..],
        &["eval", "a", "--sequence", "--sample"],
        &["eval", "a", "--sequence", "--checkpoint", "last"],
        &["export", "a", "--format", "xml"],
    ] {
        assert_eq!(drape(path, args).status.code(), Some(2), "{args:?}");
    }
    assert_eq!(names(path), ["config.toml"]);

    fs::write(path.join("file"), "").unwrap();
    let args = [
        "train",
        "config.toml",
        "--json",
        "--name",
        "a",
        "--runs",
        "file",
    ];
    assert_failure(&drape(path, &args), 1, &["cannot create file: "]);
}

#[cfg(not(feature = "cluster"))]
#[test]
fn one_of_several_processes_says_what_to_build() {
    let folder = folder();
    for name in ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"] {
        for (args, advice) in [
            (&["train"][..], "rebuild with `--features cluster`"),
            (
                &["baseline", "--policy", "sweep"],
                "only `drape train` shares its work",
            ),
            (&["eval", "runs/a"], "only `drape train` shares its work"),
        ] {
            let mut command = Command::new(env!("CARGO_BIN_EXE_drape"));
            command.args(args).env(name, "4").current_dir(&folder);
            let words = format!("started as one of 4 processes, expected one: {advice}");
            assert_failure(&command.output().unwrap(), 2, &[&words]);
        }
    }
    assert!(!folder.path().join("runs").exists());
}

#[cfg(not(feature = "gpu"))]
#[test]
fn device_that_is_not_built_in_says_how_to_get_it() {
    let folder = folder();
    let path = folder.path();
    let words = "device `gpu` is not in this build: rebuild with `--features gpu`";
    let output = refused(path, "device = \"gpu\"");
    assert_failure(&output, 2, &["config.toml: ", words]);
    let words = "`env.device` is gpu, expected cpu: this build computes on no GPU";
    let output = refused(path, "[env]\ndevice = \"gpu\"");
    assert_failure(&output, 2, &["config.toml: ", words]);
    fs::write(path.join("config.toml"), CONFIG).unwrap();
    let output = drape(path, &["train", "config.toml", "--device", "gpu"]);
    assert_failure(&output, 2, &["device `gpu` is not in this build"]);
    assert_eq!(names(path), ["config.toml"]);
}

#[test]
fn name_that_is_taken_is_refused_and_its_run_untouched() {
    let folder = trained();
    let path = folder.path();
    let before = files(&path.join("runs"));
    let output = refused(path, CONFIG);
    assert_failure(
        &output,
        2,
        &["run runs/a already exists: choose another name"],
    );
    assert!(files(&path.join("runs")) == before);
}

#[test]
fn damaged_checkpoints_are_located_and_nothing_is_changed() {
    let folder = trained();
    let path = folder.path();
    let run = path.join("runs/a");
    let last = run.join("checkpoints/last.drape");
    let whole = fs::read(&last).unwrap();
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 4;
    let stl = include_bytes!("../../assets/rib.stl");
    for (content, words) in [
        (
            Some(&whole[..whole.len() / 2]),
            &["last.drape: has ", " bytes, expected "][..],
        ),
        (Some(&whole[..5]), &["last.drape: has 5 bytes, expected 24"]),
        (Some(&[]), &["last.drape: has 0 bytes, expected 24"]),
        (Some(&flipped), &["last.drape: checksum is ", ", expected "]),
        (Some(stl), &["last.drape: not a drape file"]),
        (
            None,
            &["cannot read runs/a/checkpoints/last.drape: No such file"],
        ),
    ] {
        match content {
            Some(bytes) => fs::write(&last, bytes).unwrap(),
            None => fs::remove_file(&last).unwrap(),
        }
        let before = files(&run);
        for args in [
            &["eval", "runs/a", "--checkpoint", "last"][..],
            &["export", "runs/a", "--checkpoint", "last"],
            &["train", "--resume", "runs/a", "--json"],
        ] {
            assert_failure(&drape(path, args), 1, words);
        }
        assert!(files(&run) == before);
    }
    // The best one is another file.
    json(
        path,
        &[
            "eval",
            "runs/a",
            "--checkpoint",
            "best",
            "--episodes",
            "1",
            "--json",
        ],
    );
    let output = drape(path, &["eval", "runs/a", "--checkpoint", "none"]);
    assert_failure(&output, 2, &["there is no checkpoint none"]);
}

#[test]
fn checkpoint_of_another_run_is_refused() {
    let folder = trained();
    let path = folder.path();
    let other = CONFIG
        .replace("steps = 240", "steps = 80")
        .replace("seed = 3", "seed = 4");
    train(path, &other, "b");
    let file = "runs/b/checkpoints/last.drape";
    let words = ["b/checkpoints/last.drape: written for another configuration than runs/a/"];
    assert_failure(
        &drape(path, &["eval", "runs/a", "--checkpoint", file]),
        2,
        &words,
    );
    fs::copy(path.join(file), path.join("runs/a/checkpoints/last.drape")).unwrap();
    let before = files(&path.join("runs/a"));
    let output = drape(path, &["train", "--resume", "runs/a", "--json"]);
    assert_failure(
        &output,
        2,
        &["last.drape: written for another configuration than runs/a/"],
    );
    assert!(files(&path.join("runs/a")) == before);
}

#[test]
fn damaged_sequences_and_metrics_are_located() {
    let folder = trained();
    let path = folder.path();
    let file = path.join("runs/a/best_sequence.json");
    let text = fs::read_to_string(&file).unwrap();
    let sequence: Value = serde_json::from_str(&text).unwrap();
    let with = |vertices: &[Value]| {
        let mut sequence = sequence.clone();
        sequence["vertices"] = vertices.into();
        sequence.to_string()
    };
    let proof = path.join("runs/a/proof.json");
    let text_of_proof = fs::read_to_string(&proof).unwrap();
    for (content, words) in [
        (
            text_of_proof[..200].to_owned(),
            "proof.json: not a proof: EOF",
        ),
        (
            text_of_proof.replacen("\"vertices\": [", "\"vertices\": [9999,", 1),
            "proof.json presses vertex 9999, expected one below 289",
        ),
    ] {
        fs::write(&proof, content).unwrap();
        assert_failure(&drape(path, &["export", "runs/a"]), 1, &[words]);
    }
    fs::remove_file(&proof).unwrap();
    let vertices = sequence["vertices"].as_array().unwrap();
    let twice = [vertices[0].clone(), vertices[0].clone()];
    // A grid as large as one likes lets no vertex through that the blank has not.
    let mut large = sequence.clone();
    large["grid"]["rows"] = 1000.into();
    large["others"][0]["vertices"] = [99].as_slice().into();
    large["others"][0]["vertices"][0] = 999.into();
    fs::write(&file, large.to_string()).unwrap();
    let args = ["eval", "runs/a", "--prove"];
    let words = "best_sequence.json: presses vertex 999, expected one below 289";
    assert_failure(&drape(path, &args), 2, &[words]);
    large["grid"] = serde_json::json!({"rows": 900, "columns": 900});
    for (vertices, words) in [
        (
            vec![5000],
            "best_sequence.json: presses vertex 5000, expected one below 289",
        ),
        (
            vec![7; 290],
            "best_sequence.json: has 290 presses, expected at most 289",
        ),
    ] {
        large["vertices"] = vertices.into();
        fs::write(&file, large.to_string()).unwrap();
        for args in [
            &["eval", "runs/a", "--sequence"][..],
            &["eval", "runs/a", "--sequence", "--accuracy", "fast"],
            &["export", "runs/a"],
            &["compare", "runs/a", "runs/a"],
        ] {
            assert_failure(&drape(path, args), 2, &[words]);
        }
    }
    for (content, code, words) in [
        (
            text[..text.len() / 2].into(),
            1,
            &["best_sequence.json: not a best path: EOF"][..],
        ),
        (
            with(&[]),
            1,
            &["best_sequence.json has no vertices, expected one or more"],
        ),
        (
            with(&[9999.into()]),
            1,
            &["best_sequence.json presses vertex 9999, expected one below "],
        ),
        (
            with(&twice),
            2,
            &[
                "best_sequence.json: step 1 (from 0) of the sequence presses vertex ",
                "not allowed",
            ],
        ),
        (
            with(&vertices[..3]),
            2,
            &["the sequence ends after 3 steps, before the episode does"],
        ),
        (
            with(&[vertices.as_slice(), &twice].concat()),
            2,
            &[
                "best_sequence.json: the episode is over after ",
                "the sequence has ",
            ],
        ),
    ] {
        fs::write(&file, content).unwrap();
        for args in [&["eval", "runs/a", "--sequence"][..], &["export", "runs/a"]] {
            assert_failure(&drape(path, args), code, words);
        }
    }
    fs::remove_file(&file).unwrap();
    for args in [
        &["eval", "runs/a", "--sequence"][..],
        &["export", "runs/a"],
        &["compare", "runs/a", "runs/a"],
    ] {
        assert_failure(&drape(path, args), 2, &["runs/a has no best sequence, as"]);
    }
    fs::write(&file, text).unwrap();

    let metrics = path.join("runs/a/metrics.jsonl");
    let text = fs::read_to_string(&metrics).unwrap();
    fs::write(&metrics, text.replacen("\"step\"", "step", 1)).unwrap();
    let before = files(path);
    let args = ["train", "--resume", "runs/a", "--json"];
    assert_failure(
        &drape(path, &args),
        1,
        &["runs/a/metrics.jsonl, line 1: not a line of metrics"],
    );
    assert!(files(path) == before);

    // A time beyond any clock is a time, and the run goes on.
    let first = text.lines().next().unwrap();
    let mut late: Value = serde_json::from_str(first).unwrap();
    late["wall_time"] = 1e300.into();
    fs::write(&metrics, text.replacen(first, &late.to_string(), 1)).unwrap();
    json(path, &args);
    fs::write(&metrics, format!("{first}\n")).unwrap();
    assert_failure(
        &drape(path, &args),
        1,
        &["runs/a/metrics.jsonl has 1 lines, expected 3 at least"],
    );
}
