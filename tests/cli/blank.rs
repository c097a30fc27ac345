//! Blanks with an outline: the scenes that are shipped, and outlines that bound no blank.

use super::*;

/// A blank from `outline.csv` that lies above the rib for a moment.
const SCENE: &str = "[tool.source.shape]\nkind = \"rib\"\n\
                     [fall]\nfall_s = 0.05\nsettle_s = 0\nsubstep_rate = 600\n\
                     [placement]\nheight_mm = 70\ntilt_deg = 0\n[blank]\n";

const SQUARE: &str = "-50,-50\n50,-50\n50,50\n-50,50\n";

fn cut(folder: &Path, outline: &str, blank: &str) -> Output {
    fs::write(folder.join("outline.csv"), outline).unwrap();
    set_up(
        folder,
        &format!("{SCENE}outline = \"outline.csv\"\n{blank}"),
    )
}

#[test]
fn shipped_scenes_come_to_rest() {
    let folder = folder();
    let scenes = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/scenes");
    for (name, strain, radius_mm) in [
        ("outline-with-hole", 0.02, 60.0),
        ("bias-square", 0.01, 75.0),
    ] {
        let path = format!("{scenes}/{name}.toml");
        let report = json(folder.path(), &["scene", &path, "--out", name, "--json"]);
        let number = |key: &str| report[key].as_f64().unwrap();
        assert!(number("strain_p95") < strain, "{name}: {report}");
        assert!(number("v_rms_mm_s") < 1.0, "{name}: {report}");
        // A diagonal of 11.3 mm is a chord of the dome, and its grid errs by 0.1 mm.
        let chord_mm = 11.3 * 11.3 / (8.0 * radius_mm);
        assert!(
            number("penetration_mm") < chord_mm + 0.1,
            "{name}: {report}"
        );
        assert_eq!(names(&folder.path().join(name)).len(), 5);
    }
}

#[test]
fn outline_counts_from_the_folder_of_the_scene() {
    let folder = folder();
    let path = folder.path();
    fs::create_dir(path.join("sub")).unwrap();
    fs::write(path.join("sub/outline.csv"), SQUARE).unwrap();
    let text = format!("{SCENE}outline = \"outline.csv\"\ncell_mm = 7\nyarn_angle_deg = 30\n");
    fs::write(path.join("sub/scene.toml"), text).unwrap();
    let output = drape(path, &["scene", "sub/scene.toml", "--out", "out"]);
    let text = String::from_utf8(output.stdout).unwrap();
    let first = text.lines().next().unwrap();
    assert!(first.ends_with(" of them along the outline"), "{text}");
}

#[test]
fn outlines_that_bound_no_blank_are_located() {
    let folder = folder();
    let path = folder.path();
    let missing = format!("{SCENE}outline = \"none.csv\"\n");
    let words = ["scene.toml: cannot read none.csv", "No such file"];
    assert_failure(&set_up(path, &missing), 2, &words);
    for (outline, words) in [
        ("", &["outline.csv:1: no points", "at least 3"][..]),
        (
            "0,0\n9,0\n",
            &["outline.csv:1: loop of 2 points", "at least 3"],
        ),
        (
            "0,0\n9,nan\n9,9",
            &["outline.csv:2: found \"9,nan\"", "two numbers"],
        ),
        ("0,0\n9,1e9\n9,9", &["outline.csv:2: found \"9,1e9\""]),
        ("x,y\n0,0\n9,0\n9,9", &["outline.csv:1: found \"x,y\""]),
        ("\u{0}\u{1}", &["outline.csv:1: found"]),
        (
            "-50,-50\n50,50\n50,-50\n-50,50\n",
            &["outline.csv:3: ", "meets that from line 1", "do not cross"],
        ),
        (
            "-50,-50\n50,-50\n50,50\n-50,50\n\n90,0\n99,0\n99,9\n",
            &["outline.csv:6: hole lies outside", "expected it inside"],
        ),
    ] {
        let output = cut(path, outline, "");
        assert_failure(&output, 2, words);
        assert_failure(&output, 2, &["error: scene.toml: "]);
    }
    assert!(
        !path.join("out").exists(),
        "a failed scene leaves no folder"
    );
}

#[test]
fn cells_and_clamps_that_do_not_fit_are_refused() {
    let folder = folder();
    let path = folder.path();
    let hole = format!("{SQUARE}\n-5,-5\n5,-5\n5,5\n-5,5\n");
    // Two squares, joined by a strip 4 mm wide.
    let neck = "0,0\n40,0\n40,18\n80,18\n80,0\n120,0\n120,40\n80,40\n80,22\n40,22\n40,40\n0,40\n";
    for (outline, blank, words) in [
        (
            SQUARE,
            "cell_mm = 0",
            &["`blank.cell_mm` is 0, expected a length"][..],
        ),
        (SQUARE, "cell_mm = nan", &["`blank.cell_mm` is NaN"]),
        (
            SQUARE,
            "cell_mm = 0.05",
            &["`blank.cell_mm` is 0.05", "at most 1024"],
        ),
        (
            SQUARE,
            "yarn_angle_deg = inf",
            &["`blank.yarn_angle_deg` is inf"],
        ),
        (
            SQUARE,
            "cell_mm = 900",
            &[
                "`blank.cell_mm` is 900",
                "outline.csv",
                "no cell lies inside",
            ],
        ),
        (
            &hole,
            "cell_mm = 30\nyarn_angle_deg = 10",
            &[
                "`blank.cell_mm` is 30",
                "1 loops of border, the outline has 2",
            ],
        ),
        (
            neck,
            "vertices = [30, 30]",
            &["`blank.vertices` is [30, 30]", "falls into 2 parts"],
        ),
        (
            SQUARE,
            "[[clamps]]\nat_mm = [90, 0]",
            &["`clamps[0].at_mm` is [90.0, 0.0]", "a place on the blank"],
        ),
        (
            SQUARE,
            "[[clamps]]\nat_mm = [nan, 0]",
            &["`clamps[0].at_mm` is [NaN, 0.0]"],
        ),
    ] {
        let output = cut(path, outline, blank);
        assert_failure(&output, 2, words);
        assert_failure(&output, 2, &["error: scene.toml: "]);
    }
}
