use super::*;
use drape_cloth::fabric::{BlankConfig, Lamina, Material};

/// A small sheet which lies on the rib after a short fall.
fn small_scene() -> Scene {
    let mut config = SceneConfig::rib();
    config.blank.vertices = [9, 9];
    config.fall.fall_s = 0.2;
    config.fall.settle_s = 0.05;
    config.fall.substep_rate = 1200.0;
    Scene::new(&config, |_| {}).unwrap()
}

#[test]
fn the_standard_sheet_has_the_documented_constraints() {
    let lamina = Lamina::new(&BlankConfig::default(), Material::interglas_92125()).unwrap();
    let count = Constraints::of(&lamina);
    assert_eq!(count.vertices, 65 * 65);
    assert_eq!(count.yarn_edges + count.diagonals, 12_416);
    assert_eq!(count.triples, 8_190);
    // 8320 yarn edges, 4096 diagonals, 8190 triples and 4225 vertices.
    let vertex = 4225 * 70;
    let yarn = Operations {
        simple: 8320 * 62 + 4096 * 57 + 8450 * 65 + 4225 * 10 + vertex,
        divisions: 8320 + 4096 + 8450,
        roots: 8320 + 4096,
    };
    assert_eq!(operations(&lamina, Solver::Yarn), yarn);
    let gauss_seidel = Operations {
        simple: (8320 + 4096) * 30 + 4096 * 15 + 8190 * 35 + vertex,
        divisions: 8320 + 4096 + 8190,
        roots: 8320 + 4096,
    };
    assert_eq!(operations(&lamina, Solver::GaussSeidel), gauss_seidel);
}

/// Whatever is not listed is not computed: its data may be nonsense, and the bits are those of a
/// sheet which never had it.
#[test]
fn what_is_not_listed_is_not_computed() {
    let scene = small_scene();
    let mut lamina = scene.lamina.clone();
    for diagonal in &mut lamina.diagonals {
        // A place outside every array: to touch it would panic.
        diagonal.vertices = [u32::MAX; 2];
        diagonal.rest_length = f64::NAN;
    }
    for backend in Backend::all() {
        let mut unlisted = Case::new(&lamina, &physics(UNLISTED), backend);
        let mut absent = absent(&scene, backend);
        for case in [&mut unlisted, &mut absent] {
            case.start(&scene);
            case.step(&scene);
        }
        assert!(unlisted.state().is_finite());
        assert_eq!(unlisted.state(), absent.state(), "{backend:?}");
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
fn medians_and_differences() {
    let samples = Samples(vec![3.0, 1.0, 2.0]);
    assert_eq!((samples.min(), samples.median()), (1.0, 2.0));
    let slower = Samples(vec![3.5, 1.5, 12.5]);
    assert_eq!(slower.minus(&samples).median(), 0.5);
    assert_eq!(Samples(vec![1.0, 2.0]).median(), 1.5);
}

#[test]
fn the_longer_of_arithmetic_and_division_is_the_limit() {
    let limits = Limits {
        operations_per_second: 10.0,
        divisions_per_second: 2.0,
        roots_per_second: 1.0,
        bytes_per_second: 1.0,
    };
    let work = |simple| Operations {
        simple,
        divisions: 2,
        roots: 3,
    };
    assert_eq!(work(10).seconds(&limits), 4.0);
    assert_eq!(work(50).seconds(&limits), 5.0);
}
