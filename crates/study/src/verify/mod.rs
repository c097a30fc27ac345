//! Closed forms: answers that nobody chose, and what each solver makes of them.
//!
//! A [`Subject`] is asked for every [`Trial`]; what it finds becomes rows of a table, expected
//! beside found, and curves. One file per physical group holds the cases, each a function of
//! whoever solves it, of the mesh and of what is varied, so that tests can ask the same with
//! their own substep and mesh. All of it is f64 and runs on one thread a trial: equal trials give
//! equal rows.
//!
//! | Group | Held against |
//! | --- | --- |
//! | bending | heavy elastica; stiffness of the bimodulus |
//! | length | tension curve; weight of a chain; catenary |
//! | shear | picture frame; bias extension by the kinematics of a trellis |
//! | drape | fishnet on a sphere |
//! | contact | angle of friction; capstan; lift-off from a cylinder |
//! | motion | momentum; damping of implicit Euler |

pub mod bending;
pub mod cloth;
pub mod contact;
pub mod dome;
pub mod length;
pub mod motion;
pub mod shear;
mod trials;
pub mod twin;

use cpu_time::ThreadTime;
use rayon::prelude::*;
use serde::Serialize;

use cloth::{Fast, Solve};
use drape_cloth::sim::{Accuracy, Solver};
use twin::Reference;

pub use trials::{GROUPS, trials};

/// Who is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// The fast solver.
    Fast {
        /// How it keeps lengths.
        solver: Solver,
        /// How finely it steps.
        preset: Accuracy,
    },
    /// The finite-element twin.
    Twin,
}

impl Subject {
    /// Every one, the fastest first.
    pub fn all() -> Vec<Self> {
        let solvers = [Solver::Yarn, Solver::GaussSeidel];
        let fast = solvers.into_iter().flat_map(|solver| {
            let presets = Accuracy::ALL.into_iter();
            presets.map(move |preset| Self::Fast { solver, preset })
        });
        fast.chain([Self::Twin]).collect()
    }

    /// As in tables.
    pub fn solver(&self) -> &'static str {
        match self {
            Self::Fast { solver, .. } => match solver {
                Solver::Yarn => "yarn",
                Solver::GaussSeidel => "gauss_seidel",
            },
            Self::Twin => "twin",
        }
    }

    /// As in tables.
    pub fn preset(&self) -> &'static str {
        match self {
            Self::Fast { preset, .. } => preset.name(),
            Self::Twin => "reference",
        }
    }

    /// The fast solver, where this is one.
    fn fast(&self) -> Option<Fast> {
        match *self {
            Self::Fast { solver, preset } => Some(Fast::at(solver, preset)),
            Self::Twin => None,
        }
    }

    /// Whoever brings cloth to rest.
    fn solve(&self) -> Box<dyn Solve> {
        match *self {
            Self::Fast { solver, preset } => Box::new(Fast::at(solver, preset)),
            Self::Twin => Box::new(Reference),
        }
    }
}

/// How fine the meshes are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Coarser ones of the costly cases, of which the twin is not asked.
    Quick,
    Full,
}

/// A number that is known, and what was found instead.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    pub case: String,
    /// Of both numbers; "-" for none.
    pub unit: &'static str,
    pub expected: f64,
    /// NaN where the simulation did not come to it.
    pub found: f64,
}

/// A line in one of the pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    pub picture: Picture,
    /// The closed form itself, not what was found.
    pub exact: bool,
    /// What is varied from curve to curve; empty if nothing is.
    pub label: String,
    pub points: Vec<[f64; 2]>,
}

/// What is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Picture {
    /// Drop over reach of cantilevers.
    Cantilever,
    /// Shear over polar angle on a hemisphere [degrees].
    Hemisphere,
    /// Force over extension of a bias specimen [N over mm].
    BiasExtension,
}

/// What a trial finds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    pub answers: Vec<Answer>,
    pub curves: Vec<Curve>,
}

/// What a subject finds; none where it cannot be asked.
type Ask = Box<dyn Fn(&Subject) -> Option<Findings> + Send + Sync>;

/// A question, one simulation or a few.
pub struct Trial {
    pub group: &'static str,
    /// Whether the twin is asked too.
    with_twin: bool,
    ask: Ask,
}

/// A row of the table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    pub case: String,
    pub solver: &'static str,
    pub preset: &'static str,
    pub expected: f64,
    pub found: f64,
    /// (found - expected) / |expected|.
    pub relative_error: f64,
    pub unit: &'static str,
    #[serde(skip)]
    pub group: &'static str,
    /// Processor time of the trial, on the first of its rows [s].
    #[serde(skip)]
    pub cpu_seconds: f64,
}

/// All that was found.
#[derive(Clone, Debug, Default)]
pub struct Verification {
    /// Trial by trial, case by case, subject by subject.
    pub rows: Vec<Row>,
    pub curves: Vec<(Subject, Curve)>,
    /// Processor time of all trials [s].
    pub cpu_seconds: f64,
}

/// Asks every subject every trial, in parallel; `watch` hears when one has answered.
pub fn run(trials: &[Trial], subjects: &[Subject], watch: impl Fn() + Sync) -> Verification {
    let pairs: Vec<(usize, Subject)> = (0..trials.len())
        .flat_map(|trial| subjects.iter().map(move |&subject| (trial, subject)))
        .collect();
    let found: Vec<(Findings, f64)> = pairs
        .par_iter()
        // They differ in cost a thousandfold: shared out one by one.
        .with_max_len(1)
        .map(|(trial, subject)| {
            let start = ThreadTime::now();
            let trial = &trials[*trial];
            let asked = trial.with_twin || *subject != Subject::Twin;
            let findings = asked.then(|| (trial.ask)(subject)).flatten();
            let findings = findings.unwrap_or_default();
            watch();
            (findings, start.elapsed().as_secs_f64())
        })
        .collect();

    let mut all = Verification::default();
    let asked = pairs.into_iter().zip(found);
    let asked: Vec<((usize, Subject), (Findings, f64))> = asked.collect();
    for of_trial in asked.chunk_by(|a, b| a.0.0 == b.0.0) {
        let longest = of_trial.iter().map(|(_, (f, _))| f.answers.len()).max();
        for index in 0..longest.unwrap_or(0) {
            for ((trial, subject), (findings, seconds)) in of_trial {
                let Some(answer) = findings.answers.get(index) else {
                    continue;
                };
                all.rows.push(Row {
                    case: answer.case.clone(),
                    solver: subject.solver(),
                    preset: subject.preset(),
                    expected: answer.expected,
                    found: answer.found,
                    relative_error: (answer.found - answer.expected) / answer.expected.abs(),
                    unit: answer.unit,
                    group: trials[*trial].group,
                    cpu_seconds: if index == 0 { *seconds } else { 0.0 },
                });
            }
        }
        for ((_, subject), (findings, seconds)) in of_trial {
            all.cpu_seconds += seconds;
            let curves = findings.curves.iter().cloned();
            all.curves.extend(curves.map(|curve| (*subject, curve)));
        }
    }
    all
}

#[cfg(test)]
mod tests;
