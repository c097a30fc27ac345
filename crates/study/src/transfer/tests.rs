use super::*;
use crate::episodes::play;
use drape_cloth::fabric::BlankConfig;
use drape_cloth::scene::{Fall, SceneConfig};
use drape_task::env::Tasks;

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

/// A press of a list is the environment's own step, bit by bit, alone and in company.
#[test]
fn one_press_is_a_step_of_the_environment() {
    let (scene, env) = (scene(), env());
    for count in [1, 3] {
        let mut stepped = Draping::new(scene.clone(), &env, count).unwrap();
        let action = stepped.observation(0).mask.minimum().unwrap() as u32;
        let vertex = stepped.vertex(action).unwrap();
        stepped.step(&vec![action; count]);
        let list = [vertex];
        let ends = replay(&scene, &env, &vec![&list[..]; count]).unwrap();
        for (index, end) in ends.iter().enumerate() {
            let state = stepped.state(index);
            assert!(state.position != scene.initial.position);
            let expected = End {
                half: stepped.region_distance(&state),
                left: stepped.region_distance(&state),
                positions: state.position,
            };
            assert_eq!(end.as_ref(), Some(&expected));
        }
    }
}

/// Whole episodes end as they did when they were played under the rules of the task, also
/// those that are over before others.
#[test]
fn episodes_end_as_they_were_played() {
    let (scene, env) = (scene(), env());
    let played = play(&scene, &env, Order::Random, 3, 5, |_| {}).unwrap();
    let sequences = sequences(&scene, &env, Order::Random, 3, 5).unwrap();
    let lists: Vec<&[u32]> = sequences.iter().map(|s| &**s).collect();
    assert!(lists[0] != lists[1]);
    let ends = replay(&scene, &env, &lists).unwrap();
    for ((list, end), ended) in lists.iter().zip(&ends).zip(&played.episodes) {
        assert_eq!(list.len(), ended.steps);
        assert_eq!(end.as_ref().unwrap().left, ended.region_m);
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
    let row = judge.row(Played {
        name: "own",
        what: String::new(),
        initial_m: 5.0,
        cpu_s: 0.1,
        ends: &own,
    });
    assert_eq!((row.diverged, row.end.mean_left_m), (1, Some(3.5)));
    assert_eq!(row.end.deviation_left_m, Some(0.5f64.sqrt()));
    let half = row.halfway;
    assert_eq!((half.mean_left_m, half.lost_m), (Some(7.0), Some(4.0)));
    let row_end = row.end;
    assert_eq!(row_end.rank_correlation_twin, Some(-1.0));
    assert_eq!(row_end.rank_correlation_accurate, Some(1.0));
    // Of two, a resample holds both or has no ranks; here the former are the more.
    assert_eq!(row_end.rank_correlation_twin_interval, Some([-1.0; 2]));
    assert_eq!(row_end.more_than_balanced_interval, Some([-2.0; 2]));
    assert_eq!(
        (row_end.lost_m, row_end.best_lost_m),
        (Some(2.0), Some(2.0))
    );
    assert_eq!(row_end.lost_by_chance_m, Some(1.0));
    assert_eq!(row_end.best_rank_twin, Some(2.0));
    assert_eq!(row_end.is_best_among_3, Some(true));
    assert!((row.inside_mm.unwrap() - 3.0).abs() < 1e-12);
    assert_eq!(row.outside_mm, Some(0.0));
    assert_eq!(row_end.left_m, [Some(4.0), Some(3.0), None]);
    let by_order = row_end.rank_correlation_twin_by_order;
    assert_eq!(by_order[1], (Order::Sweep, Some(-1.0)));
    assert_eq!(by_order[0], (Order::Random, None));
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

    let case = TwinCase {
        scene: &scene,
        env: &env,
        config: &twin_config(&scene.config).unwrap(),
        rest: &scene.initial.position,
    };
    let Setting::Twin(setting) = setting(TWIN) else {
        panic!("the twin is one");
    };
    let (ends, _) = case.play(setting, &[&[]]).unwrap();
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
