use super::*;
use drape_cloth::fabric::BlankConfig;
use drape_cloth::scene::Fall;

/// The rib with a coarse blank that falls for a short time.
pub fn config() -> SceneConfig {
    let mut config = SceneConfig::rib();
    config.blank = BlankConfig {
        vertices: [13, 13],
        ..config.blank
    };
    config.tool.grid.spacing_mm = Some(12.0);
    config.fall = Fall {
        fall_s: 0.2,
        settle_s: 0.1,
        substep_rate: 1200.0,
        ..config.fall
    };
    config
}

/// Clamps of the twin end where those of the fast solver do, and its energy is accounted for.
#[test]
fn clamps_of_both_end_in_the_same_places() {
    let scene = Scene::new(&config(), |_| {}).unwrap();
    let twin = fallen(
        &scene,
        &twin_config(&scene.config).unwrap(),
        &drape_cloth::scene::Misplacement::default(),
    )
    .unwrap();
    assert!(scene.initial.fixed.count_ones(..) == 3);
    let positions = twin.positions();
    for v in scene.initial.fixed.ones() {
        for (a, b) in positions[v].iter().zip(scene.initial.position[v]) {
            assert!((a - b).abs() < 1e-9, "vertex {v}: {a} and {b}");
        }
        // A clamp's force stops its vertex up to rounding.
        assert!(twin.velocities()[v].iter().all(|u| u.abs() < 1e-12));
    }
    let energies = twin.energies();
    let share = energies.residual().abs() / energies.size();
    assert!(share < 0.02, "{energies:?}");
    assert!(energies.gravity > 0.0);
}

#[test]
fn what_the_twin_has_not_is_refused_by_name() {
    let message = |change: &dyn Fn(&mut SceneConfig)| {
        let mut config = config();
        change(&mut config);
        twin_config(&config).unwrap_err().to_string()
    };
    assert!(message(&|c| c.physics.shear = false).starts_with("`physics.shear` is false"));
    let dihedral = message(&|c| c.physics.bending = drape_cloth::sim::Bending::Dihedral);
    assert!(dihedral.starts_with("`physics.bending` is dihedral"));
    let damping = message(&|c| c.physics.damping = 1e7);
    assert!(damping.starts_with("`physics.damping` is 10000000, expected"));
    assert!(message(&|c| c.physics.strain_limit = Some(0.01)).contains("strain_limit"));
    let found = twin_config(&config()).unwrap();
    let physics = config().physics;
    assert_eq!(
        (found.damping, found.gravity),
        (physics.damping, physics.gravity)
    );
}
