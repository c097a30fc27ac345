//! Cloth over tools that are finer than its cells.

use super::{Over, Placement, Scene, SceneConfig};
use crate::fabric::BlankConfig;
use crate::math::Vec3;
use crate::mesh::{TriMesh, write_stl};
use crate::sim::{Accuracy, Backend, Cpu, Precision, Roller, World};
use crate::tool::tests::{blocks, cone, roof};
use crate::tool::{MeshSource, Source, Surface};

/// A blank of `cells` x `cells` cells that falls flat on to a mesh from 1 mm over it.
fn fallen(mesh: &TriMesh, cells: usize, cell_mm: f64) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tool.stl");
    write_stl(&path, mesh, "tool").unwrap();
    let mut config = SceneConfig::rib();
    config.clamps.clear();
    config.tool.source = Source::Mesh(MeshSource { path, scale: 1e-3 });
    config.tool.grid.spacing_mm = None;
    config.blank = BlankConfig {
        size_mm: [cells as f64 * cell_mm; 2],
        vertices: [cells + 1; 2],
        ..BlankConfig::default()
    };
    config.placement = Placement {
        over: Over::Tool,
        height_mm: 1.0,
        tilt_deg: 0.0,
        ..Placement::default()
    };
    config.fall.substep_rate = 3000.0;
    config.fall.contact_rate = 600.0;
    Scene::new(&config, |_| ()).unwrap()
}

const PLATE: [[f64; 3]; 2] = [[-0.1, -0.1, -0.02], [0.1, 0.1, 0.0]];

/// Fins and pins narrower than a cell, wherever they stand under it, and roofs hold the cloth up: it hangs
/// from their tops and lies no deeper in them than is promised.
#[test]
fn cloth_hangs_from_what_is_finer_than_its_cells() {
    let fin = |x: f64, width: f64| [[x, -0.09, -0.001], [x + width, 0.09, 0.03]];
    let pin = |x: f64, y: f64| [[x, y, -0.001], [x + 0.003, y + 0.003, 0.03]];
    let pins = [
        PLATE,
        pin(-0.02, -0.02),
        pin(0.017, -0.0215),
        pin(-0.018, 0.0162),
        pin(0.02, 0.02),
    ];
    let cases = [
        (
            "fin of 5 mm",
            blocks(&[PLATE, fin(0.0004, 0.005)]),
            6.0,
            [0.0029, 0.03],
        ),
        (
            "beside it",
            blocks(&[PLATE, fin(-0.0031, 0.005)]),
            6.0,
            [-0.0006, 0.03],
        ),
        (
            "fin of 8 mm",
            blocks(&[PLATE, fin(0.001, 0.008)]),
            10.0,
            [0.005, 0.03],
        ),
        (
            "fin of 2 mm",
            blocks(&[PLATE, fin(0.002, 0.002)]),
            6.0,
            [0.003, 0.03],
        ),
        ("pins", blocks(&pins), 10.0, [-0.0185, 0.03]),
        ("roof", roof(60.0), 6.0, [0.0, 0.06]),
        (
            "fins that cross",
            blocks(&[
                PLATE,
                [[-0.09, -0.0025, -0.001], [0.09, 0.0025, 0.02]],
                [[-0.0025, -0.09, -0.001], [0.0025, 0.09, 0.03]],
            ]),
            6.0,
            [0.0, 0.03],
        ),
        (
            "cone",
            cone(0.02, 0.03, [0.002, -0.0185]),
            6.0,
            [0.002, 0.03],
        ),
    ];
    for (name, mesh, cell_mm, [x, top]) in cases {
        let scene = fallen(&mesh, 14, cell_mm);
        assert!(scene.model.feels_between(), "{name}");
        let sheet = scene.lamina.mesh(&scene.initial.position);
        let deepest = scene.tool.surface.deepest(&sheet);
        assert!(
            deepest.depth <= scene.tolerance().depth,
            "{name}: {deepest:?}"
        );
        let over = Surface::new(&sheet).unwrap().crossings(x, -0.0185);
        let (height, _) = over[over.len() - 1];
        let low = top - 2.0 * scene.tolerance().depth;
        assert!((low..top + 1e-3).contains(&height), "{name}: {height}");
        assert!(scene.initial.v_rms() < 2e-2, "{name}");
    }
}

/// A scene whose tool is moved by whole metres has the same bits, in the frame of the tool; its files have it
/// where it is.
#[test]
fn far_tools_are_computed_about_themselves() {
    let end = |translation_mm: [f64; 3], over: Over| {
        let mut config = SceneConfig::rib();
        config.tool.grid.spacing_mm = Some(10.0);
        config.tool.pose.translation_mm = translation_mm;
        config.blank.vertices = [9, 9];
        config.fall.substep_rate = 1200.0;
        let [x, y, z] = translation_mm;
        config.placement.over = over;
        if over == Over::Origin {
            config.placement.centre_mm = [x, y];
            config.placement.height_mm += z;
        }
        let scene = Scene::new(&config, |_| ()).unwrap();
        let placed = scene.tool.in_scene(&scene.initial.position);
        (scene.initial.position.clone(), placed)
    };
    for over in [Over::Tool, Over::Origin] {
        let near = end([0.0; 3], over);
        assert_eq!(near.0, near.1);
        let far = end([5000.0, -9000.0, 3000.0], over);
        assert!(over == Over::Origin || near.0 == far.0);
        // A height of 3000.2 mm is not one of 0.2 mm to the last bit.
        for (a, b) in near.1.iter().zip(&far.1) {
            let moved = Vec3::from(*b) - Vec3::from(*a);
            assert!((moved - Vec3::new(5.0, -9.0, 3.0)).norm() < 1e-9);
        }
    }
    let (farthest, _) = end([99_999.0, 0.0, -99_999.0], Over::Tool);
    assert!(farthest.iter().flatten().all(|x| x.abs() < 0.5));
}

/// Shipped scenes cost what they cost without.
#[test]
fn shipped_tools_are_smooth() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/scenes");
    let files = std::fs::read_dir(folder).unwrap();
    for path in files.map(|file| file.unwrap().path()) {
        let mut config = SceneConfig::read(&path).unwrap();
        (config.fall.fall_s, config.fall.settle_s) = (0.0, 0.0);
        config.clamps.iter_mut().for_each(|c| c.move_mm = [0.0; 3]);
        let scene = Scene::new(&config, |_| ()).unwrap();
        // The rim of its plate lies under its blank.
        let expected = path.ends_with("outline-with-hole.toml");
        assert_eq!(scene.model.feels_between(), expected, "{}", path.display());
    }
}

/// Plates, and edges that lie beside the blank, need no contact between vertices.
#[test]
fn smooth_tools_have_no_such_stage() {
    let scene = fallen(&blocks(&[PLATE]), 8, 6.0);
    assert!(!scene.model.feels_between());
    assert!(
        scene
            .tool
            .surface
            .deepest(&scene.lamina.mesh(&scene.initial.position))
            .depth
            < 1e-6
    );
}

/// Presses beside a fin take no cloth through it, however rarely planes would be refreshed without it.
#[test]
fn presses_beside_a_fin_leave_cloth_on_it() {
    let fin = [[0.0004, -0.09, -0.001], [0.0054, 0.09, 0.02]];
    let scene = fallen(&blocks(&[PLATE, fin]), 14, 6.0);
    let world = World::new(scene.model.clone(), scene.tool.clone());
    let roller = Roller {
        pressure: 1e6,
        speed: 4.0,
    };
    for accuracy in [Accuracy::Fast, Accuracy::Balanced] {
        let mut cloth = Cpu::new(&world, 1, Precision::F32);
        cloth.load(0, &scene.initial);
        for x in [0.012, -0.006, 0.024, -0.018] {
            let is_under = |at: &[f64; 2]| (at[0] - x).abs() < 1e-3 && at[1].abs() < 0.02;
            let rest = scene.lamina.rest.iter().enumerate();
            let under: Vec<u32> = rest
                .filter(|(_, at)| is_under(at))
                .map(|(v, _)| v as u32)
                .collect();
            let areas = vec![3.6e-5; scene.lamina.vertex_count()];
            let press = roller.press(0, &under, &areas);
            cloth.step(&accuracy.stepping().press(0.1), &[press]);
        }
        let sheet = scene.lamina.mesh(&cloth.snapshot(0).position);
        let deepest = scene.tool.surface.deepest(&sheet);
        assert!(
            deepest.depth <= scene.tolerance().depth,
            "{accuracy:?}: {deepest:?}"
        );
        let over = Surface::new(&sheet).unwrap().crossings(0.003, 0.001);
        let (height, _) = over[over.len() - 1];
        assert!(height > 0.019, "{accuracy:?}: {height}");
    }
}
