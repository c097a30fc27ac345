//! Lists of presses pressed again: side by side as alone, with an observer, until they diverge.

use drape_cloth::sim::Snapshot;
use drape_task::env::{Played, ReplayDiverged, Task};

use super::*;

/// An episode in three lengths, one of them of no press at all.
#[test]
fn lists_side_by_side_end_as_each_alone_and_as_they_were_played() {
    let mut env = Draping::new(COARSE.clone(), &small_region(), 3).unwrap();
    let mut player = Player::new(1, 1);
    let mut episode = Draping::new(COARSE.clone(), &small_region(), 1).unwrap();
    let mut vertices = Vec::new();
    for _ in 0..6 {
        let action = player.choose(&episode);
        assert!(episode.observation(0).allows(action[0]));
        vertices.push(episode.vertex(action[0]).unwrap());
        episode.step(&action);
    }
    let lists = [&vertices[..], &vertices[..2], &[]];
    let mut seen: Vec<Vec<Snapshot>> = vec![Vec::new(); lists.len()];
    let ends = env.replay(&lists, |env, index, presses| {
        assert_eq!(seen[index].len(), presses);
        seen[index].push(env.state(index));
    });
    assert_eq!(ends, [Ok(()); 3]);
    assert!(seen[0][6] == episode.state(0));
    assert_eq!(env.state(0).pressed, episode.state(0).pressed);
    for (list, seen) in lists.iter().zip(&seen) {
        assert_eq!(seen.len(), list.len() + 1);
        let mut alone = Draping::new(COARSE.clone(), &small_region(), 1).unwrap();
        assert_eq!(alone.replay(&[list], |_, _, _| ()), [Ok(())]);
        assert!(alone.state(0) == seen[list.len()]);
    }
}

/// However many are played at a time.
#[test]
fn episodes_of_a_task_do_not_depend_on_their_company() {
    let play = |most| {
        let choose = |env: &Draping, first: usize| {
            let choose = |k| {
                let allowed: Vec<u32> = env.observation(k).allowed().collect();
                allowed[7 * (first + k) % allowed.len()]
            };
            (0..env.count()).map(choose).collect()
        };
        let end = |_: &Task, played: Played| played.episode;
        Draping::play_all(&COARSE, &small_region(), 5, most, choose, end).unwrap()
    };
    let all = play(5);
    assert_eq!((all.len(), play(2), play(1)), (5, all.clone(), all));
}

#[test]
fn divergence_ends_a_list_and_tells_its_press() {
    let mut scene = (**COARSE).clone();
    Arc::make_mut(&mut scene.initial).velocity[0] = [1e12, 0.0, 0.0];
    let mut env = Draping::new(Arc::new(scene), &small_region(), 2).unwrap();
    let vertex = env.tasks()[0].region_vertices().next().unwrap();
    let mut calls = Vec::new();
    let ends = env.replay(&[&[vertex; 3], &[]], |_, index, presses| {
        calls.push((index, presses));
    });
    assert_eq!(ends, [Err(ReplayDiverged { presses: 1 }), Ok(())]);
    assert_eq!(calls, [(0, 0), (1, 0)]);
}
