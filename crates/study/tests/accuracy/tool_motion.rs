//! Tools that move during the fall, against the same motion seen from elsewhere.

use super::*;
use drape_cloth::scene::{Clamp, Fall, Placement, Scene, SceneConfig};

fn scene(shape: Shape, blank: BlankConfig, placement: Placement) -> SceneConfig {
    SceneConfig {
        tool: ToolConfig {
            source: Source::Shape(shape),
            pose: Pose::default(),
            grid: GridConfig::default(),
        },
        material: None,
        blank,
        placement,
        fall: Fall {
            substep_rate: 3000.0,
            ..Fall::default()
        },
        clamps: Vec::new(),
        physics: PhysicsConfig {
            damping: 0.0,
            ..PhysicsConfig::default()
        },
    }
}

fn set_up(config: &SceneConfig) -> Scene {
    Scene::new(config, |_| {}).unwrap()
}

/// A cylinder that rises under a strip which hangs by its ends, and the strip let down on to it.
#[test]
fn a_rising_tool_is_cloth_that_is_let_down() {
    let way = 40.0;
    let blank = BlankConfig {
        size_mm: [60.0, 300.0],
        vertices: [5, 21],
        ..BlankConfig::default()
    };
    let placement = Placement {
        height_mm: 85.0,
        tilt_deg: 0.0,
        ..Placement::default()
    };
    let mut rising = scene(Shape::Cylinder(Cylinder::default()), blank, placement);
    rising.fall.settle_s = 3.0;
    rising.physics.friction = false;
    rising.physics.damping = 5.0;
    for side in [-1.0, 1.0] {
        rising.clamps.push(Clamp {
            at_mm: [0.0, 150.0 * side],
            radius_mm: 31.0,
            move_mm: [0.0, -10.0 * side, 0.0],
        });
    }
    rising.fall.tool_move_mm = [0.0, 0.0, way];
    let mut lowered = rising.clone();
    lowered.fall.tool_move_mm = [0.0; 3];
    lowered.placement.height_mm += way;
    for clamp in &mut lowered.clamps {
        clamp.move_mm[2] -= way;
    }
    let [rising, lowered] = [rising, lowered].map(|config| set_up(&config));
    let pairs = rising
        .initial
        .position
        .iter()
        .zip(&lowered.initial.position);
    let apart = pairs.map(|(a, b)| (Vec3::from(*a) - Vec3::from(*b)).norm());
    let apart = apart.fold(0.0, f64::max);
    // Two frames with planes looked up at other moments: folds settle a little differently.
    assert!(apart < 3e-4, "up to {apart} m apart");
    let touching = (rising.initial.position.iter())
        .filter(|&&x| rising.tool.distance(x).0 < 1e-3)
        .count();
    assert!(touching > 10, "{touching} vertices touch");
}

/// A free sheet on a plate that slides away under it: motion of the sheet in x, mean and
/// greatest deviation from it [m], and its mean velocity [m/s].
fn towed(change: impl Fn(&mut SceneConfig)) -> [f64; 3] {
    let blank = BlankConfig {
        size_mm: [100.0, 80.0],
        vertices: [6, 5],
        ..BlankConfig::default()
    };
    let placement = Placement {
        height_mm: 0.0,
        tilt_deg: 0.0,
        ..Placement::default()
    };
    let mut config = scene(Shape::Plate(Plate::default()), blank, placement);
    config.fall.tool_move_mm = [150.0, 0.0, 0.0];
    config.fall.fall_s = 0.5;
    config.fall.settle_s = 0.0;
    change(&mut config);
    let scene = set_up(&config);
    let count = scene.lamina.vertex_count() as f64;
    let moved = scene.initial.position.iter().zip(&scene.lamina.rest);
    let moved: Vec<f64> = moved.map(|(x, rest)| x[0] - rest[0]).collect();
    let mean = moved.iter().sum::<f64>() / count;
    let off = moved.iter().map(|m| (m - mean).abs()).fold(0.0, f64::max);
    let speed = scene.initial.velocity.iter().map(|v| v[0]).sum::<f64>() / count;
    [mean, off, speed]
}

/// The sheet gains speed with mu g until it is as fast as the plate, and goes on with it. When the
/// plate stops it slides on as far as it was left behind.
#[test]
fn a_sliding_tool_takes_cloth_along_by_friction() {
    let [_, slip] = Material::interglas_92125().friction();
    let (speed, seconds) = (0.3, 0.5);
    let behind = speed * speed / (2.0 * slip * GRAVITY);
    let [way, off, velocity] = towed(|_| {});
    close(way, speed * seconds - behind, 2e-3);
    close(velocity, speed, 1e-9);
    assert!(off < 1e-6, "{off}");
    let [way, ..] = towed(|config| {
        config.fall.settle_s = 0.5;
        config.fall.settle_damping = 0.0;
    });
    close(way, speed * seconds, 1e-3);
}

/// Without friction the sheet stays, whatever the damping: the air does not move with the tool.
#[test]
fn a_sliding_tool_without_friction_leaves_cloth_behind() {
    for solver in [Solver::Yarn, Solver::GaussSeidel] {
        for damping in [0.0, 50.0] {
            let [way, off, velocity] = towed(|config| {
                config.physics.friction = false;
                config.physics.solver = solver;
                config.physics.damping = damping;
            });
            assert!(way.abs() < 1e-9 && off < 1e-9, "{way}, {off}");
            assert!(velocity.abs() < 1e-9, "{velocity}");
        }
    }
}

#[test]
fn ways_of_the_tool_that_cannot_be_are_refused() {
    for (tool_move_mm, fall_s, message) in [
        (
            [0.0, f64::NAN, 0.0],
            1.0,
            "`fall.tool_move_mm` is [0.0, NaN, 0.0], expected three lengths within +-100000 mm",
        ),
        (
            [0.0, 0.0, 1.0],
            0.0,
            "`fall.tool_move_mm` is [0.0, 0.0, 1.0], expected [0, 0, 0] where `fall.fall_s` is 0",
        ),
        (
            [3000.0, 0.0, 0.0],
            1.0,
            "`fall.tool_move_mm` is [3000.0, 0.0, 0.0], expected a way at no more than half of \
             `physics.speed_cap`",
        ),
    ] {
        let mut config = SceneConfig::rib();
        config.fall.tool_move_mm = tool_move_mm;
        config.fall.fall_s = fall_s;
        assert_eq!(config.check().unwrap_err().to_string(), message);
    }
    for (physics, message) in [
        (
            "adhesion = -1.0",
            "`physics.adhesion` is -1, expected a tack from 0 to 1000000 kPa",
        ),
        (
            "strain_limit = 0.0",
            "`physics.strain_limit` is 0, expected a strain from 1e-6 to 10",
        ),
    ] {
        let mut config = SceneConfig::rib();
        config.physics = toml::from_str(physics).unwrap();
        assert_eq!(config.check().unwrap_err().to_string(), message);
    }
}
