//! Runs that are gone on with under other keys, and what is refused before the work.

use super::run::*;
use super::*;

/// More steps come to what they would have come to at once; other environments and another step size go on from
/// there. What may not change is named, and nothing is written.
#[test]
fn complete_run_takes_more_steps_and_other_keys() {
    let folder = trained();
    let path = folder.path();
    let run = path.join("runs/a");
    let resume = |args: &[&str]| {
        drape(
            path,
            &[&["train", "--resume", "runs/a", "--json"], args].concat(),
        )
    };
    let before = files(&run);
    for (args, words) in [
        (
            &["--set", "env.stencil_mm=20"][..],
            "config.toml: `env.stencil_mm` is 20, expected 18.0 as in the run",
        ),
        (
            &["--set", "seed=4"],
            "`seed` is 4, expected 3 as in the run, where these may change: environments, ",
        ),
        (
            &["--set", "ppo.learning_rate=0"],
            "ppo: `learning_rate` is 0.0, expected a number",
        ),
        (
            &["--set", "learning_rate"],
            "`--set` is learning_rate, expected",
        ),
        (
            &["--steps", "80"],
            "config.toml: `steps` is 80, expected at least 240, which are taken",
        ),
    ] {
        assert_failure(&resume(args), 2, &[words]);
        let after = files(&run);
        assert!(
            before
                .iter()
                .all(|(name, bytes)| name.starts_with("events/") || after[name] == *bytes)
        );
    }
    train(path, &CONFIG.replace("steps = 240", "steps = 480"), "whole");
    let outcome: Value = serde_json::from_slice(&resume(&["--steps", "480"]).stdout).unwrap();
    assert_eq!(
        (&outcome["complete"], &outcome["env_steps"]),
        (&true.into(), &480.into())
    );
    let [found, expected] = ["a", "whole"].map(|run| files(&path.join("runs").join(run)));
    for name in LEARNT {
        assert!(found[name] == expected[name], "{name}");
    }
    let more = [
        "--steps",
        "600",
        "--set",
        "environments=6",
        "--set",
        "ppo.learning_rate=1e-4",
    ];
    assert!(resume(&more).status.success());
    let last = metrics(&run).pop().unwrap();
    assert_eq!(
        (&last["step"], &last["learning_rate"]),
        (&600.into(), &1e-4.into())
    );
    // What it is from now on is in its configuration.
    assert!(resume(&[]).status.success());
    let text = fs::read_to_string(run.join("config.toml")).unwrap();
    assert!(
        text.contains("environments = 6\n") && text.contains("steps = 600\n"),
        "{text}"
    );
    json(path, &["eval", "runs/a", "--episodes", "1", "--json"]);
}

/// Before the fall.
#[test]
fn members_that_cannot_be_are_refused() {
    let folder = folder();
    let path = folder.path();
    for (key, words) in [
        (
            "placement.tilt_deg",
            "config.toml: `scenes.0`, member 0: `placement.tilt_deg` is 91.",
        ),
        (
            "env.stencil_mm",
            "config.toml: `scenes.0`, member 0: `env.stencil_mm` is -",
        ),
    ] {
        let range = if key == "env.stencil_mm" {
            "[-9.0, -1.0]"
        } else {
            "[91.0, 92.0]"
        };
        let config =
            format!("{CONFIG}[[scenes]]\nmembers = 3\n[scenes.vary]\n\"{key}\" = {range}\n");
        assert_failure(&refused(path, &config), 2, &[words]);
    }
}
