use drape_task::env::Costs;
use drape_task::path::PathFigures;

use super::*;

/// What a path costs is taken off its score where that is asked for, counted on the tool, and nowhere else; rewards
/// stay.
#[test]
fn costs_are_taken_off_the_score_where_they_count() {
    let config = EnvConfig {
        costs: Costs {
            stroke: 0.01,
            turn: 0.02,
            metre: 0.03,
            undraped: 0.04,
        },
        // Ends before all is draped.
        max_steps: Some(20),
        drape_threshold_mm: 0.02,
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
            let (task, end) = (plain.task(index), plain.finished(index).unwrap());
            let pressed = end.presses().iter().map(|&(v, _)| plain.action(v).unwrap());
            assert!(pressed.eq(expected.actions.iter().copied()));
            // As they are counted for people and robots: on the tool.
            let points = task.points(end.presses());
            let path = PathFigures::new(&points, config.join_distance());
            let x = &end.cloth().position;
            let undraped = task.region.undraped_inner(plain.scene(), 2e-5, x);
            let counts = [
                path.strokes,
                path.sharp_turns,
                path.length_m + path.jump_m,
                undraped as f64,
            ];
            let costs = counts.iter().zip([0.01, 0.02, 0.03, 0.04]);
            let cost: f64 = costs.map(|(count, cost)| count * cost).sum();
            assert!(counts.iter().all(|&count| count > 0.0), "{counts:?}");
            let scores = [expected, found].map(|episode| episode.score.unwrap());
            assert!((scores[0] - cost - scores[1]).abs() < 1e-12);
            assert_eq!(costly.score(index, &points, end.cloth()), scores[1]);
        }
    }
}
