use drape_task::env::Costs;
use drape_task::path::{Feasibility, PathFigures, PressedPoint, Robot, Rolling};

use super::*;

/// What a path costs is taken off its worth, counted on the tool, and of nothing else.
#[test]
fn costs_are_taken_off_what_a_path_is_worth() {
    let config = |second: f64, undraped: f64, untouched: f64| EnvConfig {
        costs: Costs {
            second,
            undraped,
            untouched,
            infeasible: 0.1,
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
    let (plain, costly) = (config(0.0, 0.0, 0.0), config(0.001, 0.04, 0.003));
    let (mut env, other) = (new(&plain), new(&costly));
    let mut player = Player::new(3, 1);
    play(&mut env, &mut player, 9);
    let (end, task) = (env.episode(0), other.task(0));
    let points = task.points(end.presses());
    let path = PathFigures::new(&points, costly.rolling());
    let undraped = task.undraped_inner(end.cloth()) as f64;
    let touched = &end.cloth().pressed.touched;
    let untouched = task.pressable_vertices().filter(|&v| !touched[v as usize]);
    let untouched = untouched.count() as f64;
    let counts = [
        path.strokes,
        path.sharp_turns,
        path.jump_m,
        path.length_m,
        undraped,
        untouched,
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
    let cost = 0.001 * seconds + 0.04 * undraped + 0.003 * untouched;
    assert!((score - cost - worth).abs() < 1e-12);
    assert_eq!(env.scores(), [score]);
}

/// A robot that reaches one side of the tool, and presses no two points in one stroke.
struct OneSided;

impl Feasibility for OneSided {
    fn allows(&self, point: &PressedPoint) -> bool {
        point.position.x < -0.08
    }

    fn infeasible(&self, path: &[PressedPoint], rolling: Rolling) -> usize {
        assert!(rolling.join_distance > 0.0);
        path.len() - 1
    }
}

/// What a robot cannot press is masked from the start and pressed by nobody; what it cannot roll over costs.
#[test]
fn a_robot_masks_and_costs() {
    let with = EnvConfig {
        robot: Robot(Some(Arc::new(OneSided))),
        ..small_region()
    };
    let new = |config: &EnvConfig| Draping::new(COARSE.clone(), config, 1).unwrap();
    let (free, mut env) = (new(&small_region()), new(&with));
    let all: Vec<u32> = free.task(0).pressable_vertices().collect();
    let some: Vec<u32> = env.task(0).pressable_vertices().collect();
    assert!(
        all.iter()
            .eq(free.task(0).region_vertices().collect::<Vec<_>>().iter())
    );
    assert!(
        !some.is_empty() && some.len() < all.len(),
        "{} of {}",
        some.len(),
        all.len()
    );
    let at = &COARSE.initial.position;
    let origin = COARSE.tool.origin;
    for &v in &all {
        let place = COARSE.tool.surface.project(at[v as usize].into()).position + origin;
        assert_eq!(some.contains(&v), place.x < -0.08);
    }
    let mut player = Player::new(3, 1);
    play(&mut env, &mut player, 60);
    let end = env.episode(0);
    assert!(end.presses().len() > 1);
    assert!(end.presses().iter().all(|(v, _)| some.contains(v)));
    let (worth, score) = (
        env.task(0).worth(&end).unwrap(),
        env.task(0).score(end.cloth()),
    );
    let presses = end.presses().len() as f64;
    assert!((score - 0.05 * (presses - 1.0) - worth).abs() < 1e-12);
    // One that reaches nothing is no task.
    struct Nothing;
    impl Feasibility for Nothing {
        fn allows(&self, _: &PressedPoint) -> bool {
            false
        }
        fn infeasible(&self, path: &[PressedPoint], _: Rolling) -> usize {
            path.len()
        }
    }
    let none = EnvConfig {
        robot: Robot(Some(Arc::new(Nothing))),
        ..small_region()
    };
    let error = Draping::new(COARSE.clone(), &none, 1).err().unwrap();
    assert!(error.to_string().contains("reaches no vertex"), "{error}");
}
