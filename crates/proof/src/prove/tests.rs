use std::sync::Arc;

use super::*;
use drape_cloth::scene::Scene;
use drape_cloth::tool::{Shape, Source};
use drape_task::env::{Draping, EnvConfig, Scatter, Spread};
use drape_task::path::PathFigures;

fn scene() -> Arc<Scene> {
    let mut config = crate::twin::tests::config();
    // Wide enough to be no finer than these cells.
    if let Source::Shape(Shape::Rib(rib)) = &mut config.tool.source {
        (rib.half_width_mm, rib.plate_mm) = (120.0, [480.0; 2]);
    }
    Arc::new(Scene::new(&config, |_| {}).unwrap())
}

fn env() -> EnvConfig {
    EnvConfig {
        region_mm: Some([-186.0, -186.0, -30.0, -30.0]),
        crop: true,
        stencil_mm: 80.0,
        ..EnvConfig::default()
    }
}

fn scatter() -> Scatter {
    let spreads = [
        (Quantity::ShiftMm, Spread::Range([-4.0, 4.0])),
        (Quantity::Friction, Spread::Deviation(0.2)),
        (Quantity::Stencil, Spread::Deviation(0.05)),
        (Quantity::PressOffsetMm, Spread::Deviation(4.0)),
    ];
    Scatter {
        risk: 0.5,
        substep_rates: vec![1200.0],
        training: false,
        spreads: spreads.into_iter().collect(),
    }
}

fn case<'a>(scene: &'a Arc<Scene>, env: &'a EnvConfig, scatter: &'a Scatter) -> Case<'a> {
    Case {
        scene,
        env,
        scatter,
        seed: 3,
    }
}

fn found(case: Case, paths: &[Vec<u32>], random: usize, judge: Physics) -> Proof {
    let choice = choose(case, paths, Method { random, judge }, Listener::QUIET).unwrap();
    prove(case, &choice, judge, Listener::QUIET).unwrap()
}

fn by(judge: Physics) -> Method {
    Method { random: 1, judge }
}

fn row(proof: &Proof, physics: Physics, order: &str) -> Row {
    let mut rows = proof.rows.iter();
    let found = rows.find(|row| row.physics == physics && row.order == order);
    found.expect("a row for each").clone()
}

const ORDERS: [&str; 5] = ["path", "random", "sweep", "outwards", "inwards"];

/// Without scatter there is one world, that of the scene: a path that is among the random ones has the same
/// figures, and the best of several is chosen by what it leaves there, in steps as fine as `accurate`.
#[test]
fn paths_are_held_against_orders_in_the_same_world() {
    let (scene, env, none) = (scene(), env(), Scatter::default());
    let case = case(&scene, &env, &none);
    let random = sequences(&scene, &env, Order::Random, 5, 3).unwrap();
    let found = found(case, &random, 5, Physics::Solver);
    let [path, same] = ["path", "random"].map(|order| row(&found, Physics::Solver, order));
    assert_eq!(path.best, same.best);
    let rows = ORDERS.map(|order| row(&found, Physics::Solver, order));
    assert_eq!(rows.each_ref().map(|row| row.count), [5, 5, 2, 3, 9]);
    assert!(rows.iter().all(|row| row.worlds == 1));
    let Best {
        path: best, score, ..
    } = found.best.unwrap();
    let figures = path.best;
    for equal in [figures.score, figures.nominal_score, figures.worst_score] {
        assert_eq!(equal, score);
    }
    assert!(path.mean_score < score && path.deviation_score > 0.0);
    let mut draping = Draping::new(scene.clone(), &none.finest(&env), 1).unwrap();
    draping.replay(&[&best], |_, _, _| ())[0].unwrap();
    assert!((draping.task(0).score(&draping.state(0)) - score).abs() < 1e-12);
    // The steps of the task end elsewhere.
    let mut own = Draping::new(scene.clone(), &env, 1).unwrap();
    own.replay(&[&best], |_, _, _| ())[0].unwrap();
    assert_ne!(own.task(0).score(&own.state(0)), score);
}

/// A press that is taken out of what was chosen is not proved.
#[test]
fn what_is_proved_is_what_is_left_of_the_choice() {
    let (scene, env, none) = (scene(), env(), Scatter::default());
    let case = case(&scene, &env, &none);
    let paths = sequences(&scene, &env, Order::Random, 2, 3).unwrap();
    let mut choice = choose(case, &paths, by(Physics::Solver), Listener::QUIET).unwrap();
    let path = choice.path.as_mut().unwrap();
    path.truncate(path.len() / 2);
    let half = path.clone();
    let found = prove(case, &choice, Physics::Solver, Listener::QUIET).unwrap();
    assert_eq!(found.best.as_ref().unwrap().path, half);
    let pressed = row(&found, Physics::Solver, "path").best.path.presses;
    assert_eq!(pressed, half.len() as f64);
}

/// A best path that is given up counts as diverged, and the next best is proved, until none is left that was ranked.
#[test]
fn next_best_takes_the_place_of_what_is_lost() {
    let (scene, env, none) = (scene(), env(), Scatter::default());
    let case = case(&scene, &env, &none);
    let paths = sequences(&scene, &env, Order::Random, 5, 3).unwrap();
    let mut choice = choose(case, &paths, by(Physics::Solver), Listener::QUIET).unwrap();
    let proved = |choice: &Choice| {
        let found = prove(case, choice, Physics::Solver, Listener::QUIET).unwrap();
        assert!(!found.is_lost());
        (
            found.best.clone().unwrap(),
            row(&found, Physics::Solver, "path"),
        )
    };
    let (best, whole) = proved(&choice);
    assert!(choice.go_on());
    let (next, less) = proved(&choice);
    assert!(paths.contains(&next.path) && next.path != best.path);
    assert!(next.score < best.score && less.mean_score < whole.mean_score);
    assert_eq!([whole.diverged, less.diverged, less.count], [0, 1, 5]);
    let mut lost = prove(case, &choice, Physics::Solver, Listener::QUIET).unwrap();
    lost.rows[0].best.score = f64::NAN;
    assert!(lost.is_lost());
    assert!(!choice.go_on() && choice.path == Some(next.path));
}

/// What a path costs decides, and is not taken off the score that is told.
#[test]
fn costs_decide_which_path_is_best() {
    let (scene, mut env, none) = (scene(), env(), Scatter::default());
    let paths = sequences(&scene, &env, Order::Random, 5, 3).unwrap();
    let proved = |env: &EnvConfig| found(case(&scene, env, &none), &paths, 1, Physics::Solver);
    let free = proved(&env);
    env.costs.second = 1.0;
    let costly = proved(&env);
    let seconds = |proof: &Proof| row(proof, Physics::Solver, "path").best.robot_s;
    let all = paths.iter().map(|path| {
        let one = [path.clone()];
        seconds(&found(case(&scene, &env, &none), &one, 1, Physics::Solver))
    });
    // A second costs more than any score.
    assert_eq!(seconds(&costly), all.fold(f64::INFINITY, f64::min));
    let score = |proof: &Proof| row(proof, Physics::Solver, "path").best.score;
    assert!(score(&costly) <= score(&free) && score(&costly) > 0.0);
}

/// In scattered worlds the solver and the twin press the same paths, from falls of their own; the twin has the
/// last word; and what one quantity alone does is less than what all do.
#[test]
fn paths_are_proved_in_worlds_that_chose_none() {
    let (scene, env, scatter) = (scene(), env(), scatter());
    let case = case(&scene, &env, &scatter);
    let paths = sequences(&scene, &env, Order::Random, 3, 3).unwrap();
    let found = found(case, &paths, 2, Physics::Twin);
    for (physics, worlds) in [(Physics::Solver, PROVING), (Physics::Twin, TWIN)] {
        let path = row(&found, physics, "path");
        assert_eq!((path.count, path.worlds), (3, worlds));
        let figures = &path.best;
        assert!(figures.worst_score < figures.worst_quarter_score || worlds < 9);
        assert!(figures.worst_quarter_score < figures.score);
        assert_ne!(figures.nominal_score, figures.score);
    }
    let twin = row(&found, Physics::Twin, "path").best;
    let best = found.best.unwrap();
    assert_eq!((best.score, best.physics), (twin.score, Physics::Twin));
    // The world of the scene is the one that is recorded.
    let recording = found.recording.unwrap();
    assert!(recording.by_twin && recording.vertices() == best.path);
    let last = recording.frames.last().unwrap();
    assert!((last.score - twin.nominal_score).abs() < 1e-12);
    let alone = sensitivity(case, &best.path, Listener::QUIET).unwrap();
    assert_eq!(alone.len(), scatter.spreads.len());
    assert!(
        alone
            .windows(2)
            .all(|pair| pair[0].worst_score <= pair[1].worst_score)
    );
    assert!(alone.iter().all(|one| one.worst_score <= one.score + 1e-12));
    // On this mesh a stencil a little wider has the vertices of before under it.
    let hurts = |one: &&Sensitivity| one.worst_score < one.score - 1e-6;
    assert!(alone.iter().filter(hurts).count() >= 3, "{alone:?}");
}

/// What diverges in one of its worlds has no figures.
#[test]
fn what_diverged_counts_in_no_figure() {
    let left = |score| {
        Some(Left {
            distance_m: 1.0 - score,
            surplus_m: 0.0,
            score,
            worth: score,
            undraped_inner: 2,
            shear_deg: 10.0,
            path: PathFigures::default(),
        })
    };
    let figures = Figures::new(&[left(0.9), left(0.25), left(0.75)], &env());
    assert_eq!((figures.score, figures.distance_m), (0.5, 0.5));
    assert_eq!((figures.worst_score, figures.nominal_score), (0.25, 0.9));
    let figures = Figures::new(&[left(0.9), None, left(0.75)], &env());
    let json = serde_json::to_value(&figures).unwrap();
    assert!(json["score"].is_null() && json["worst_score"].is_null());
}

/// Steps that are finer than `accurate` stay.
#[test]
fn a_proof_is_never_coarser_than_the_training() {
    let (mut env, none) = (env(), Scatter::default());
    let fine = drape_cloth::sim::Accuracy::Accurate.stepping();
    assert_eq!(none.finest(&env).stepping(), fine);
    env.substep_rate = Some(48_000.0);
    let found = none.finest(&env).stepping();
    assert_eq!((found.substep_rate, found.contact_rate), (48_000.0, 1200.0));
}

/// Asked, the twin has the last word on the path: the one that leaves least in its worlds, which need not be the solver's.
#[test]
fn twin_chooses_among_the_best() {
    let (scene, env, scatter) = (scene(), env(), scatter());
    let case = case(&scene, &env, &scatter);
    let quiet = Listener::QUIET;
    let paths = sequences(&scene, &env, Order::Random, 8, 2).unwrap();
    let [by_solver, by_twin] = [Physics::Solver, Physics::Twin].map(|judge| {
        choose(case, &paths, by(judge), quiet)
            .unwrap()
            .path
            .unwrap()
    });
    let worlds = case.worlds(CHOOSING.iter().sum::<u64>() as usize, SEEDS[0], quiet);
    let lists = [&by_solver[..], &by_twin[..]];
    let numbers = [Some(0), Some(1), Some(2)];
    let (left, _) = in_twin(case, &worlds.unwrap(), &lists, &numbers, quiet).unwrap();
    let [solver, twin] = [0, 1].map(|k| {
        let worths: Vec<f64> = left[k].iter().map(|left| left.unwrap().worth).collect();
        scatter.judge(&worths)
    });
    assert_ne!(
        by_solver, by_twin,
        "a draw in which they agree shows nothing"
    );
    assert!(twin > solver, "{twin} {solver}");
}

/// Who presses by the list, whatever is seen, leaves what the list leaves where the masks allow it, as in the world of the
/// scene; who goes by what each world shows leaves something else in the others.
#[test]
fn who_does_not_look_is_blind() {
    let (scene, env, scatter) = (scene(), env(), scatter());
    let case = case(&scene, &env, &scatter);
    // The order of the image, which the masks allow wherever the last stencil has been.
    let first = |draping: &Draping, index: usize| draping.observation(index).allowed().next();
    let actions = |draping: &Draping| -> Vec<u32> {
        let all = 0..draping.count();
        all.map(|index| first(draping, index).unwrap()).collect()
    };
    let mut draping = Draping::new(scene.clone(), &scatter.finest(&env), 1).unwrap();
    let path = draping.play(actions).remove(0).end;
    let path: Vec<u32> = path.presses().iter().map(|&(vertex, _)| vertex).collect();
    let mut made = 0;
    let by_list = |draping: &Draping| {
        let next = path.get(made).and_then(|&vertex| draping.action(vertex));
        made += 1;
        let all = 0..draping.count();
        all.map(|index| {
            let allowed = next.filter(|&next| draping.observation(index).allows(next));
            allowed.unwrap_or_else(|| first(draping, index).unwrap())
        })
        .collect()
    };
    let [blind, same] = looked(case, &path, by_list, Listener::QUIET).unwrap();
    assert_eq!(
        [&*blind.order, &*same.order, "solver"],
        ["blind", "policy", same.physics.name()]
    );
    assert_eq!((blind.worlds, same.worlds), (24, 24));
    assert_eq!(blind.best.nominal_score, same.best.nominal_score);
    let [_, other] = looked(case, &path, actions, Listener::QUIET).unwrap();
    assert!(other.best.score.is_finite() && other.best.score != blind.best.score);
}
