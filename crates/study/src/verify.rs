//! Closed forms: answers that nobody chose, and what each solver makes of them.
//!
//! One file per physical group holds the simulations, each a function of whoever solves it, of the
//! mesh and of what is varied, so that tests can ask the same with their own substep and mesh. All
//! of it is f64 and runs on one thread a case: equal cases give equal rows.
//!
//! | Group | Held against |
//! | --- | --- |
//! | bending | heavy elastica; stiffness of the bimodulus |
//! | length | tension curve; weight of a chain and of soft sheets; catenary |
//! | shear | picture frame; weight of a cell by a curve; bias extension by the kinematics of a trellis |
//! | drape | fishnet on a sphere |
//! | contact | angle of friction; capstan; lift-off from a cylinder |
//! | motion | momentum; damping of implicit Euler |

pub mod bending;
pub mod contact;
mod dome;
pub mod length;
mod motion;
mod shear;
pub mod solve;

use crate::study::{Context, Effort, Report, Study, StudyError, only};
use drape_report::Format::{Digits, Hidden};
use drape_report::Table;

use solve::{Answer, Ask};

pub use solve::Subject;

/// Hold every solver against closed forms: what is expected, what is found
///
/// Asks the fast solver at its presets, with the yarn solver and with Gauss-Seidel, and the
/// finite-element twin.
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

/// A question of a group.
pub struct ClosedForm {
    pub group: &'static str,
    ask: Ask,
}

/// Every case, group by group. Where it has to be quick the costly ones have coarser meshes, or
/// are without the twin, which would take minutes.
pub fn cases(effort: Effort) -> Vec<ClosedForm> {
    let groups = [
        ("bending", bending::asks()),
        ("length", length::asks()),
        ("shear", shear::asks(effort)),
        ("drape", dome::asks(effort)),
        ("contact", contact::asks(effort)),
        ("motion", motion::asks()),
    ];
    let of_group = |(group, asks): (_, Vec<Ask>)| {
        let asks = asks.into_iter();
        asks.map(move |ask| ClosedForm { group, ask })
    };
    groups.into_iter().flat_map(of_group).collect()
}

/// Asks every subject every case, in parallel. Rows come case by case and subject by subject.
pub fn ask(cases: &[ClosedForm], subjects: &[Subject], context: &Context) -> Vec<Verified> {
    let pairs: Vec<(usize, Subject)> = (0..cases.len())
        .flat_map(|case| subjects.iter().map(move |&subject| (case, subject)))
        .collect();
    let found = context.each(&pairs, |&(case, subject)| {
        let ClosedForm { group, ask } = &cases[case];
        let row = |answer| Verified {
            group,
            subject,
            answer,
        };
        let rows = ask(&*subject.solver()).into_iter().map(row);
        let numbered = rows.enumerate().map(|(k, row)| ((case, k), row));
        numbered.collect::<Vec<_>>()
    });
    let mut rows: Vec<_> = found.into_iter().flatten().collect();
    rows.sort_by_key(|(place, _)| *place);
    rows.into_iter().map(|(_, row)| row).collect()
}

impl Study for Verify {
    const NAME: &'static str = "verify";
    const TABLES: &'static [&'static str] = &["errors", "counts", "cases"];

    fn run(&self, context: &Context) -> Result<Report, StudyError> {
        let chosen = only(cases(self.quick.into()), &self.groups, |case| case.group)?;
        let subjects = Subject::all();
        let rows = ask(&chosen, &subjects, context);

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
            .number("expected", Digits(5), |of| of[of.len() - 1].answer.expected);
        for subject in &subjects {
            let name = subject.names().join(" ");
            errors = errors.number(name, 2, |of| {
                let own = of.iter().find(|row| row.subject == *subject);
                own.map(|row| 1e2 * row.relative_error())
            });
        }
        let count = |subject: &Subject, counts: fn(&Verified) -> bool| {
            let own = rows.iter().filter(|row| row.subject == *subject);
            own.filter(|row| counts(row)).count()
        };
        let is_met = |row: &Verified| row.relative_error().abs() <= TOLERANCE;
        let title = format!("Within {:.0} %", 1e2 * TOLERANCE);
        let counts = Table::of("counts", title, &subjects)
            .text("solver", |subject| subject.names()[0])
            .text("preset", |subject| subject.names()[1])
            .text("cases", |subject| count(subject, |_| true))
            .text("met", |subject| count(subject, is_met));
        let all = Table::of("cases", "", &rows)
            .text("group", |row| row.group)
            .text("case", |row| row.answer.case.clone())
            .text("solver", |row| row.subject.names()[0])
            .text("preset", |row| row.subject.names()[1])
            .text("unit", |row| row.answer.unit)
            .number("expected", Hidden, |row| row.answer.expected)
            .number("found", Hidden, |row| row.answer.found)
            .number("relative error", Hidden, Verified::relative_error);
        Ok(Report::new([errors.end(), counts.end(), all.end()]))
    }
}

#[cfg(test)]
mod tests;
