use super::*;

/// A small sheet which lies on the rib after a short fall.
fn small_scene() -> Scene {
    let mut config = SceneConfig::rib();
    config.blank.vertices = [9, 9];
    config.fall.fall_s = 0.2;
    config.fall.settle_s = 0.05;
    config.fall.substep_rate = 1200.0;
    Scene::new(&config, |_| {}).unwrap()
}

/// Whatever is not listed is not computed: its data may be nonsense, and the bits are those of a
/// sheet which never had it.
#[test]
fn what_is_not_listed_is_not_computed() {
    let scene = small_scene();
    let mut lamina = Lamina::clone(&scene.lamina);
    for diagonal in &mut lamina.diagonals {
        // A place outside every array: to touch it would panic.
        *diagonal = [u32::MAX; 2];
    }
    for backend in BenchDevice::all() {
        let mut unlisted = Timed::new(&scene, &lamina, &physics(UNLISTED), backend);
        let mut absent = absent(&scene, backend);
        for case in [&mut unlisted, &mut absent] {
            case.start(&scene);
            case.step();
        }
        let [unlisted, absent] = [unlisted, absent].map(|case| case.0.snapshot(0));
        assert!(unlisted.is_finite());
        assert_eq!(unlisted, absent, "{backend:?}");
    }
}

#[test]
fn every_feature_changes_the_default() {
    for feature in FEATURES {
        assert_ne!(physics(feature), PhysicsConfig::default(), "{feature}");
        assert!(physics(feature).check().is_ok(), "{feature}");
    }
}

#[test]
fn medians_and_least_values() {
    assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
    assert_eq!(median(&[1.0, 2.0]), 1.5);
    assert!(median(&[]).is_nan());
    assert_eq!(extremes(&[3.0, 1.0, 2.0]), [1.0, 3.0]);
}
