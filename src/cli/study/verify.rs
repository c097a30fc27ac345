use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::anyhow;
use serde::Serialize;

use super::folder;
use crate::cli::Failure;
use crate::cli::output::{bar, print, print_json};
use drape_cloth::sim::{Accuracy, Solver};
use drape_report::{Chart, Color, SERIES, Series};
use drape_study::verify::{
    Curve, Extent, GROUPS, Picture, Row, Subject, Verification, run as compute, trials,
};

/// Hold every solver against closed forms: what is expected, what is found
///
/// Asks the fast solver at its presets, with the yarn solver and with Gauss-Seidel, and the
/// finite-element twin. Writes cases.json and pictures, each as PNG and SVG. Files of an earlier
/// study in the folder are replaced.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study verify --quick
  drape study verify --group bending --group contact
  drape study verify --out verification --json > cases.json")]
pub struct Args {
    /// Coarser meshes where cases are costly, and those without the twin: less than two minutes
    /// of processor time
    #[arg(long)]
    quick: bool,

    /// Compute this group only; can be given several times
    #[arg(long = "group", value_name = "NAME")]
    groups: Vec<String>,

    /// Folder for table and pictures; runs/study-verify-DATE if not given
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,

    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

/// Name of the table in the folder.
const TABLE: &str = "cases.json";

/// Share of the expected number up to which a row counts as met.
const TOLERANCE: f64 = 0.01;

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    cases: Vec<Row>,
    quick: bool,
    /// How many rows of each solver and preset there are, and lie within the tolerance.
    counts: Vec<Count>,
    tolerance: f64,
    out: PathBuf,
    /// Pictures in the folder.
    files: Vec<String>,
    /// Processor time of all simulations [s].
    cpu_seconds: f64,
    /// Wall time [s].
    seconds: f64,
}

#[derive(Serialize)]
struct Count {
    solver: &'static str,
    preset: &'static str,
    cases: usize,
    met: usize,
}

/// Runs `drape study verify`.
pub fn run(args: Args) -> Result<(), Failure> {
    if let Some(name) = args.groups.iter().find(|n| !GROUPS.contains(&&***n)) {
        return Err(Failure::invalid(anyhow!(
            "there is no group `{name}`, expected one of {}",
            GROUPS.join(", ")
        )));
    }
    let out = folder(args.out.as_deref(), "study-verify-")?;

    let start = Instant::now();
    let extent = if args.quick {
        Extent::Quick
    } else {
        Extent::Full
    };
    let mut chosen = trials(extent);
    chosen.retain(|t| args.groups.is_empty() || args.groups.iter().any(|g| g == t.group));
    let subjects = Subject::all();
    let template = "{bar:24} {pos}/{len} simulations, {eta} left";
    let bar = bar((chosen.len() * subjects.len()) as u64, template, args.json);
    let found = compute(&chosen, &subjects, || bar.inc(1));
    bar.finish_and_clear();

    let files = draw(&found, &out.path)?;
    let report = Report {
        counts: counts(&found.rows, &subjects),
        quick: args.quick,
        tolerance: TOLERANCE,
        out: out.path.clone(),
        files,
        cpu_seconds: found.cpu_seconds,
        seconds: start.elapsed().as_secs_f64(),
        cases: found.rows,
    };
    drape_cloth::file::write_atomic(&report.out.join(TABLE), |file| {
        Ok(serde_json::to_writer_pretty(file, &report)?)
    })?;
    if args.json {
        print_json(&report)
    } else {
        print(&table(&report))
    }
}

fn counts(rows: &[Row], subjects: &[Subject]) -> Vec<Count> {
    let of = |subject: &Subject| {
        let (solver, preset) = (subject.solver(), subject.preset());
        let own = rows
            .iter()
            .filter(|r| (r.solver, r.preset) == (solver, preset));
        Count {
            solver,
            preset,
            cases: own.clone().count(),
            met: own.filter(|r| r.relative_error.abs() <= TOLERANCE).count(),
        }
    };
    subjects.iter().map(of).collect()
}

fn table(report: &Report) -> String {
    let width = report.cases.iter().map(|row| row.case.len()).max();
    let width = width.unwrap_or(0).max(4);
    let mut lines = vec![format!(
        "{:width$}  {:12} {:9} {:>11} {:>11} {:4} {:>9} {:>7}",
        "case", "solver", "preset", "expected", "found", "unit", "error", "cpu"
    )];
    let mut last = ("", "");
    for row in &report.cases {
        if row.group != last.0 {
            lines.push(row.group.into());
        }
        // A case is named once, its solvers follow.
        let case = if row.case == last.1 { "" } else { &row.case };
        last = (row.group, &row.case);
        let cpu = if row.cpu_seconds > 0.0 {
            format!("{:.2} s", row.cpu_seconds)
        } else {
            String::new()
        };
        let line = format!(
            "{case:width$}  {:12} {:9} {:>11} {:>11} {:4} {:>9} {cpu:>7}",
            row.solver,
            row.preset,
            number(row.expected),
            number(row.found),
            row.unit,
            percent(row.relative_error),
        );
        lines.push(line.trim_end().into());
    }
    lines.push(format!("within {:.0} %", 100.0 * report.tolerance));
    for count in &report.counts {
        lines.push(format!(
            "  {:12} {:9} {} of {}",
            count.solver, count.preset, count.met, count.cases
        ));
    }
    lines.push("none: does not come to rest, or holds at no value that was tried".into());
    lines.push(format!(
        "{:.0} s of processor time, {:.0} s",
        report.cpu_seconds, report.seconds
    ));
    let out = report.out.display();
    lines.push(format!("{TABLE} and pictures in {out}"));
    lines.join("\n")
}

/// Five digits, without an exponent as long as it is short.
fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        a if !a.is_finite() => "none".into(),
        a if !(1e-3..1e6).contains(&a) => format!("{value:.4e}"),
        a => {
            let decimals = (4.0 - a.log10().floor()).max(0.0) as usize;
            format!("{value:.decimals$}")
        }
    }
}

/// With its sign, two decimals where it is small.
fn percent(error: f64) -> String {
    match 100.0 * error {
        p if !p.is_finite() => "none".into(),
        p if p.abs() < 100.0 => format!("{p:+.2} %"),
        p if p.abs() < 1e5 => format!("{p:+.0} %"),
        p => format!("{p:+.0e} %"),
    }
}

/// Draws every picture of which there are curves, and gives the names of the files.
fn draw(found: &Verification, folder: &Path) -> Result<Vec<String>, Failure> {
    let pictures = [
        (Picture::Cantilever, "cantilever"),
        (Picture::Hemisphere, "hemisphere"),
        (Picture::BiasExtension, "bias-extension"),
    ];
    let mut files = Vec::new();
    for (picture, name) in pictures {
        let series = series(picture, &found.curves);
        if series.is_empty() {
            continue;
        }
        let [title, x_label, y_label] = labels(picture);
        let chart = Chart {
            title: title.into(),
            x_label: x_label.into(),
            y_label: y_label.into(),
            series,
            ..Chart::default()
        };
        for extension in ["png", "svg"] {
            let file = format!("{name}.{extension}");
            chart.save(&folder.join(&file))?;
            files.push(file);
        }
    }
    Ok(files)
}

fn labels(picture: Picture) -> [&'static str; 3] {
    match picture {
        Picture::Cantilever => [
            "heavy elastica, w L^3 / D = 1, 5, 20, 100 (accurate)",
            "reach / L",
            "height / L",
        ],
        Picture::Hemisphere => [
            "shear on the bias line of a hemisphere",
            "polar angle [deg]",
            "shear [deg]",
        ],
        Picture::BiasExtension => [
            "bias extension of 170 x 50 mm (yarn solver, twin)",
            "extension [mm]",
            "force [N]",
        ],
    }
}

/// Ink of closed forms; those that were found are drawn beneath.
const EXACT: Color = [30, 30, 30];

/// What is shown: the accurate preset of cantilevers, and what fits on the scale of the closed
/// form: of Gauss-Seidel the accurate preset on a hemisphere, and no force.
fn series(picture: Picture, curves: &[(Subject, Curve)]) -> Vec<Series> {
    let (mut exact, mut found): (Vec<Series>, Vec<Series>) = Default::default();
    let mut colors: Vec<String> = Vec::new();
    for (subject, curve) in curves.iter().filter(|(_, c)| c.picture == picture) {
        if curve.exact {
            // Every subject brings the same; one is enough.
            if !exact.iter().any(|s| s.points == curve.points) {
                exact.push(Series {
                    label: if exact.is_empty() {
                        "closed form".into()
                    } else {
                        String::new()
                    },
                    points: curve.points.clone(),
                    color: EXACT,
                });
            }
            continue;
        }
        let shown = match (picture, subject) {
            (_, Subject::Twin) => true,
            (Picture::Cantilever, Subject::Fast { preset, .. }) => *preset == Accuracy::Accurate,
            (Picture::Hemisphere, Subject::Fast { solver, preset }) => {
                *solver == Solver::Yarn || *preset == Accuracy::Accurate
            }
            (Picture::BiasExtension, Subject::Fast { solver, .. }) => *solver == Solver::Yarn,
        };
        if !shown {
            continue;
        }
        let mut name = format!("{} {}", subject.solver(), subject.preset());
        if picture == Picture::BiasExtension {
            name = format!("{name}, {}", curve.label);
        }
        let known = colors.iter().position(|n| *n == name);
        let index = known.unwrap_or_else(|| {
            colors.push(name.clone());
            colors.len() - 1
        });
        found.push(Series {
            label: if known.is_none() { name } else { String::new() },
            points: curve.points.clone(),
            color: SERIES[index % SERIES.len()],
        });
    }
    found.extend(exact);
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.123_456_7, "0.12346"),
            (-0.3189, "-0.31890"),
            (1050.0, "1050.0"),
            (2.63e-5, "2.6300e-5"),
            (21_000.0, "21000"),
            (0.0, "0"),
            (f64::NAN, "none"),
        ] {
            assert_eq!(number(value), text);
        }
        for (error, text) in [
            (0.00123, "+0.12 %"),
            (-0.7, "-70.00 %"),
            (12.0, "+1200 %"),
            (1.6e4, "+2e6 %"),
            (f64::NAN, "none"),
        ] {
            assert_eq!(percent(error), text);
        }
    }
}
