use super::run::*;
use super::*;

const STUDY: [&str; 6] = ["study", "learning", "a.toml", "b.toml", "--steps", "240"];

#[test]
fn seeds_are_trained_compared_and_gone_on_with() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("a.toml"), CONFIG).unwrap();
    fs::write(
        path.join("b.toml"),
        CONFIG.replace("epochs = 2", "epochs = 1"),
    )
    .unwrap();
    let study = |more: &[&str]| drape(path, &[&STUDY[..], more, &["--json"]].concat());
    let report = |more: &[&str]| -> Value {
        let output = study(more);
        assert!(output.status.success(), "{}", said(output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let first = report(&["--seeds", "2", "--jobs", "2", "--out", "s"]);
    let rows = first["figures"].as_array().unwrap();
    assert_eq!(rows.len(), 18);
    for row in rows {
        assert_eq!(row["runs"], 2, "{row}");
        let [low, mean, high] = ["low", "mean", "high"].map(|key| number(&row[key]));
        assert!(low <= mean && mean <= high, "{row}");
    }
    assert_eq!(first["runs"].as_array().unwrap().len(), 4);
    for row in first["improvement"].as_array().unwrap() {
        assert_eq!(row["configuration"], "b");
        assert!((0.0..=1.0).contains(&number(&row["probability"])), "{row}");
    }
    let out = path.join("s");
    let files = [
        "a",
        "b",
        "best.png",
        "figures.csv",
        "greedy.png",
        "improvement.csv",
        "learning.json",
        "learning.md",
        "mean.png",
        "runs.csv",
    ];
    assert_eq!(names(&out), files);

    // As `drape train` trains it.
    let train = [
        "train", "a.toml", "--seed", "2", "--steps", "240", "--name", "x",
    ];
    assert!(drape(path, &train).status.success());
    for file in ["best_sequence.json", "proof.json"] {
        let read = |run: &str| fs::read(path.join(run).join(file)).unwrap();
        assert_eq!(read("s/a/seed-2"), read("runs/x"), "{file}");
    }

    // One run is complete but for its proof, one but for its pictures, one is missing; the others stay as they are.
    fs::remove_file(out.join("b/seed-1/pictures/after.png")).unwrap();
    let [lost, kept] = ["b/seed-2/proof.json", "a/seed-1/proof.json"].map(|name| out.join(name));
    let old = fs::read(&lost).unwrap();
    fs::remove_file(&lost).unwrap();
    fs::write(&kept, fs::read_to_string(&kept).unwrap() + " ").unwrap();
    let again = report(&["--seeds", "3", "--resume", "s"]);
    assert_eq!(fs::read(&lost).unwrap(), old);
    assert!(out.join("b/seed-1/pictures/after.png").exists());
    assert!(fs::read_to_string(&kept).unwrap().ends_with(' '));
    let runs = again["runs"].as_array().unwrap();
    let seconds = |row: &Value| number(&row["seconds"]);
    assert_eq!(runs.len(), 6);
    assert_eq!(seconds(&runs[0]), seconds(&first["runs"][0]));
    assert_eq!(seconds(&runs[4]), seconds(&first["runs"][3]));

    fs::write(path.join("b.toml"), CONFIG).unwrap();
    let refused = study(&["--seeds", "2", "--resume", "s"]);
    let words = ["b/seed-1: trained with another configuration than b.toml for seed 1"];
    assert_failure(&refused, 2, &words);
}

#[test]
fn what_cannot_be_studied_is_refused_before_the_first_training() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("a.toml"), CONFIG).unwrap();
    fs::write(path.join("b.toml"), "seed = -1").unwrap();
    fs::write(path.join("runs.csv.toml"), CONFIG).unwrap();
    for (args, words) in [
        (
            &["runs.csv.toml"][..],
            "a configuration is called `runs.csv`, expected",
        ),
        (&["a.toml", "b.toml"][..], "b.toml:1:8: invalid value"),
        (
            &["a.toml", "./a.toml"][..],
            "two configurations are called `a`",
        ),
        (
            &["a.toml", "--resume", "none"][..],
            "there is no folder none",
        ),
    ] {
        let output = drape(path, &[&["study", "learning"], args].concat());
        assert_failure(&output, 2, &[words]);
        assert!(names(path).iter().all(|name| name.ends_with(".toml")));
    }
}

/// A name may begin like an option, and no training lives on without its study: it keeps what it has learnt, also
/// where it is asked to stop itself, as by Ctrl-C at a terminal.
#[cfg(target_os = "linux")]
#[test]
fn trainings_are_of_their_study() {
    let folder = folder();
    let path = folder.path();
    fs::write(
        path.join("-a.toml"),
        CONFIG.replace("steps = 240", "steps = 1000000"),
    )
    .unwrap();
    for (out, signal) in [("r", "KILL"), ("s", "INT")] {
        let mut study = Command::new(env!("CARGO_BIN_EXE_drape"));
        study.args([
            "study", "learning", "--seeds", "1", "--out", out, "--", "-a.toml",
        ]);
        let mut study = begun(study.current_dir(path), &[]);
        let run = path.join(out).join("-a/seed-1");
        wait_for_lines(&run, 1);
        let checkpoint = || fs::read(run.join("checkpoints/last.drape")).unwrap();
        let (before, id) = (checkpoint(), study.id());
        let children = format!("/proc/{id}/task/{id}/children");
        let training: u32 = fs::read_to_string(children)
            .unwrap()
            .trim()
            .parse()
            .unwrap();
        if signal == "INT" {
            send(signal, training);
        }
        send(signal, id);
        study.wait().unwrap();
        let start = std::time::Instant::now();
        // It has let go of its run, and can be gone on with.
        while fs::File::open(run.join(".lock"))
            .unwrap()
            .try_lock()
            .is_err()
        {
            assert!(start.elapsed().as_secs() < 60, "it trains on");
        }
        assert!(checkpoint() != before, "{out}");
    }
}
