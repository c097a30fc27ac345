use drape_task::env::Effort;

use super::*;

/// What the way costs is taken off press by press, and off the score; going on from a saved state
/// changes no bit of it.
#[test]
fn effort_is_taken_off_rewards_and_score() {
    let finally = small_region();
    let dear = EnvConfig {
        stroke_cost: 0.01,
        turn_cost: 0.02,
        metre_cost: 0.03,
        ..finally.clone()
    };
    let [mut plain, mut costly, mut resumed] =
        [&finally, &dear, &dear].map(|c| Draping::new(COARSE.clone(), c, 2).unwrap());
    let mut player = Player::new(3, 2);
    let mut rewards = [0.0; 2];
    let mut ended = 0;
    while ended < 2 {
        resumed.load(&costly.save()).unwrap();
        let actions = player.choose(&plain);
        let [expected, found, again] =
            [&mut plain, &mut costly, &mut resumed].map(|env| env.step(&actions));
        assert_eq!(found, again);
        for (index, (expected, found)) in expected.iter().zip(&found).enumerate() {
            rewards[index] += found.reward;
            let Some(expected) = &expected.episode else {
                continue;
            };
            ended += 1;
            let episode = found.episode.as_ref().unwrap();
            assert_eq!(episode.total_reward, std::mem::take(&mut rewards[index]));
            let vertices = expected.actions.iter().filter_map(|&a| plain.vertex(a));
            let vertices: Vec<u32> = vertices.collect();
            let effort = Effort::new(&COARSE.lamina, &dear).of_path(&vertices);
            assert!(effort > 0.05);
            let score = expected.score.unwrap() - effort;
            assert!((episode.score.unwrap() - score).abs() < 1e-12);
            let initial = costly.initial_objective();
            let total = f64::from(expected.total_reward) - effort * initial;
            assert!((f64::from(episode.total_reward) - total).abs() < 1e-5 * initial);
        }
    }
}
