//! Who is asked, and what is found.

use super::solve::{Fast, Reference, Solve};
use drape_cloth::sim::{Accuracy, Solver};

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

/// As in configurations and tables.
pub fn solver_name(solver: Solver) -> &'static str {
    match solver {
        Solver::Yarn => "yarn",
        Solver::GaussSeidel => "gauss_seidel",
    }
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
            Self::Fast { solver, .. } => solver_name(*solver),
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
    pub fn fast(&self) -> Option<Fast> {
        match *self {
            Self::Fast { solver, preset } => Some(Fast::at(solver, preset)),
            Self::Twin => None,
        }
    }

    /// Whoever brings cloth to rest.
    pub fn solve(&self) -> Box<dyn Solve> {
        match self.fast() {
            Some(fast) => Box::new(fast),
            None => Box::new(Reference),
        }
    }
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
pub struct ProfileCurve {
    pub picture: Picture,
    /// Behind the name of the subject; none for a closed form.
    pub label: Option<String>,
    pub points: Vec<[f64; 2]>,
}

impl ProfileCurve {
    /// The closed form, and what was found.
    pub fn pair(
        picture: Picture,
        label: &str,
        exact: Vec<[f64; 2]>,
        found: Vec<[f64; 2]>,
    ) -> Vec<Self> {
        let curve = |label, points| Self {
            picture,
            label,
            points,
        };
        vec![curve(None, exact), curve(Some(label.into()), found)]
    }
}

/// What is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Picture {
    /// Height over reach of cantilevers.
    Cantilever,
    /// Shear over polar angle on a hemisphere [degrees].
    Hemisphere,
    /// Force over extension of a bias specimen [N over mm].
    BiasExtension,
}

/// What a case finds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    pub answers: Vec<Answer>,
    pub curves: Vec<ProfileCurve>,
}

impl Findings {
    /// A single answer.
    pub fn one(case: impl Into<String>, unit: &'static str, expected: f64, found: f64) -> Self {
        let mut findings = Self::default();
        findings.add(case, unit, expected, found);
        findings
    }

    /// Adds an answer.
    pub fn add(&mut self, case: impl Into<String>, unit: &'static str, expected: f64, found: f64) {
        self.answers.push(Answer {
            case: case.into(),
            unit,
            expected,
            found,
        });
    }
}
