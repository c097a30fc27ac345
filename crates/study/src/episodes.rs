//! Whole episodes in fixed orders of pressing: whether the states they end in can be believed,
//! and how much the order matters.
//!
//! Three orders: masked random; straight sweeps, one direction an episode; and outwards from a
//! place, one place of a 7 x 7 grid an episode. All are played under the rules of the task, on the
//! allowed vertex that comes first, by rows and columns.

use std::sync::Arc;

use crate::statistics::extremes;
use crate::study::{Context, Report, SceneOptions, Study, StudyError, stencil_mm};
use crate::table::Table;
use drape_cloth::file::ValueError;
use drape_cloth::math::{Purpose, Stream, mean_and_deviation};
use drape_cloth::measure::surplus;
use drape_cloth::scene::{Scene, Summary};
use drape_cloth::sim::{Backend, Cpu, Precision, Snapshot, World};
use drape_task::env::{Draping, End, EnvConfig, Played, Region, Task, Tasks, most_environments};
use drape_task::search::{Order, choose};

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
        let mut env = self.scene.env(region);
        env.stencil_mm = stencil_mm(&scene.lamina, env.stencil_mm);
        // An episode takes about a step for each five vertices; progress need not be exact.
        let region = env.region(&scene.lamina)?;
        let expected = region.vertices.count_ones(..).div_ceil(5) as f64;
        let mut rows = Vec::new();
        for order in Order::ALL {
            let told = |steps| (context.progress)((steps as f64 / expected).min(1.0), order.name());
            let count = usize::from(self.count);
            let rested = |played: Played| rest(&scene, &env, &region, played.end.cloth());
            let ends: Vec<Rested> = play(&scene, &env, order, (count, 1), told, rested)?;
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

/// Plays `count` episodes in an order, drawn under a seed, and keeps what `of` makes of those that do not diverge.
/// `progress` is told the number of steps taken.
pub fn play<T>(
    scene: &Arc<Scene>,
    config: &EnvConfig,
    order: Order,
    (count, seed): (usize, u64),
    mut progress: impl FnMut(usize),
    of: impl Fn(Played) -> T,
) -> Result<Vec<T>, ValueError> {
    let stream = |index| Stream::new(seed, Purpose::Evaluation, index as u32);
    let mut streams: Vec<Stream> = (0..count).map(stream).collect();
    let mut steps = 0;
    let choose = |env: &Draping, first: usize| {
        progress(steps);
        steps += 1;
        let choose = |(index, stream): (usize, &mut Stream)| {
            let share = (first + index) as f64 / count as f64;
            choose(env, index, order, share, stream)
        };
        let streams = streams[first..].iter_mut().take(env.count());
        streams.enumerate().map(choose).collect()
    };
    let of = |_: &Task, played: Played| {
        let is_whole = played.episode.end != End::Diverged;
        is_whole.then(|| of(played))
    };
    let most = most_environments(scene.lamina.vertex_count());
    let kept = Draping::play_all((scene, config), (count, most), choose, of)?;
    Ok(kept.into_iter().flatten().collect())
}

/// The vertices that `count` episodes in an order press, without those that diverge.
pub fn sequences(
    scene: &Arc<Scene>,
    config: &EnvConfig,
    order: Order,
    count: usize,
    seed: u64,
) -> Result<Vec<Vec<u32>>, ValueError> {
    let vertices = |played: Played| played.end.presses().iter().map(|&(v, _)| v).collect();
    let mut lists: Vec<Vec<u32>> = play(scene, config, order, (count, seed), |_| (), vertices)?;
    lists.retain(|list| !list.is_empty());
    Ok(lists)
}

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
