//! Whole episodes in [fixed orders](drape_proof::orders) of pressing: whether the states they end in can be believed,
//! and how much the order matters.
//!
//! All are played under the rules of the task, on the allowed vertex that comes first, by rows and columns.

use std::sync::Arc;

use crate::statistics::extremes;
use crate::study::{Context, Report, SceneOptions, Study, StudyError, restless, stencil_mm};
use drape_cloth::math::mean_and_deviation;
use drape_cloth::measure::surplus;
use drape_cloth::scene::{Scene, Summary};
use drape_cloth::sim::{Backend, Cpu, Precision, Snapshot, World};
use drape_proof::orders::play;
use drape_report::Table;
use drape_task::env::{EnvConfig, Played, Region};
use drape_task::search::Order;

/// Play whole episodes in fixed orders: strain, rest and penetration after them, and how much
/// the order matters
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study episodes
  drape study episodes --count 16 --region=-186,-186,-60,-60
  drape study episodes mine.toml --json > episodes.json")]
pub struct Episodes {
    #[command(flatten)]
    scene: SceneOptions,

    /// Episodes in each order
    #[arg(long, default_value_t = 64, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    count: u16,
}

/// What a state after an episode is like, and what it comes to.
#[derive(Debug)]
pub struct Rested {
    /// Of the state as it is.
    pub summary: Summary,
    /// Summed distance of the region to the tool [m], and mean surplus of its yarns [m].
    pub region_m: f64,
    pub surplus_m: f64,
    /// Root mean square speed [mm/s] a quarter of a second later.
    pub v_rms_mm_s: f64,
    /// Greatest tensile strain of a yarn edge [-] then.
    pub tension_max: f64,
}

impl Study for Episodes {
    const NAME: &'static str = "episodes";
    const TABLES: &'static [&'static str] = &["ends"];

    fn scene(&self) -> Option<&SceneOptions> {
        Some(&self.scene)
    }

    fn run(&self, context: &Context) -> Result<Report, StudyError> {
        let (mut config, region) = self.scene.read(context)?;
        self.scene.set_mesh(&mut config, None)?;
        let fall = |share| (context.progress)(share, "falling");
        let scene = Arc::new(Scene::new(&config, fall)?);
        let mut env = restless(self.scene.region.or(region));
        env.stencil_mm = stencil_mm(&scene.lamina, env.stencil_mm);
        // An episode takes about a step for each five vertices; progress need not be exact.
        let region = env.region(&scene.lamina)?;
        let expected = region.vertices.count_ones(..).div_ceil(5) as f64;
        let mut rows = Vec::new();
        for order in Order::ALL {
            let told = |steps| (context.progress)((steps as f64 / expected).min(1.0), order.name());
            let count = usize::from(self.count);
            let rested = |played: Played| rest(&scene, &env, &region, played.end.cloth());
            let ends: Vec<Rested> = play(&scene, &env, order, count, 1, told, rested)?;
            let diverged = count - ends.len();
            rows.extend(FIGURES.map(|(name, of)| {
                let values: Vec<f64> = ends.iter().map(of).collect();
                let (means, range) = (mean_and_deviation(&values), extremes(&values));
                (order.name(), name, diverged, means, range)
            }));
        }
        let initial = scene
            .tool
            .summed_distance(region.vertices.ones(), &scene.initial.position);
        let title = format!(
            "{} episodes in each order from {initial:.3} m; those that diverge have no figures",
            self.count
        );
        let table = Table::of("ends", title, &rows)
            .text("order", |(order, ..)| *order)
            .text("figure", |(_, name, ..)| *name)
            .text("diverged", |(_, _, diverged, ..)| *diverged)
            .number("mean", 4, |(.., means, _)| means[0])
            .number("deviation", 4, |(.., means, _)| means[1])
            .number("min", 4, |(.., range)| range[0])
            .number("max", 4, |(.., range)| range[1]);
        Ok(Report::new([table.end()]))
    }
}

/// A figure of the end of an episode: its name, and how it is got.
type Figure = (&'static str, fn(&Rested) -> f64);

const FIGURES: [Figure; 11] = [
    ("distance left [m]", |r| r.region_m),
    ("surplus left [mm]", |r| 1e3 * r.surplus_m),
    ("whole sheet [m]", |r| r.summary.distance_m),
    ("tension p95 [%]", |r| 1e2 * r.summary.tension_p95),
    ("tension max [%]", |r| 1e2 * r.summary.tension_max),
    ("compression p95 [%]", |r| 1e2 * r.summary.compression_p95),
    ("compression max [%]", |r| 1e2 * r.summary.compression_max),
    ("penetration [mm]", |r| r.summary.penetration_mm),
    ("v_rms at the end [mm/s]", |r| r.summary.v_rms_mm_s),
    ("v_rms at rest [mm/s]", |r| r.v_rms_mm_s),
    ("tension max at rest [%]", |r| 1e2 * r.tension_max),
];

/// Measures a state and lets it come to rest.
pub fn rest(
    scene: &Scene,
    config: &EnvConfig,
    Region { vertices, .. }: &Region,
    state: &Snapshot,
) -> Rested {
    let world = World::new(scene.model.clone(), scene.tool.clone());
    let mut cloth = Cpu::new(&world, 1, Precision::F32);
    cloth.load(0, state);
    cloth.step(&config.stepping().control(0.25), &[]);
    let rested = cloth.snapshot(0);
    let tension = scene.lamina.yarn_strain(&rested.position).into_iter();
    Rested {
        region_m: scene.tool.summed_distance(vertices.ones(), &state.position),
        surplus_m: surplus(&scene.lamina, &scene.tool, &state.position, vertices),
        summary: scene.summary(state),
        v_rms_mm_s: 1e3 * rested.v_rms(),
        tension_max: tension.fold(0.0, f64::max),
    }
}
