use drape_task::env::Costs;
use drape_task::path::PathFigures;

use super::*;

/// What a path costs is taken off its worth, counted on the tool, and of nothing else.
#[test]
fn costs_are_taken_off_what_a_path_is_worth() {
    let config = |second: f64, undraped: f64| EnvConfig {
        costs: Costs {
            second,
            undraped,
            press_s: 0.5,
            stroke_s: 2.0,
            turn_s: 1.5,
            contact_mm_s: 50.0,
            jump_mm_s: 200.0,
        },
        drape_threshold_mm: 0.02,
        ..small_region()
    };
    let new = |config: &EnvConfig| Draping::new(COARSE.clone(), config, 1).unwrap();
    let (plain, costly) = (config(0.0, 0.0), config(0.001, 0.04));
    let (mut env, other) = (new(&plain), new(&costly));
    let mut player = Player::new(3, 1);
    play(&mut env, &mut player, 9);
    let (end, task) = (env.episode(0), other.task(0));
    let points = task.points(end.presses());
    let path = PathFigures::new(&points, costly.join_distance());
    let undraped = task.undraped_inner(end.cloth()) as f64;
    let counts = [
        path.strokes,
        path.sharp_turns,
        path.jump_m,
        path.length_m,
        undraped,
    ];
    // All but jumps.
    let is_there = |k: usize| k == 2 || counts[k] > 0.0;
    assert!((0..counts.len()).all(is_there), "{counts:?}");
    let seconds = 0.5 * path.presses
        + 2.0 * path.strokes
        + 1.5 * path.sharp_turns
        + path.length_m / 0.05
        + path.jump_m / 0.2;
    assert!((costly.costs.seconds(&path) - seconds).abs() < 1e-12);
    let score = task.score(end.cloth());
    assert_eq!(env.task(0).worth(&end), Some(score));
    let worth = task.worth(&end).unwrap();
    assert!((score - 0.001 * seconds - 0.04 * undraped - worth).abs() < 1e-12);
    assert_eq!(env.scores(), [score]);
}
