//! How episodes end, begin again, and go on from a saved state.

use drape_cloth::sim::Precision;
use drape_cloth::sim::{Snapshot, TOUCHED};
use drape_task::env::End;

use super::*;

fn small(scene: &Arc<Scene>, count: usize) -> Draping {
    Draping::new(scene.clone(), &small_region(), count).unwrap()
}

/// Saves in the middle, loads into environments which did something else, and plays both on
/// over the end of their episodes.
fn saved_state_goes_on_exactly(scene: &Arc<Scene>) {
    let mut env = small(scene, 3);
    play(&mut env, &mut Player::new(1, 3), 30);
    let bytes = env.save();
    let mut again = small(scene, 3);
    play(&mut again, &mut Player::new(2, 3), 17);
    again.load(&bytes).unwrap();
    for index in 0..3 {
        assert_eq!(again.observation(index), env.observation(index));
    }
    let expected = play(&mut env, &mut Player::new(3, 3), 120);
    let found = play(&mut again, &mut Player::new(3, 3), 120);
    assert!(expected.iter().flatten().any(|o| o.episode.is_some()));
    assert!(found == expected);
    assert!(again.save() == env.save());
}

#[test]
fn saved_state_goes_on_exactly_by_gauss_seidel() {
    saved_state_goes_on_exactly(&GAUSS_SEIDEL);
}

#[test]
fn saved_state_goes_on_exactly_with_yarns() {
    saved_state_goes_on_exactly(&COARSE);
}

#[test]
fn saved_state_goes_on_exactly_over_a_hole() {
    let config = EnvConfig {
        region_mm: Some([-20.0, 20.0, 60.0, 80.0]),
        crop: true,
        ..EnvConfig::default()
    };
    let make = || Draping::new(HOLED.clone(), &config, 2).unwrap();
    let mut env = make();
    play(&mut env, &mut Player::new(1, 2), 15);
    let mut again = make();
    again.load(&env.save()).unwrap();
    let expected = play(&mut env, &mut Player::new(3, 2), 60);
    assert!(expected.iter().flatten().any(|o| o.episode.is_some()));
    assert!(play(&mut again, &mut Player::new(3, 2), 60) == expected);
    assert!(again.save() == env.save());
}

/// An environment at its start sees the same after loading, to the bit, in either precision.
#[test]
fn start_is_observed_alike_after_loading() {
    for precision in [Precision::F32, Precision::F64] {
        let config = EnvConfig {
            precision,
            ..small_region()
        };
        let env = Draping::new(COARSE.clone(), &config, 2).unwrap();
        let mut again = Draping::new(COARSE.clone(), &config, 2).unwrap();
        again.load(&env.save()).unwrap();
        assert_eq!(again.observation(1), env.observation(1));
    }
}

/// The same actions give the same episode, whatever came before it.
fn episodes_repeat(scene: &Arc<Scene>) {
    let mut env = small(scene, 2);
    let first = play(&mut env, &mut Player::new(1, 2), 40);
    play(&mut env, &mut Player::new(2, 2), 13);
    env.reset(0);
    env.reset(1);
    let second = play(&mut env, &mut Player::new(1, 2), 40);
    assert!(first == second);
    let state = env.state(1);
    let mut new = small(scene, 2);
    play(&mut new, &mut Player::new(1, 2), 40);
    assert!(new.state(1) == state);
}

#[test]
fn episodes_repeat_by_gauss_seidel() {
    episodes_repeat(&GAUSS_SEIDEL);
}

#[test]
fn episodes_repeat_with_yarns() {
    episodes_repeat(&COARSE);
}

#[test]
fn reset_concerns_one_environment() {
    let mut env = small(&COARSE, 3);
    let shown = |env: &Draping, index: usize| (seen(env, index), env.state(index));
    let fresh = shown(&env, 1);
    play(&mut env, &mut Player::new(5, 3), 6);
    let others = [0, 2].map(|i| shown(&env, i));
    assert!(env.state(1) != fresh.1);
    env.reset(1);
    assert!(shown(&env, 1) == fresh);
    assert!([0, 2].map(|i| shown(&env, i)) == others);
}

#[test]
fn step_limit_truncates() {
    let config = EnvConfig {
        max_steps: Some(7),
        ..small_region()
    };
    let mut env = Draping::new(COARSE.clone(), &config, 2).unwrap();
    let outcomes = play(&mut env, &mut Player::new(5, 2), 14);
    for (step, outcomes) in outcomes.iter().enumerate() {
        for (index, outcome) in outcomes.iter().enumerate() {
            assert_eq!(outcome.reward, 0.0);
            let Some(episode) = &outcome.episode else {
                assert_ne!(step % 7, 6);
                continue;
            };
            assert_eq!(step % 7, 6);
            assert_eq!(episode.end, End::Truncated);
            assert_eq!(episode.actions.len(), 7);
            assert_eq!(episode.total_reward, 0.0);
            // What the agent saw last still offers something to do.
            let last = env.last().row(index);
            assert!(last.allowed().next().is_some());
            assert!(last.marks.iter().any(|mark| mark & TOUCHED != 0));
            assert!(env.finished(index).is_some());
        }
    }
}

#[test]
#[should_panic(expected = "is masked out")]
fn forbidden_action_panics() {
    let mut env = small(&COARSE, 1);
    let action = env.observation(0).allowed().next().unwrap();
    env.step(&[action]);
    // Touched by now.
    env.step(&[action]);
}

#[test]
#[should_panic(expected = "is masked out")]
fn action_in_the_hole_panics() {
    let mut env = Draping::new(HOLED.clone(), &EnvConfig::default(), 1).unwrap();
    let absent = |action: &u32| env.vertex(*action).is_none();
    let action = (0..env.shape().pixel_count() as u32).find(absent).unwrap();
    env.step(&[action]);
}

#[test]
#[should_panic(expected = "is masked out")]
fn action_outside_the_region_panics() {
    let config = EnvConfig {
        crop: false,
        ..small_region()
    };
    let mut env = Draping::new(COARSE.clone(), &config, 1).unwrap();
    env.step(&[0]);
}

/// The layout of saved environments: presses, total reward, and the cloth.
type Saved = (Vec<(u32, [f64; 3])>, f32, u64, Snapshot);

#[test]
fn diverged_environment_ends_alone() {
    ends_alone(|cloth, vertex| cloth.position[vertex] = [1e30, 0.0, 1e30]);
    ends_alone(|cloth, vertex| cloth.velocity[vertex] = [0.0, 1e12, 0.0]);
}

/// An end beyond belief is no score and earns nothing, played or replayed: yarns are too long, or a
/// vertex is held 3 mm deep in the tool.
#[test]
fn ends_beyond_belief_have_diverged() {
    let ends = |scene: &Arc<Scene>, config: &EnvConfig| {
        let mut env = Draping::new(scene.clone(), config, 2).unwrap();
        let outcomes = play(&mut env, &mut Player::new(8, 2), 120);
        let rewards = outcomes.iter().flatten().map(|o| o.reward);
        let reward: f32 = rewards.map(f32::abs).sum();
        let mut episodes = outcomes.iter().flatten().filter_map(|o| o.episode.clone());
        let first = episodes.next().expect("an episode ends");
        assert!(episodes.all(|episode| episode.end == first.end));
        assert_eq!(first.score.is_none(), first.end == End::Diverged);
        let vertices = first.actions.iter().filter_map(|&a| env.vertex(a));
        let list: Vec<u32> = vertices.collect();
        let mut again = Draping::new(scene.clone(), config, 1).unwrap();
        let replayed = again.replay(&[&list], |_, _, _| ());
        assert_eq!(replayed[0].is_err(), first.end == End::Diverged);
        (first.end, reward > 0.0)
    };
    let config = small_region();
    assert_eq!(ends(&COARSE, &config), (End::Terminated, true));
    let taut = EnvConfig {
        max_tension: 1e-3,
        ..config.clone()
    };
    assert_eq!(ends(&COARSE, &taut), (End::Diverged, false));

    let mut sunk = Scene::clone(&COARSE);
    let region = config.region(&sunk.lamina).unwrap().vertices;
    let off = |v: &usize| sunk.tool.distance(sunk.initial.position[*v]).0.abs();
    let outside = (0..sunk.lamina.vertex_count()).filter(|&v| !region.contains(v));
    let nearest = outside.min_by(|v, w| off(v).total_cmp(&off(w))).unwrap();
    let initial = Arc::make_mut(&mut sunk.initial);
    let (phi, normal) = sunk.tool.distance(initial.position[nearest]);
    for (x, n) in initial.position[nearest].iter_mut().zip(normal) {
        *x -= (phi + 3e-3) * n;
    }
    initial.fixed.insert(nearest);
    let sunk = Arc::new(sunk);
    assert_eq!(ends(&sunk, &config), (End::Diverged, false));
    let bold = EnvConfig {
        max_depth_mm: 4.0,
        ..config
    };
    assert_eq!(ends(&sunk, &bold), (End::Terminated, true));
}

/// Spoils one of four environments, and steps them beside four that are whole.
fn ends_alone(spoil: impl Fn(&mut Snapshot, usize)) {
    let mut env = small(&COARSE, 4);
    play(&mut env, &mut Player::new(6, 4), 5);
    let bytes = env.save();
    let mut saved: Vec<Saved> = postcard::from_bytes(&bytes).unwrap();
    let corner = saved[2].3.position.len() - 1;
    spoil(&mut saved[2].3, corner);
    let mut spoiled = small(&COARSE, 4);
    spoiled
        .load(&postcard::to_allocvec(&saved).unwrap())
        .unwrap();
    let fresh = small(&COARSE, 1);
    // Loaded as well, so that both go on from the same.
    env = small(&COARSE, 4);
    env.load(&bytes).unwrap();

    let actions = Player::new(7, 4).choose(&env);
    let expected = env.step(&actions);
    let found = spoiled.step(&actions);
    for index in [0, 1, 3] {
        assert!(found[index] == expected[index]);
        assert!(spoiled.observation(index) == env.observation(index));
        assert!(spoiled.state(index) == env.state(index));
    }
    let episode = found[2].episode.as_ref().unwrap();
    assert_eq!((episode.end, found[2].reward), (End::Diverged, 0.0));
    assert_eq!(episode.actions.len(), 6);
    let last = spoiled.last().row(2);
    assert!(last.distance.iter().all(|d| d.is_finite()));
    assert!(last.allowed().next().is_some());
    assert!(spoiled.observation(2) == fresh.observation(0));
    assert!(spoiled.state(2) == fresh.state(0));
}

#[test]
fn unusable_saved_states_change_nothing() {
    let mut env = small(&COARSE, 2);
    play(&mut env, &mut Player::new(8, 2), 3);
    let bytes = env.save();
    let mut three = small(&COARSE, 3);
    assert_eq!(
        three.load(&bytes).unwrap_err(),
        "2 environments saved, expected 3"
    );
    let error = env.load(&bytes[..bytes.len() / 2]).unwrap_err();
    assert!(error.starts_with("not saved environments: "), "{error}");
    let mut saved: Vec<Saved> = postcard::from_bytes(&bytes).unwrap();
    saved[1].3.velocity[3][0] = f64::NAN;
    assert_eq!(
        env.load(&postcard::to_allocvec(&saved).unwrap())
            .unwrap_err(),
        "environment 1 is not of a blank of 1089 vertices"
    );
    assert!(env.save() == bytes);
}
