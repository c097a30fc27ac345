//! Where the simulator converges, where it is stable but wrong, and where it diverges.
//!
//! A [`Sweep`] varies two quantities to their extremes and simulates one small piece of cloth for
//! every pair of values, with both solvers and in both precisions. Each cell is judged against a
//! closed form, or a state that must not change. Outcomes, in the order in which they are decided:
//!
//! | Outcome | Means |
//! | --- | --- |
//! | panicked | the simulator panicked: a bug |
//! | refused | a check of the configuration refused the cell with an error |
//! | diverged | [`Backend::finite`](drape_cloth::sim::Backend::finite) said no after a frame |
//! | non-finite | it said yes, but a position or velocity is no number: a bug |
//! | converged | the error at the end is at most [`THRESHOLD`] |
//! | wrong | it is larger |
//!
//! The error is a mean over vertices divided by the size of the sheet; each trial names its norm.

mod free;
mod hanging;
mod lying;
mod sweeps;
mod trial;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

use crate::study::{Context, Report, Study, StudyError, only};
use drape_cloth::sim::{Precision, Solver};
use drape_report::{Color, HeatMap, Image, Tile};
use drape_report::{Format::Hidden, Table};
use sweeps::Axis;

pub use sweeps::{Sweep, sweeps};
pub use trial::{Outcome, THRESHOLD};

/// Sweep the simulator's extremes: what converges, what is wrong, what diverges
///
/// Writes cells.csv, one row a cell, and a heat map of every sweep in f64 and f32: the error in per
/// cent, blue up to 1 and yellow beyond.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study stability --quick
  drape study stability --quick --sweep compliance --sweep impact --out soft
  drape study stability --out study --json > study.json")]
pub struct Stability {
    /// Sample the sweeps coarsely: about 15 s on two cores instead of about a minute
    #[arg(long)]
    quick: bool,

    /// Compute this sweep only; can be given several times
    #[arg(long = "sweep", value_name = "NAME")]
    names: Vec<String>,
}

/// Every combination of solver and precision; each cell of a sweep is computed with all.
pub const VARIANTS: [(Solver, Precision); 4] = [
    (Solver::Yarn, Precision::F64),
    (Solver::GaussSeidel, Precision::F64),
    (Solver::Yarn, Precision::F32),
    (Solver::GaussSeidel, Precision::F32),
];

/// One simulation of a sweep and what came of it.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepCell {
    pub sweep: &'static str,
    /// Index of the tick along x and along y.
    pub at: [usize; 2],
    pub solver: Solver,
    pub precision: Precision,
    pub outcome: Outcome,
    /// At the end, over the size of the sheet [-].
    pub error: Option<f64>,
    /// Error message of a refusal or a panic; else empty.
    pub note: String,
    /// Wall time [s].
    pub seconds: f64,
}

/// Computes `sweeps`, cells in parallel: sweep by sweep, y by y, x running fastest within it, all
/// [`VARIANTS`] of a place together. Equal sweeps give equal figures, times apart, for any number
/// of threads.
pub fn compute(sweeps: &[Sweep], context: &Context) -> Vec<SweepCell> {
    let mut places = Vec::new();
    for sweep in sweeps {
        let [columns, rows] = [0, 1].map(|axis| sweep.axes[axis].ticks.len());
        for y in 0..rows {
            for x in 0..columns {
                places.extend(VARIANTS.map(|variant| (sweep, [x, y], variant)));
            }
        }
    }
    context.each(&places, |&(sweep, at, (solver, precision))| {
        cell(sweep, at, solver, precision)
    })
}

/// One cell. A panic costs this cell alone, so that the study can tell of it.
fn cell(sweep: &Sweep, at: [usize; 2], solver: Solver, precision: Precision) -> SweepCell {
    let start = Instant::now();
    let knobs = sweep.knobs(at, solver);
    let tried = || (sweep.trial)(&knobs).map(|trial| trial.run(&knobs, precision));
    let ((outcome, error), note) = match catch_unwind(AssertUnwindSafe(tried)) {
        Ok(Ok(found)) => (found, String::new()),
        Ok(Err(refusal)) => ((Outcome::Refused, None), refusal.to_string()),
        Err(cause) => {
            let text = cause.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| cause.downcast_ref::<&str>().copied());
            let note = text.unwrap_or("unknown panic").to_owned();
            ((Outcome::Panicked, None), note)
        }
    };
    SweepCell {
        sweep: sweep.name,
        at,
        solver,
        precision,
        outcome,
        error,
        note,
        seconds: start.elapsed().as_secs_f64(),
    }
}

impl Study for Stability {
    const NAME: &'static str = "stability";
    const TABLES: &'static [&'static str] = &["counts", "cells"];

    fn run(&self, context: &Context) -> Result<Report, StudyError> {
        let sweeps = only(sweeps(self.quick.into()), &self.names, |sweep| sweep.name)?;
        let cells = compute(&sweeps, context);

        let mut groups: Vec<_> = (sweeps.iter())
            .flat_map(|sweep| Solver::ALL.map(|solver| (sweep.name, solver.name())))
            .collect();
        groups.push(("all", "both"));
        let count = |group: &(&str, &str), counts: &dyn Fn(&SweepCell) -> bool| {
            let name = |cell: &SweepCell| (cell.sweep, cell.solver.name());
            let is_own = |cell: &&SweepCell| group.0 == "all" || name(cell) == *group;
            let own = cells.iter().filter(is_own);
            own.filter(|cell| counts(cell)).count()
        };
        let title = "Cells by their outcome, f64 and f32 together";
        let mut counts = Table::of("counts", title, &groups)
            .text("sweep", |group| group.0)
            .text("solver", |group| group.1)
            .text("cells", |group| count(group, &|_| true));
        for (outcome, name) in Outcome::ALL {
            counts = counts.text(name, |group| count(group, &|cell| cell.outcome == outcome));
        }
        let mut report = Report::new([counts.end(), cell_table(&sweeps, &cells)]);
        for sweep in &sweeps {
            for precision in [Precision::F64, Precision::F32] {
                let digits = precision.name();
                let maps = Solver::ALL.map(|solver| {
                    let title = format!("{}: {}, {digits}", sweep.name, solver.name());
                    let own = cells.iter().filter(|cell| {
                        (cell.sweep, cell.solver, cell.precision) == (sweep.name, solver, precision)
                    });
                    map(sweep, title, own).image()
                });
                let name = format!("{}-{digits}.png", sweep.name);
                report.image(name, Image::beside(&maps));
            }
        }
        Ok(report)
    }
}

fn cell_table(sweeps: &[Sweep], cells: &[SweepCell]) -> Table {
    let axis = |cell: &SweepCell, axis: usize| {
        let sweep = sweeps.iter().find(|sweep| sweep.name == cell.sweep);
        let axis_of = &sweep.expect("cells are of these sweeps").axes[axis];
        (axis_of.name, axis_of.ticks[cell.at[axis]].1.clone())
    };
    Table::of("cells", "", cells)
        .text("sweep", |cell| cell.sweep)
        .text("x", |cell| axis(cell, 0).0)
        .text("x value", |cell| axis(cell, 0).1)
        .text("y", |cell| axis(cell, 1).0)
        .text("y value", |cell| axis(cell, 1).1)
        .text("solver", |cell| cell.solver.name())
        .text("precision", |cell| cell.precision.name())
        .text("outcome", |cell| cell.outcome.name())
        .number("error", Hidden, |cell| cell.error)
        .number("time [s]", Hidden, |cell| cell.seconds)
        .text("note", |cell| cell.note.clone())
        .end()
}

fn map<'a>(sweep: &Sweep, title: String, cells: impl Iterator<Item = &'a SweepCell>) -> HeatMap {
    let [x, y] = &sweep.axes;
    let ticks = |axis: &Axis| axis.ticks.iter().map(|(_, label)| label.clone()).collect();
    HeatMap {
        title,
        x_label: x.name.into(),
        y_label: y.name.into(),
        x_ticks: ticks(x),
        y_ticks: ticks(y),
        tiles: cells.map(tile).collect(),
    }
}

/// Numbers that are none, and panics: in no other colour, so that they are noticed.
const FAULT: Color = [255, 0, 255];

/// Blue up to the threshold, yellow to orange beyond: by the logarithm of the error, 1e-6 to
/// the threshold and from there to 1.
fn ramp(error: f64) -> Color {
    let (from, to, low, high) = match error <= THRESHOLD {
        true => ([8, 81, 156], [189, 215, 231], 1e-6, THRESHOLD),
        false => ([252, 228, 110], [214, 84, 20], THRESHOLD, 1.0),
    };
    let t = ((error / low).log10() / f64::log10(high / low)).clamp(0.0, 1.0);
    let mix = |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * t).round() as u8;
    std::array::from_fn(|k| mix(from[k], to[k]))
}

fn tile(cell: &SweepCell) -> Tile {
    let error = cell.error.unwrap_or(f64::NAN);
    let (color, text) = match cell.outcome {
        Outcome::Converged | Outcome::Wrong => (ramp(error), percent(error)),
        Outcome::Diverged => ([110, 10, 20], "div".into()),
        Outcome::Refused => ([170, 170, 175], "refused".into()),
        Outcome::NonFinite => (FAULT, "NaN".into()),
        Outcome::Panicked => (FAULT, "panic".into()),
    };
    Tile { color, text }
}

/// An error in per cent with two digits, or its power of ten where it is small or large.
fn percent(error: f64) -> String {
    match 100.0 * error {
        p if p <= 0.0 => "0".into(),
        p if !(1e-2..1e4).contains(&p) => format!("{p:.0e}"),
        p if p < 1.0 => format!("{p:.2}"),
        p if p < 10.0 => format!("{p:.1}"),
        p => format!("{p:.0}"),
    }
}

#[cfg(test)]
mod tests;
