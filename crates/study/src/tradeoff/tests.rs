use super::*;

/// A coarse blank that falls for a moment, and a corner of it.
fn small() -> (SceneConfig, EnvConfig) {
    let mut scene = SceneConfig::rib();
    scene.blank.vertices = [17, 17];
    scene.tool.grid.spacing_mm = 10.0;
    (scene.fall.fall_s, scene.fall.settle_s) = (0.2, 0.2);
    let env = EnvConfig {
        region_mm: Some([-186.0, -186.0, -90.0, -90.0]),
        crop: true,
        stencil_mm: 50.0,
        ..EnvConfig::default()
    };
    (scene, env)
}

#[test]
fn errors_fall_with_the_rate_to_none_at_the_reference() {
    let (scene, env) = small();
    let mut chosen = variations(&scene, &env, true);
    let rates = ["60/s", "600/s"];
    chosen
        .retain(|s| s.axis == "yarn" && rates.contains(&s.value.as_str()) || s.value == "accurate");
    let mut itself = chosen[0].clone();
    itself.around = itself.reference.clone();
    chosen.push(itself);
    let (_, points, noise) = measure(&scene, &env, &chosen, &Context::quiet()).unwrap();
    assert_eq!(points.len(), 4);
    let falls: Vec<[f64; 2]> = points.iter().map(|p| p.fall_mm.unwrap()).collect();
    for pair in falls.windows(2) {
        assert!(pair[1][0] < pair[0][0], "{pair:?}");
    }
    assert!(points.iter().all(|p| p.microseconds.unwrap() > 0.0));
    let mean_mm = |k: usize| points[k].eight_mm.unwrap();
    assert_eq!([falls[3][1], mean_mm(3)], [0.0; 2]);
    assert!(falls[2][1] > 0.0, "the reference is finer");
    assert!(falls[0][1] > 1.0, "{:?}", falls[0]);
    assert!(mean_mm(3) < mean_mm(0));
    assert!(recommend(&points, noise).point.unwrap() < points.len());
}

#[test]
fn the_cheapest_within_twice_the_noise_is_recommended() {
    let (scene, env) = small();
    let variation = &variations(&scene, &env, true)[0];
    let of = |microseconds: f64, rms_m: Option<f64>| MeasuredPoint {
        microseconds: Some(microseconds),
        rms_m,
        ..MeasuredPoint::of(variation)
    };
    let noise = Noise {
        distance_rms_m: 0.01,
        mean_mm: 1.0,
    };
    let points = [
        of(9.0, Some(0.001)),
        of(5.0, Some(0.02)),
        of(1.0, Some(0.03)),
    ];
    let found = recommend(&points, noise);
    assert_eq!((found.point, found.is_within), (Some(1), true));
    let found = recommend(&points[2..], noise);
    assert_eq!((found.point, found.is_within), (Some(0), false));
    let none = recommend(&[of(1.0, None)], noise);
    assert_eq!((none.point, none.is_within), (None, false));
    let unknown = Noise {
        distance_rms_m: f64::NAN,
        ..noise
    };
    let found = recommend(&points, unknown);
    assert_eq!((found.point, found.is_within), (Some(0), false));
    assert!(!found.text.contains("NaN"), "{}", found.text);
}

/// Three cells under the stencil on every mesh, as 18 mm are on the default one.
#[test]
fn models_keep_three_cells_under_the_stencil_and_the_fall_of_the_scene() {
    let around = (SceneConfig::rib(), EnvConfig::default());
    let all = variations(&around.0, &around.1, false);
    let models = || all.iter().filter(|s| !s.is_method);
    assert!(models().all(|s| s.around.0.fall.substep_rate == around.0.fall.substep_rate));
    let sides: Vec<_> = all
        .iter()
        .filter(|s| s.axis == "mesh")
        .map(|s| (s.around.0.blank.vertices[0], s.around.1.stencil_mm))
        .collect();
    assert_eq!(sides[..2], [(129, 18.0), (65, 18.0)]);
    let (vertices, side) = sides[2];
    assert!(
        vertices == 33 && (side - 3.0 * 370.0 / 32.0).abs() < 1e-9,
        "{side}"
    );
}
