use super::*;
use crate::study::Effort;

/// A coarse blank that falls for a moment, and a corner of it.
fn small() -> (SceneConfig, EnvConfig) {
    let mut scene = SceneConfig::rib();
    scene.blank.vertices = [17, 17];
    scene.tool.grid.spacing_mm = Some(10.0);
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
    let mut chosen = variations(&scene, &env, Effort::Quick);
    let rates = ["60/s", "600/s", "12000/s"];
    chosen.retain(|v| v.axis == "yarn" && rates.contains(&v.value.as_str()) || v.axis == "pushed");
    let mut itself = chosen[0].clone();
    itself.around = itself.reference.clone();
    chosen.push(itself);
    let mut measuring = Measuring::new(&scene, &env).unwrap();
    let rows: Vec<Row> = (chosen.iter())
        .map(|variation| measuring.row(variation).unwrap())
        .collect();
    let [coarse, usual, fine, pushed, itself] = &rows[..] else {
        panic!("{} rows", rows.len())
    };
    let falls = [coarse, usual, fine, itself].map(|row| row.fall_mm.unwrap());
    assert!(falls.is_sorted_by(|a, b| a > b), "{falls:?}");
    assert!(falls[0] > 1.0, "{falls:?}");
    let errors = |row: &Row| row.presses.as_ref().unwrap().eight_mm;
    assert_eq!([falls[3], errors(itself)], [0.0; 2]);
    assert!(
        rows.iter()
            .all(|row| row.presses.as_ref().unwrap().microseconds > 0.0)
    );
    assert!(errors(fine) < errors(coarse));
    // A push tells what no error can be less than, and is one itself.
    assert_eq!(pushed.fall_mm, Some(0.0));
    assert!(0.0 < errors(pushed) && errors(pushed) < errors(coarse));
}

/// Three cells under the stencil on every mesh, as 18 mm are on the default one.
#[test]
fn models_keep_three_cells_under_the_stencil_and_the_fall_of_the_scene() {
    let around = (SceneConfig::rib(), EnvConfig::default());
    let all = variations(&around.0, &around.1, Effort::Full);
    let mut models = all.iter().filter(|v| ["mesh", "physics"].contains(&v.axis));
    assert!(models.all(|v| v.around.0.fall == around.0.fall));
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
