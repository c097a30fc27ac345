use std::fs;
use std::path::Path;
use std::process::Output;

use serde_json::{Value, json};

use super::viewer::{Viewer, drape};

fn run(folder: &Path, args: &[&str]) -> Output {
    let output = drape().args(args).current_dir(folder).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{args:?}: {stderr}");
    output
}

#[test]
fn a_task_made_in_the_page_is_one_that_train_takes() {
    let viewer = Viewer::new();
    let mut page = viewer.page();
    let start = page.ready();
    let change = json!({
        "region_mm": [-100.0, -100.0, 0.0, 20.0],
        "placement": { "centre_mm": [5.0, 0.0], "height_mm": 105.0, "tilt_deg": 4.0 },
        "clamps": [{ "at_mm": [-130, -130], "radius_mm": 10, "move_mm": [0, 0, -60] }],
        "tool": "cylinder",
    });
    page.say(&json!({ "do": "task", "change": change }));
    page.until(|moment| moment["stage"] == 2 && moment["phase"] == "ready");
    assert_ne!(page.bits(), start);
    assert_eq!(page.stage["region_mm"], change["region_mm"]);
    // One that cannot be leaves all as it is.
    let lies = page.bits();
    page.say(&json!({ "do": "task", "change": { "region_mm": [900, 900, 901, 901] } }));
    page.words("region_mm");
    assert_eq!(page.bits(), lies);
    page.say(&json!({ "do": "save_task" }));
    page.words("task-1.toml");
    let folder = viewer.folder.path();
    run(
        folder,
        &["train", "task-1.toml", "--name", "a", "--polish", "0"],
    );
    let config: toml::Table =
        toml::from_str(&fs::read_to_string(folder.join("runs/a/config.toml")).unwrap()).unwrap();
    assert_eq!(
        config["env"]["region_mm"].as_array().unwrap()[3].as_float(),
        Some(20.0)
    );
    assert_eq!(
        config["scene"]["clamps"][0]["radius_mm"].as_float(),
        Some(10.0)
    );
    assert_eq!(
        config["scene"]["tool"]["source"]["shape"]["kind"].as_str(),
        Some("cylinder")
    );
}

#[test]
fn presses_by_hand_are_recorded_proved_and_imitated() {
    let viewer = Viewer::new();
    let folder = viewer.folder.path();
    let mut page = viewer.page();
    page.ready();
    page.say(&json!({ "do": "save_presses" }));
    page.words("nothing has been pressed");
    let order: Vec<u32> = (0..8)
        .rev()
        .flat_map(|row| (0..8).map(move |column| 17 * row + 7 - column))
        .collect();
    page.press(&order);
    let score = page.moment["numbers"]["score"].as_f64().unwrap();
    page.say(&json!({ "do": "save_presses" }));
    assert!(page.words("presses-1").contains("presses-1.drape"));
    page.say(&json!({ "do": "save_presses" }));
    page.words("presses-2.drape");
    let made: Value =
        serde_json::from_slice(&fs::read(folder.join("presses-1.json")).unwrap()).unwrap();
    assert_eq!(made["vertices"], json!(order));
    assert_eq!(made["score"], score);

    for files in [["presses-1.drape"], ["presses-1.json"]] {
        let name = files[0];
        run(
            folder,
            &[
                &[
                    "train",
                    "presses-1.toml",
                    "--polish",
                    "0",
                    "--name",
                    name,
                    "--demonstrate",
                ],
                &files[..],
            ]
            .concat(),
        );
        let kept: Value = serde_json::from_slice(
            &fs::read(folder.join("runs").join(name).join("demonstrations.json")).unwrap(),
        )
        .unwrap();
        assert_eq!(kept, json!([order]));
        // What was shown is among what the run has found, as far as the rules let it be pressed.
        let best: Value = serde_json::from_slice(
            &fs::read(folder.join("runs").join(name).join("best_sequence.json")).unwrap(),
        )
        .unwrap();
        let lists = std::iter::once(&best["vertices"]).chain(
            best["others"]
                .as_array()
                .unwrap()
                .iter()
                .map(|other| &other["vertices"]),
        );
        let begins = |list: &Value| {
            list.as_array().unwrap().iter().take(3).eq(order[..1]
                .iter()
                .map(|&v| json!(v))
                .collect::<Vec<_>>()
                .iter()
                .chain(&list.as_array().unwrap()[1..3]))
        };
        assert!(lists.into_iter().any(begins), "{best}");
    }
    // The same bits once more, by another command.
    let again = run(
        folder,
        &[
            "eval",
            "runs/presses-1.drape",
            "--recording",
            "presses-1.drape",
            "--json",
        ],
    );
    let again: Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!(
        (&again["same_bits"], &again["score"]),
        (&json!(true), &json!(score))
    );

    let output = drape()
        .args(["train", "--demonstrate", "presses-1.drape"])
        .current_dir(folder)
        .output()
        .unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(
        stderr.contains("presses-1.drape: its presses are on another blank"),
        "{stderr}"
    );
}

#[test]
fn a_run_is_replayed_and_its_policy_asked() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("task.toml"), super::TASK).unwrap();
    run(
        folder.path(),
        &["train", "task.toml", "--name", "a", "--polish", "0"],
    );
    let read = |name: &str| -> Value {
        serde_json::from_slice(&fs::read(folder.path().join("runs/a").join(name)).unwrap()).unwrap()
    };
    let path = read("proof.json")["path"]["vertices"].clone();
    let nominal = read("best_sequence.json");
    let viewer = Viewer::of(folder, &["runs/a"]);
    let mut page = viewer.page();
    page.ready();
    let start = page.moment["at"].as_u64().unwrap();
    let presses = path.as_array().unwrap().len() as u64;
    assert_eq!(
        (&page.moment["count"], &page.moment["has_policy"]),
        (&json!(start + presses + 1), &json!(true))
    );
    // Its end, and back, without what lies between.
    page.order(&json!({ "do": "seek", "to": start + presses }));
    let end = page.bits();
    assert_eq!(page.moment["numbers"]["presses"], presses);
    let lists = std::iter::once(&nominal).chain(nominal["others"].as_array().unwrap());
    let known = lists
        .into_iter()
        .find(|list| list["vertices"] == path)
        .expect("it is one of the best");
    let score = page.moment["numbers"]["score"].as_f64().unwrap();
    assert!(
        (score - known["score"].as_f64().unwrap()).abs() < 1e-9,
        "{score} {known}"
    );
    page.order(&json!({ "do": "seek", "to": start + 3 }));
    page.order(&json!({ "do": "seek", "to": start + presses }));
    assert_eq!(page.bits(), end);
    page.order(&json!({ "do": "reset" }));
    page.say(&json!({ "next": 0, "stage": 1, "shade": "policy" }));
    let page_range = loop {
        if let tungstenite::Message::Binary(bytes) = page.socket.read().unwrap() {
            let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
            break serde_json::from_slice::<Value>(&bytes[4..4 + length]).unwrap()["boxes"][0]["range"].clone();
        }
    };
    // Probabilities in per cent.
    let most = page_range[1].as_f64().unwrap();
    assert!(
        page_range[0] == 0.0 && most > 1.0 && most <= 100.0,
        "{page_range}"
    );
    page.order(&json!({ "do": "follow", "on": true }));
    page.until(|moment| moment["following"] == false);
    assert_eq!(page.moment["over"], true);
    // From wherever the fall is looked at, it begins where the blank lies.
    let followed = page.bits();
    page.order(&json!({ "do": "seek", "to": 2 }));
    page.order(&json!({ "do": "follow", "on": true }));
    page.until(|moment| moment["following"] == false);
    assert_eq!(page.bits(), followed);
    let curves = page.until(|moment| {
        moment["curves"]
            .as_array()
            .is_some_and(|all| !all.is_empty())
    });
    assert_eq!(curves["curves"][0]["name"], "a");
    assert!(!curves["curves"][0]["best"].as_array().unwrap().is_empty());
    let rivals = page.until(|moment| {
        moment["rivals"]
            .as_array()
            .is_some_and(|all| all.len() == 4)
    });
    assert_eq!(
        rivals["rivals"][0]["name"],
        "the run's path, as it was judged"
    );
    assert_eq!(rivals["rivals"][1]["name"], "the policy");

    // What was pressed by hand gives way to what the run has found, and stays beside it if it is kept there.
    page.order(&json!({ "do": "reset" }));
    let by_hand = page.press(&[72, 73]);
    assert_ne!(by_hand, end);
    let score = page.moment["numbers"]["score"].clone();
    page.order(&json!({ "do": "beside" }));
    assert_eq!(page.moment["beside"][2], score);
    page.order(&json!({ "do": "path" }));
    assert_eq!(page.moment["count"], start + presses + 1);
    page.order(&json!({ "do": "seek", "to": start + presses }));
    assert_eq!((page.bits(), &page.moment["beside"][2]), (end, &score));
    page.order(&json!({ "do": "beside" }));
    assert_eq!(page.moment["beside"], Value::Null);

    let folder = viewer.folder.path();
    run(folder, &["view", "runs/a", "--export", "page.html"]);
    let page = fs::read_to_string(folder.join("page.html")).unwrap();
    let data = page
        .split("const DATA = ")
        .nth(1)
        .unwrap()
        .lines()
        .next()
        .unwrap();
    let data: Value = serde_json::from_str(data.trim_end_matches(';')).unwrap();
    assert_eq!(
        data["moments"].as_array().unwrap().len() as u64,
        presses + 1
    );
    assert!(!page.contains("http://") && !page.contains("https://"));
}

#[test]
fn a_recording_finds_its_task_and_another_stands_beside_it() {
    let first = Viewer::new();
    let mut page = first.page();
    page.ready();
    let mut ends = Vec::new();
    for (number, order) in [[72, 73, 74, 75], [90, 107, 124, 141]]
        .into_iter()
        .enumerate()
    {
        page.order(&json!({ "do": "reset" }));
        page.press(&order);
        ends.push((page.bits(), page.moment["numbers"]["score"].clone()));
        page.say(&json!({ "do": "save_presses" }));
        page.words(&format!("presses-{}.drape", number + 1));
    }
    let folder = tempfile::tempdir().unwrap();
    for name in ["presses-1.drape", "presses-1.toml", "presses-2.drape"] {
        fs::copy(first.folder.path().join(name), folder.path().join(name)).unwrap();
    }
    let viewer = Viewer::of(folder, &["presses-1.drape", "--beside", "presses-2.drape"]);
    let mut page = viewer.page();
    page.ready();
    let at = page.moment["at"].as_u64().unwrap();
    page.order(&json!({ "do": "seek", "to": at + 4 }));
    assert_eq!(
        (page.bits(), &page.moment["numbers"]["score"]),
        (ends[0].0.clone(), &ends[0].1)
    );
    assert_eq!(page.moment["beside"][2], ends[1].1);
    let boxes = page.moment["boxes"].as_array().unwrap();
    assert!(boxes[1]["low"].is_array() && boxes[0] != boxes[1]);

    // A state stands beside its task, as far as that is of the same blank.
    let folder = viewer.folder.path();
    let task = fs::read_to_string(folder.join("task.toml")).unwrap();
    let (_, scene) = task.split_once("[scene.tool.grid]").unwrap();
    let scene = format!("[tool.grid]{scene}").replace("[scene.", "[");
    fs::write(folder.join("state.toml"), &scene).unwrap();
    run(
        folder,
        &["scene", "state.toml", "--state", "state.json", "--out", "s"],
    );
    let other = folder.join("other.toml");
    fs::write(&other, scene.replace("[17, 17]", "[19, 19]")).unwrap();
    let refused = |what: &str, beside: &str, words: &str| {
        let mut args = vec!["view", what, "--export", "page.html"];
        args.extend(["--beside", beside].iter().filter(|_| !beside.is_empty()));
        let output = drape().args(args).current_dir(folder).output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains(words), "{stderr}");
    };
    refused(
        "other.toml",
        "state.json",
        "state.json: is of another blank",
    );
    refused(
        "other.toml",
        "presses-1.drape",
        "presses-1.drape: is of another blank",
    );
    run(folder, &["view", "state.json", "--export", "page.html"]);
    let page = fs::read_to_string(folder.join("page.html")).unwrap();
    assert!(page.contains("const DATA = {\"moments\":[\""));
    fs::copy(folder.join("presses-1.drape"), folder.join("other.drape")).unwrap();
    refused("other.drape", "", "its presses are on another blank");

    fs::remove_file(folder.join("presses-1.toml")).unwrap();
    refused("presses-1.drape", "", "presses-1.toml beside it");
}
