use std::sync::Mutex;

use super::*;

fn named(name: &str) -> Sweep {
    let all = sweeps(Extent::Quick);
    all.into_iter().find(|sweep| sweep.name == name).unwrap()
}

/// The same sweep, of some ticks of each axis only.
fn cut(name: &str, x: &[usize], y: &[usize]) -> Sweep {
    let mut sweep = named(name);
    for (axis, chosen) in sweep.axes.iter_mut().zip([x, y]) {
        axis.ticks = chosen.iter().map(|&i| axis.ticks[i].clone()).collect();
    }
    sweep
}

#[test]
fn outcomes_are_counted_and_cells_come_in_their_order() {
    let sweep = cut("damping", &[0, 2], &[0, 3]);
    let heard = Mutex::new(Tally::default());
    let swept = run(vec![sweep.clone(), sweep], |outcome| {
        heard.lock().unwrap().add(outcome);
    });
    assert_eq!(swept.len(), 2);
    for swept in &swept {
        assert_eq!(swept.cells.len(), swept.sweep.cell_count());
        for (i, cell) in swept.cells.iter().enumerate() {
            assert_eq!(cell.at, [i / 4 % 2, i / 8]);
            assert_eq!((cell.solver, cell.precision), VARIANTS[i % 4]);
        }
        assert_eq!(swept.variant(Solver::Yarn, Precision::F32).count(), 4);
    }
    let tally = Tally::of(swept.iter().flat_map(|swept| &swept.cells));
    assert_eq!(tally, *heard.lock().unwrap());
    assert_eq!(tally.cells, 32);
    // Undamped fall at one substep a frame is known to be wrong by g t h / 2.
    assert!(tally.wrong > 0 && tally.converged > 0, "{tally:?}");
    assert_eq!(csv(&swept).lines().count(), 33);
}

/// A fall in n substeps of h is too long by g t h / 2: the study finds the very error.
#[test]
fn error_is_that_of_the_integrator() {
    let swept = run(vec![cut("damping", &[0, 1], &[0])], |_| ());
    let seconds = swept[0].cells[0].figures.simulated_s;
    for cell in swept[0].variant(Solver::Yarn, Precision::F64) {
        let h = seconds / cell.figures.substeps as f64;
        let expected = 0.5 * 9.81 * seconds * h / 0.08;
        let found = cell.figures.error;
        assert!(
            (found / expected - 1.0).abs() < 1e-6,
            "{found} is not {expected}"
        );
    }
}

#[test]
fn refusals_and_panics_cost_one_cell_each() {
    let mut refused = cut("damping", &[0], &[0]);
    refused.axes[1].ticks[0].value = -1.0;
    let mut broken = cut("damping", &[0], &[0]);
    broken.trial = |_| panic!("on purpose");
    let swept = run(vec![refused, broken], |_| ());
    for cell in &swept[0].cells {
        assert_eq!(cell.outcome, Outcome::Refused);
        assert_eq!(cell.note, "`physics.damping` is -1, expected a number >= 0");
    }
    for cell in &swept[1].cells {
        assert_eq!(
            (cell.outcome, cell.note.as_str()),
            (Outcome::Panicked, "on purpose")
        );
    }
}

#[test]
fn sweeps_have_names_of_their_own_and_their_quick_form_is_smaller() {
    let (quick, full) = (sweeps(Extent::Quick), sweeps(Extent::Full));
    let mut names: Vec<_> = quick.iter().map(|sweep| sweep.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), quick.len());
    for (quick, full) in quick.iter().zip(&full) {
        assert_eq!(quick.name, full.name);
        assert!(quick.cell_count() <= full.cell_count());
    }
}
