use super::*;
use crate::episodes::play;
use crate::transfer::tests::{env, scene};
use drape_cloth::measure::surplus;

fn row(proof: &Proof, physics: Physics, order: &str) -> Row {
    let mut rows = proof.rows.iter();
    let found = rows.find(|row| row.physics == physics && row.order == order);
    found.expect("a row for each").clone()
}

/// A path that is among the random ones has the same figures, and the best of several is chosen
/// by what it leaves in the finer physics, not by its place in the list.
#[test]
fn paths_are_held_against_orders_in_the_same_physics() {
    let (scene, env) = (scene(), env());
    let random = sequences(&scene, &env, Order::Random, 5, 0).unwrap();
    let found = prove(&scene, &env, &random, (5, false), &Context::quiet()).unwrap();
    let [path, same] =
        ["path", "random"].map(|order| row(&found, Physics::Accurate, order).figures);
    assert_eq!(path, same);
    let counts = ["path", "random", "sweep", "outwards"]
        .map(|order| row(&found, Physics::Accurate, order).count);
    assert_eq!(counts, [5, 5, 2, 3]);
    let Best {
        index: best, score, ..
    } = found.best.unwrap();
    assert_eq!(score, path.best_score);
    assert!(path.least_surplus_m < path.surplus_m && path.score < path.best_score);

    let mut draping = Draping::new(scene.clone(), &finely(&env), 1).unwrap();
    draping.replay(&[&random[best]], |_, _, _| ())[0].unwrap();
    assert!((draping.score(0, &draping.points(0), &draping.state(0)) - score).abs() < 1e-12);
    // The steps of the task end elsewhere.
    let own = play(&scene, &env, Order::Random, 5, 0, |_| ()).unwrap();
    let region = env.region(&scene.lamina).unwrap().vertices;
    let own = surplus(
        &scene.lamina,
        &scene.tool,
        &own[best].end.cloth().position,
        &region,
    );
    assert_ne!(own, path.least_surplus_m);
}

/// What a path costs decides, as where it is polished.
#[test]
fn costs_decide_which_path_is_best() {
    let (scene, mut env) = (scene(), env());
    let paths = sequences(&scene, &env, Order::Random, 5, 0).unwrap();
    let proved = |env: &EnvConfig| {
        let found = prove(&scene, env, &paths, (1, false), &Context::quiet());
        found.unwrap().best.unwrap()
    };
    let free = proved(&env);
    env.costs.metre = 1.0;
    let costly = proved(&env);
    let mut draping = Draping::new(scene.clone(), &finely(&env), 5)
        .unwrap()
        .costly();
    let lists: Vec<&[u32]> = paths.iter().map(|path| &path[..]).collect();
    let _ = draping.replay(&lists, |_, _, _| ());
    let scores: Vec<f64> = (0..5)
        .map(|k| draping.score(k, &draping.points(k), &draping.state(k)))
        .collect();
    let best = scores.iter().copied().max_by(f64::total_cmp).unwrap();
    assert!((costly.score - best).abs() < 1e-12 && (scores[costly.index] - best).abs() < 1e-12);
    assert!(costly.score < free.score);
}

/// The best four at `accurate` go on to the twin, and the best there is chosen.
#[test]
fn the_twin_has_the_last_word() {
    let (scene, env) = (scene(), env());
    let paths = sequences(&scene, &env, Order::Random, 6, 3).unwrap();
    let found = prove(&scene, &env, &paths, (4, true), &Context::quiet()).unwrap();
    let counts = ["path", "random", "sweep", "outwards"]
        .map(|order| [Physics::Accurate, Physics::Twin].map(|p| row(&found, p, order).count));
    assert_eq!(counts, [[6, 4], [4, 1], [1, 1], [2, 2]]);
    let twin = row(&found, Physics::Twin, "path").figures;
    let best = found.best.unwrap();
    assert_eq!((best.score, best.physics), (twin.best_score, Physics::Twin));
    let best = best.index;
    let again = prove(
        &scene,
        &env,
        &paths[best..=best],
        (4, true),
        &Context::quiet(),
    )
    .unwrap();
    assert_eq!(again.best.map(|found| found.score), Some(twin.best_score));
}

#[test]
fn what_diverged_counts_in_no_figure() {
    let left = |score| {
        Some(Left {
            distance_m: 1.0 - score,
            surplus_m: 0.0,
            score,
            undraped_inner: 2,
            shear_deg: 10.0,
            path: PathFigures::default(),
        })
    };
    let groups = [
        ("path", vec![vec![0], vec![1], vec![2]], 3),
        ("random", vec![vec![3]], 2),
    ];
    let all = [left(0.25), None, left(0.75), None];
    let rows = summed(Physics::Twin, &groups, &all);
    assert_eq!(ranked(&all[..3]), [(2, 0.75), (0, 0.25)]);
    assert_eq!((rows[0].count, rows[0].diverged), (2, 1));
    let figures = &rows[0].figures;
    assert_eq!(
        (figures.score, figures.distance_m, figures.undraped_inner),
        (0.5, 0.5, 2.0)
    );
    // One had diverged where it was looked for.
    assert_eq!((rows[1].count, rows[1].diverged), (0, 2));
    let json = serde_json::to_value(&rows[1]).unwrap();
    assert!(json["score"].is_null() && json["least_surplus_m"].is_null());
    assert_eq!(
        (&json["physics"], &json["count"]),
        (&"twin".into(), &0.into())
    );
}

/// Steps that are finer than `accurate` stay.
#[test]
fn a_proof_is_never_coarser_than_the_training() {
    let mut env = env();
    assert_eq!(finely(&env).stepping(), Accuracy::Accurate.stepping());
    env.substep_rate = Some(48_000.0);
    let found = finely(&env).stepping();
    assert_eq!((found.substep_rate, found.contact_rate), (48_000.0, 1200.0));
}
