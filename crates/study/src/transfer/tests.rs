use super::*;
use crate::episodes::play;
use drape_cloth::fabric::BlankConfig;
use drape_cloth::scene::{Fall, SceneConfig};

fn scene() -> Arc<Scene> {
    let mut config = SceneConfig::rib();
    config.blank = BlankConfig {
        vertices: [13, 13],
        ..config.blank
    };
    config.tool.grid.spacing_mm = 12.0;
    config.fall = Fall {
        fall_s: 0.3,
        settle_s: 0.1,
        substep_rate: 1200.0,
        ..config.fall
    };
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

/// Whole episodes end as they did when they were played under the rules of the task, also
/// those that are over before others.
#[test]
fn episodes_end_as_they_were_played() {
    let (scene, env) = (scene(), env());
    let played = play(&scene, &env, Order::Random, 3, 5, |_| {}).unwrap();
    let lists: Vec<&[u32]> = played.iter().map(|p| &*p.pressed).collect();
    assert!(lists[0] != lists[1]);
    let ends = replay(&scene, &env, &lists).unwrap();
    for (end, played) in ends.iter().zip(&played) {
        assert_eq!(end.as_ref().unwrap().left, played.region_m);
    }
}

#[test]
fn sequences_are_shared_among_the_orders() {
    let all = generate(&scene(), &env(), 5, 1).unwrap();
    let count = |order| all.iter().filter(|s| s.order == order).count();
    assert_eq!(Order::ALL.map(count), [2, 2, 1]);
}

/// Figures of three sequences of which one is lost in the setting that is judged.
#[test]
fn rows_leave_lost_sequences_out() {
    let end = |left: f64, x: f64| {
        Some(End {
            half: 2.0 * left,
            left,
            positions: vec![[x, 0.0, 0.0], [0.0; 3]],
        })
    };
    let twin = [end(1.0, 0.0), end(3.0, 0.0), end(2.0, 0.0)];
    let own = [end(4.0, 0.002), end(3.0, 0.004), None];
    let sequence = Sequence {
        order: Order::Sweep,
        vertices: vec![0],
    };
    let judge = Judge {
        balanced: &twin,
        accurate: &own,
        twin: &twin,
        sequences: &vec![sequence; 3],
        is_inside: &|v| v == 0,
    };
    let row = judge.row("own", 0.1, &own);
    let (half, end) = (row.half, row.end);
    assert_eq!(row.diverged, 1);
    assert_eq!(end.left_m, Some([3.5, 0.5f64.sqrt()]));
    assert_eq!((half.left_m.unwrap()[0], half.lost_m), (7.0, Some(4.0)));
    assert_eq!(end.rank_twin, Some(-1.0));
    assert_eq!(end.rank_accurate, Some(1.0));
    // Of two, a resample holds both or has no ranks; here the former are the more.
    assert_eq!(end.rank_twin_interval, Some([-1.0; 2]));
    assert_eq!(end.more_than_balanced, Some([-2.0; 2]));
    assert_eq!((end.lost_m, end.best_lost_m), (Some(2.0), Some(2.0)));
    assert_eq!(end.lost_by_chance_m, Some(1.0));
    assert_eq!(end.best_rank_twin, Some(2.0));
    assert!((row.off_twin_mm[0].unwrap() - 3.0).abs() < 1e-12);
    assert_eq!(row.off_twin_mm[1], Some(0.0));
    assert_eq!(end.all_m, [Some(4.0), Some(3.0), None]);
    assert_eq!(end.rank_twin_by_order, [None, Some(-1.0), None]);
}

fn setting(wanted: &str) -> Setting {
    let found = settings().into_iter().find(|(name, _)| *name == wanted);
    found.unwrap().1
}

/// Nothing pressed is nothing lost, in both.
#[test]
fn a_list_without_a_press_ends_where_it_starts() {
    let (scene, env) = (scene(), env());
    let ends = replay(&scene, &env, &[&[], &[0]]).unwrap();
    let end = ends[0].as_ref().unwrap();
    // The lanes compute in f32.
    for (x, y) in end.positions.iter().zip(&scene.initial.position) {
        for (x, y) in x.iter().zip(y) {
            assert!((x - y).abs() < 1e-6);
        }
    }
    assert!(end.half == end.left && end.left > 0.0);
    assert!(ends[1].as_ref().unwrap().left != end.left);

    let Setting::Twin(setting) = setting(TWIN) else {
        panic!("the twin is one");
    };
    let config = twin_config(&scene.config).unwrap();
    let rest = &scene.initial.position;
    let (ends, _) = replay_in_twin(&scene, &env, &config, rest, setting, &[&[]]).unwrap();
    let twin = ends[0].as_ref().unwrap();
    assert_eq!(
        (twin.half, &twin.positions),
        (twin.left, &scene.initial.position)
    );
    assert!((twin.left - end.left).abs() < 1e-6 * 169.0);
}

/// Rows that bear the name of a preset step as the preset does.
#[test]
fn presets_are_what_they_are_called() {
    let (scene, env) = (scene(), env());
    for preset in Accuracy::ALL {
        let Setting::Fast(fast) = setting(preset.name()) else {
            panic!("{preset:?} is none of the fast solver's");
        };
        let (_, mut changed) = changed(&scene, &env, fast);
        let mut expected = env.clone();
        expected.set_stepping(preset.stepping());
        changed.precision = expected.precision;
        assert_eq!(changed, expected, "{preset:?}");
    }
}
