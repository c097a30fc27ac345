//! Closed forms: answers that nobody chose, and what each solver makes of them.
//!
//! A [`Subject`] is asked for every [`Case`]; what it finds becomes rows of a table, expected
//! beside found, and curves. One file per physical group holds the simulations, each a function
//! of whoever solves it, of the mesh and of what is varied, so that tests can ask the same with
//! their own substep and mesh. All of it is f64 and runs on one thread a case: equal cases give
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
mod cases;
pub mod contact;
mod dome;
pub mod length;
mod motion;
mod shear;
pub mod solve;
mod subject;

use crate::study::{Context, Report, Study, StudyError, only};
use crate::table::Table;
use drape_cloth::sim::{Accuracy, Solver};
use drape_report::{Chart, SERIES, Series};

pub use cases::{Case, cases};
pub use subject::{Answer, Findings, Picture, ProfileCurve, Subject, solver_name};

/// Hold every solver against closed forms: what is expected, what is found
///
/// Asks the fast solver at its presets, with the yarn solver and with Gauss-Seidel, and the
/// finite-element twin. Writes pictures too, as PNG.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study verify --quick
  drape study verify --group bending --group contact
  drape study verify --out verification --json > cases.json")]
pub struct Verify {
    /// Coarser meshes where cases are costly, and those without the twin: less than two minutes
    /// of processor time
    #[arg(long)]
    quick: bool,

    /// Compute this group only; can be given several times
    #[arg(long = "group", value_name = "NAME")]
    groups: Vec<String>,
}

/// Share of the expected number up to which a row counts as met.
const TOLERANCE: f64 = 0.01;

/// A number that a subject has found.
#[derive(Clone, Debug, PartialEq)]
pub struct Verified {
    pub group: &'static str,
    pub subject: Subject,
    pub answer: Answer,
}

impl Verified {
    /// (found - expected) / |expected|.
    pub fn relative_error(&self) -> f64 {
        (self.answer.found - self.answer.expected) / self.answer.expected.abs()
    }
}

/// Asks every subject every case, in parallel. Rows come case by case and subject by subject.
pub fn ask(
    cases: &[Case],
    subjects: &[Subject],
    context: &Context,
) -> (Vec<Verified>, Vec<(Subject, ProfileCurve)>) {
    let pairs: Vec<(&Case, Subject)> = (cases.iter())
        .flat_map(|case| subjects.iter().map(move |&subject| (case, subject)))
        .collect();
    let found = context.each(&pairs, |(case, subject)| {
        let asked = case.with_twin || *subject != Subject::Twin;
        let found = asked.then(|| (case.ask)(subject)).flatten();
        found.unwrap_or_default()
    });
    let (mut rows, mut curves) = (Vec::new(), Vec::new());
    let of_cases = found.chunks(subjects.len()).zip(cases);
    for (findings, case) in of_cases {
        let longest = findings.iter().map(|f| f.answers.len()).max();
        for index in 0..longest.unwrap_or(0) {
            for (&subject, findings) in subjects.iter().zip(findings) {
                rows.extend(findings.answers.get(index).map(|answer| Verified {
                    group: case.group,
                    subject,
                    answer: answer.clone(),
                }));
            }
        }
        for (subject, findings) in subjects.iter().zip(findings) {
            curves.extend(findings.curves.iter().map(|c| (*subject, c.clone())));
        }
    }
    (rows, curves)
}

impl Study for Verify {
    const NAME: &'static str = "verify";

    fn run(&self, context: &Context) -> Result<Report, StudyError> {
        let chosen = only(cases(self.quick), &self.groups, |case| case.group)?;
        let subjects = Subject::all();
        let (rows, curves) = ask(&chosen, &subjects, context);

        let by_case: Vec<&[Verified]> = rows
            .chunk_by(|a, b| (a.group, &a.answer.case) == (b.group, &b.answer.case))
            .collect();
        let title =
            "Relative errors [%]; none where it does not come to rest, or holds at no value";
        let mut errors = Table::of("errors", title, &by_case)
            .text("group", |of| of[0].group)
            .text("case", |of| of[0].answer.case.clone())
            .text("unit", |of| of[0].answer.unit)
            // Of one pass over the chain it depends on the substep: that of the finest is shown.
            .digits("expected", "", 5, |of| of[of.len() - 1].answer.expected);
        for subject in &subjects {
            let name = format!("{} {}", subject.solver(), subject.preset());
            errors = errors.number(name, "", 2, |of| {
                let own = of.iter().find(|row| row.subject == *subject);
                own.map(|row| 1e2 * row.relative_error())
            });
        }
        let of = |subject: &Subject| {
            let subject = *subject;
            rows.iter().filter(move |row| row.subject == subject)
        };
        let title = format!("Within {:.0} %", 1e2 * TOLERANCE);
        let counts = Table::of("counts", title, &subjects)
            .text("solver", |subject| subject.solver())
            .text("preset", |subject| subject.preset())
            .text("cases", |subject| of(subject).count())
            .text("met", |subject| {
                let met = |row: &&Verified| row.relative_error().abs() <= TOLERANCE;
                of(subject).filter(met).count()
            })
            .end();
        let all = Table::of("cases", "", &rows)
            .text("group", |row| row.group)
            .text("case", |row| row.answer.case.clone())
            .text("solver", |row| row.subject.solver())
            .text("preset", |row| row.subject.preset())
            .text("unit", |row| row.answer.unit)
            .hidden("expected", "", |row| row.answer.expected)
            .hidden("found", "", |row| row.answer.found)
            .hidden("relative error", "", Verified::relative_error)
            .end_hidden();
        let mut report = Report::new([errors.end(), counts, all]);
        for (picture, name, [title, x_label, y_label]) in PICTURES {
            let series = series(picture, &curves);
            if !series.is_empty() {
                let chart = Chart {
                    title: title.into(),
                    x_label: x_label.into(),
                    y_label: y_label.into(),
                    series,
                    ..Chart::default()
                };
                report.chart(name, chart);
            }
        }
        Ok(report)
    }
}

/// The pictures, the names of their files, and what stands on them.
const PICTURES: [(Picture, &str, [&str; 3]); 3] = [
    (
        Picture::Cantilever,
        "cantilever",
        [
            "heavy elastica, w L^3 / D = 1, 5, 20, 100 (accurate)",
            "reach / L",
            "height / L",
        ],
    ),
    (
        Picture::Hemisphere,
        "hemisphere",
        [
            "shear on the bias line of a hemisphere",
            "polar angle [deg]",
            "shear [deg]",
        ],
    ),
    (
        Picture::BiasExtension,
        "bias-extension",
        [
            "bias extension of 170 x 50 mm (yarn solver, twin)",
            "extension [mm]",
            "force [N]",
        ],
    ),
];

/// What is shown: the accurate preset of cantilevers, and what fits on the scale of the closed
/// form: of Gauss-Seidel the accurate preset on a hemisphere, and no force.
fn is_shown(picture: Picture, subject: &Subject) -> bool {
    let Subject::Fast { solver, preset } = subject else {
        return true;
    };
    let (is_yarn, is_accurate) = (*solver == Solver::Yarn, *preset == Accuracy::Accurate);
    match picture {
        Picture::Cantilever => is_accurate,
        Picture::Hemisphere => is_yarn || is_accurate,
        Picture::BiasExtension => is_yarn,
    }
}

/// Closed forms above what was found. A name is in the legend once.
fn series(picture: Picture, curves: &[(Subject, ProfileCurve)]) -> Vec<Series> {
    let (mut exact, mut found): (Vec<Series>, Vec<Series>) = Default::default();
    let mut names: Vec<String> = Vec::new();
    for (subject, curve) in curves.iter().filter(|(_, c)| c.picture == picture) {
        let points = curve.points.clone();
        let Some(label) = &curve.label else {
            // Every subject brings the same; one is enough.
            if !exact.iter().any(|s| s.points == points) {
                let label = if exact.is_empty() { "closed form" } else { "" };
                exact.push(Series {
                    label: label.into(),
                    points,
                    color: [30, 30, 30],
                });
            }
            continue;
        };
        if !is_shown(picture, subject) {
            continue;
        }
        let name = format!("{} {}{label}", subject.solver(), subject.preset());
        let known = names.iter().position(|known| *known == name);
        found.push(Series {
            label: known.map_or(name.clone(), |_| String::new()),
            points,
            color: SERIES[known.unwrap_or(names.len()) % SERIES.len()],
        });
        if known.is_none() {
            names.push(name);
        }
    }
    found.extend(exact);
    found
}

#[cfg(test)]
mod tests;
