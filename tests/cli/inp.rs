use super::run::{CONFIG, train, trained};
use super::*;

/// Lines of the data of the first card that begins with `card`.
fn data<'a>(deck: &'a str, card: &str) -> Vec<&'a str> {
    let (_, rest) = deck
        .split_once(&format!("\n{card}"))
        .unwrap_or_else(|| panic!("no {card}"));
    // What is left of the card itself comes first.
    let lines = rest.split_once('\n').map_or("", |(_, data)| data).lines();
    lines.take_while(|line| !line.starts_with('*')).collect()
}

/// Both dialects have the same vertices in their order and the same presses.
#[test]
fn decks_hold_lamina_clamps_and_presses() {
    let folder = trained();
    let path = folder.path();
    stdout(path, &["export", "runs/a", "--format", "calculix"]);
    let args = ["export", "runs/a", "--format", "abaqus"];
    let report = json(path, &[&args[..], &["--out", "ab.inp", "--json"]].concat());
    assert_eq!(report["file"], "ab.inp");
    let read = |name: &str| fs::read_to_string(path.join(name)).unwrap();
    let [calculix, abaqus] = ["runs/a/draping.inp", "ab.inp"].map(read);
    // CalculiX has a shell for a cell, Abaqus two, and begins before the fall.
    let shells = |deck, card| data(deck, card).len();
    assert_eq!(shells(&calculix, "*ELEMENT, TYPE=S8R, ELSET=LAMINA"), 256);
    assert_eq!(shells(&abaqus, "*ELEMENT, TYPE=S3, ELSET=LAMINA"), 512);
    let height = |deck| {
        let nodes = data(deck, "*NODE, NSET=LAMINA_NODES");
        assert_eq!(nodes.len(), 289);
        let heights = nodes.iter().map(|node| node.rsplit(", ").next().unwrap());
        heights
            .map(|z| z.parse::<f64>().unwrap())
            .fold(f64::MAX, f64::min)
    };
    assert_eq!(height(&calculix), 2.0);
    assert!(height(&abaqus) < 1.0);
    assert!(calculix.contains("\n*BOUNDARY, AMPLITUDE=LOAD_0\n1, 1, 1, 2.40000000e1\n"));
    assert_eq!(data(&abaqus, "*ELEMENT, TYPE=R3D3, ELSET=TOOL").len(), 9146);
    // The clamps at the front left corner and in the middle of the front edge.
    assert_eq!(data(&calculix, "*NSET, NSET=CLAMPS"), ["1, 9"]);
    assert!(
        calculix
            .contains("\nLAMINA, GRAV, 9.81000000e3, 0.00000000e0, 0.00000000e0, -1.00000000e0\n")
    );
    let count = |deck: &str, card: &str| deck.matches(card).count();
    let presses = count(&calculix, "*ELSET, ELSET=PRESS_");
    assert!(presses > 10, "{presses}");
    for (deck, step, each) in [
        (&calculix, "*STATIC\n", 0),
        (&abaqus, "*DYNAMIC, EXPLICIT\n", 1),
    ] {
        let presses = count(deck, "*ELSET, ELSET=PRESS_");
        assert_eq!(count(deck, step), 1 + each * presses);
        assert_eq!(count(deck, ", P, -1.00000000e0\n"), presses);
    }
    // Every shell is pressed by one step at most.
    let mut pressed: Vec<&str> = (1..=presses)
        .flat_map(|k| data(&calculix, &format!("*ELSET, ELSET=PRESS_{k}")))
        .flat_map(|line| line.split(", "))
        .collect();
    let total = pressed.len();
    pressed.sort_unstable();
    pressed.dedup();
    assert_eq!(pressed.len(), total);
    assert!(abaqus.contains("*FABRIC") && !calculix.contains("*FABRIC"));
}

/// The elastic shell of CalculiX has its thickness from bending, the fabric of Abaqus has not. There a press lasts
/// until the next.
#[test]
fn calculix_needs_bending() {
    let folder = folder();
    let path = folder.path();
    let config = CONFIG.replace("steps = 240", "steps = 80");
    for [key, value, found] in [
        ["bending", "\"off\"", "off"],
        ["bending_stiffness", "{ newton_metre = 0 }", "0"],
    ] {
        let config = format!("{config}[scene.physics]\n{key} = {value}\n");
        train(path, &config, key);
        let run = format!("runs/{key}");
        let output = drape(path, &["export", &run, "--format", "calculix"]);
        let word = format!("{run}/config.toml: `physics.{key}` is {found}, expected bending");
        assert_failure(&output, 2, &[&word]);
        stdout(path, &["export", &run, "--format", "abaqus"]);
        let deck = fs::read_to_string(path.join(&run).join("draping.inp")).unwrap();
        assert!(deck.contains("\n*DYNAMIC, EXPLICIT\n, 6.00000000e-2\n"));
    }
}
