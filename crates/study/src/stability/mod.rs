//! Where the simulator converges, where it is stable but wrong, and where it diverges.
//!
//! A [`Sweep`] varies two quantities to their extremes and simulates one small piece of cloth
//! for every pair of values, with both solvers and in both precisions. Each cell is judged
//! against an answer that is known: a closed form, or a state that must not change. Nothing is
//! compared with stored numbers.
//!
//! Outcomes, in the order in which they are decided:
//!
//! | Outcome | Means |
//! | --- | --- |
//! | panicked | the simulator panicked: a bug |
//! | refused | a check of the configuration refused the cell with an error |
//! | diverged | [`Batch::sound`](drape_cloth::sim::Batch::sound) said no after a frame |
//! | non-finite | it said yes, but a position or velocity is no number: a bug |
//! | converged | the error at the end is at most [`THRESHOLD`] |
//! | wrong | it is larger |
//!
//! The error is a mean over vertices divided by the size of the sheet, so without unit; each
//! sweep names its norm. Work is bounded: a cell has a fixed number of frames and substeps.

mod cloth;
mod free;
mod hanging;
mod lying;
mod sweeps;
mod table;
mod trial;
pub(crate) mod truth;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

use drape_cloth::sim::Solver;
use trial::{Setting, Trial};

pub use sweeps::{Extent, sweeps};
pub use table::csv;

/// Largest error that counts as converged: one per cent of the sheet's size.
pub const THRESHOLD: f64 = 0.01;

/// Numbers that a cell is computed in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// As scenes are set up.
    F64,
    /// As episodes are played.
    F32,
}

/// Every combination of solver and precision; each cell of a sweep is computed with all.
pub const VARIANTS: [(Solver, Precision); 4] = [
    (Solver::Yarn, Precision::F64),
    (Solver::GaussSeidel, Precision::F64),
    (Solver::Yarn, Precision::F32),
    (Solver::GaussSeidel, Precision::F32),
];

/// A value on an axis and how it is written.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tick {
    pub value: f64,
    pub label: String,
}

/// What is varied along one side of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Axis {
    /// With its unit.
    pub name: &'static str,
    pub ticks: Vec<Tick>,
}

/// Two quantities that are varied together.
#[derive(Clone, Debug, Serialize)]
pub struct Sweep {
    pub name: &'static str,
    /// What is simulated, and what it is held against.
    pub answer: &'static str,
    /// x, then y.
    pub axes: [Axis; 2],
    #[serde(skip)]
    trial: fn(&Setting) -> Result<Trial, trial::Refusal>,
}

/// How a cell ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    Converged,
    Wrong,
    Diverged,
    Refused,
    NonFinite,
    Panicked,
}

impl Outcome {
    /// As in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Wrong => "wrong",
            Self::Diverged => "diverged",
            Self::Refused => "refused",
            Self::NonFinite => "non_finite",
            Self::Panicked => "panicked",
        }
    }
}

/// One simulation of a sweep and what came of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Index of the tick along x and along y.
    pub at: [usize; 2],
    pub solver: Solver,
    pub precision: Precision,
    pub outcome: Outcome,
    pub figures: Figures,
    /// Error message of a refusal or a panic; else empty.
    pub note: String,
    /// Wall time [s].
    pub seconds: f64,
}

/// What is measured on a cell; NaN where it did not come to that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Error at the end over the size of the sheet [-].
    pub error: f64,
    /// 95th percentile and maximum of the absolute yarn strain at the end [-].
    pub strain_p95: f64,
    pub strain_max: f64,
    /// Largest speed of a vertex at the end of any frame [m/s].
    pub speed_max: f64,
    /// Largest speed of a vertex at the end [m/s].
    pub speed_end: f64,
    /// Deepest vertex inside the tool at the end [mm].
    pub penetration_mm: f64,
    /// Simulated time [s] and substeps taken.
    pub simulated_s: f64,
    pub substeps: usize,
}

impl Figures {
    const NONE: Self = Self {
        error: f64::NAN,
        strain_p95: f64::NAN,
        strain_max: f64::NAN,
        speed_max: f64::NAN,
        speed_end: f64::NAN,
        penetration_mm: f64::NAN,
        simulated_s: 0.0,
        substeps: 0,
    };
}

/// How many cells ended in each way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Tally {
    pub cells: usize,
    pub converged: usize,
    pub wrong: usize,
    pub diverged: usize,
    pub refused: usize,
    /// Must be 0: numbers that got out although the simulator called them sound.
    pub non_finite: usize,
    /// Must be 0.
    pub panicked: usize,
}

impl Tally {
    /// Counts one more cell.
    pub fn add(&mut self, outcome: Outcome) {
        self.cells += 1;
        *match outcome {
            Outcome::Converged => &mut self.converged,
            Outcome::Wrong => &mut self.wrong,
            Outcome::Diverged => &mut self.diverged,
            Outcome::Refused => &mut self.refused,
            Outcome::NonFinite => &mut self.non_finite,
            Outcome::Panicked => &mut self.panicked,
        } += 1;
    }

    /// Counts all of `cells`.
    pub fn of<'a>(cells: impl IntoIterator<Item = &'a Cell>) -> Self {
        let mut tally = Self::default();
        cells.into_iter().for_each(|cell| tally.add(cell.outcome));
        tally
    }
}

/// A sweep that has been computed.
#[derive(Clone, Debug)]
pub struct Swept {
    pub sweep: Sweep,
    /// y by y, x running fastest within it, all [`VARIANTS`] of a place together.
    pub cells: Vec<Cell>,
}

impl Swept {
    /// The cells of one variant, y by y.
    pub fn variant(&self, solver: Solver, precision: Precision) -> impl Iterator<Item = &Cell> {
        let cells = self.cells.iter();
        cells.filter(move |cell| (cell.solver, cell.precision) == (solver, precision))
    }
}

impl Sweep {
    /// Number of cells, all variants counted.
    pub fn cell_count(&self) -> usize {
        self.axes[0].ticks.len() * self.axes[1].ticks.len() * VARIANTS.len()
    }
}

/// Computes `sweeps`, cells in parallel. `watch` hears of every cell as it ends, from any
/// thread. Equal sweeps give equal figures, times apart, for any number of threads.
pub fn run(sweeps: Vec<Sweep>, watch: impl Fn(Outcome) + Sync) -> Vec<Swept> {
    let places = sweeps.iter().enumerate().flat_map(|(index, sweep)| {
        let [columns, rows] = [0, 1].map(|axis| sweep.axes[axis].ticks.len());
        (0..rows).flat_map(move |y| {
            (0..columns).flat_map(move |x| VARIANTS.map(|variant| (index, [x, y], variant)))
        })
    });
    let places: Vec<_> = places.collect();
    let cells: Vec<Cell> = places
        .par_iter()
        // Cells differ in cost a thousandfold: shared out one by one.
        .with_max_len(1)
        .map(|&(index, at, (solver, precision))| {
            let cell = compute(&sweeps[index], at, solver, precision);
            watch(cell.outcome);
            cell
        })
        .collect();
    let mut cells = cells.into_iter();
    let swept = sweeps.into_iter().map(|sweep| Swept {
        cells: cells.by_ref().take(sweep.cell_count()).collect(),
        sweep,
    });
    swept.collect()
}

/// One cell. A panic costs this cell alone, so that the study can tell of it.
fn compute(sweep: &Sweep, at: [usize; 2], solver: Solver, precision: Precision) -> Cell {
    let start = Instant::now();
    let [x, y] = [0, 1].map(|axis| sweep.axes[axis].ticks[at[axis]].value);
    let setting = Setting { x, y, solver };
    let ended = catch_unwind(AssertUnwindSafe(|| match (sweep.trial)(&setting) {
        Ok(trial) => {
            let (outcome, figures) = trial.run(precision);
            (outcome, figures, String::new())
        }
        Err(refusal) => (Outcome::Refused, Figures::NONE, refusal.to_string()),
    }));
    let (outcome, figures, note) = ended.unwrap_or_else(|cause| {
        let text = cause.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| cause.downcast_ref::<&str>().copied());
        let note = text.unwrap_or("unknown panic").to_owned();
        (Outcome::Panicked, Figures::NONE, note)
    });
    Cell {
        at,
        solver,
        precision,
        outcome,
        figures,
        note,
        seconds: start.elapsed().as_secs_f64(),
    }
}

#[cfg(test)]
mod tests;
