//! The files that a run is made from: what becomes of them, and of the run without them.

use super::run::*;
use super::*;

const MATERIAL: &str = include_str!("../../configs/materials/interglas-92125.toml");

const SQUARE: &str = "-185,-185\n185,-185\n185,185\n-185,185\n";

/// Tool, material and outline of a run may change or go, and the run be moved: it goes on from its
/// own copies. Two of them have the same name.
#[test]
fn a_run_keeps_what_it_was_made_from() {
    let folder = folder();
    let path = folder.path();
    stdout(path, &["tool", "rib", "--out", "tool.stl"]);
    fs::create_dir(path.join("sub")).unwrap();
    fs::write(path.join("sheet.txt"), MATERIAL).unwrap();
    fs::write(path.join("sub/sheet.txt"), SQUARE).unwrap();
    let config = CONFIG
        .replace(
            "[scene.blank]\n",
            "[scene.blank]\noutline = \"sub/sheet.txt\"\n",
        )
        .replace(
            "[scene.blank]",
            "[scene]\nmaterial = \"sheet.txt\"\n\n[scene.blank]",
        )
        .replace("shape]\nkind = \"rib\"", "stl]\npath = \"tool.stl\"");
    train(path, &config, "a");
    let run = path.join("runs/a");
    let inputs = ["_sheet.txt", "sheet.txt", "tool.stl"];
    assert_eq!(names(&run.join("inputs")), inputs);

    let eval = |run: &str| {
        let args = ["eval", run, "--sequence", "--episodes", "1", "--json"];
        let report = json(path, &args);
        let mut episode = report["episode"].clone();
        episode.as_object_mut().unwrap().remove("seconds");
        episode
    };
    let before = eval("runs/a");
    stdout(path, &["tool", "hemisphere", "--out", "tool.stl"]);
    fs::write(path.join("sheet.txt"), MATERIAL.replace("0.35", "0.5")).unwrap();
    fs::remove_dir_all(path.join("sub")).unwrap();
    assert_eq!(eval("runs/a"), before);
    fs::create_dir(path.join("moved")).unwrap();
    fs::rename(&run, path.join("moved/b")).unwrap();
    let run = path.join("moved/b");
    assert_eq!(eval("moved/b"), before);
    json(path, &["export", "moved/b", "--json"]);
    json(path, &["train", "--resume", "moved/b", "--json"]);

    // Its configuration makes another run of the same files.
    let args = ["train", "moved/b/config.toml", "--name", "c", "--json"];
    json(path, &args);
    let [b, c] = [&run, &path.join("runs/c")].map(|run| files(run));
    for name in ["config.toml"].iter().chain(&LEARNT) {
        assert!(b[*name] == c[*name], "{name}");
    }

    for name in inputs {
        let file = run.join("inputs").join(name);
        let whole = fs::read(&file).unwrap();
        let mut changed = whole.clone();
        changed[5] ^= 1;
        for (content, words) in [
            (Some(changed), ": digest is crc32:"),
            (None, ": No such file"),
        ] {
            match content {
                Some(content) => fs::write(&file, content).unwrap(),
                None => fs::remove_file(&file).unwrap(),
            }
            let before = files(&run);
            for args in [
                &["eval", "moved/b"][..],
                &["export", "moved/b"],
                &["train", "--resume", "moved/b", "--json"],
                &["compare", "moved/b", "runs/c"],
                &["study", "twin", "--path", "moved/b", "--out", "out"],
            ] {
                let words = [&format!("moved/b/inputs/{name}{words}")[..]];
                assert_failure(&drape(path, args), 2, &words);
            }
            assert!(files(&run) == before);
        }
        fs::write(&file, whole).unwrap();
    }

    // What does not say what its files were is another configuration.
    let file = run.join("config.toml");
    let text = fs::read_to_string(&file).unwrap();
    let table = text.find("[inputs]").unwrap();
    fs::write(&file, &text[..table]).unwrap();
    let words = ["last.drape: written for another configuration than moved/b/"];
    let args = ["train", "--resume", "moved/b", "--json"];
    assert_failure(&drape(path, &args), 2, &words);
}

/// What a command reads, or a run is made of, is not replaced by what it writes: it says so before the work.
#[test]
fn nothing_that_is_read_is_written_over() {
    let folder = trained();
    let path = folder.path();
    stdout(path, &["tool", "rib", "--out", "tool.stl"]);
    let scene = scene(RIB).replace("shape]\nkind = \"rib\"", "mesh]\npath = \"tool.stl\"");
    fs::write(path.join("scene.toml"), scene).unwrap();
    let before = files(path);
    let runs = [
        "config.toml",
        "run.json",
        "proof.json",
        "metrics.jsonl",
        "best_sequence.json",
        "checkpoints/best.drape",
        "loop.json",
    ];
    for file in runs.map(|name| format!("runs/a/{name}")) {
        for args in [
            &["export", "runs/a", "--out", &file][..],
            &["eval", "runs/a", "--episodes", "0", "--state", &file],
            &["view", "runs/a", "--export", &file],
        ] {
            let message = format!("{file} would be replaced, but the run ");
            assert_failure(&drape(path, args), 2, &[&message, " needs it"]);
        }
    }
    for args in [
        &["tool", "rib", "--out", "runs/a/events/tool.stl"][..],
        &[
            "eval",
            "runs/a",
            "--episodes",
            "0",
            "--out",
            "runs/a/pictures",
        ],
    ] {
        assert_failure(&drape(path, args), 2, &[" would be replaced, but the run "]);
    }
    for args in [
        &["scene", "scene.toml", "--out", "."][..],
        &["scene", "scene.toml", "--out", "o", "--state", "tool.stl"],
        &["view", "scene.toml", "--export", "tool.stl"],
        &["view", "scene.toml", "--export", "scene.toml"],
    ] {
        assert_failure(&drape(path, args), 2, &[" would be replaced, but is read"]);
    }
    assert!(files(path) == before);
}
