use std::fmt::Write as _;
use std::time::Instant;

use anyhow::Context;
use serde::Serialize;

use super::Failure;
use super::output::{Progress, print, print_json};
use drape_cloth::sim::Solver;
use drape_study::bench::{ENVIRONMENTS, Effort, Findings, Row, run as measure};

/// Measure the speed of the simulation on this machine
///
/// The standard sheet on the built-in rib: time of a substep for every solver, instruction set
/// and feature, its share of what the machine could do, and environment steps a second. Leave
/// the machine alone meanwhile.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape bench --quick
  drape bench --json > bench.json")]
pub struct Args {
    /// Few repeats: some ten seconds instead of about a minute
    #[arg(long)]
    quick: bool,

    /// Turns of every variant; fewer than the usual say nothing about speed
    #[arg(long, hide = true, value_parser = clap::value_parser!(u16).range(1..))]
    repeats: Option<u16>,

    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    findings: Findings,
    quick: bool,
    /// Wall time of the command [s].
    seconds: f64,
}

/// Runs `drape bench`.
pub fn run(args: Args) -> Result<(), Failure> {
    let mut effort = if args.quick {
        Effort::QUICK
    } else {
        Effort::FULL
    };
    if let Some(repeats) = args.repeats {
        effort.repeats = repeats.into();
    }
    let start = Instant::now();
    let progress = Progress::new("measuring", args.json);
    let findings = measure(&effort, |share| progress.set(share)).context("cannot start threads")?;
    drop(progress);
    let report = Report {
        findings,
        quick: args.quick,
        seconds: start.elapsed().as_secs_f64(),
    };
    if args.json {
        print_json(&report)
    } else {
        print(&text(&report))
    }
}

fn text(report: &Report) -> String {
    let found = &report.findings;
    let sheet = &found.sheet;
    let mut text = format!(
        "standard sheet: {} vertices, {} distance and {} bending constraints\n\
         CPU time for an environment and substep [us]; shares of the machine's limits\n\n\
         {:12} {:9} {:4} {:>5} {:>8} {:>8} {:>11} {:>10}\n",
        sheet.vertices,
        sheet.yarn_edges + sheet.diagonals,
        sheet.triples,
        "core",
        "isa",
        "type",
        "lanes",
        "median",
        "least",
        "arithmetic",
        "bandwidth",
    );
    for row in &found.core {
        text += &core_line(row);
    }
    let _ = write!(
        text,
        "\n{ENVIRONMENTS} environments, random presses\n{}{:18} {:>8.2}\n",
        found.core.iter().map(throughput_line).collect::<String>(),
        "ratio",
        found.thread_ratio,
    );
    let _ = writeln!(
        text,
        "\n{:32} {:>8} {:>8} {:>10}",
        "features", "median", "least", "difference"
    );
    for feature in &found.features {
        let _ = writeln!(
            text,
            "{:32} {:8.2} {:8.2} {:+10.2}",
            feature.physics, feature.microseconds, feature.microseconds_min, feature.difference
        );
    }
    let unlisted = &found.unlisted;
    let _ = write!(
        text,
        "shear and bending not listed {:.2}, nothing there for them {:.2}: difference {:+.3}\n\n\
         measured in {:.0} s",
        unlisted.unlisted, unlisted.absent, unlisted.difference, report.seconds
    );
    text
}

/// A row that has a time; else nothing.
fn core_line(row: &Row) -> String {
    let (Some(median), Some(least)) = (row.microseconds, row.microseconds_min) else {
        return String::new();
    };
    let percent = |share: Option<f64>| share.map_or(f64::NAN, |share| 1e2 * share);
    format!(
        "{:12} {:9} {:4} {:5} {median:8.2} {least:8.2} {:9.0} % {:8.0} %\n",
        name(row.solver),
        row.isa,
        row.precision,
        row.lanes,
        percent(row.arithmetic_share),
        percent(row.bandwidth_share),
    )
}

/// A row that has a throughput; else nothing.
fn throughput_line(row: &Row) -> String {
    let (Some(threads), Some(rate)) = (row.threads, row.env_steps_per_second) else {
        return String::new();
    };
    let noun = if threads == 1 { "thread" } else { "threads" };
    format!("{threads} {noun:16} {rate:8.0} steps/s\n")
}

fn name(solver: Solver) -> &'static str {
    match solver {
        Solver::Yarn => "yarn",
        Solver::GaussSeidel => "gauss_seidel",
    }
}
