use super::run::*;
use super::*;

/// A policy that has learnt on two scenes plays on a third, of another size and region, and the run
/// keeps nothing of it; one whose weights belong to places is refused there.
#[test]
fn a_policy_of_a_family_plays_on_a_scene_of_another_size() {
    let folder = folder();
    let network = "\n[policy.network.unet]\nchannels = 4\nlevels = 2\nvalue_hidden = 8\n";
    let scenes = "\n[[scenes]]\n[scenes.vary]\n\"placement.tilt_deg\" = [24.0, 27.0]\n";
    let write = |name: &str, text: String| fs::write(folder.path().join(name), text).unwrap();
    write("family.toml", format!("{CONFIG}{network}{scenes}"));
    write("single.toml", CONFIG.into());
    let scene = CONFIG.split_once("[scene.blank]").unwrap().1;
    let scene = format!("[blank]{scene}")
        .replace("[scene.", "[")
        .replace("[[scene.", "[[");
    write("other.toml", scene.replace("[17, 17]", "[21, 19]"));
    for name in ["family", "single"] {
        let config = format!("{name}.toml");
        let args = ["train", &config, "--name", name, "--json"];
        let outcome = json(folder.path(), &args);
        assert_eq!(outcome["complete"], true);
    }
    let before = files(&folder.path().join("runs/family"));
    let other = ["--scene", "other.toml", "--region=-186,-186,60,-40"];
    let more = [
        "--checkpoint",
        "last",
        "--prove",
        "--episodes",
        "3",
        "--out",
        "x",
        "--json",
    ];
    let eval = |run: &'static str| [&["eval", run], &other[..], &more].concat();
    let report = json(folder.path(), &eval("runs/family"));
    let paths = &report["proof"][0];
    assert_eq!(
        (&paths["order"], &paths["count"]),
        (&"path".into(), &4.into())
    );
    assert_eq!(files(&folder.path().join("runs/family")), before);

    let output = drape(folder.path(), &eval("runs/single"));
    assert_eq!(output.status.code(), Some(2));
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("or a `unet`"), "{message}");
    // On images of its size it plays.
    write(
        "same.toml",
        scene.replace("[blank]", "[placement]\nheight_mm = 3.0\n[blank]"),
    );
    let same = [
        "eval",
        "runs/single",
        "--checkpoint",
        "last",
        "--scene",
        "same.toml",
        "--out",
        "y",
        "--json",
    ];
    assert!(json(folder.path(), &same)["episode"]["score"].is_number());
    // A region off the blank.
    let elsewhere = [
        "--scene",
        "other.toml",
        "--region=500,500,600,600",
        "--out",
        "x",
    ];
    let output = drape(
        folder.path(),
        &[&["eval", "runs/family"], &elsewhere[..]].concat(),
    );
    assert_eq!(output.status.code(), Some(2));

    // What varies is part of the run, so that it goes on with the same scenes.
    let config = fs::read_to_string(folder.path().join("runs/family/config.toml")).unwrap();
    assert!(
        config.contains("\"placement.tilt_deg\" = [24.0, 27.0]"),
        "{config}"
    );
    let resumed = drape(
        folder.path(),
        &["train", "--resume", "runs/family", "--json"],
    );
    assert!(resumed.status.success());
    write(
        "wrong.toml",
        format!("{CONFIG}{network}\n[[scenes]]\n[scenes.vary]\ntilt = [24.0, 27.0]\n"),
    );
    let output = drape(folder.path(), &["train", "wrong.toml"]);
    assert_eq!(output.status.code(), Some(2));
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("`scenes.0.vary` is tilt"), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
}
