//! Environments in worlds of their own, and lists that are judged there.

use drape_task::cluster::Cluster;
use drape_task::env::{Member, Quantity, Scatter, Spread, Task, Worlds};
use drape_task::search::{Job, Judge, Moves, Order, choose, moves};

use super::*;

fn worlds() -> Arc<Worlds> {
    let spreads = [
        (Quantity::ShiftMm, Spread::Range([-3.0, 3.0])),
        (Quantity::TurnDeg, Spread::Deviation(1.0)),
        (Quantity::WavinessMm, Spread::Deviation(0.5)),
        (Quantity::Friction, Spread::Deviation(0.2)),
        (Quantity::Stencil, Spread::Deviation(0.05)),
        (Quantity::PressOffsetMm, Spread::Deviation(1.0)),
    ];
    let scatter = Scatter {
        risk: 0.5,
        substep_rates: vec![600.0, 1200.0],
        training: true,
        spreads: spreads.into_iter().collect(),
    };
    Worlds::new(&COARSE, &scatter, 3, 5, |_| ()).unwrap().into()
}

fn scattered(count: usize, worlds: &Arc<Worlds>) -> Draping {
    let member = Member {
        scene: COARSE.clone(),
        config: small_region(),
        count,
        worlds: Some(worlds.clone()),
    };
    Draping::on(vec![member], &Cluster::default()).unwrap()
}

/// Each episode is in another world; an environment that enters one by itself comes to the same bits; and
/// what was saved goes on through the same worlds.
#[test]
fn every_episode_is_in_a_world_of_its_own() {
    let worlds = worlds();
    let mut env = scattered(3, &worlds);
    let starts: Vec<_> = (0..3).map(|index| env.state(index)).collect();
    for (index, start) in starts.iter().enumerate() {
        let world = worlds.world(index as u64);
        assert_eq!(start.own.parameters, world.parameters);
        assert!(start.position != COARSE.initial.position);
        let mut alone = scattered(1, &worlds);
        alone.enter(0, Some(&world));
        assert_eq!(alone.state(0), *start);
        let presses = [450, 451, 452].map(Some);
        for press in presses {
            let mut all = vec![None; 3];
            all[index] = press;
            env.press(&all);
            alone.press(&[press]);
        }
        assert_eq!(alone.state(0), env.state(index));
        assert_eq!(alone.scores()[0], env.scores()[index]);
        env = scattered(3, &worlds);
    }
    let mut player = Player::new(2, 3);
    let (mut ended, mut saved) = (0, None);
    let mut seen = Vec::new();
    while ended < 6 {
        if ended > 1 && saved.is_none() {
            saved = Some((env.save(), player.0.clone(), seen.len()));
        }
        let outcomes = play(&mut env, &mut player, 1).remove(0);
        ended += outcomes
            .iter()
            .filter(|outcome| outcome.episode.is_some())
            .count();
        seen.push((outcomes, env.state(1).own.parameters));
    }
    let (saved, streams, from) = saved.unwrap();
    let mut again = scattered(3, &worlds);
    again.load(&saved).unwrap();
    let mut player = Player(streams);
    for expected in &seen[from..] {
        let outcomes = play(&mut again, &mut player, 1).remove(0);
        assert_eq!((outcomes, again.state(1).own.parameters), *expected);
    }
    let drawn = &seen.last().unwrap().1;
    assert_ne!(*drawn, starts[1].own.parameters);
}

/// The scene's own world is that of an environment without scatter.
#[test]
fn the_world_of_the_scene_is_one_of_them() {
    let mut env = scattered(2, &worlds());
    env.enter(1, None);
    let plain = Draping::new(COARSE.clone(), &small_region(), 1).unwrap();
    assert_eq!(env.state(1), plain.state(0));
    assert!(env.task(1).initial == plain.task(0).initial);
    assert!(env.task(0).initial != plain.task(0).initial);
}

fn lists(count: usize) -> Vec<Vec<u32>> {
    let mut env = Draping::new(COARSE.clone(), &small_region(), count).unwrap();
    let mut stream = Stream::new(4, Purpose::Evaluation, 0);
    let played = env.play(|env| {
        let each = 0..count;
        each.map(|k| choose(env, k, Order::Random, 0.0, &mut stream))
            .collect()
    });
    let vertices = played
        .iter()
        .map(|played| played.end.presses().iter().map(|&(v, _)| v));
    vertices.map(Iterator::collect).collect()
}

/// What a list comes to in a world depends on nothing else: not on its company, not on the number of threads,
/// and not on whether it goes on from where another has come to.
#[test]
fn judgements_depend_on_list_and_world_alone() {
    let (worlds, lists) = (worlds(), lists(5));
    let judge = || Judge::new(&COARSE, &worlds, &worlds.scatter.rated(&small_region())).unwrap();
    let all: Vec<&[u32]> = lists.iter().map(|list| &**list).collect();
    let expected = judge().scores(0, &all, &[0, 1, 2, 9]);
    let pool = |threads| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
    };
    for threads in [1, 3] {
        let found = pool(threads).install(|| judge().scores(0, &all[1..2], &[1, 9]));
        assert_eq!(found, [[expected[1][1], expected[1][3]]]);
    }
    assert!(expected[1][0] != expected[1][1] && expected[1][1] != expected[1][3]);
    // Two lists with the same beginning.
    let mut other = lists[0].clone();
    let at = other.len() / 2;
    other[at..].reverse();
    let job = |list: &[u32]| Job::new(list, Some(2));
    let mut judge = judge();
    let mut press = |job| {
        let before = judge.spent();
        let ended = judge.press(0, vec![job], Task::worth, |_| ()).remove(0);
        (ended, judge.spent() - before)
    };
    let (whole, _) = press(job(&other));
    let (parent, _) = press(Job {
        stride: Some(3),
        ..job(&lists[0])
    });
    assert_eq!(parent.found, Some(expected[0][2]));
    assert_eq!(parent.states.len(), 1 + lists[0].len() / 3);
    let (rest, spent) = press(Job {
        from: Some(parent.states[at / 3].clone()),
        ..job(&other)
    });
    assert!(whole.found.is_some() && whole.found == rest.found);
    assert_eq!(spent, (other.len() - at / 3 * 3) as u64);
}

/// A race gives the order of all its worlds to those that stay in it.
#[test]
fn races_end_with_the_best() {
    let (worlds, lists) = (worlds(), lists(6));
    let mut judge = Judge::new(&COARSE, &worlds, &worlds.scatter.rated(&small_region())).unwrap();
    let all: Vec<&[u32]> = lists.iter().map(|list| &**list).collect();
    let ranked = judge.race(0, &all, 0..9, 2);
    assert_eq!(ranked.len(), 3);
    assert!(ranked.windows(2).all(|pair| pair[0].1 >= pair[1].1));
    let worlds_of_all: Vec<u64> = (0..9).collect();
    for &(k, worth) in &ranked {
        let scores = judge.scores(0, &[all[k]], &worlds_of_all).remove(0);
        assert_eq!(worth, worlds.scatter.judge(&scores));
    }
}

/// From random orders, moves come to what holds in worlds that chose nothing, better than the best of them on
/// average over seeds, and again to the same.
#[test]
fn moves_find_orders_that_hold() {
    let (worlds, lists) = (worlds(), lists(4));
    let mut config = small_region();
    config.costs.second = 1e-3;
    let fresh: Vec<u64> = (1000..1012).collect();
    let method = Moves {
        chains: 4,
        ..Moves::default()
    };
    let search = |seed, budget| {
        let mut judge = Judge::new(&COARSE, &worlds, &worlds.scatter.rated(&config)).unwrap();
        let mut rounds = 0;
        let found = moves(&mut judge, &lists, method, budget, seed, |at| {
            rounds = at.rounds;
            true
        });
        assert_eq!(found.rounds, rounds);
        found
    };
    let mut judge = Judge::new(&COARSE, &worlds, &worlds.scatter.rated(&config)).unwrap();
    let mut worth = |list: &[u32]| {
        let scores = judge.scores(1, &[list], &fresh).remove(0);
        worlds.scatter.judge(&scores)
    };
    let before: Vec<f64> = lists.iter().map(|list| worth(list)).collect();
    let best = before.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut mean = 0.0;
    for seed in 1..4 {
        let found = search(seed, 15_000);
        let (order, judged) = &found.orders[0];
        let after = worth(order);
        mean += after / 3.0;
        // Better than three of the four by far.
        let is_better = |&&other: &&f64| after > other + 0.1;
        assert_eq!(before.iter().filter(is_better).count(), 3, "{after}");
        assert!((after - judged).abs() < 0.05, "{judged} {after}");
    }
    assert!(search(1, 3_000).orders == search(1, 3_000).orders);
    assert!(mean > best, "{mean} {before:?}");
}
