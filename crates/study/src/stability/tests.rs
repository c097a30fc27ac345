use super::*;
use crate::study::Effort;

/// The quick form of a sweep, of some ticks of each axis only.
fn cut(name: &str, x: &[usize], y: &[usize]) -> Sweep {
    let mut sweep = only(sweeps(Effort::Quick), &[name.into()], |sweep| sweep.name).unwrap();
    let mut sweep = sweep.remove(0);
    for (axis, chosen) in sweep.axes.iter_mut().zip([x, y]) {
        axis.ticks = chosen.iter().map(|&i| axis.ticks[i].clone()).collect();
    }
    sweep
}

#[test]
fn cells_come_in_their_order() {
    let cells = compute(&[cut("damping", &[0, 2], &[0, 3])], &Context::quiet());
    assert_eq!(cells.len(), 16);
    for (i, cell) in cells.iter().enumerate() {
        assert_eq!(cell.at, [i / 4 % 2, i / 8]);
        assert_eq!((cell.solver, cell.precision), VARIANTS[i % 4]);
    }
    // Undamped fall at one substep a frame is known to be wrong by g t h / 2.
    for outcome in [Outcome::Wrong, Outcome::Converged] {
        assert!(cells.iter().any(|cell| cell.outcome == outcome));
    }
}

/// A fall in n substeps of h is too long by g t h / 2: the study finds the very error.
#[test]
fn error_is_that_of_the_integrator() {
    let sweep = cut("damping", &[0, 1], &[0]);
    let cells = compute(std::slice::from_ref(&sweep), &Context::quiet());
    // Six frames of 1/60 s.
    let seconds = 0.1;
    for cell in cells.iter().step_by(4) {
        let h = seconds / 6.0 / sweep.axes[0].ticks[cell.at[0]].0;
        let expected = 0.5 * 9.81 * seconds * h / 0.08;
        let found = cell.error.unwrap();
        assert!(
            (found / expected - 1.0).abs() < 1e-6,
            "{found} is not {expected}"
        );
    }
}

#[test]
fn refusals_and_panics_cost_one_cell_each() {
    let mut refused = cut("damping", &[0], &[0]);
    refused.axes[1].ticks[0].0 = -1.0;
    let mut broken = cut("damping", &[0], &[0]);
    broken.trial = |_| panic!("on purpose");
    let cells = compute(&[refused, broken], &Context::quiet());
    for cell in &cells[..4] {
        assert_eq!(cell.outcome, Outcome::Refused);
        assert_eq!(cell.note, "`physics.damping` is -1, expected a number >= 0");
    }
    for cell in &cells[4..] {
        let found = (cell.outcome, cell.note.as_str());
        assert_eq!(found, (Outcome::Panicked, "on purpose"));
    }
}

#[test]
fn sweeps_have_names_of_their_own_and_their_quick_form_is_smaller() {
    let (quick, full) = (sweeps(Effort::Quick), sweeps(Effort::Full));
    let mut names: Vec<_> = quick.iter().map(|sweep| sweep.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), quick.len());
    let count = |sweep: &Sweep| sweep.axes[0].ticks.len() * sweep.axes[1].ticks.len();
    for (quick, full) in quick.iter().zip(&full) {
        assert_eq!(quick.name, full.name);
        assert!(count(quick) <= count(full));
    }
    for (outcome, name) in Outcome::ALL {
        assert_eq!(outcome.name(), name);
    }
}

#[test]
fn errors_are_short_and_colours_change_at_the_threshold() {
    for (error, text) in [
        (0.0, "0"),
        (3.2e-9, "3e-7"),
        (0.00123, "0.12"),
        (0.0456, "4.6"),
        (0.789, "79"),
        (1234.0, "1e5"),
    ] {
        assert_eq!(percent(error), text);
    }
    assert_eq!(ramp(THRESHOLD), [189, 215, 231]);
    assert_eq!(ramp(0.0), [8, 81, 156]);
    assert_eq!(ramp(1e9), [214, 84, 20]);
    assert!(ramp(1.01 * THRESHOLD)[0] > 250);
}
