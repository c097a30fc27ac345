//! CalculiX as an independent witness: it reads the decks that drape writes, and gives the
//! closed forms that drape's own solvers are held to. Needs `ccx` (Debian: calculix-ccx), so
//! they run only when asked for: `cargo test --release --test calculix -- --ignored`.

use std::fs;
use std::path::Path;
use std::process::Command;

use drape_cloth::fabric::Lamina;
use drape_cloth::math::Vec3;
use drape_cloth::mesh::TriMesh;
use drape_cloth::scene::{Scene, SceneConfig};
use drape_cloth::sim::{Aim, Roller, under_stencil};
use drape_cloth::tool::{Pose, Tool};
use drape_cloth::twin::{PressConfig, Twin, TwinConfig};
use drape_task::path::Frame;
use drape_task::path::inp::{Deck, Dialect, DrapingDeck, FabricCard};

/// Runs the deck `name`.inp of `folder` and gives what `ccx` printed. It names what it cannot
/// read with `*ERROR`; its exit status does not tell, being 201 after a check without analysis.
fn ccx(folder: &Path, name: &str) -> String {
    let mut command = Command::new("ccx");
    command.args(["-i", name]).current_dir(folder);
    let output = command.env("OMP_NUM_THREADS", "1").output();
    let output = output.expect("ccx is installed");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(!text.contains("*ERROR"), "{}", tail(&text));
    text
}

fn tail(text: &str) -> &str {
    let start = text.len().saturating_sub(2000);
    text.get(start..).unwrap_or(text)
}

/// Displacements [mm] that a `.dat` file printed last, one node a line.
fn displacements(path: &Path) -> Vec<[f64; 3]> {
    all_displacements(path).pop().unwrap()
}

/// Displacements [mm] of every time at which a `.dat` file printed them.
fn all_displacements(path: &Path) -> Vec<Vec<[f64; 3]>> {
    let text = fs::read_to_string(path).unwrap();
    let times = text.split("displacements").skip(1).map(|time| {
        let rows = time.lines().skip(1).filter_map(|line| {
            let words = line.split_whitespace();
            let numbers: Vec<f64> = words.filter_map(|w| w.parse().ok()).collect();
            (numbers.len() == 4).then(|| [numbers[1], numbers[2], numbers[3]])
        });
        rows.collect()
    });
    times.collect()
}

/// Shells of eight nodes over a strip of `cells` x 2 in the plane z = 0, length and width [m].
/// Nodes stand in rows of five across the strip; the middles of the shells are no one's.
fn strip(length: f64, width: f64, cells: u32) -> (Vec<Vec3>, Vec<[u32; 8]>) {
    let (columns, rows) = (2 * cells, 4);
    let nodes = (0..=columns).flat_map(|i| {
        (0..=rows).map(move |j| {
            let x = length * f64::from(i) / f64::from(columns);
            Vec3::new(x, width * f64::from(j) / f64::from(rows), 0.0)
        })
    });
    let at = move |i: u32, j: u32| i * (rows + 1) + j;
    let shells = (0..cells).flat_map(|i| {
        (0..2).map(move |j| {
            let (a, b) = (2 * i, 2 * j);
            [
                at(a, b),
                at(a + 2, b),
                at(a + 2, b + 2),
                at(a, b + 2),
                at(a + 1, b),
                at(a + 2, b + 1),
                at(a + 1, b + 2),
                at(a, b + 1),
            ]
        })
    });
    (nodes.collect(), shells.collect())
}

/// Heavy elastica at w L^3 / D = 8: drop and reach of the tip.
#[test]
#[ignore = "needs ccx"]
fn cantilever_has_the_drop_and_reach_of_the_elastica() {
    let folder = tempfile::tempdir().unwrap();
    // mm, N, s, t, MPa.
    let (length, thickness, modulus, gravity) = (100.0, 0.2, 1e5, 9810.0);
    let stiffness = modulus * f64::powi(thickness, 3) / 12.0;
    let weight = 8.0 * stiffness / f64::powi(length, 3);
    let (nodes, shells) = strip(1e-3 * length, 5e-3, 20);
    let row = |first: usize| (first..first + 5).collect::<Vec<_>>();

    let mut deck = Deck::new("heavy elastica");
    deck.nodes("ALL", 1, &nodes)
        .elements("S8R", "STRIP", 1.., 1, &shells)
        .card("NSET, NSET=CLAMP")
        .labels(&row(1))
        .card("NSET, NSET=TIP")
        .labels(&row(nodes.len() - 4))
        .card("MATERIAL, NAME=CLOTH")
        .card("ELASTIC")
        .row(&[modulus, 0.0])
        .card("DENSITY")
        .row(&[weight / thickness / gravity])
        .card("SHELL SECTION, ELSET=STRIP, MATERIAL=CLOTH")
        .row(&[thickness])
        .card("BOUNDARY")
        .line("CLAMP, 1, 6")
        .card("STEP, NLGEOM, INC=200")
        .card("STATIC")
        .row(&[0.02, 1.0, 1e-7, 0.05])
        .card("DLOAD")
        .line(&format!("STRIP, GRAV, {gravity}, 0., 0., -1."))
        .card("NODE PRINT, NSET=TIP, FREQUENCY=1000")
        .line("U")
        .card("END STEP");
    deck.write(&folder.path().join("strip.inp")).unwrap();
    ccx(folder.path(), "strip");
    let tip = displacements(&folder.path().join("strip.dat"));
    assert_eq!(tip.len(), 5);
    for [x, _, z] in tip {
        let (drop, reach) = (-z / length, 1.0 + x / length);
        println!("drop {drop:.5}, reach {reach:.5}");
        assert!((drop / 0.64063 - 1.0).abs() < 1e-3, "drop {drop}");
        assert!((reach / 0.72442 - 1.0).abs() < 1e-3, "reach {reach}");
    }
}

/// Strip clamped at the crown of a frictionless cylinder of radius R, w R^3 / D = 2, length 2 R:
/// place of the tip, from the axis. Contact is a penalty on the face of solid elements.
#[test]
#[ignore = "needs ccx and 23 s of CPU time"]
fn strip_over_a_cylinder_has_its_tip_where_the_closed_form_has_it() {
    let folder = tempfile::tempdir().unwrap();
    let (radius, thickness, modulus, gravity) = (100.0, 0.2, 1e5, 9810.0);
    let stiffness = modulus * f64::powi(thickness, 3) / 12.0;
    let weight = 2.0 * stiffness / f64::powi(radius, 3);
    let (mut nodes, shells) = strip(2e-3 * radius, 5e-3, 24);
    for node in &mut nodes {
        node.z = 1e-3 * radius;
    }
    // The middle surface lies on the radius, so the cylinder is half a thickness smaller.
    let (inner, outer) = (radius - 2.0, radius - 0.5 * thickness);
    let sectors = 70;
    let ring = (0..=sectors).flat_map(|i| {
        let (sin, cos) = (-2.0 + 72.0 * f64::from(i) / f64::from(sectors))
            .to_radians()
            .sin_cos();
        [[-1.0, inner], [-1.0, outer], [6.0, inner], [6.0, outer]]
            .map(|[y, r]| Vec3::new(r * sin, y, r * cos) * 1e-3)
    });
    let ring: Vec<Vec3> = ring.collect();
    let solids: Vec<[u32; 8]> = (0..sectors as u32)
        .map(|i| [0, 4, 6, 2, 1, 5, 7, 3].map(|k| 4 * i + k))
        .collect();
    let first = 1 + nodes.len();
    let row = |first: usize| (first..first + 5).collect::<Vec<_>>();

    let mut deck = Deck::new("strip over a cylinder");
    deck.nodes("ALL", 1, &nodes)
        .elements("S8R", "STRIP", 1.., 1, &shells)
        .nodes("RING", first, &ring)
        .elements("C3D8", "CYLINDER", 1 + shells.len().., first, &solids)
        .card("NSET, NSET=CLAMP")
        .labels(&row(1))
        .card("NSET, NSET=TIP")
        .labels(&row(nodes.len() - 4))
        .card("MATERIAL, NAME=CLOTH")
        .card("ELASTIC")
        .row(&[modulus, 0.0])
        .card("DENSITY")
        .row(&[weight / thickness / gravity])
        .card("SHELL SECTION, ELSET=STRIP, MATERIAL=CLOTH")
        .row(&[thickness])
        .card("SOLID SECTION, ELSET=CYLINDER, MATERIAL=CLOTH")
        .card("SURFACE, NAME=BELOW")
        .line("STRIP, SNEG")
        .card("SURFACE, NAME=ABOVE")
        .line("CYLINDER, S2")
        .card("SURFACE INTERACTION, NAME=CONTACT")
        .card("SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR")
        .row(&[0.01])
        .card("CONTACT PAIR, INTERACTION=CONTACT, TYPE=SURFACE TO SURFACE")
        .line("BELOW, ABOVE")
        .card("BOUNDARY")
        .line("CLAMP, 1, 6")
        .line("RING, 1, 3")
        .card("STEP, NLGEOM, INC=400")
        .card("STATIC")
        .row(&[0.05, 1.0, 1e-7, 0.1])
        .card("DLOAD")
        .line(&format!("STRIP, GRAV, {gravity}, 0., 0., -1."))
        .card("NODE PRINT, NSET=TIP, FREQUENCY=1000")
        .line("U")
        .card("END STEP");
    deck.write(&folder.path().join("cylinder.inp")).unwrap();
    ccx(folder.path(), "cylinder");
    let tip = displacements(&folder.path().join("cylinder.dat"));
    assert_eq!(tip.len(), 5);
    for [x, _, z] in tip {
        let place = [2.0 + x / radius, 1.0 + z / radius];
        let off = (place[0] - 1.34870).hypot(place[1] + 0.31890);
        println!("tip at {place:.5?}, off by {off:.5}");
        assert!(off < 1e-3, "tip at {place:?}");
    }
}

/// A square of `cells` x `cells` at height `z` [m], facing up.
fn square(side: f64, cells: u32, z: f64) -> TriMesh {
    let at = move |i: u32| side * (f64::from(i) / f64::from(cells) - 0.5);
    let vertices = (0..=cells).flat_map(|j| (0..=cells).map(move |i| Vec3::new(at(i), at(j), z)));
    let triangles = (0..cells).flat_map(|j| {
        (0..cells).flat_map(move |i| {
            let v = j * (cells + 1) + i;
            let up = v + cells + 1;
            [[v, v + 1, up + 1], [v, up + 1, up]]
        })
    });
    TriMesh {
        vertices: vertices.collect(),
        triangles: triangles.collect(),
    }
}

/// The fabric of the paper, Table 2.
fn fabric() -> FabricCard {
    FabricCard {
        thickness: 0.35e-3,
        areal_mass: 0.28,
        tension: [
            vec![[0.0, 0.0], [0.005, 3.0], [0.02, 40.0]],
            vec![[0.0, 0.0], [0.006, 5.0], [0.025, 60.0]],
        ],
        compression: [
            vec![[0.0, 0.0], [0.02, 0.12]],
            vec![[0.0, 0.0], [0.02, 0.0405]],
        ],
        shear: [
            vec![[0.0, 0.0], [0.1, 0.005]],
            vec![[0.0, 0.0], [0.1, 0.0036]],
        ],
        bending: [7.09e-5, 2.63e-5],
        friction: [0.28, 0.25],
    }
}

/// A draping deck of a small sheet over a plate, two presses in its middle.
fn draping_deck() -> Deck {
    let (lamina, tool) = (square(0.08, 8, 0.5e-3), square(0.1, 2, 0.0));
    let yarns = vec![[Vec3::x(), Vec3::y()]; lamina.triangles.len()];
    let corners = [0, 8, 72, 80].map(|v| (v, Vec3::zeros()));
    let presses = [vec![54, 55, 70, 71], vec![56, 57, 72, 73, 70]];
    DrapingDeck {
        title: "sheet over a plate",
        lamina: &lamina,
        yarns: &yarns,
        clamped: &corners,
        tool: &tool,
        fabric: &fabric(),
        presses: &presses,
        step_s: 0.1,
        pressure: 1e6,
        gravity: 9.81,
        frame: Frame::scene(&Pose::default()),
    }
    .deck(Dialect::Calculix)
}

/// `ccx` reads every card of a draping deck and the geometry behind it; nothing is solved.
#[test]
#[ignore = "needs ccx"]
fn draping_deck_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let mut lines = Vec::new();
    let deck = draping_deck();
    let mut source = deck.text().lines();
    while let Some(line) = source.next() {
        if line == "*STATIC" {
            source.next();
            lines.push("*NO ANALYSIS");
        } else {
            lines.push(line);
        }
    }
    fs::write(folder.path().join("read.inp"), lines.join("\n") + "\n").unwrap();
    let text = ccx(folder.path(), "read");
    let reached = text.contains("Using up to 1 cpu(s) for the symmetric stiffness");
    assert!(
        reached && !text.contains("*WARNING reading"),
        "{}",
        tail(&text)
    );
    // A deck that is wrong is not read: the check can fail.
    let wrong = lines
        .join("\n")
        .replacen("MATERIAL=FABRIC", "MATERIAL=WOOL", 1);
    fs::write(folder.path().join("wrong.inp"), wrong + "\n").unwrap();
    let mut command = Command::new("ccx");
    let output = command
        .args(["-i", "wrong"])
        .current_dir(folder.path())
        .output();
    let text = String::from_utf8_lossy(&output.unwrap().stdout).into_owned();
    assert!(text.contains("*ERROR"), "{}", tail(&text));
}

/// The sheet of `configs/scenes/rib-elastic.toml` comes to rest on the rib under its weight and
/// is pressed on to it at three places, one after the other, in CalculiX and in the twin.
/// Both have straight laws and no friction, and press until they rest.
#[test]
#[ignore = "needs ccx and 35 s of CPU time"]
fn sheet_pressed_on_a_rib_lies_where_the_twin_has_it() {
    let scene = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../configs/scenes/rib-elastic.toml"
    );
    let scene = SceneConfig::read(scene.as_ref()).unwrap();
    let material = scene.read_material().unwrap();
    let lamina = Lamina::new(&scene.blank, material.clone()).unwrap();
    let tool = Tool::new(&scene.tool).unwrap();
    let mut unfallen = scene.clone();
    (unfallen.fall.fall_s, unfallen.fall.settle_s) = (0.0, 0.0);
    unfallen
        .clamps
        .iter_mut()
        .for_each(|c| c.move_mm = [0.0; 3]);
    let start = Scene::new(&unfallen, |_| ()).unwrap().initial;
    // Pressure [Pa], 400 times the weight, side of the stencil [m], bending stiffness [N m].
    let (pressure, side, bending) = (1e3, 0.04, 2e-4);

    let config = TwinConfig {
        bending_stiffness: Some([bending; 2]),
        friction: scene.physics.friction,
        ..TwinConfig::default()
    };
    let mut twin = Twin::new(&lamina, &config).unwrap();
    twin.set_positions(&start.position);
    for v in start.fixed.ones() {
        twin.fix(v as u32);
    }
    let rest = |twin: &mut Twin| {
        assert!(twin.relax(Some(&tool), 1e-7, 20.0).unwrap());
        twin.positions()
    };
    let mut states = vec![rest(&mut twin)];
    let press = PressConfig {
        roller: Roller {
            pressure,
            speed: 1.0,
        },
        press_s: 0.05,
        ..PressConfig::default()
    };
    let mut presses = Vec::new();
    let mut under_stencils = Vec::new();
    for at in [[3, 6], [3, 3], [9, 9]] {
        let vertex = lamina.vertex_at(at[0], at[1]).unwrap();
        let aim = Aim::default();
        let pressed = under_stencil(&lamina, &tool, vertex, side, aim, |v| twin.position(v));
        assert_eq!(pressed.len(), 9);
        assert_eq!(twin.press(&tool, &press, &pressed).unwrap(), pressed);
        let is_under = |t: &[u32; 3]| t.iter().all(|v| pressed.contains(v));
        let count = lamina.triangles.len() as u32;
        let under = (0..count).filter(|t| is_under(&lamina.triangles[*t as usize]));
        presses.push(under.collect());
        under_stencils.push(pressed);
        states.push(rest(&mut twin));
    }

    let points = |curve: &drape_cloth::fabric::Curve| curve.points().to_vec();
    let yarns = [&material.warp, &material.weft];
    let deck = DrapingDeck {
        title: "elastic sheet on a rib",
        lamina: &lamina.mesh(&start.position),
        yarns: &vec![[Vec3::x(), Vec3::y()]; lamina.triangles.len()],
        clamped: &start
            .fixed
            .ones()
            .map(|v| (v as u32, Vec3::zeros()))
            .collect::<Vec<_>>(),
        tool: &tool.mesh,
        fabric: &FabricCard {
            thickness: material.thickness(),
            areal_mass: lamina.mass.iter().sum::<f64>() / lamina.area(),
            tension: yarns.map(|law| points(&law.tension)),
            compression: yarns.map(|law| points(&law.compression)),
            shear: [&material.shear.positive, &material.shear.negative].map(points),
            bending: [bending; 2],
            friction: [0.0; 2],
        },
        presses: &presses,
        step_s: 0.1,
        pressure,
        gravity: scene.physics.gravity,
        frame: Frame::scene(&scene.tool.pose),
    }
    .deck(Dialect::Calculix);
    let folder = tempfile::tempdir().unwrap();
    deck.write(&folder.path().join("rib.inp")).unwrap();
    ccx(folder.path(), "rib");

    let found = all_displacements(&folder.path().join("rib.dat"));
    assert_eq!(found.len(), states.len());
    for (k, (found, state)) in found.iter().zip(&states).enumerate() {
        assert_eq!(found.len(), state.len());
        let mut distances: Vec<f64> = Vec::new();
        for ((start, by), place) in start.position.iter().zip(found).zip(state) {
            let by = 1e-3 * Vec3::from(*by);
            distances.push(1e3 * (Vec3::from(*start) + by - Vec3::from(*place)).norm());
        }
        let mean = distances.iter().sum::<f64>() / distances.len() as f64;
        let greatest = distances.into_iter().fold(0.0, f64::max);
        let moved = |from: &[[f64; 3]]| {
            let distance =
                |(a, b): (&[f64; 3], &[f64; 3])| (Vec3::from(*a) - Vec3::from(*b)).norm();
            1e3 * from.iter().zip(state).map(distance).fold(0.0, f64::max)
        };
        let [all, last] = [moved(&start.position), moved(&states[k.saturating_sub(1)])];
        println!("{k}: off by {mean:.3} mm, {greatest:.3} at most; moved {all:.1}, {last:.1}");
        assert!(mean < 0.35 && greatest < 1.0, "{mean} {greatest}");
        // What is pressed comes to lie on the tool, as in the twin, but for the depth of contact
        // and the difference of facets and distance grid; what is still to be pressed stands off.
        for (j, vertices) in under_stencils.iter().enumerate() {
            let gap = |v: &u32| {
                let (start, by) = (&start.position[*v as usize], found[*v as usize]);
                let place = Vec3::from(*start) + 1e-3 * Vec3::from(by);
                1e3 * tool.distance(place.into()).0
            };
            let gap = vertices
                .iter()
                .map(gap)
                .fold(0.0, |most, gap| gap.abs().max(most));
            println!("   gap under press {j}: {gap:.3} mm");
            assert!(
                if j < k { gap < 0.2 } else { gap > 0.3 },
                "press {j}: {gap}"
            );
        }
    }
}
