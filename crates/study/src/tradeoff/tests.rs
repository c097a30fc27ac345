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
    let mut chosen = settings(&scene, &env, Extent::Quick);
    let rates = ["60/s", "600/s"];
    chosen
        .retain(|s| s.axis == "yarn" && rates.contains(&s.value.as_str()) || s.value == "accurate");
    let mut itself = chosen[0].clone();
    (itself.scene, itself.env) = itself.reference.clone();
    chosen.push(itself);
    let found = run(&scene, &env, &chosen, |_| ()).unwrap();
    let points = &found.points;
    assert_eq!(points.len(), 4);
    for pair in points.windows(2) {
        let [coarse, fine] = [&pair[0], &pair[1]];
        assert!(fine.initial_mean_mm < coarse.initial_mean_mm, "{pair:?}");
        assert!(fine.microseconds > 0.0);
    }
    let [worst, best] = [&points[0], &points[3]];
    assert_eq!([best.initial_max_mm, best.sequences_mean_mm], [0.0; 2]);
    assert!(points[2].initial_max_mm > 0.0, "the reference is finer");
    assert!(worst.initial_max_mm > 1.0, "{worst:?}");
    assert!(best.sequences_mean_mm < worst.sequences_mean_mm);
    assert_eq!(found.presets.len(), 1);
    assert!(found.recommendation.point.unwrap() < points.len());

    let text = csv(points);
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 1 + points.len());
    for (row, point) in rows[1..].iter().zip(points) {
        let fields = serde_json::to_value(point).unwrap();
        assert_eq!(row.len(), fields.as_object().unwrap().len());
        for (name, cell) in rows[0].iter().zip(row) {
            match &fields[*name] {
                serde_json::Value::String(value) => assert_eq!(value, cell),
                value => assert_eq!(&value.to_string(), cell, "{name}"),
            }
        }
    }
}

#[test]
fn the_cheapest_within_twice_the_noise_is_recommended() {
    let (scene, env) = small();
    let mut chosen = settings(&scene, &env, Extent::Quick);
    chosen.retain(|s| s.axis == "yarn" && s.value == "6000/s");
    let point = run(&scene, &env, &chosen, |_| ()).unwrap().points.remove(0);
    let of = |microseconds: f64, sequences_rms_m: f64| Point {
        microseconds,
        sequences_rms_m,
        ..point.clone()
    };
    let noise = Noise {
        distance_rms_m: 0.01,
        mean_mm: 1.0,
    };
    let points = [of(9.0, 0.001), of(5.0, 0.02), of(1.0, 0.03)];
    let found = recommend(&points, noise);
    assert_eq!((found.point, found.is_within), (Some(1), true));
    let found = recommend(&points[2..], noise);
    assert_eq!((found.point, found.is_within), (Some(0), false));
    assert_eq!(found.tolerance_m, Some(0.02));
    let lost = recommend(&[of(1.0, f64::NAN)], noise);
    assert_eq!((lost.point, lost.is_within), (None, false));
    let unknown = Noise {
        distance_rms_m: f64::NAN,
        ..noise
    };
    let found = recommend(&points, unknown);
    assert_eq!(
        (found.point, found.is_within, found.tolerance_m),
        (Some(0), false, None)
    );
    assert!(!found.text.contains("NaN"), "{}", found.text);
}

/// Three cells under the stencil on every mesh, as 18 mm are on the default one.
#[test]
fn models_keep_three_cells_under_the_stencil_and_the_fall_of_the_scene() {
    let around = (SceneConfig::rib(), EnvConfig::default());
    let all = settings(&around.0, &around.1, Extent::Full);
    let models = || all.iter().filter(|s| s.kind == Kind::Model);
    assert!(models().all(|s| s.scene.fall.substep_rate == around.0.fall.substep_rate));
    let sides: Vec<_> = all
        .iter()
        .filter(|s| s.axis == "mesh")
        .map(|s| (s.scene.blank.vertices[0], s.env.stencil_mm))
        .collect();
    assert_eq!(sides[..2], [(129, 18.0), (65, 18.0)]);
    let (vertices, side) = sides[2];
    assert!(
        vertices == 33 && (side - 3.0 * 370.0 / 32.0).abs() < 1e-9,
        "{side}"
    );
}

/// The twin that falls is held against is that of the study of the twin, settled as there.
#[test]
fn falls_of_the_twin_are_those_of_the_study_of_the_twin() {
    let (mut scene, _) = small();
    let found = against_twin(&scene).unwrap();
    let mut coarse = scene.clone();
    coarse.blank.vertices = [9, 9];
    let (fast, _) = crate::twin::set_up(&coarse, |_| {}).unwrap();
    let config = crate::twin::twin_config(&coarse).unwrap();
    let twin = crate::twin::fallen(&fast, &config).unwrap();
    let all = 0..found.vertices;
    let expected = distance(&fast.tool, all, &twin.positions());
    assert_eq!((found.vertices, found.distance_m), (81, expected));

    scene.physics.shear = false;
    let message = against_twin(&scene).unwrap_err().to_string();
    assert!(message.starts_with("`physics.shear` is false"), "{message}");
}
