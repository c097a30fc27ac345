//! Scenes from their files to where the blank has come to rest.

use std::sync::LazyLock;

use drape_cloth::scene::{Fabric, Placement, Scene, SceneConfig, SceneError, wrinkle_count};

/// The built-in scene, set up as users get it.
static RIB: LazyLock<Scene> = LazyLock::new(|| Scene::new(&SceneConfig::rib(), |_| {}).unwrap());

/// The built-in scene on a coarse blank, grid and substep.
fn coarse() -> SceneConfig {
    let mut config = SceneConfig::rib();
    config.blank.vertices = [17, 17];
    config.tool.grid.spacing_mm = Some(10.0);
    config.fall.substep_rate = 1200.0;
    config
}

#[test]
fn rib_leaves_two_wrinkles_in_a_believable_state() {
    let summary = RIB.summary(&RIB.initial);
    assert_eq!(summary.wrinkles, 2, "{summary:?}");
    assert!(summary.strain_p95 < 0.01, "{summary:?}");
    // Cells lie on its crest as chords do, 8.2 mm long where it has a radius of 28 mm: 0.3 mm. The distance grid
    // errs by a tenth there.
    assert!(summary.penetration_mm < 0.4, "{summary:?}");
    assert!(summary.v_rms_mm_s < 5.0, "{summary:?}");
    // Glass hardly stretches: 2e-4 found. Some edges next to clamps stretch by 0.7 %.
    assert!(summary.tension_p95 < 4e-4, "{summary:?}");
    assert!(summary.tension_max < 0.01, "{summary:?}");
    assert!(RIB.initial.is_finite());
}

#[test]
fn equal_configurations_give_equal_bits() {
    let [a, b] = [coarse(), coarse()].map(|config| Scene::new(&config, |_| {}).unwrap());
    let bits = |scene: &Scene| -> Vec<u64> {
        let state = &scene.initial;
        let numbers = state.position.iter().chain(&state.velocity).flatten();
        numbers.map(|x| x.to_bits()).collect()
    };
    assert!(bits(&a) == bits(&b));
}

/// Each clamp moves in a straight line, holds what lies within its radius, and rests.
#[test]
fn clamps_end_where_they_are_told() {
    let mut config = coarse();
    config.clamps[0].radius_mm = 25.0;
    config.clamps[2].move_mm = [-24.0, 3.0, 5.0];
    let scene = Scene::new(&config, |_| {}).unwrap();
    let held: Vec<usize> = scene.initial.fixed.ones().collect();
    // The first one holds 2 x 2 vertices of 23 mm cells in its corner.
    assert_eq!(held, [0, 1, 8, 16, 17, 18]);
    // The low edge hangs level at 0.2 mm; the blank rises from it at 25 degrees.
    let (sin, cos) = 25.0f64.to_radians().sin_cos();
    for vertex in held {
        let [u, v] = scene.lamina.rest[vertex];
        let moved = match vertex {
            8 => [0.0; 3],
            16 => [-0.024, 0.003, 0.005],
            _ => [0.024, 0.0, 0.0],
        };
        let along = v + 0.185;
        let hung = [u, -0.185 + along * cos, 0.0002 + along * sin];
        for k in 0..3 {
            let off = scene.initial.position[vertex][k] - hung[k] - moved[k];
            assert!(off.abs() < 1e-12, "vertex {vertex} is {off:e} m off");
        }
        assert_eq!(scene.initial.velocity[vertex], [0.0; 3]);
    }
}

/// Without fall and settling the blank is where its placement puts it.
#[test]
fn placement_tilts_about_the_lowest_edge() {
    let mut config = coarse();
    config.clamps.clear();
    config.fall.fall_s = 0.0;
    config.fall.settle_s = 0.0;
    config.placement = Placement {
        centre_mm: [10.0, 20.0],
        height_mm: 30.0,
        tilt_deg: -30.0,
        ..Placement::default()
    };
    let scene = Scene::new(&config, |_| {}).unwrap();
    // (u, v) lies at (10 + u, 20 + v), and the edge at the highest y, v = 185, stays low.
    for (x, [u, v]) in scene.initial.position.iter().zip(&scene.lamina.rest) {
        let along = 0.185 - v;
        let (sin, cos) = 30.0f64.to_radians().sin_cos();
        let expected = [0.01 + u, 0.205 - along * cos, 0.03 + along * sin];
        for k in 0..3 {
            assert!(
                (x[k] - expected[k]).abs() < 1e-12,
                "{x:?} is not {expected:?}"
            );
        }
    }
    assert_eq!(scene.initial.v_rms(), 0.0);
}

/// Without fall and settling, on a coarse hemisphere of 75 mm at `at_mm`.
fn hanging(at_mm: [f64; 3], placement: &str) -> SceneConfig {
    let text = format!(
        "blank = {{ size_mm = [200, 100], vertices = [21, 11] }}\nfall = {{ fall_s = 0, settle_s = 0 }}\n\
         placement = {{ {placement} }}\n[tool]\nsource.shape.kind = \"hemisphere\"\n\
         pose.translation_mm = {at_mm:?}\ngrid.spacing_mm = 5"
    );
    toml::from_str(&text).unwrap()
}

/// The axis of the tilt turns the blank's rise, not its yarns: on a round tool a square that is
/// tilted about y is one that is tilted about x, seen from the side.
#[test]
fn placement_tilts_about_any_axis() {
    let positions = |tilt: &str| {
        let mut config = hanging([0.0; 3], &format!("height_mm = 90, {tilt}"));
        config.blank.size_mm = [100.0, 100.0];
        config.blank.vertices = [11, 11];
        let scene = Scene::new(&config, |_| {}).unwrap();
        scene.initial.position.clone()
    };
    let near = |x: [f64; 3], y: [f64; 3]| (0..3).all(|k| (x[k] - y[k]).abs() < 1e-12);
    let about_x = positions("tilt_deg = 20");
    // Vertices count by rows along x.
    for (axis, turned) in [(0, 0), (90, 1), (180, 2), (-90, 3)] {
        let found = positions(&format!("tilt_deg = 20, tilt_axis_deg = {axis}"));
        for (v, x) in about_x.iter().enumerate() {
            let (mut at, mut x) = ([v % 11, v / 11], *x);
            for _ in 0..turned {
                at = [10 - at[1], at[0]];
                x = [-x[1], x[0], x[2]];
            }
            let y = found[at[0] + 11 * at[1]];
            assert!(near(x, y), "{axis}: {x:?} is not {y:?}");
        }
    }
    // About one diagonal: the corners on the other are the highest and the lowest.
    let heights = positions("tilt_deg = 20, tilt_axis_deg = 135");
    let [high, a, b, low] = [0, 10, 110, 120].map(|v| heights[v][2]);
    assert!((a - b).abs() < 1e-12 && high > a + 0.02 && a > low + 0.02);
    assert!((low - 0.09).abs() < 1e-12, "{low}");
}

/// Wherever the tool stands, the blank hangs the same over it.
#[test]
fn placement_counts_from_the_tool() {
    let over = "over = \"tool\", centre_mm = [10, 0], height_mm = 3, tilt_deg";
    for (tilt, touching) in [(0.0f64, 75.0), (20.0, 0.0)] {
        let scenes = [[0.0; 3], [2000.0, -300.0, 500.0]].map(|at| {
            let config = hanging(at, &format!("{over} = {tilt}"));
            (at, Scene::new(&config, |_| {}).unwrap())
        });
        let x = |(at, scene): &([f64; 3], Scene), v: usize| -> [f64; 3] {
            let placed = scene.tool.in_scene(&scene.initial.position);
            std::array::from_fn(|k| 1e3 * placed[v][k] - at[k])
        };
        for v in 0..231 {
            let [a, b] = [x(&scenes[0], v), x(&scenes[1], v)];
            assert!(
                (0..3).all(|k| (a[k] - b[k]).abs() < 0.1),
                "{a:?} is not {b:?}"
            );
        }
        // The plane of the blank is its height above where it touches the sphere, or the plate.
        let [_, y, z] = x(&scenes[0], 10);
        let (sin, cos) = tilt.to_radians().sin_cos();
        let sphere = 75.0 / cos + y * sin / cos;
        let expected = if tilt == 0.0 {
            touching
        } else {
            sphere.max(touching)
        };
        assert!(
            (z - expected - 3.0).abs() < 0.5,
            "{z} is not 3 over {expected}"
        );
        assert!((x(&scenes[0], 115)[0] - 10.0).abs() < 1e-9);
        assert!(scenes[1].1.clearance() > 2e-3);
    }
}

/// What is refused says what would not be.
#[test]
fn impossible_placements_name_one_that_is_not() {
    let refused =
        |placement: &str| match Scene::new(&hanging([500.0, 0.0, 100.0], placement), |_| {}) {
            Err(error) => error,
            Ok(_) => panic!("{placement}"),
        };
    for (height, base, min) in [
        (100.0, "centre_mm = [500, 0]", 175.0),
        (-20.0, "over = \"tool\"", 0.0),
    ] {
        let error = refused(&format!("height_mm = {height}, tilt_deg = 0, {base}"));
        let SceneError::InTool {
            height_mm,
            min_mm,
            depth_mm,
        } = error
        else {
            panic!("{error}");
        };
        assert_eq!(height_mm, height);
        assert!((min_mm - min).abs() < 0.5 && depth_mm > 15.0, "{error}");
        let config = hanging(
            [500.0, 0.0, 100.0],
            &format!("height_mm = {min_mm}, tilt_deg = 0, {base}"),
        );
        assert!(Scene::new(&config, |_| {}).is_ok());
    }
    let beside = refused("height_mm = 200, centre_mm = [100, 0]").to_string();
    let words = "`placement.centre_mm` is [100.0, 0.0], expected one at which the blank is over the tool, \
                 whose middle is at [500.0, 0.0]";
    assert_eq!(beside, words);
    let beside = refused("over = \"tool\", centre_mm = [0, 400]").to_string();
    assert!(
        beside.ends_with("whose middle is at [0.0, 0.0]"),
        "{beside}"
    );
}

/// A clamp up on the slope of the blank holds it there.
#[test]
fn clamps_that_hold_the_blank_in_the_air_are_told() {
    let mut config = coarse();
    let held = |config: &SceneConfig| Scene::new(config, |_| {}).unwrap().farthest_clamp();
    assert!(held(&config).is_some_and(|(_, distance)| distance < 1e-3));
    config.clamps[1].at_mm = [0.0, 185.0];
    let (index, distance) = held(&config).unwrap();
    assert!(
        index == 1 && (0.1..0.16).contains(&distance),
        "{index}: {distance}"
    );
    config.clamps.clear();
    assert_eq!(held(&config), None);
}

#[test]
fn progress_runs_from_zero_to_one() {
    let mut seen = Vec::new();
    let mut config = coarse();
    config.fall.fall_s = 0.05;
    config.fall.settle_s = 0.05;
    Scene::new(&config, |share| seen.push(share)).unwrap();
    assert_eq!(seen.len(), 7);
    assert!(seen.is_sorted() && seen[0] == 0.0 && seen[6] == 1.0);
}

#[test]
fn impossible_scenes_are_refused_with_key_found_and_expected() {
    let refuse = |change: fn(&mut SceneConfig), message: &str| {
        let mut config = coarse();
        change(&mut config);
        let error = Scene::new(&config, |_| {}).err().expect(message);
        assert_eq!(error.to_string(), message);
    };
    refuse(
        |c| c.fall.fall_s = -1.0,
        "`fall.fall_s` is -1, expected a number from 0 to 600",
    );
    refuse(
        |c| c.fall.settle_s = f64::NAN,
        "`fall.settle_s` is NaN, expected a number from 0 to 600",
    );
    refuse(
        |c| c.fall.settle_damping = -2.0,
        "`fall.settle_damping` is -2, expected a number from 0 to 200",
    );
    refuse(
        |c| c.fall.substep_rate = 10.0,
        "`fall.substep_rate` is 10, expected a number from 60 to 1000000",
    );
    refuse(
        |c| c.placement.tilt_deg = 90.0,
        "`placement.tilt_deg` is 90, expected an angle between -90 and 90 degrees, without these",
    );
    refuse(
        |c| c.placement.height_mm = f64::INFINITY,
        "`placement.height_mm` is inf, expected a number from -10000 to 10000",
    );
    refuse(
        |c| c.clamps[1].at_mm = [0.0, -186.0],
        "`clamps[1].at_mm` is [0.0, -186.0], expected a place on the blank, in its own frame",
    );
    refuse(
        |c| c.clamps[2].radius_mm = -1.0,
        "`clamps[2].radius_mm` is -1, expected a number from 0 to 100000",
    );
    refuse(
        |c| c.clamps[0].move_mm[2] = f64::NAN,
        "`clamps[0].move_mm` is NaN, expected a number from -10000 to 10000",
    );
    refuse(
        |c| c.fall.fall_s = 0.008,
        "`clamps[0].move_mm` is [24.0, 0.0, 0.0], expected no displacement where `fall.fall_s` is \
         less than half of 1/60 s",
    );
    refuse(
        |c| c.fall.contact_rate = 0.0,
        "`fall.contact_rate` is 0, expected a number from 1 to 1000000",
    );
    refuse(
        |c| c.physics.damping = -1.0,
        "`physics.damping` is -1, expected a number >= 0",
    );
    refuse(
        |c| c.blank.vertices = [1, 17],
        "`blank.vertices` is [1, 17], expected two numbers from 2 to 1025",
    );
}

#[test]
fn unknown_keys_are_refused_and_paths_count_from_the_file() {
    let error = toml::from_str::<SceneConfig>("[tool]\n[fall]\nfall = 1").unwrap_err();
    assert!(error.message().contains("unknown field `fall`"), "{error}");

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let text = "material = \"cloth.toml\"\n[tool.source.stl]\npath = \"punch.stl\"\n";
    std::fs::write(&path, text).unwrap();
    let config = SceneConfig::read(&path).unwrap();
    let file = folder.path().join("cloth.toml");
    assert_eq!(config.material, Some(Fabric::File(file)));
    let error = Scene::new(&config, |_| {}).err().unwrap().to_string();
    assert!(error.contains("cloth.toml"), "{error}");

    let error = SceneConfig::read(&folder.path().join("none.toml")).unwrap_err();
    assert!(error.to_string().contains("none.toml"), "{error}");
}

/// Patches that stand off by more than 15 mm, on a blank of 20 x 20 vertices: at least two of
/// them and touching the border.
#[test]
fn wrinkles_are_patches_that_run_out_over_the_border() {
    let mut config = coarse();
    config.blank.vertices = [20, 20];
    config.clamps.clear();
    config.fall.fall_s = 0.0;
    config.fall.settle_s = 0.0;
    let lamina = Scene::new(&config, |_| {}).unwrap().lamina;
    let count = |raised: &[[usize; 2]]| {
        let mut phi = vec![0.0149; 400];
        for [row, column] in raised {
            phi[row * 20 + column] = 0.0151;
        }
        wrinkle_count(&lamina, &phi)
    };
    assert_eq!(count(&[]), 0);
    // One vertex is less than 0.4 % of 400; two beside each other, even by a corner, count.
    assert_eq!(count(&[[0, 5]]), 0);
    assert_eq!(count(&[[0, 5], [1, 6]]), 1);
    assert_eq!(count(&[[0, 5], [1, 6], [19, 0], [18, 0]]), 2);
    // A bridge over the inside is none.
    assert_eq!(count(&[[9, 9], [9, 10], [10, 9], [10, 10]]), 0);
    // Joined at the far end it is one.
    assert_eq!(count(&[[0, 5], [1, 6], [2, 7], [1, 8], [0, 9]]), 1);
}

/// Clamps stop with the fall, whether or not there is time to settle.
#[test]
fn clamps_rest_without_settling() {
    let mut config = coarse();
    config.fall.settle_s = 0.0;
    config.fall.fall_s = 0.1;
    let scene = Scene::new(&config, |_| {}).unwrap();
    assert_eq!(scene.initial.fixed.count_ones(..), 3);
    for vertex in scene.initial.fixed.ones() {
        assert_eq!(scene.initial.velocity[vertex], [0.0; 3]);
    }
}

/// The scenes with domes list locking; of a material that has none it is refused.
#[test]
fn locking_is_listed_where_the_material_has_it() {
    let read = |path: &str| SceneConfig::read(path.as_ref()).unwrap();
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs");
    for name in ["bias-square", "outline-with-hole"] {
        assert!(
            read(&format!("{folder}/scenes/{name}.toml"))
                .physics
                .shear_locking
        );
    }
    let material = std::fs::read_to_string(format!("{folder}/materials/interglas-92125.toml"));
    let material = material.unwrap();
    let (unlocked, _) = material.split_once("[shear.locking]").unwrap();
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), unlocked).unwrap();
    let mut config = coarse();
    config.material = Some(Fabric::File(file.path().into()));
    config.physics.shear_locking = true;
    let error = Scene::new(&config, |_| {}).err().unwrap();
    assert_eq!(
        error.to_string(),
        "`physics.shear_locking` is true, expected false where the material has no `shear.locking`"
    );
}

/// Cut cells beside yarns rest, whatever their shape, and hardly stretch.
#[test]
fn outlines_along_the_yarns_come_to_rest() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("outline.csv");
    let rectangle = |[a, b]: [f64; 2]| [[-a, -b], [a, -b], [a, b], [-a, b]].to_vec();
    let corner = vec![
        [-57.9, -54.3],
        [58.4, -54.3],
        [58.4, 3.0],
        [-1.2, 3.0],
        [-1.2, 62.0],
        [-57.9, 62.0],
    ];
    let hole = vec![[-19.0, -23.6], [26.1, -23.6], [26.1, 20.7], [-19.0, 20.7]];
    let cases = [
        (vec![rectangle([60.0, 61.0])], 8.0, true),
        (vec![rectangle([61.0, 61.0])], 8.0, true),
        (vec![rectangle([45.0, 45.0])], 8.0, true),
        (vec![rectangle([64.0, 63.0])], 7.3, true),
        (vec![rectangle([61.0, 58.0]), hole.clone()], 7.5, true),
        (vec![rectangle([61.0, 58.0]), hole.clone()], 9.0, true),
        (vec![rectangle([61.0, 58.0]), hole], 9.0, false),
        (vec![corner], 7.3, true),
    ];
    for (loops, cell_mm, shear) in cases {
        let points = |one: &Vec<[f64; 2]>| one.iter().map(|[x, y]| format!("{x}, {y}\n")).collect();
        let text: Vec<String> = loops.iter().map(points).collect();
        std::fs::write(&file, text.join("\n")).unwrap();
        let config = format!(
            "blank = {{ outline = {file:?}, cell_mm = {cell_mm}, mass = \"datasheet\" }}\n\
             placement = {{ height_mm = 35.0, tilt_deg = 0.0 }}\n\
             fall = {{ fall_s = 0.3, settle_s = 1.0, substep_rate = 3000.0 }}\n\
             physics = {{ shear = {shear}, shear_locking = {shear} }}\n[tool]\n\
             source.shape = {{ kind = \"hemisphere\", radius_mm = 30.0 }}\ngrid.spacing_mm = 4.0\n"
        );
        let config: SceneConfig = toml::from_str(&config).unwrap();
        let scene = Scene::new(&config, |_| {}).unwrap();
        let summary = scene.summary(&scene.initial);
        assert!(
            summary.v_rms_mm_s < 2.0,
            "{loops:?}, {cell_mm}, {shear}: {summary:?}"
        );
        assert!(
            summary.tension_max < 0.015,
            "{loops:?}, {cell_mm}, {shear}: {summary:?}"
        );
        assert!(
            summary.strain_p95 < 0.005,
            "{loops:?}, {cell_mm}, {shear}: {summary:?}"
        );
    }
}
