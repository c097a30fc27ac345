//! Whether the preset matters for the task: fixed sequences of presses, played under several
//! settings of the fast solver and in the finite-element twin, and how far the settings agree
//! which sequence is the better one.
//!
//! The settings of the fast solver all start from the state of the scene's fall, as a training
//! does. The twin starts from where it has fallen itself, and once, for what the presses alone do,
//! from the fast solver's state. Time ends with the last press.

use std::sync::Arc;

use cpu_time::ProcessTime;

use crate::episodes::sequences;
use crate::points::apart_mm;
use crate::presses::{Positions, replay, replay_in_twin, resting};
use crate::ranking::{interval, pair_loss, ranks, spearman};
use crate::study::{CORNER, Context, Report, SceneOptions, Study, StudyError, stencil_mm};
use crate::table::{Format::Hidden, Table};
use crate::twin::fall::{fallen, twin_config};
use drape_cloth::file::ValueError;
use drape_cloth::math::mean_and_deviation;
use drape_cloth::measure::surplus;
use drape_cloth::scene::Scene;
use drape_cloth::sim::{Accuracy, Precision, Solver, Stepping};
use drape_report::{Chart, Image, SERIES, Series};
use drape_task::env::{Draping, EnvConfig, EpisodeState, Goal, Objective};
use drape_task::search::Order;

/// Play the same presses under several settings and in the finite-element twin: do they agree
/// which path is the better one?
///
/// Paths are found under the preset `balanced`, which trains. The settings are the presets,
/// `accurate` in f64, the rates 1200, 2400 and 4800, and Gauss-Seidel at the rate of `balanced`. The
/// blank has 33 vertices along its longer side where `--mesh` does not say otherwise, the region
/// is the front left corner. Writes scatter.png too, the distance and the surplus that each path
/// leaves in the fast solver against those in the twin.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study transfer
  drape study transfer --count 12 --mesh 25 --out transfer
  drape study transfer mine.toml --region=-60,-60,60,60 --json > transfer.json")]
pub struct Transfer {
    #[command(flatten)]
    scene: SceneOptions,

    /// Paths, a third in each of the orders: masked random, sweeps, outwards
    #[arg(long, default_value_t = 32, value_name = "N", value_parser = clap::value_parser!(u16).range(2..=4096))]
    count: u16,

    /// Seed of the random order
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
}

/// A list of presses: vertices in the order they are pressed.
type Sequence = (Order, Vec<u32>);

/// Where a sequence has led to.
#[derive(Clone, Debug, PartialEq)]
struct End {
    /// What is left in the region: the objective, mean distance and surplus; the summed distance;
    /// the mean surplus [m].
    left_m: [f64; 3],
    positions: Positions,
}

/// Whatever computes the presses.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Player {
    Fast(Solver, Stepping, Precision),
    Twin,
    /// The twin from where the fast solver's fall has ended, not its own.
    TwinFromFast,
}

/// The preset that trains, under which paths are found.
const BALANCED: &str = "balanced";
/// What players are held against.
const TWIN: &str = "twin";

fn players() -> [(&'static str, Player); 9] {
    let fast = |solver, stepping| Player::Fast(solver, stepping, Precision::F32);
    let yarn = |rate, interval| fast(Solver::Yarn, Stepping::every(rate, interval));
    let [rough, balanced, accurate] = Accuracy::ALL.map(Accuracy::stepping);
    let accurate = Player::Fast(Solver::Yarn, accurate, Precision::F64);
    [
        ("fast", fast(Solver::Yarn, rough)),
        (BALANCED, fast(Solver::Yarn, balanced)),
        ("yarn_1200", yarn(1200.0, 5)),
        ("yarn_2400", yarn(2400.0, 5)),
        ("yarn_4800", yarn(4800.0, 10)),
        ("accurate", accurate),
        ("gauss_seidel", fast(Solver::GaussSeidel, balanced)),
        (TWIN, Player::Twin),
        ("twin_same_start", Player::TwinFromFast),
    ]
}

impl Study for Transfer {
    const NAME: &'static str = "transfer";
    const TABLES: &'static [&'static str] = &["objective", "distance", "orders", "paths"];

    fn scene(&self) -> Option<&SceneOptions> {
        Some(&self.scene)
    }

    fn run(&self, context: &Context) -> Result<Report, StudyError> {
        let (mut config, region) = self.scene.read(context)?;
        self.scene.set_mesh(&mut config, Some(33))?;
        // Refused before the work.
        twin_config(&config)?;
        let fall = |share| (context.progress)(share, "falling");
        let scene = Arc::new(Scene::new(&config, fall)?);
        let mut env = self.scene.env(region.or(Some(CORNER)));
        env.stencil_mm = stencil_mm(&scene.lamina, env.stencil_mm);
        let paths = generate(&scene, &env, self.count.into(), self.seed)?;
        if paths.len() < 2 {
            return Err(StudyError::FastDiverged);
        }
        let inside = env.region(&scene.lamina)?.vertices;
        let lists: Vec<&[u32]> = paths.iter().map(|(_, vertices)| &**vertices).collect();
        (context.progress)(0.0, "the twin's fall");
        let rest = fallen(&scene, &twin_config(&config)?)?.positions();
        let mut rows = Vec::new();
        for (done, (name, player)) in players().into_iter().enumerate() {
            (context.progress)(done as f64 / players().len() as f64, name);
            let (ends, cpu_s) = play(&scene, &env, &rest, player, &lists)?;
            rows.push(Row { name, ends, cpu_s });
        }
        Ok(report(&rows, &paths, |v| inside.contains(v)))
    }
}

/// About `count` sequences, of every order as many, found under the preset `balanced`.
fn generate(
    scene: &Arc<Scene>,
    env: &EnvConfig,
    count: usize,
    seed: u64,
) -> Result<Vec<Sequence>, ValueError> {
    let mut env = env.clone();
    env.set_accuracy(Accuracy::Balanced);
    let mut all = Vec::new();
    for (k, order) in Order::ALL.into_iter().enumerate() {
        let share = (count + Order::ALL.len() - 1 - k) / Order::ALL.len();
        if share > 0 {
            let found = sequences(scene, &env, order, share, seed)?.into_iter();
            all.extend(found.map(|vertices| (order, vertices)));
        }
    }
    Ok(all)
}

/// What a player has found.
#[derive(Clone, Debug)]
struct Row {
    name: &'static str,
    /// None of sequences in which the simulation diverged; they count in no figure.
    ends: Vec<Option<End>>,
    /// CPU time of all presses of all sequences [s].
    cpu_s: f64,
}

impl Row {
    /// What every sequence leaves, by its place in [`End::left_m`] [m].
    fn left_m(&self, what: usize) -> Vec<Option<f64>> {
        let ends = self.ends.iter();
        ends.map(|end| Some(end.as_ref()?.left_m[what])).collect()
    }

    /// The mean of it over the sequences of an order; NaN without any.
    fn mean_of(&self, what: usize, order: Order, paths: &[Sequence]) -> f64 {
        let all = self.left_m(what).into_iter().zip(paths);
        let own = all.filter(|(_, path)| path.0 == order);
        let found: Vec<f64> = own.filter_map(|(left, _)| left).collect();
        mean_and_deviation(&found)[0]
    }
}

/// Plays lists of presses, side by side in the lanes or each on a thread; none where one diverges.
/// Gives their CPU time [s] too. `rest` is where the twin has fallen to.
fn play(
    scene: &Arc<Scene>,
    env: &EnvConfig,
    rest: &[[f64; 3]],
    player: Player,
    lists: &[&[u32]],
) -> Result<(Vec<Option<End>>, f64), StudyError> {
    let region = env.region(&scene.lamina)?.vertices;
    let start = match player {
        Player::Twin => rest,
        _ => &scene.initial.position[..],
    };
    let goal = Goal::new(Objective::Surplus, scene.clone(), region.clone(), start);
    let end = |end: EpisodeState| {
        let positions = end.cloth().position.clone();
        let surplus = surplus(&scene.lamina, &scene.tool, &positions, &region);
        let distance = scene.tool.summed_distance(region.ones(), &positions);
        End {
            left_m: [goal.left(&positions), distance, surplus],
            positions,
        }
    };
    let (ends, cpu_s) = match player {
        Player::Fast(solver, stepping, precision) => {
            let (mut scene, mut env) = (scene.clone(), env.clone());
            let mut physics = scene.config.physics.clone();
            if physics.solver != solver {
                physics.solver = solver;
                scene = Arc::new(scene.with_physics(physics));
            }
            env.set_stepping(stepping);
            env.precision = precision;
            let start = ProcessTime::now();
            let mut draping = Draping::new(scene, &env, lists.len())?;
            let ends = replay(&mut draping, lists, |_| ());
            (ends, start.elapsed().as_secs_f64())
        }
        _ => {
            let scene = resting(scene, start.to_vec());
            replay_in_twin(&scene, env, lists, &|_, _| (), &Context::quiet())?
        }
    };
    Ok((ends.into_iter().map(|at| at.map(end)).collect(), cpu_s))
}

fn named<'a>(rows: &'a [Row], name: &str) -> &'a Row {
    let row = rows.iter().find(|row| row.name == name);
    row.expect("the study has this player")
}

/// Mean distance of the same vertices at the end of all sequences that both have ended [mm]; NaN
/// without any.
fn off_mm(a: &Row, b: &Row, is_chosen: impl Fn(usize) -> bool) -> f64 {
    let ends = a.ends.iter().zip(&b.ends);
    let means = ends.filter_map(|(a, b)| {
        let [a, b] = [&a.as_ref()?.positions, &b.as_ref()?.positions];
        let chosen = (0..a.len()).filter(|&v| is_chosen(v));
        let pairs: Vec<[usize; 2]> = chosen.map(|v| [v, v]).collect();
        Some(apart_mm(a, b, &pairs)[0])
    });
    mean_and_deviation(&means.collect::<Vec<_>>())[0]
}

fn report(rows: &[Row], paths: &[Sequence], is_inside: impl Fn(usize) -> bool) -> Report {
    let vertices = (rows[0].ends.iter().flatten().next()).map_or(0, |end| end.positions.len());
    let presses: usize = paths.iter().map(|(_, vertices)| vertices.len()).sum();
    let title = format!(
        "Mean distance and surplus: {vertices} vertices, {} paths of {:.1} presses on average",
        paths.len(),
        presses as f64 / paths.len() as f64
    );
    let objective = agreements("objective", title, rows, 0);
    let distance = agreements("distance", "Summed distance".into(), rows, 1);
    let title = "Summed distance and mean surplus by order; where the vertices lie, mean distance \
                 from the same ones of the twin";
    let twin = named(rows, TWIN);
    let left = |k: usize| move |row: &Row| row.mean_of(1, Order::ALL[k], paths);
    let surplus = |k: usize| move |row: &Row| 1e3 * row.mean_of(2, Order::ALL[k], paths);
    let diverged = |row: &Row| row.ends.iter().filter(|end| end.is_none()).count();
    let inside = |row: &Row| off_mm(row, twin, &is_inside);
    let outside = |row: &Row| off_mm(row, twin, |v| !is_inside(v));
    let places = Table::of("orders", title, rows)
        .text("setting", |row| row.name)
        .number("random [m]", 4, left(0))
        .number("sweeps [m]", 4, left(1))
        .number("outwards [m]", 4, left(2))
        .number("random surplus [mm]", 2, surplus(0))
        .number("sweeps surplus [mm]", 2, surplus(1))
        .number("outwards surplus [mm]", 2, surplus(2))
        .text("diverged", diverged)
        .number("off the twin inside [mm]", 3, inside)
        .number("outside [mm]", 3, outside)
        .number("CPU [s]", 2, |row| row.cpu_s);
    let all: Vec<(&Row, usize)> = (rows.iter())
        .flat_map(|row| (0..paths.len()).map(move |path| (row, path)))
        .collect();
    let left = |what: usize| move |(row, path): &(&Row, usize)| row.left_m(what)[*path];
    let all = Table::of("paths", "", &all)
        .text("setting", |(row, _)| row.name)
        .text("path", |(_, path)| *path)
        .text("order", |(_, path)| paths[*path].0.name())
        .text("presses", |(_, path)| paths[*path].1.len())
        .number("objective [m]", Hidden, left(0))
        .number("distance [m]", Hidden, left(1))
        .number("surplus [m]", Hidden, left(2));
    let mut report = Report::new([objective, distance, places.end(), all.end()]);
    report.notes.push(
        "rank: correlation with the twin, 90 % of it over resampled paths, and of how much it is \
         more than that of balanced; lost: left more in the twin by this setting's choice of two \
         paths, and by a choice by chance; best rank: of its best path in the twin"
            .into(),
    );
    report.fact("vertices", vertices);
    let lists: Vec<_> = paths.iter().map(|(_, vertices)| vertices).collect();
    report.fact("sequences", lists);
    let scatters = [(1, "distance"), (2, "surplus")].map(|what| scatter(paths, rows, what));
    report.image("scatter.png", Image::beside(&scatters));
    report
}

/// How the players judge the sequences by what is left, by its place in [`End::left_m`], and what
/// following their judgement costs in the twin.
fn agreements(name: &'static str, title: String, rows: &[Row], what: usize) -> Table {
    let [balanced, twin] = &[BALANCED, TWIN].map(|name| named(rows, name).left_m(what));
    let own = |row: &Row| row.left_m(what);
    let left = |row: &Row| {
        let found: Vec<f64> = own(row).into_iter().flatten().collect();
        (!found.is_empty()).then(|| mean_and_deviation(&found))
    };
    // Beside the twin's, of the sequences that both have brought to an end.
    let pairs = |row: &Row| -> Vec<[f64; 2]> {
        let both = own(row).into_iter().zip(twin);
        both.filter_map(|(own, twin)| Some([own?, (*twin)?]))
            .collect()
    };
    // Over resamples of the sequences that all three have brought to an end.
    let resampled = |row: &Row, of: fn([Option<f64>; 2]) -> Option<f64>| {
        let all: Vec<[f64; 3]> = (own(row).into_iter().zip(balanced).zip(twin))
            .filter_map(|((own, balanced), twin)| Some([own?, (*balanced)?, (*twin)?]))
            .collect();
        let found = interval(all.len(), |drawn| {
            let beside = |k: usize| -> Vec<[f64; 2]> {
                drawn.iter().map(|&i| [all[i][k], all[i][2]]).collect()
            };
            of([0, 1].map(|k| spearman(&beside(k))))
        });
        found.map_or("-".into(), |[low, high]| format!("{low:.2} .. {high:.2}"))
    };
    let over_balanced = |row: &Row| resampled(row, |[own, balanced]| Some(own? - balanced?));
    let by_chance = |row: &Row| {
        let pairs = pairs(row).into_iter();
        pair_loss(&pairs.map(|[_, twin]| [0.0, twin]).collect::<Vec<_>>())
    };
    // The twin's rank of the sequence that is the first of the best in the row.
    let best_rank = |row: &Row| {
        let (own, twin): (Vec<f64>, Vec<f64>) = pairs(row).into_iter().map(<_>::from).unzip();
        let best = (0..own.len()).min_by(|&a, &b| own[a].total_cmp(&own[b]))?;
        Some(ranks(&twin)[best])
    };
    Table::of(name, title, rows)
        .text("setting", |row| row.name)
        .number("left [m]", 4, |row| left(row).map(|left| left[0]))
        .number("deviation [m]", 4, |row| left(row).map(|left| left[1]))
        .number("rank twin", 3, |row| spearman(&pairs(row)))
        .text("rank twin 90 %", |row| resampled(row, |[own, _]| own))
        .text("over balanced 90 %", over_balanced)
        .number("lost [m]", 4, |row| pair_loss(&pairs(row)))
        .number("by chance [m]", 4, by_chance)
        .number("best rank", 1, best_rank)
        .end()
}

/// Every path as a dot: what of [`End::left_m`] is left in the twin over that in the fast solver.
fn scatter(paths: &[Sequence], rows: &[Row], (what, name): (usize, &str)) -> Image {
    let [fast, twin] = [BALANCED, TWIN].map(|name| named(rows, name).left_m(what));
    let series = Order::ALL.into_iter().zip(SERIES).map(|(order, color)| {
        let own = (0..paths.len()).filter(|&path| paths[path].0 == order);
        // A dot is a curve of one point.
        let points = own.filter_map(|path| Some([[fast[path]?, twin[path]?], [f64::NAN; 2]]));
        Series {
            label: order.name().into(),
            points: points.flatten().collect(),
            color,
        }
    });
    Chart {
        title: format!("Left in the focus region: {name}"),
        x_label: "fast solver, balanced [m]".into(),
        y_label: "finite-element twin [m]".into(),
        series: series.collect(),
        ..Chart::default()
    }
    .image()
}

#[cfg(test)]
pub mod tests;
