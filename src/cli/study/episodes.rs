use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::region;
use crate::cli::Failure;
use crate::cli::failure::{OrInvalid, scene_failure};
use crate::cli::output::{Progress, print, print_json};
use drape_cloth::math::mean_and_deviation;
use drape_cloth::scene::{Scene, SceneConfig};
use drape_study::episodes::{Ended, Order, Played, play};
use drape_task::env::EnvConfig;

/// Play whole episodes in fixed orders: strain, rest and penetration after them, and how much
/// the order matters
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study episodes
  drape study episodes --count 16 --region=-186,-186,-60,-60
  drape study episodes mine.toml --json > episodes.json")]
pub struct Args {
    /// Scene file; the built-in rib with two wrinkles if not given
    config: Option<PathBuf>,

    /// Episodes in each order
    #[arg(long, default_value_t = 64, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    count: u16,

    /// Focus region on the flat blank [mm]: least x, least y, greatest x, greatest y; the whole
    /// blank if not given
    #[arg(long, value_name = "X,Y,X,Y", value_parser = region, allow_hyphen_values = true)]
    region: Option<[f64; 4]>,

    /// Seed of the random order
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,

    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    orders: Vec<Played>,
    /// Wall time of the episodes [s].
    seconds: f64,
}

/// Runs `drape study episodes`.
pub fn run(args: Args) -> Result<(), Failure> {
    let config = match &args.config {
        Some(path) => SceneConfig::read(path).or_invalid()?,
        None => SceneConfig::rib(),
    };
    let env = EnvConfig {
        region_mm: args.region,
        crop: true,
        ..EnvConfig::default()
    };
    let bar = Progress::new("falling", args.json);
    let scene = Scene::new(&config, |share| bar.set(share));
    drop(bar);
    let place = args.config.as_ref().map(|path| path.display().to_string());
    let place = place.unwrap_or("the built-in scene".into());
    let scene = Arc::new(scene.map_err(|error| scene_failure(error, &place))?);
    // Refused before the work.
    let region = env.region(&scene.lamina).or_invalid()?;
    // An episode takes about a step for each five vertices; the bar need not be exact.
    let expected = region.vertices.count_ones(..).div_ceil(5);

    let start = Instant::now();
    let mut orders = Vec::new();
    for order in Order::ALL {
        let title = match order {
            Order::Random => "random",
            Order::Sweep => "sweeps",
            Order::Outwards => "outwards",
        };
        let bar = Progress::new(title, args.json);
        let count = usize::from(args.count);
        let told = |steps: usize| bar.set((steps as f64 / expected as f64).min(1.0));
        orders.push(play(&scene, &env, order, count, args.seed, told).or_invalid()?);
    }
    let report = Report {
        orders,
        seconds: start.elapsed().as_secs_f64(),
    };
    if args.json {
        print_json(&report)
    } else {
        print(&table(&report))
    }
}

/// A figure of the table, from the end of an episode.
type Figure = (&'static str, f64, fn(&Ended) -> f64);

const FIGURES: [Figure; 12] = [
    ("distance left [m]", 1.0, |e| e.region_m),
    ("whole sheet [m]", 1.0, |e| e.summary.distance_m),
    ("undraped vertices", 1.0, |e| e.undraped as f64),
    ("tension p95 [%]", 1e2, |e| e.summary.tension_p95),
    ("tension max [%]", 1e2, |e| e.summary.tension_max),
    ("compression p95 [%]", 1e2, |e| e.summary.compression_p95),
    ("compression max [%]", 1e2, |e| e.summary.compression_max),
    ("edges crushed > 5 % [%]", 1e2, |e| e.crushed_share),
    ("penetration [mm]", 1.0, |e| e.summary.penetration_mm),
    ("v_rms at the end [mm/s]", 1.0, |e| e.summary.v_rms_mm_s),
    ("v_rms at rest [mm/s]", 1.0, |e| e.rest_v_rms_mm_s),
    ("tension max at rest [%]", 1e2, |e| e.rest_tension_max),
];

fn table(report: &Report) -> String {
    let mut text = String::new();
    for played in &report.orders {
        let lost = played.episodes.iter().filter(|e| e.diverged).count();
        let _ = writeln!(
            text,
            "{:?}: {} episodes, {lost} diverged, {:.3} m at the start\n{:24} {:>10} {:>10} {:>10} {:>10}",
            played.order,
            played.episodes.len(),
            played.initial_m,
            "",
            "mean",
            "deviation",
            "least",
            "greatest"
        );
        for (name, scale, of) in FIGURES {
            // A state that is lost has no figures.
            let sound = played.episodes.iter().filter(|e| !e.diverged);
            let values: Vec<f64> = sound.map(|e| scale * of(e)).collect();
            let [mean, deviation] = mean_and_deviation(&values);
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            let greatest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let _ = writeln!(
                text,
                "  {name:24} {mean:>8.4} {deviation:>10.4} {least:>10.4} {greatest:>10.4}"
            );
        }
    }
    let _ = write!(text, "{:.0} s", report.seconds);
    text
}
