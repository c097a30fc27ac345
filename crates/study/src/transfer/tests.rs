use super::*;
use crate::episodes;

pub fn scene() -> Arc<Scene> {
    Arc::new(Scene::new(&crate::twin::tests::config(), |_| {}).unwrap())
}

pub fn env() -> EnvConfig {
    EnvConfig {
        region_mm: Some([-186.0, -186.0, -30.0, -30.0]),
        crop: true,
        stencil_mm: 80.0,
        ..EnvConfig::default()
    }
}

/// As the environment steps.
fn play_fast(scene: &Arc<Scene>, env: &EnvConfig, lists: &[&[u32]]) -> (Vec<Option<End>>, f64) {
    let player = Player::Fast(Solver::Yarn, env.stepping(), env.precision);
    play(scene, env, &[], player, lists).unwrap()
}

/// Whole episodes end as they did when they were played under the rules of the task, also
/// those that are over before others.
#[test]
fn episodes_end_as_they_were_played() {
    let (scene, env) = (scene(), env());
    let played = episodes::play(&scene, &env, Order::Random, 3, 5, |_| {}).unwrap();
    let lists = episodes::sequences(&scene, &env, Order::Random, 3, 5).unwrap();
    let lists: Vec<&[u32]> = lists.iter().map(|list| &list[..]).collect();
    assert!(lists[0] != lists[1]);
    let (ends, _) = play_fast(&scene, &env, &lists);
    for (end, played) in ends.iter().zip(&played) {
        assert_eq!(end.as_ref().unwrap().positions, played.end.cloth().position);
    }
}

#[test]
fn sequences_are_shared_among_the_orders() {
    let all = generate(&scene(), &env(), 5, 1).unwrap();
    let count = |order| all.iter().filter(|path| path.0 == order).count();
    assert_eq!(Order::ALL.map(count), [2, 2, 1]);
}

/// Figures of three sequences of which one diverges for the player that is judged.
#[test]
fn rows_leave_diverged_sequences_out() {
    let end = |left: f64, x: f64| {
        Some(End {
            left_m: [2.0 * left, left, left],
            positions: vec![[x, 0.0, 0.0], [0.0; 3]],
        })
    };
    let row = |name, ends: &[Option<End>; 3]| Row {
        name,
        ends: ends.to_vec(),
        cpu_s: 0.1,
    };
    let twin = [end(1.0, 0.0), end(3.0, 0.0), end(2.0, 0.0)];
    let own = [end(4.0, 0.002), end(3.0, 0.004), None];
    let rows = [
        row(BALANCED, &twin),
        row("accurate", &own),
        row(TWIN, &twin),
    ];
    let paths = vec![(Order::Sweep, vec![0]); 3];
    let report = report(&rows, &paths, |v| v == 0);
    let json: Vec<_> = report.tables.iter().map(Table::json).collect();
    let [objective, end, places] = [0, 1, 2].map(|table: usize| &json[table][1]);
    assert_eq!(places["diverged"], 1);
    assert_eq!(
        (&end["left_m"], &end["deviation_m"]),
        (&3.5.into(), &0.5f64.sqrt().into())
    );
    assert_eq!(
        (&objective["left_m"], &objective["lost_m"]),
        (&7.0.into(), &4.0.into())
    );
    assert_eq!(end["rank_twin"], -1.0);
    // Of two, a resample holds both or has no ranks; here the former are the more.
    assert_eq!(end["rank_twin_90"], "-1.00 .. -1.00");
    assert_eq!(end["over_balanced_90"], "-2.00 .. -2.00");
    assert_eq!(end["lost_m"], 2.0);
    assert_eq!(
        (&end["by_chance_m"], &end["best_rank"]),
        (&1.0.into(), &2.0.into())
    );
    let inside = places["off_the_twin_inside_mm"].as_f64().unwrap();
    assert!((inside - 3.0).abs() < 1e-12);
    assert_eq!(places["outside_mm"], 0.0);
    assert_eq!(places["sweeps_m"], 3.5);
    assert!(places["random_m"].is_null());
    assert!(json[3][5]["distance_m"].is_null());
}

/// Nothing pressed is nothing lost, in both.
#[test]
fn a_list_without_a_press_ends_where_it_starts() {
    let (scene, env) = (scene(), env());
    let (ends, _) = play_fast(&scene, &env, &[&[], &[0]]);
    let end = ends[0].as_ref().unwrap();
    // The lanes compute in f32.
    for (x, y) in end.positions.iter().zip(&scene.initial.position) {
        for (x, y) in x.iter().zip(y) {
            assert!((x - y).abs() < 1e-6);
        }
    }
    assert!(end.left_m.iter().all(|&left| left > 0.0));
    assert!(ends[1].as_ref().unwrap().left_m != end.left_m);

    let (ends, _) = play(&scene, &env, &[], Player::TwinFromFast, &[&[]]).unwrap();
    let twin = ends[0].as_ref().unwrap();
    assert_eq!(twin.positions, scene.initial.position);
    assert!((twin.left_m[1] - end.left_m[1]).abs() < 1e-6 * 169.0);
}

/// Rows that bear the name of a preset step as the preset does.
#[test]
fn presets_are_what_they_are_called() {
    for preset in Accuracy::ALL {
        let found = players()
            .into_iter()
            .find(|(name, _)| *name == preset.name());
        let Some((_, Player::Fast(Solver::Yarn, stepping, _))) = found else {
            panic!("{preset:?} is none of the fast solver's");
        };
        assert_eq!(stepping, preset.stepping(), "{preset:?}");
    }
}
