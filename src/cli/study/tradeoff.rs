use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;

use super::{folder, region, twin_failure};
use crate::cli::Failure;
use crate::cli::failure::{OrInvalid, scene_failure};
use crate::cli::output::{bar, print, print_json};
use drape_cloth::file::write_atomic;
use drape_cloth::scene::SceneConfig;
use drape_report::{Chart, Color, Level, SERIES, Scale, Series};
use drape_study::tradeoff::{
    Extent, Findings, Kind, Noise, Point, TradeoffError, Twinned, against_twin, csv,
    run as compute, settings,
};
use drape_study::twin::twin_config;
use drape_task::env::EnvConfig;

/// Name of the table in the folder.
const TABLE: &str = "points.csv";
/// Name of the report in the folder.
const REPORT: &str = "tradeoff.json";
/// Names of the picture in the folder.
const PICTURES: [&str; 2] = ["tradeoff.png", "tradeoff.svg"];
/// The focus region of the quickstart, and a smaller one in its corner [mm].
const REGIONS: [[f64; 4]; 2] = [
    [-186.0, -186.0, -60.0, -60.0],
    [-186.0, -186.0, -95.0, -95.0],
];

/// Measure what accuracy costs: CPU time of an environment step against error, over solver,
/// rates, precision, press, mesh, tool grid and physics
///
/// Writes points.csv, tradeoff.json and tradeoff.png and .svg, which shows cost against error with
/// the presets marked. Files of an earlier study in the folder are replaced.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study tradeoff --quick
  drape study tradeoff mine.toml --region=-50,-50,50,50 --json > tradeoff.json")]
pub struct Args {
    /// Scene file; the built-in rib with two wrinkles if not given
    config: Option<PathBuf>,

    /// Fewer points on a smaller region: some three minutes of CPU time
    #[arg(long)]
    quick: bool,

    /// Focus region on the flat blank [mm]: least x, least y, greatest x, greatest y; a corner of
    /// the built-in scene, the whole blank of another one if not given
    #[arg(long, value_name = "X,Y,X,Y", value_parser = region, allow_hyphen_values = true)]
    region: Option<[f64; 4]>,

    /// Also with --quick: hold falls against the finite-element twin on a mesh of twice the cell.
    /// Without it a scene that the twin has nothing for goes without
    #[arg(long)]
    twin: bool,

    /// Folder for table, report and picture; runs/study-tradeoff-DATE if not given
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
    findings: Findings,
    /// Falls against the finite-element twin, where it was asked.
    twin: Option<Twinned>,
    quick: bool,
    out: PathBuf,
    table: &'static str,
    pictures: [&'static str; 2],
    /// Wall time [s].
    seconds: f64,
}

/// Runs `drape study tradeoff`.
pub fn run(args: Args) -> Result<(), Failure> {
    let place = args.config.as_ref().map(|path| path.display().to_string());
    let place = place.unwrap_or("the built-in scene".into());
    let (scene, around) = match &args.config {
        Some(path) => (SceneConfig::read(path).or_invalid()?, None),
        None => (SceneConfig::rib(), Some(REGIONS[usize::from(args.quick)])),
    };
    let env = EnvConfig {
        region_mm: args.region.or(around),
        crop: true,
        ..EnvConfig::default()
    };
    let extent = if args.quick {
        Extent::Quick
    } else {
        Extent::Full
    };
    let settings = settings(&scene, &env, extent);
    scene.check().or_invalid_in(&place)?;
    // A scene that the twin has nothing for is refused before the work, or goes without.
    let has_twin = match twin_config(&scene) {
        Ok(_) => args.twin || !args.quick,
        Err(error) if args.twin => return Err(scene_failure(error, &place)),
        Err(_) => false,
    };
    let out = folder(args.out.as_deref(), "study-tradeoff-")?;

    let start = Instant::now();
    let template = "{bar:24} {pos}/{len} points, {eta} left; {msg}";
    let bar = bar(settings.len() as u64, template, args.json);
    let found = compute(&scene, &env, &settings, |setting| {
        bar.set_message(format!("{} {}", setting.axis, setting.value));
        bar.inc(1);
    });
    let findings = found.map_err(|error| {
        // A bar that stays on the screen would stand in the error's line.
        bar.finish_and_clear();
        failure(error, &place)
    })?;
    let twin = if has_twin {
        bar.set_message("finite-element twin");
        Some(against_twin(&scene))
    } else {
        None
    };
    bar.finish_and_clear();
    let twin = twin.transpose();
    let twin = twin.map_err(|error| twin_failure(error, &place))?;

    let report = Report {
        findings,
        twin,
        quick: args.quick,
        out: out.path.clone(),
        table: TABLE,
        pictures: PICTURES,
        seconds: start.elapsed().as_secs_f64(),
    };
    let text = csv(&report.findings.points);
    write_atomic(&report.out.join(TABLE), |file| {
        file.write_all(text.as_bytes())
    })?;
    let json = serde_json::to_string_pretty(&report)?;
    write_atomic(&report.out.join(REPORT), |file| writeln!(file, "{json}"))?;
    let chart = chart(&report.findings);
    for name in PICTURES {
        chart.save(&report.out.join(name))?;
    }
    if args.json {
        print_json(&report)
    } else {
        print(&table(&report))
    }
}

fn failure(error: TradeoffError, place: &str) -> Failure {
    match error {
        TradeoffError::Scene(error) => scene_failure(error, place),
        TradeoffError::Env(error) => Failure::invalid(error),
    }
}

/// Cost against error, both as logarithms. What has no error has no place on it.
fn chart(found: &Findings) -> Chart {
    let of = |axis: &str| {
        let points = found.points.iter();
        let at = points.filter(|p| p.axis == axis && p.kind == Kind::Method);
        at.map(place).collect::<Vec<_>>()
    };
    let axes = [
        ("yarn", "yarn, 60 to 6000/s"),
        ("gauss_seidel", "Gauss-Seidel, 60 to 6000/s"),
        ("contact_interval", "contact interval 1 to 20"),
        ("precision", "f32, f64"),
    ];
    let mut series = Vec::new();
    for ((axis, label), color) in axes.into_iter().zip(SERIES) {
        let points = of(axis);
        // A dot for every point, under one name.
        for &point in &points {
            series.push(dot("", point, color));
        }
        series.push(Series {
            label: label.into(),
            points,
            color,
        });
    }
    for (preset, color) in found.presets.iter().zip(PRESETS) {
        series.push(dot(
            &format!("preset {}", preset.value),
            place(preset),
            color,
        ));
    }
    let Noise { mean_mm, .. } = found.noise;
    Chart {
        title: "Cost and error of the pressing sequences".into(),
        x_label: "CPU time of an environment step [us]".into(),
        y_label: "mean error of place in the region [mm]".into(),
        series,
        levels: vec![Level {
            label: "noise: start pushed by 1 um".into(),
            value: logarithm(mean_mm),
            deviation: 0.0,
            color: [120, 120, 125],
        }],
        scale: Scale::Log10,
    }
}

const PRESETS: [Color; 3] = [[20, 20, 24], [200, 20, 60], [20, 110, 230]];

fn dot(label: &str, point: [f64; 2], color: Color) -> Series {
    Series {
        label: label.into(),
        points: vec![point],
        color,
    }
}

fn place(point: &Point) -> [f64; 2] {
    [point.microseconds, point.sequences_mean_mm].map(logarithm)
}

/// NaN where there is none: such points are not drawn.
fn logarithm(value: f64) -> f64 {
    if value > 0.0 { value.log10() } else { f64::NAN }
}

fn table(report: &Report) -> String {
    let found = &report.findings;
    let mut text = format!(
        "{} presses on {} vertices; errors [mm] of the fall, of the sweep's first row and end, of 8 sequences;\n\
         distance left [m], its mean and rms difference from the reference [m]\n\n\
         {:40} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}\n",
        found.presses,
        found.region_vertices,
        "",
        "us/step",
        "fall",
        "row",
        "sweep",
        "eight",
        "left",
        "bias",
        "rms"
    );
    for p in &found.points {
        let _ = writeln!(
            text,
            "{:40} {:>9.1} {:>8.3} {:>8.3} {:>8.3} {:>8.3} {:>8.4} {:>+8.4} {:>8.4}",
            format!("{}: {}", p.axis, p.value),
            p.microseconds,
            p.initial_mean_mm,
            p.early_mean_mm,
            p.region_mean_mm,
            p.sequences_mean_mm,
            p.sequences_distance_m,
            p.sequences_bias_m,
            p.sequences_rms_m,
        );
    }
    let _ = writeln!(
        text,
        "\nnoise, start pushed by 1 um: {:.3} mm, {:.4} m",
        found.noise.mean_mm, found.noise.distance_rms_m
    );
    if let Some(twin) = &report.twin {
        let _ = writeln!(
            text,
            "finite-element twin, {} vertices: {:.3} m left by the fall, {:.0} s of CPU time",
            twin.vertices, twin.distance_m, twin.seconds
        );
        for fall in &twin.falls {
            let _ = writeln!(
                text,
                "  {:?} {}/s: {:.3} mm from it on average, {:.2} mm at most, {:.3} m",
                fall.solver, fall.substep_rate, fall.mean_mm, fall.max_mm, fall.distance_m
            );
        }
    }
    let _ = write!(
        text,
        "recommended: {}\n{TABLE}, {REPORT} and {} in {}; {:.0} s",
        found.recommendation.text,
        PICTURES[0],
        report.out.display(),
        report.seconds
    );
    text
}
