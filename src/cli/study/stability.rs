use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

use anyhow::anyhow;
use serde::Serialize;

use super::folder;
use crate::cli::Failure;
use crate::cli::output::{bar, print, print_json};
use drape_cloth::file::write_atomic;
use drape_cloth::sim::Solver;
use drape_report::{Color, HeatMap, Image, Tile};
use drape_study::stability::{
    Axis, Cell, Extent, Outcome, Precision, Sweep, Swept, THRESHOLD, Tally, csv, run as compute,
    sweeps,
};

/// Name of the table in the folder.
const TABLE: &str = "cells.csv";

/// Sweep the simulator's extremes: what converges, what is wrong, what diverges
///
/// Writes cells.csv, one row a cell, and a heat map of every sweep in f64 and f32. Files of an
/// earlier study in the folder are replaced.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study stability --quick
  drape study stability --quick --sweep compliance --sweep impact --out soft
  drape study stability --out study --json > study.json")]
pub struct Args {
    /// Sample the sweeps coarsely: about 15 s on two cores instead of some minutes
    #[arg(long)]
    quick: bool,

    /// Compute this sweep only; can be given several times
    #[arg(long = "sweep", value_name = "NAME")]
    names: Vec<String>,

    /// Folder for table and heat maps; runs/study-stability-DATE if not given
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,

    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    tally: Tally,
    quick: bool,
    /// Largest error that counts as converged, over the size of the sheet.
    threshold: f64,
    sweeps: Vec<SweepReport>,
    out: PathBuf,
    table: &'static str,
    /// Wall time [s].
    seconds: f64,
}

#[derive(Serialize)]
struct SweepReport {
    name: &'static str,
    answer: &'static str,
    axes: [Axis; 2],
    #[serde(flatten)]
    tally: Tally,
    /// The same of each solver, both precisions together.
    yarn: Tally,
    gauss_seidel: Tally,
    /// Heat maps in the folder.
    files: Vec<String>,
}

/// Runs `drape study stability`.
pub fn run(args: Args) -> Result<(), Failure> {
    let chosen = choose(&args)?;
    let out = folder(args.out.as_deref(), "study-stability-")?;

    let start = Instant::now();
    let total: usize = chosen.iter().map(Sweep::cell_count).sum();
    let template = "{bar:24} {pos}/{len} cells, {per_sec:.0}, {eta} left; {msg}";
    let bar = bar(total as u64, template, args.json);
    let heard = Mutex::new(Tally::default());
    let swept = compute(chosen, |outcome| {
        let mut tally = heard.lock().expect("counting does not panic");
        tally.add(outcome);
        bar.set_message(format!(
            "{} converged, {} wrong, {} diverged",
            tally.converged, tally.wrong, tally.diverged
        ));
        bar.inc(1);
    });
    bar.finish_and_clear();
    let seconds = start.elapsed().as_secs_f64();

    let text = csv(&swept);
    write_atomic(&out.path.join(TABLE), |file| {
        file.write_all(text.as_bytes())
    })?;
    let mut reports = Vec::new();
    for swept in &swept {
        reports.push(SweepReport {
            name: swept.sweep.name,
            answer: swept.sweep.answer,
            axes: swept.sweep.axes.clone(),
            tally: Tally::of(&swept.cells),
            yarn: of_solver(swept, Solver::Yarn),
            gauss_seidel: of_solver(swept, Solver::GaussSeidel),
            files: draw(swept, &out.path)?,
        });
    }
    let report = Report {
        tally: Tally::of(swept.iter().flat_map(|swept| &swept.cells)),
        quick: args.quick,
        threshold: THRESHOLD,
        sweeps: reports,
        out: out.path.clone(),
        table: TABLE,
        seconds,
    };
    if args.json {
        print_json(&report)
    } else {
        print(&table(&report))
    }
}

/// The sweeps that were asked for, in their own order.
fn choose(args: &Args) -> Result<Vec<Sweep>, Failure> {
    let all = sweeps(if args.quick {
        Extent::Quick
    } else {
        Extent::Full
    });
    let known: Vec<_> = all.iter().map(|sweep| sweep.name).collect();
    if let Some(name) = args.names.iter().find(|name| !known.contains(&&***name)) {
        return Err(Failure::invalid(anyhow!(
            "there is no sweep `{name}`, expected one of {}",
            known.join(", ")
        )));
    }
    let wanted =
        |sweep: &Sweep| args.names.is_empty() || args.names.iter().any(|name| name == sweep.name);
    Ok(all.into_iter().filter(wanted).collect())
}

fn of_solver(swept: &Swept, solver: Solver) -> Tally {
    Tally::of(swept.cells.iter().filter(|cell| cell.solver == solver))
}

/// Writes a heat map for each precision, the solvers beside each other, and gives their names.
fn draw(swept: &Swept, folder: &Path) -> Result<Vec<String>, Failure> {
    let mut files = Vec::new();
    for (precision, digits) in [(Precision::F64, "f64"), (Precision::F32, "f32")] {
        let solvers = [
            (Solver::Yarn, "yarn"),
            (Solver::GaussSeidel, "gauss_seidel"),
        ];
        let maps = solvers.map(|(solver, name)| {
            let title = format!("{}: {name}, {digits}", swept.sweep.name);
            map(swept, title, swept.variant(solver, precision)).image()
        });
        let file = format!("{}-{digits}.png", swept.sweep.name);
        Image::beside(&maps).save_png(&folder.join(&file))?;
        files.push(file);
    }
    Ok(files)
}

fn map<'a>(swept: &Swept, title: String, cells: impl Iterator<Item = &'a Cell>) -> HeatMap {
    let [x, y] = &swept.sweep.axes;
    let ticks = |axis: &Axis| axis.ticks.iter().map(|tick| tick.label.clone()).collect();
    HeatMap {
        title,
        x_label: x.name.into(),
        y_label: y.name.into(),
        x_ticks: ticks(x),
        y_ticks: ticks(y),
        tiles: cells.map(tile).collect(),
        legend: [
            ("converged, error in %: 1e-4", ramp(1e-6)),
            ("0.01", ramp(1e-4)),
            ("1", ramp(THRESHOLD)),
            ("wrong: 2", ramp(0.02)),
            ("100", ramp(1.0)),
            ("diverged", DIVERGED),
            ("refused", REFUSED),
            ("fault", FAULT),
        ]
        .map(|(text, color)| (text.into(), color))
        .into(),
    }
}

const DIVERGED: Color = [110, 10, 20];
const REFUSED: Color = [170, 170, 175];
/// Numbers that are none, and panics: in no other colour, so that they are noticed.
const FAULT: Color = [255, 0, 255];

/// Green up to the threshold, yellow to orange beyond: by the logarithm of the error, 1e-6 to
/// the threshold and from there to 1.
fn ramp(error: f64) -> Color {
    let share =
        |low: f64, high: f64| ((error / low).log10() / (high / low).log10()).clamp(0.0, 1.0);
    let (from, to, t) = if error <= THRESHOLD {
        ([0, 104, 80], [176, 222, 150], share(1e-6, THRESHOLD))
    } else {
        ([252, 228, 110], [214, 84, 20], share(THRESHOLD, 1.0))
    };
    let mix = |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * t).round() as u8;
    std::array::from_fn(|k| mix(from[k], to[k]))
}

fn tile(cell: &Cell) -> Tile {
    let (color, text) = match cell.outcome {
        Outcome::Converged | Outcome::Wrong => {
            (ramp(cell.figures.error), percent(cell.figures.error))
        }
        Outcome::Diverged => (DIVERGED, "div".into()),
        Outcome::Refused => (REFUSED, "refused".into()),
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

fn table(report: &Report) -> String {
    let mut lines = vec![format!(
        "{:16} {:>6} {:>10} {:>6} {:>9} {:>8}",
        "sweep", "cells", "converged", "wrong", "diverged", "refused"
    )];
    let mut row = |name: &str, tally: &Tally| {
        lines.push(format!(
            "{name:16} {:>6} {:>10} {:>6} {:>9} {:>8}",
            tally.cells, tally.converged, tally.wrong, tally.diverged, tally.refused
        ));
    };
    for sweep in &report.sweeps {
        row(sweep.name, &sweep.tally);
        row("  yarn", &sweep.yarn);
        row("  gauss_seidel", &sweep.gauss_seidel);
    }
    row("all", &report.tally);
    let Tally {
        non_finite,
        panicked,
        ..
    } = report.tally;
    lines.push(format!(
        "non-finite numbers in sound states {non_finite}, panics {panicked}; {:.0} s",
        report.seconds
    ));
    let out = report.out.display();
    lines.push(format!("{TABLE} and heat maps in {out}"));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_short() {
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
    }

    #[test]
    fn colours_change_at_the_threshold() {
        assert_eq!(ramp(THRESHOLD), [176, 222, 150]);
        assert_eq!(ramp(0.0), [0, 104, 80]);
        assert_eq!(ramp(1e9), [214, 84, 20]);
        assert!(ramp(1.01 * THRESHOLD)[0] > 250);
    }
}
