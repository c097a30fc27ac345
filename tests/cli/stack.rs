//! Plies that are draped one on the other.

use super::run::{files, number};
use super::*;

/// A coarse dome; its blank hangs clear of whatever has been draped on it.
const BASE: &str = r#"
seed = 3
steps = 160
environments = 4
evaluation_interval = 1
proof_paths = 4

[env]
objective = "distance"
region_mm = [-131.0, -131.0, 0.0, 0.0]
stencil_mm = 40.0

[scatter]
substep_rates = [600.0]

[ppo]
rollout_steps = 20
minibatch_size = 40
epochs = 2

[scene.blank]
size_mm = [260.0, 260.0]
vertices = [17, 17]

[scene.placement]
height_mm = 85.0
tilt_deg = 0.0

[scene.fall]
fall_s = 0.6
settle_s = 0.6
substep_rate = 1200

[scene.tool.source.shape]
kind = "hemisphere"

[scene.tool.grid]
spacing_mm = 8
"#;

const PLIES: &str = "config = \"base.toml\"\n[[plies]]\nangle_deg = 0\n[[plies]]\nangle_deg = 45\n\
                     [plies.config]\nsteps = 80\nenv.stencil_mm = 42.0\n";

const ARGS: [&str; 3] = ["stack", "dome.toml", "--json"];

fn with(stack: &str) -> TempDir {
    let folder = folder();
    fs::write(folder.path().join("base.toml"), BASE).unwrap();
    fs::write(folder.path().join("dome.toml"), stack).unwrap();
    folder
}

/// What a successful command printed, whatever it warned of.
fn printed(folder: &Path, args: &[&str]) -> Value {
    let output = drape(folder, args);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{args:?}: {stderr}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The second ply lies on the first, its yarns are turned, and what is proved is not trained again.
#[test]
fn second_ply_lies_on_the_first() {
    let folder = with(PLIES);
    let path = folder.path();
    let report = printed(path, &ARGS);
    let plies = report["plies"].as_array().unwrap();
    assert_eq!(plies.len(), 2);
    for (ply, run) in plies.iter().zip(["runs/dome/ply-1", "runs/dome/ply-2"]) {
        assert_eq!(ply["run"], run);
        for file in [
            "proof.json",
            "trajectory.json",
            "field.vtu",
            "field.shear.png",
        ] {
            assert!(path.join(run).join(file).is_file(), "{run}/{file}");
        }
    }
    let config = |run: &str| fs::read_to_string(path.join(run).join("config.toml")).unwrap();
    let second = config("runs/dome/ply-2");
    for line in ["yarn_angle_deg = 45.0", "steps = 80", "stencil_mm = 42.0"] {
        assert!(second.contains(line), "{line}");
        assert!(!config("runs/dome/ply-1").contains(line), "{line}");
    }
    assert!(second.contains("inputs/next-tool.stl"));

    assert!(plies[0]["gap"].is_null());
    let (gap, thickness) = (&plies[1]["gap"], number(&plies[1]["thickness_m"]));
    assert!(number(&gap["points"]) > 20.0);
    // Between the vertices of so coarse a sheet the dome stands out by up to a millimetre, on which the second lies.
    let mean = number(&gap["mean_m"]);
    assert!(mean > 0.5 * thickness && mean < thickness + 1e-3, "{gap}");
    // A grid of 4 mm does not see how far a crushed fold stands out where this is less than one of its cells.
    assert!(number(&gap["least_m"]) > -4e-3 - thickness, "{gap}");

    let trained = files(&path.join("runs"));
    assert_eq!(printed(path, &ARGS), report);
    assert!(files(&path.join("runs")) == trained);

    // The first by itself makes the same tool; the second is one, too.
    for run in ["runs/dome/ply-1", "runs/dome/ply-2"] {
        let args = ["export", run, "--format", "next-tool", "--json"];
        let report = printed(path, &args);
        assert_eq!(report["file"], format!("{run}/next-tool.stl"));
    }
    let again = fs::read(path.join("runs/dome/ply-1/next-tool.stl")).unwrap();
    assert!(again == trained["dome/ply-1/next-tool.stl"]);

    fs::write(path.join("dome.toml"), PLIES.replace("45", "30")).unwrap();
    let words = [
        "runs/dome/ply-2",
        "another configuration",
        "dome.toml",
        "--name",
    ];
    assert_failure(&drape(path, &ARGS), 2, &words);
}

#[test]
fn stacks_that_cannot_be_are_refused_before_anything_is_trained() {
    let member = "[[plies.config.scenes]]\nmembers = 2\n";
    let tool = "[plies.config.scene.tool.pose]\nrotation_deg = [0, 0, 5]\n";
    for (stack, words) in [
        ("plies = []", &["dome.toml", "`plies` is 0"][..]),
        ("[[plies]]\n", &["dome.toml", "angle_deg"]),
        (
            "[[plies]]\nangle_deg = 0\nturn = 1\n",
            &["dome.toml", "turn"],
        ),
        (
            "[[plies]]\nangle_deg = 400\n",
            &["dome.toml, ply 1", "`blank.yarn_angle_deg` is 400"],
        ),
        (
            "[[plies]]\nangle_deg = 0\nconfig.env.stencil = 1\n",
            &["dome.toml, ply 1", "stencil"],
        ),
        (
            &format!("[[plies]]\nangle_deg = 0\n[[plies]]\nangle_deg = 0\n{member}"),
            &["dome.toml, ply 2", "`scenes` is 1"],
        ),
        (
            &format!("[[plies]]\nangle_deg = 0\n{tool}"),
            &["dome.toml, ply 1", "`scene.tool`"],
        ),
        (
            "[[plies]]\nangle_deg = 0\nconfig.preset = \"paper\"\n",
            &["dome.toml, ply 1", "`preset`"],
        ),
        (
            "[[plies]]\nangle_deg = 0\nconfig.scene.blank.yarn_angle_deg = 30\n",
            &["dome.toml, ply 1", "`scene.blank.yarn_angle_deg`"],
        ),
        (
            "config = \"none.toml\"\n[[plies]]\nangle_deg = 0\n",
            &["none.toml"],
        ),
    ] {
        let folder = with(stack);
        assert_failure(&drape(folder.path(), &ARGS), 2, words);
        assert_eq!(names(folder.path()), ["base.toml", "dome.toml"], "{stack}");
    }
    let folder = with(PLIES);
    let args = [&ARGS[..], &["--name", "a/b"]].concat();
    assert_failure(
        &drape(folder.path(), &args),
        2,
        &["a/b", "cannot name a run"],
    );
}
