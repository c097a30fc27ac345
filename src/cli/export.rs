use std::path::PathBuf;

use clap::ValueEnum;
use serde::Serialize;

use super::Failure;
use super::eval::{Loaded, Source};
use super::result::path;
use crate::path::{write_csv, write_json};

/// Write the ordered draping points for the robot
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Run folder
    run: PathBuf,

    /// JSON in metres, or CSV in millimetres
    #[arg(long, value_enum, default_value_t = Format::Json)]
    format: Format,

    /// File to write; trajectory.json or trajectory.csv in the run folder if not given
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Export the greedy policy of a checkpoint (best, last, or a file) instead of the best
    /// sequence of the run
    #[arg(long, value_name = "best|last|FILE")]
    checkpoint: Option<String>,

    /// Print one JSON object about the export instead of text
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    Json,
    Csv,
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    file: PathBuf,
    points: usize,
    strokes: usize,
    score: f64,
}

/// Runs `drape export`.
pub fn run(args: Args) -> Result<(), Failure> {
    let loaded = Loaded::open(&args.run, args.json)?;
    let source = match &args.checkpoint {
        Some(name) => Source::Checkpoint(name),
        None => Source::Sequence,
    };
    let (played, ..) = loaded.play(source)?;
    let points = path(&played, &loaded.config.env)?;
    let file = args.out.unwrap_or_else(|| {
        let json = loaded.folder.trajectory();
        match args.format {
            Format::Json => json,
            Format::Csv => json.with_extension("csv"),
        }
    });
    match args.format {
        Format::Json => write_json(&file, &points)?,
        Format::Csv => write_csv(&file, &points)?,
    }
    let report = Report {
        points: points.len(),
        strokes: points.iter().filter(|point| point.starts_stroke).count(),
        score: played.summary.score,
        file,
    };
    if args.json {
        return super::output::print_json(&report);
    }
    super::output::print(&format!(
        "{}: {} points in {} strokes and presses, {:.2} % of the distance removed",
        report.file.display(),
        report.points,
        report.strokes,
        100.0 * report.score
    ))
}
