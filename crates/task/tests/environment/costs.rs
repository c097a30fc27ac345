use drape_task::env::Costs;

use super::*;

/// What a path costs is taken off its score where that is asked for, and nowhere else; rewards stay.
#[test]
fn costs_are_taken_off_the_score_where_they_count() {
    let config = EnvConfig {
        costs: Costs {
            stroke: 0.01,
            turn: 0.02,
            metre: 0.03,
            undraped: 0.04,
        },
        ..small_region()
    };
    let new = || Draping::new(COARSE.clone(), &config, 2).unwrap();
    let (mut plain, mut costly) = (new(), new().costly());
    let mut player = Player::new(3, 2);
    let mut ended = 0;
    while ended < 2 {
        let actions = player.choose(&plain);
        let [expected, found] = [&mut plain, &mut costly].map(|env| env.step(&actions));
        for (index, (expected, found)) in expected.iter().zip(&found).enumerate() {
            assert_eq!(expected.reward, found.reward);
            let (Some(expected), Some(found)) = (&expected.episode, &found.episode) else {
                continue;
            };
            ended += 1;
            let vertices = expected.actions.iter().filter_map(|&a| plain.vertex(a));
            let vertices: Vec<u32> = vertices.collect();
            let end = plain.finished(index).unwrap();
            let (scene, region) = (plain.scene(), plain.region());
            let cost = config.cost(scene, region, &vertices, &end.position);
            let undraped = region.undraped_inner(scene, 1e-3, &end.position);
            assert!(cost > 0.01 + 0.04 * undraped as f64);
            let scores = [expected, found].map(|episode| episode.score.unwrap());
            assert!((scores[0] - cost - scores[1]).abs() < 1e-12);
            assert_eq!(costly.score(&vertices, end), scores[1]);
        }
    }
}
