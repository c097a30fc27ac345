use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::anyhow;
use serde::Serialize;

use super::{REGION, folder, region, scene_config, set_mesh, twin_failure};
use crate::cli::Failure;
use crate::cli::failure::{OrInvalid, scene_failure};
use crate::cli::output::{Progress, print, print_json};
use drape_cloth::file::write_atomic;
use drape_report::{Chart, Image, SERIES, Series};
use drape_study::episodes::Order;
use drape_study::transfer::{Agreement, BALANCED, Row, TWIN, Transfer, generate, transfer};
use drape_study::twin::{set_up, stencil_mm};
use drape_task::env::EnvConfig;

/// Play the same presses under several settings and in the finite-element twin: do they agree
/// which path is the better one?
///
/// Paths are found under the preset `balanced`, which trains. The settings are the presets,
/// `accurate` in f64, the rates 1200 and 2400, and Gauss-Seidel at the rate of `balanced`.
/// Writes transfer.json and scatter.png, the distance that each path leaves in the fast solver
/// against that in the twin.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study transfer
  drape study transfer --count 12 --mesh 25 --out transfer
  drape study transfer mine.toml --region=-60,-60,60,60 --json > transfer.json")]
pub struct Args {
    /// Scene file; the built-in rib with two wrinkles if not given
    config: Option<PathBuf>,

    /// Paths, a third in each of the orders: masked random, sweeps, outwards
    #[arg(long, default_value_t = 32, value_name = "N", value_parser = clap::value_parser!(u16).range(2..=4096))]
    count: u16,

    /// Vertices along the blank's longer side; 33 if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(3..=257))]
    mesh: Option<u16>,

    /// Focus region on the flat blank [mm]: least x, least y, greatest x, greatest y; that of
    /// the quickstart if not given
    #[arg(long, value_name = "X,Y,X,Y", value_parser = region, allow_hyphen_values = true)]
    region: Option<[f64; 4]>,

    /// Seed of the random order
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,

    /// Folder for the files; runs/study-transfer-DATE if not given
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

/// What is printed, and written to the folder.
#[derive(Serialize)]
struct Report {
    vertices: usize,
    stencil_mm: f64,
    region_mm: [f64; 4],
    #[serde(flatten)]
    transfer: Transfer,
    out: PathBuf,
}

/// Runs `drape study transfer`.
pub fn run(args: Args) -> Result<(), Failure> {
    let (mut config, place) = scene_config(args.config.as_deref())?;
    set_mesh(&mut config, args.mesh.map(usize::from))?;
    let region_mm = args.region.unwrap_or(REGION);
    let out = folder(args.out.as_deref(), "study-transfer-")?;
    let bar = Progress::new("falling", args.json);
    let set = set_up(&config, |share| bar.set(share));
    drop(bar);
    let (scene, _) = set.map_err(|error| scene_failure(error, &place))?;
    let mut env = EnvConfig {
        region_mm: Some(region_mm),
        crop: true,
        ..EnvConfig::default()
    };
    env.stencil_mm = stencil_mm(&scene.lamina, env.stencil_mm);
    let paths = generate(&scene, &env, usize::from(args.count), args.seed).or_invalid()?;
    if paths.len() < 2 {
        return Err(anyhow!("the simulation diverged in all paths but {}", paths.len()).into());
    }
    let bar = Progress::new("pressing", args.json);
    let found = transfer(&scene, &env, paths, |share| bar.set(share));
    drop(bar);
    let found = found.map_err(|error| twin_failure(error, &place))?;
    let halves = scatter(&found, "after half of the presses", |row| &row.halfway);
    let ends = scatter(&found, "after all presses", |row| &row.end);
    Image::beside(&[halves, ends]).save_png(&out.path.join("scatter.png"))?;
    let report = Report {
        vertices: scene.lamina.vertex_count(),
        stencil_mm: env.stencil_mm,
        region_mm,
        transfer: found,
        out: out.path.clone(),
    };
    write_atomic(&report.out.join("transfer.json"), |file| {
        Ok(serde_json::to_writer_pretty(file, &report)?)
    })?;
    if args.json {
        return print_json(&report);
    }
    print(&table(&report))
}

fn row<'a>(found: &'a Transfer, name: &str) -> &'a Row {
    let row = found.settings.iter().find(|row| row.name == name);
    row.expect("the study has this setting")
}

/// Every path as a dot: distance left in the twin over that in the fast solver.
fn scatter(found: &Transfer, when: &str, of: fn(&Row) -> &Agreement) -> Image {
    let (fast, twin) = (of(row(found, BALANCED)), of(row(found, TWIN)));
    let mut series = Vec::new();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (order, color) in Order::ALL.into_iter().zip(SERIES) {
        let mut points = Vec::new();
        let both = fast.left_m.iter().zip(&twin.left_m).zip(&found.sequences);
        for ((fast, twin), sequence) in both {
            if let (Some(x), Some(y), true) = (*fast, *twin, sequence.order == order) {
                // A dot is a curve of one point.
                points.extend([[x, y], [f64::NAN; 2]]);
                (low, high) = (low.min(x).min(y), high.max(x).max(y));
            }
        }
        series.push(Series {
            label: match order {
                Order::Random => "random",
                Order::Sweep => "sweeps",
                Order::Outwards => "outwards",
            }
            .into(),
            points,
            color,
        });
    }
    series.push(Series {
        label: "equal".into(),
        points: vec![[low, low], [high, high]],
        color: [150, 150, 150],
    });
    Chart {
        title: format!("Distance left in the focus region {when}"),
        x_label: "fast solver, balanced [m]".into(),
        y_label: "finite-element twin [m]".into(),
        series,
        ..Chart::default()
    }
    .image()
}

/// The agreement of a setting at one of the times at which it is looked at.
type At = fn(&Row) -> &Agreement;

fn table(report: &Report) -> String {
    let found = &report.transfer;
    let presses: usize = found.sequences.iter().map(|s| s.vertices.len()).sum();
    let mut text = format!(
        "{} vertices, {} paths of {:.1} presses on average\n",
        report.vertices,
        found.sequences.len(),
        presses as f64 / found.sequences.len() as f64
    );
    let number = |value: Option<f64>, decimals: usize| {
        value.map_or("-".into(), |value| format!("{value:.decimals$}"))
    };
    let span = |interval: Option<[f64; 2]>| {
        interval.map_or("-".into(), |[low, high]| format!("{low:.2} .. {high:.2}"))
    };
    let times: [(&str, At); 2] = [
        ("after half of the presses", |row| &row.halfway),
        ("after all presses", |row| &row.end),
    ];
    for (when, of) in times {
        let _ = writeln!(
            text,
            "{when:26} {:>8} {:>8} {:>7} {:>7} {:>15} {:>15} {:>8} {:>8} {:>5}",
            "left [m]",
            "+-",
            "rank/ac",
            "rank/tw",
            "90 %",
            "-balanced 90 %",
            "lost [m]",
            "best [m]",
            "rank"
        );
        for row in &found.settings {
            let found = of(row);
            let _ = writeln!(
                text,
                "  {:24} {:>8} {:>8} {:>7} {:>7} {:>15} {:>15} {:>8} {:>8} {:>5}",
                row.name,
                number(found.mean_left_m, 4),
                number(found.deviation_left_m, 4),
                number(found.rank_correlation_accurate, 3),
                number(found.rank_correlation_twin, 3),
                span(found.rank_correlation_twin_interval),
                span(found.more_than_balanced_interval),
                number(found.lost_m, 4),
                number(found.best_lost_m, 4),
                number(found.best_rank_twin, 1)
            );
        }
        let chance = found.settings.first().map(of);
        let chance = chance.and_then(|found| found.lost_by_chance_m);
        let _ = writeln!(text, "  {:24} {:>75}", "by chance", number(chance, 4));
    }
    let _ = writeln!(
        text,
        "{:26} {:>8} {:>8} {:>7} {:>7} {:>8}",
        "off the twin, accurate [mm]", "inside", "outside", "inside", "outside", "CPU [s]"
    );
    for row in &found.settings {
        let _ = writeln!(
            text,
            "  {:24} {:>9} {:>8} {:>7} {:>7} {:8.2}",
            row.name,
            number(row.inside_mm, 3),
            number(row.outside_mm, 3),
            number(row.inside_accurate_mm, 3),
            number(row.outside_accurate_mm, 3),
            row.cpu_s
        );
    }
    let _ = write!(
        text,
        "rank/ac, rank/tw: rank correlation with the accurate setting and with the twin; 90 %: of \
         resampled paths, of the latter and of how much it is more than that of balanced; lost: \
         left more in the twin by this setting's choice of two paths; best: by its best path, \
         whose rank in the twin follows\nfiles in {}",
        report.out.display()
    );
    text
}
