use super::run::*;
use super::*;

#[test]
fn training_leaves_a_complete_folder() {
    let folder = folder();
    fs::write(folder.path().join("config.toml"), CONFIG).unwrap();
    let args = ["train", "config.toml", "--name", "a"];
    let output = drape(folder.path(), &[&args[..], &["--json"]].concat());
    assert!(output.status.success());
    assert!(output.stderr.is_empty());
    let outcome: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(outcome["run"], "runs/a");
    assert_eq!(outcome["complete"], true);
    assert_eq!(outcome["env_steps"], 240);
    let shares = ["simulation_share", "inference_share", "update_share"];
    let shares = shares.map(|key| number(&outcome[key]));
    assert!(shares.iter().all(|share| *share > 0.0));
    assert!(shares.iter().sum::<f64>() <= 1.0, "{outcome}");

    let run = folder.path().join("runs/a");
    assert_eq!(files(&run).into_keys().collect::<Vec<_>>(), FILES);
    assert_eq!(names(folder.path()), ["config.toml", "runs"]);

    let info = read_json(&run.join("run.json"));
    assert_eq!(info["seed"], 3);
    assert_eq!(info["version"], env!("CARGO_PKG_VERSION"));

    let metrics = metrics(&run);
    assert_eq!(steps(&metrics), [80, 160, 240]);
    let mut best = f64::NEG_INFINITY;
    for (index, line) in metrics.iter().enumerate() {
        assert_eq!(number(&line["iteration"]), index as f64 + 1.0);
        let values = line.as_object().unwrap().values();
        assert!(values.into_iter().all(|value| value.is_number()), "{line}");
        assert!(number(&line["best_score"]) >= best.max(number(&line["greedy_score"])));
        best = number(&line["best_score"]);
    }
    assert_eq!(number(&outcome["best_score"]), best);
    assert_eq!(outcome["mean_score"], metrics[2]["mean_score"]);

    let sequence = read_json(&run.join("best_sequence.json"));
    assert_eq!(number(&sequence["score"]), best);
    let others = sequence["others"].as_array().unwrap();
    let scores: Vec<f64> = others.iter().map(|other| number(&other["score"])).collect();
    assert!(!scores.is_empty() && scores.len() < 64, "{scores:?}");
    assert!(scores[0] <= best && scores.is_sorted_by(|a, b| a >= b));
    let proved = read_json(&run.join("proof.json"));
    assert_eq!(proved["proof"], outcome["proof"]);
    let paths: Vec<&Value> = std::iter::once(&sequence)
        .chain(others)
        .map(|path| &path["vertices"])
        .collect();
    assert!(paths.contains(&&proved["path"]["vertices"]));
    let path = read_json(&run.join("trajectory.json"));
    let points = path["points"].as_array().unwrap();
    let pressed: Vec<&Value> = points.iter().map(|point| &point["vertex"]).collect();
    let vertices = proved["path"]["vertices"].as_array().unwrap();
    assert_eq!(pressed, vertices.iter().collect::<Vec<_>>());
    assert!(vertices.len() > 10);
}

#[test]
fn pictures_and_film_decode_in_their_sizes() {
    let folder = trained();
    let pictures = folder.path().join("runs/a/pictures");
    for (name, size) in [
        ("before.png", (720, 620)),
        ("after.png", (720, 620)),
        ("crushed.png", (720, 620)),
        ("path.png", (720, 620)),
        ("reward.png", (960, 560)),
    ] {
        let file = std::io::BufReader::new(fs::File::open(pictures.join(name)).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height), size, "{name}");
        assert!(pixels.iter().any(|&value| value != pixels[0]), "{name}");
    }
    let file = fs::File::open(pictures.join("rollout.gif")).unwrap();
    let mut film = gif::DecodeOptions::new().read_info(file).unwrap();
    assert_eq!((film.width(), film.height()), (480, 400));
    let mut count = 0;
    while film.read_next_frame().unwrap().is_some() {
        count += 1;
    }
    let proved = read_json(&folder.path().join("runs/a/proof.json"));
    let presses = proved["path"]["vertices"].as_array().unwrap().len();
    // One before each press and one at the end.
    assert_eq!(count, presses + 1);
}

/// Length, checksum, data, checksum: as many records as lines of metrics, and the version.
#[test]
fn events_are_a_chain_of_records() {
    let folder = trained();
    let path = "runs/a/events/events.out.tfevents.drape";
    let bytes = fs::read(folder.path().join(path)).unwrap();
    let mut rest = &bytes[..];
    let mut records = Vec::new();
    while !rest.is_empty() {
        let length = u64::from_le_bytes(rest[..8].try_into().unwrap()) as usize;
        records.push(&rest[12..12 + length]);
        rest = &rest[16 + length..];
    }
    let holds =
        |record: &[u8], text: &str| record.windows(text.len()).any(|w| w == text.as_bytes());
    assert_eq!(records.len(), 4);
    assert!(holds(records[0], "brain.Event:2"));
    for record in &records[1..] {
        for tag in ["iteration", "greedy_score", "policy_loss", "wall_time"] {
            assert!(holds(record, tag), "{tag}");
        }
    }
}

/// The resolved configuration, moved elsewhere, trains the same again; keys that were
/// switched off stay so.
#[test]
fn resolved_configuration_is_complete() {
    let folder = folder();
    let path = folder.path();
    let off = "[ppo]\nimitation = \"off\"\nmax_grad_norm = \"off\"";
    let config = CONFIG
        .replace("[ppo]", off)
        .replace("steps = 240", "steps = 80");
    train(path, &config, "a");
    let text = fs::read_to_string(path.join("runs/a/config.toml")).unwrap();
    assert!(text.contains("imitation = \"off\""), "{text}");
    train(path, &text, "b");
    let [a, b] = ["runs/a", "runs/b"].map(|run| files(&path.join(run)));
    for name in ["config.toml"].iter().chain(&LEARNT) {
        assert!(a[*name] == b[*name], "{name}");
    }
    json(path, &["eval", "runs/a", "--episodes", "1", "--json"]);
    json(path, &["train", "--resume", "runs/a", "--json"]);
}

/// By a key or by an option; what is written is what it stands for.
#[test]
fn accuracy_is_resolved_in_the_configuration_of_the_run() {
    let folder = folder();
    let path = folder.path();
    let config = CONFIG.replace("steps = 240", "steps = 80");
    let with = |line: &str| config.replace("[env]", &format!("[env]\n{line}"));
    train(path, &with("accuracy = \"fast\""), "key");
    fs::write(path.join("config.toml"), with("substep_rate = 900")).unwrap();
    let args = ["train", "config.toml", "--name", "option", "--json"];
    json(path, &[&args[..], &["--accuracy", "fast"]].concat());
    train(path, &with("accuracy = \"balanced\""), "balanced");
    train(path, &config, "default");
    let [key, option, balanced, default] = ["key", "option", "balanced", "default"]
        .map(|run| fs::read_to_string(path.join("runs").join(run).join("config.toml")).unwrap());
    assert!(key.contains("\naccuracy = \"fast\"\n"), "{key}");
    assert!(!key.contains("substep_rate = 900"), "{key}");
    assert_eq!(key, option);
    assert_ne!(key, default);
    assert_eq!(balanced, default);
    json(path, &["eval", "runs/key", "--episodes", "1", "--json"]);
    for [option, value] in [["--accuracy", "fast"], ["--runs", "runs"]] {
        let args = ["train", "--resume", "runs/key", option, value];
        assert_eq!(drape(path, &args).status.code(), Some(2));
    }
}

#[test]
fn text_has_no_control_codes_where_nobody_watches() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("config.toml"), CONFIG).unwrap();
    let output = drape(path, &["train", "config.toml", "--name", "a"]);
    let (stdout, stderr) = (
        String::from_utf8(output.stdout).unwrap(),
        said(output.stderr),
    );
    assert!(output.status.success(), "{stderr}");
    assert_eq!(
        stderr,
        "writing runs/a\nplaying 32 random episodes for comparison\nproving the best paths\n"
    );
    assert!(
        stdout.starts_with("runs/a: 240 environment steps in "),
        "{stdout}"
    );
    assert!(stdout.ends_with("next: drape eval runs/a\n"), "{stdout}");
    assert!(stdout.lines().all(|line| line.len() <= 100), "{stdout}");
    let control = |c: char| c.is_control() && c != '\n';
    assert!(!stdout.contains(control), "{stdout:?}");
}

#[test]
fn runs_without_a_name_are_dated_and_never_overwritten() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("config.toml"), CONFIG).unwrap();
    let args = [
        "train",
        "config.toml",
        "--steps",
        "1",
        "--runs",
        "in/here",
        "--json",
    ];
    let runs = [(); 2].map(|()| json(path, &args)["run"].as_str().unwrap().to_owned());
    assert_ne!(runs[0], runs[1]);
    assert_eq!(names(&path.join("in/here")).len(), 2);
    for run in runs {
        assert!(run.starts_with("in/here/20"), "{run}");
        assert_eq!(
            files(&path.join(run)).into_keys().collect::<Vec<_>>(),
            FILES
        );
    }
}

#[test]
fn learning_does_not_depend_on_the_number_of_threads() {
    let folder = folder();
    fs::write(folder.path().join("config.toml"), CONFIG).unwrap();
    let train = |threads: &str, seed: &str| {
        let name = format!("{threads}-{seed}");
        let mut command = Command::new(env!("CARGO_BIN_EXE_drape"));
        command.args([
            "train",
            "config.toml",
            "--json",
            "--name",
            &name,
            "--seed",
            seed,
        ]);
        command.env("RAYON_NUM_THREADS", threads);
        let output = command.current_dir(folder.path()).output().unwrap();
        assert!(output.status.success());
        let run = folder.path().join("runs").join(name);
        let files = files(&run);
        (LEARNT.map(|name| files[name].clone()), metrics(&run))
    };
    let one = train("1", "5");
    assert!(one == train("2", "5"));
    assert!(one == train("3", "5"));
    let other = train("2", "6");
    for (name, (a, b)) in LEARNT.iter().zip(one.0.iter().zip(&other.0)) {
        assert!(a != b, "{name}");
    }
}

/// The network halves the image three times: 17 x 17 leaves 2 x 2.
#[test]
fn paper_preset_trains() {
    let folder = folder();
    let path = folder.path();
    let config = format!("preset = \"paper\"\n{CONFIG}");
    let outcome = train(path, &config, "a");
    assert_eq!(outcome["env_steps"], 240);
    assert_eq!(
        files(&path.join("runs/a")).into_keys().collect::<Vec<_>>(),
        FILES
    );
    let metrics = metrics(&path.join("runs/a"));
    assert_eq!(number(&metrics[2]["learning_rate"]), 2.5e-4);
    let report = json(path, &["eval", "runs/a", "--episodes", "2", "--json"]);
    assert!(number(&report["episode"]["score"]) > 0.0);
    let small = config.replace("[17, 17]", "[7, 17]");
    let other = super::folder();
    let output = refused(other.path(), &small.replace("-80.0, -80.0", "186.0, 186.0"));
    assert_failure(
        &output,
        2,
        &["config.toml: policy: `network.paper.channels` is 3 blocks"],
    );
}

#[test]
fn complete_run_is_not_trained_further() {
    let folder = trained();
    let path = folder.path();
    let run = path.join("runs/a");
    let before = files(&run);
    let outcome = json(path, &["train", "--resume", "runs/a", "--json"]);
    assert_eq!(outcome["complete"], true);
    assert_eq!(outcome["env_steps"], 240);
    let last = metrics(&run).pop().unwrap();
    for key in ["mean_score", "best_score"] {
        assert_eq!(outcome[key], last[key]);
    }
    let after = files(&run);
    assert_eq!(
        after.keys().collect::<Vec<_>>(),
        before.keys().collect::<Vec<_>>()
    );
    // The event file carries the time at which it was written.
    for (name, bytes) in before
        .iter()
        .filter(|(name, _)| !name.starts_with("events/"))
    {
        assert!(after[name] == *bytes, "{name}");
    }
}

/// Killed or asked to stop while it polishes, a run polishes again to the same end, and so does one
/// that has come to its end. What is found is no worse than without.
#[cfg(unix)]
#[test]
fn interrupted_polish_begins_again() {
    let folder = folder();
    let path = folder.path();
    let plain = train(path, CONFIG, "plain");
    let config = CONFIG.replace("steps = 240", "steps = 240\npolish = 400");
    let whole = train(path, &config, "whole");
    let proved = |outcome: &Value| number(&outcome["proof"][0]["score"]);
    assert!(proved(&whole) >= proved(&plain));
    // What was searched for in the steps of a proof is what it finds.
    assert!(proved(&whole) >= number(&whole["best_score"]));
    let expected = files(&path.join("runs/whole"));
    for signal in ["KILL", "INT"] {
        let (run, output) = interrupted(path, &config, signal, signal, 3);
        assert_eq!(names(&run.join("pictures")), [""; 0]);
        if signal == "INT" {
            let outcome: Value = serde_json::from_slice(&output.stdout).unwrap();
            assert_eq!(outcome["complete"], false);
        }
        for _ in 0..2 {
            let run = run.to_str().unwrap();
            let resumed = json(path, &["train", "--resume", run, "--json"]);
            assert_eq!(resumed["best_score"], whole["best_score"]);
        }
        let found = files(&run);
        for name in LEARNT {
            assert!(found[name] == expected[name], "{signal}: {name}");
        }
    }
    // What it has proved it keeps, without polish, with more steps, and polished again.
    let score = || number(&read_json(&path.join("runs/whole/proof.json"))["path"]["score"]);
    let before = score();
    for (key, value) in [("--polish", "0"), ("--steps", "320"), ("--polish", "200")] {
        json(
            path,
            &["train", "--resume", "runs/whole", key, value, "--json"],
        );
        assert!(score() >= before, "{key} {value}");
        let args = [
            "eval",
            "runs/whole",
            "--sequence",
            "--episodes",
            "1",
            "--json",
        ];
        json(path, &args);
    }
}

/// Killed or asked to stop as soon as it has begun, a run that searches comes to the same end. The best that
/// was found is among what it keeps.
#[cfg(unix)]
#[test]
fn interrupted_search_begins_again() {
    let folder = folder();
    let path = folder.path();
    let imitation = "[ppo.imitation]\npretraining = 20\n";
    let config = CONFIG.replace("steps = 240", "steps = 240\nsearch = 8000") + imitation;
    let whole = train(path, &config, "whole");
    let found = train(path, &config.replace("search = 8000", "search = 0"), "none");
    assert!(number(&whole["best_score"]) > number(&found["best_score"]));
    let expected = files(&path.join("runs/whole"));
    for signal in ["KILL", "INT"] {
        let (run, _) = interrupted(path, &config, signal, signal, 0);
        json(
            path,
            &["train", "--resume", run.to_str().unwrap(), "--json"],
        );
        let found = files(&run);
        for name in LEARNT {
            assert!(found[name] == expected[name], "{signal}: {name}");
        }
    }
    let off = config.replace(imitation, "");
    let off = off.replace("[ppo]\n", "[ppo]\nimitation = \"off\"\n");
    let message = "config.toml: `search` is 8000, expected 0 where nothing is imitated";
    assert_failure(&refused(path, &off), 2, &[message]);
}

#[cfg(unix)]
#[test]
fn interrupted_training_goes_on_exactly() {
    let folder = folder();
    let path = folder.path();
    let config = CONFIG
        .replace("steps = 240", "steps = 1600")
        .replace("evaluation_interval = 1", "evaluation_interval = 7");
    train(path, &config, "whole");
    let whole = path.join("runs/whole");
    let expected = files(&whole);

    let check = |run: &Path| {
        let found = files(run);
        assert_eq!(
            found.keys().collect::<Vec<_>>(),
            expected.keys().collect::<Vec<_>>()
        );
        let steady = |name: &str| {
            !matches!(name, "metrics.jsonl" | "run.json") && !name.starts_with("events/")
        };
        for (name, bytes) in expected.iter().filter(|(name, _)| steady(name)) {
            assert!(found[name] == *bytes, "{name} of {}", run.display());
        }
        assert_eq!(metrics(run), metrics(&whole));
        let events = "events/events.out.tfevents.drape";
        assert_eq!(found[events].len(), expected[events].len());
    };

    // Asked to stop: it ends the iteration, saves and says so.
    let (run, output) = interrupted(path, &config, "int", "INT", 3);
    assert_eq!(output.status.code(), Some(130));
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        stderr,
        "stopping after this iteration, search or proof; again to stop at once\n"
    );
    let outcome: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(outcome["complete"], false);
    assert_eq!(names(&run.join("pictures")), [""; 0]);
    assert_eq!(outcome["env_steps"], *steps(&metrics(&run)).last().unwrap());
    let resumed = json(path, &["train", "--resume", "runs/int", "--json"]);
    assert_eq!(resumed["complete"], true);
    let last = metrics(&whole).pop().unwrap();
    assert_eq!(resumed["best_score"], last["best_score"]);
    check(&run);

    // Killed before and after the first regular checkpoint, in the middle of a line.
    for (name, lines) in [("early", 2), ("late", 12)] {
        let (run, output) = interrupted(path, &config, name, "KILL", lines);
        assert_eq!(output.status.code(), None);
        let mut log = fs::OpenOptions::new()
            .append(true)
            .open(run.join("metrics.jsonl"))
            .unwrap();
        std::io::Write::write_all(&mut log, b"{\"step\":\n\xff").unwrap();
        json(
            path,
            &["train", "--resume", &format!("runs/{name}"), "--json"],
        );
        check(&run);
    }
}

/// Killed before its first checkpoint, a run has little more than its configuration.
#[test]
fn run_without_a_checkpoint_begins_anew() {
    let folder = trained();
    let path = folder.path();
    let run = path.join("runs/a");
    let expected = files(&run);
    for name in names(&run) {
        let file = run.join(&name);
        if file.is_dir() {
            fs::remove_dir_all(&file).unwrap();
        } else if !matches!(&*name, "config.toml" | "run.json") {
            fs::remove_file(&file).unwrap();
        }
    }
    fs::write(run.join("metrics.jsonl"), "").unwrap();
    json(path, &["train", "--resume", "runs/a", "--json"]);
    let found = files(&run);
    assert!(found.keys().eq(expected.keys()));
    for name in LEARNT {
        assert!(found[name] == expected[name], "{name}");
    }
}

#[test]
fn run_in_use_is_refused() {
    let folder = trained();
    let path = folder.path();
    let before = files(path);
    let lock = fs::File::create(path.join("runs/a/.lock")).unwrap();
    lock.lock().unwrap();
    for args in [
        &["train", "--resume", "runs/a", "--json"][..],
        &["eval", "runs/a", "--prove", "--episodes", "1"],
    ] {
        assert_failure(&drape(path, args), 2, &["runs/a is in use"]);
    }
    let after = files(path);
    assert!(before.iter().all(|(name, bytes)| after[name] == *bytes));
}

/// The file that does not fit is left out, the one before it stays, and the run goes on once
/// there is room.
#[cfg(unix)]
#[test]
fn full_disk_during_training_costs_no_checkpoint() {
    let folder = folder();
    let path = folder.path();
    let config = CONFIG.replace("steps = 240", "steps = 1600");
    train(path, &config, "whole");
    let (run, _) = interrupted(path, &config, "a", "TERM", 3);
    let before = files(&run);
    let args = ["train", "--resume", "runs/a", "--json"];
    let output = drape_on_full_disk(path, &args);
    assert_failure(
        &output,
        1,
        &["cannot write runs/a/checkpoints/", ".drape: File too large"],
    );
    let after = files(&run);
    assert_eq!(
        after.keys().collect::<Vec<_>>(),
        before.keys().collect::<Vec<_>>()
    );
    for name in ["checkpoints/last.drape", "config.toml", "run.json"] {
        assert!(after[name] == before[name], "{name}");
    }
    json(
        path,
        &[
            "eval",
            "runs/a",
            "--checkpoint",
            "last",
            "--episodes",
            "1",
            "--json",
        ],
    );
    json(path, &args);
    let [found, expected] = ["runs/a", "runs/whole"].map(|run| files(&path.join(run)));
    for name in LEARNT {
        assert!(found[name] == expected[name], "{name}");
    }

    let output = drape_on_full_disk(path, &["train", "config.toml", "--name", "b", "--json"]);
    assert_failure(
        &output,
        1,
        &["cannot write runs/b/checkpoints/last.drape: File too large"],
    );
}

/// A step limit ends episodes early; they count with what they have reached.
#[test]
fn step_limit_shorter_than_an_episode_trains_and_replays() {
    let folder = folder();
    let path = folder.path();
    let config = CONFIG
        .replace("[env]", "[env]\nmax_steps = 5")
        .replace("steps = 240", "steps = 80");
    train(path, &config, "a");
    let report = json(path, &["eval", "runs/a", "--episodes", "2", "--json"]);
    assert_eq!(report["episode"]["steps"], 5);
}

/// Where the cloth lies on the tool already there is nothing to learn.
#[test]
fn region_that_lies_on_the_tool_is_refused() {
    let folder = folder();
    let path = folder.path();
    let config = CONFIG
        .replace("kind = \"rib\"", "kind = \"plate\"")
        .replace("move_mm = [24.0, 0.0, 0.0]", "")
        .replace(
            "[scene.fall]",
            "[scene.placement]\ntilt_deg = 0.0\nheight_mm = 0.0\n[scene.fall]",
        );
    let output = refused(path, &config);
    assert_failure(&output, 2, &["`env.region_mm` has", "expected a region"]);
}
