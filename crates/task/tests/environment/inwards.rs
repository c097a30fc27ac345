//! Orders inwards beside others.

use super::*;
use drape_task::env::Worlds;
use drape_task::search::{Judge, Order, choose, inwards};

/// On a quarter of a dome cloth that is held on top and brought in from the border is left with far less surplus than
/// after the best of eight orders outwards or four sweeps.
#[test]
fn on_a_dome_cloth_is_best_brought_in_from_the_border() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../configs/scenes/hemisphere.toml"
    );
    let config = SceneConfig::read(Path::new(path)).unwrap();
    let scene = Arc::new(Scene::new(&config, |_| {}).unwrap());
    let env = EnvConfig {
        region_mm: Some([-131.0, -131.0, 0.0, 0.0]),
        stencil_mm: 25.5,
        substep_rate: Some(2400.0),
        contact_rate: Some(480.0),
        drape_strain: 0.03,
        ..EnvConfig::default()
    };
    let played = |order, count: usize| {
        let mut stream = Stream::new(1, Purpose::Evaluation, 0);
        let next = |env: &Draping, first: usize| {
            let all = 0..env.count();
            let share = |index| (first + index) as f64 / count as f64;
            all.map(|index| choose(env, index, order, share(index), &mut stream))
                .collect()
        };
        let of = |_: &_, played: drape_task::env::Played| played.episode.score.unwrap();
        let scores = Draping::play_all(&scene, &env, count, count, next, of).unwrap();
        scores.into_iter().fold(f64::NEG_INFINITY, f64::max)
    };
    let others = played(Order::Outwards, 8).max(played(Order::Sweep, 4));
    let worlds = Arc::new(Worlds::nominal(&scene));
    let mut judge = Judge::new(&scene, &worlds, std::slice::from_ref(&env)).unwrap();
    // Nine places, then sixteen more.
    let tried = |judge: &mut Judge, times: usize| {
        let mut asked = 0;
        inwards(judge, 0, 99, |_| {
            asked += 1;
            asked <= times
        })
    };
    assert!((1..=9).contains(&tried(&mut judge, 1).len()));
    let found = tried(&mut judge, 2);
    let best = judge.scores(0, &[&found[0]], &[0])[0][0];
    assert!(best > others + 0.1, "{best} and {others}");
}
