//! Whether the preset matters for the task: fixed sequences of presses, played under several
//! settings of the fast solver and in the finite-element twin, and how far the settings agree
//! which sequence is the better one.
//!
//! Settings of the fast solver are the presets, `accurate` in f64, two rates between them and
//! Gauss-Seidel at the rate of `balanced`. All start from one state, that of the scene's fall: a
//! training has no other. The twin starts from where it has fallen itself, and once, for what the
//! presses alone do, from the fast solver's state. Time ends with the last press.

use std::sync::Arc;

use cpu_time::{ProcessTime, ThreadTime};
use rayon::prelude::*;

use crate::episodes::{Order, sequences};
use crate::points::distance;
use crate::ranking::{interval, least, pair_loss, ranks, spearman};
use crate::study::{Context, QUICKSTART, Report, SceneOptions, Study, StudyError, stencil_mm};
use crate::table::Table;
use crate::twin::fall::{ACCELERATION, SPEED, fallen, lying, press_config, twin_config};
use crate::twin::set_up;
use drape_cloth::file::ValueError;
use drape_cloth::math::{Vec3, mean_and_deviation};
use drape_cloth::scene::Scene;
use drape_cloth::sim::Precision;
use drape_cloth::sim::{Accuracy, Solver, Stepping};
use drape_cloth::twin::{Hold, Twin, TwinConfig};
use drape_report::{Chart, Image, SERIES, Series};
use drape_task::env::{Draping, EnvConfig};

/// Play the same presses under several settings and in the finite-element twin: do they agree
/// which path is the better one?
///
/// Paths are found under the preset `balanced`, which trains. The settings are the presets,
/// `accurate` in f64, the rates 1200 and 2400, and Gauss-Seidel at the rate of `balanced`. The
/// blank has 33 vertices along its longer side where `--mesh` does not say otherwise, the region
/// is that of the quickstart. Writes scatter.png too, the distance that each path leaves in the fast
/// solver against that in the twin.
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

/// A strain that no draped vertex reaches: the rule of strain is off.
const ANY_STRAIN: f64 = 1e5;

/// A list of presses: vertices in the order they are pressed.
#[derive(Clone, Debug)]
struct Sequence {
    order: Order,
    vertices: Vec<u32>,
}

/// Where a sequence has led to.
#[derive(Clone, Debug, PartialEq)]
struct End {
    /// Summed distance left in the region after half of the presses, rounded up [m].
    half: f64,
    /// Summed distance left in the region [m].
    left: f64,
    /// Position of every vertex [m].
    positions: Vec<[f64; 3]>,
}

/// The same presses by whatever computes them.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Setting {
    Fast(FastSetting),
    Twin(TwinSetting),
}

/// A way of stepping the fast solver.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FastSetting {
    solver: Solver,
    stepping: Stepping,
    precision: Precision,
    any_strain: bool,
}

/// A way of pressing in the twin.
#[derive(Clone, Copy, Debug, PartialEq)]
struct TwinSetting {
    hold: Hold,
    accelerated: bool,
    /// Starts where the fast solver's fall has ended.
    starts_as_fast: bool,
}

/// The preset that trains, under which paths are found.
const BALANCED: &str = "balanced";
/// What the rank correlations hold settings against.
const ACCURATE: &str = "accurate";
const TWIN: &str = "twin";

fn settings() -> Vec<(&'static str, Setting)> {
    let preset = |preset: Accuracy| FastSetting {
        solver: Solver::Yarn,
        stepping: preset.stepping(),
        precision: Precision::F32,
        any_strain: false,
    };
    let balanced = preset(Accuracy::Balanced);
    let yarn = |rate| FastSetting {
        stepping: Stepping::every(rate, 5),
        ..balanced
    };
    let any_strain = FastSetting {
        any_strain: true,
        ..balanced
    };
    let accurate = FastSetting {
        precision: Precision::F64,
        ..preset(Accuracy::Accurate)
    };
    let gauss_seidel = FastSetting {
        solver: Solver::GaussSeidel,
        ..balanced
    };
    let twin = TwinSetting {
        hold: Hold::Fixed,
        accelerated: false,
        starts_as_fast: false,
    };
    let pressure = TwinSetting {
        hold: Hold::Pressure,
        ..twin
    };
    let accelerated = TwinSetting {
        accelerated: true,
        ..twin
    };
    let same_start = TwinSetting {
        starts_as_fast: true,
        ..twin
    };
    vec![
        ("fast", Setting::Fast(preset(Accuracy::Fast))),
        (BALANCED, Setting::Fast(balanced)),
        ("balanced_any_strain", Setting::Fast(any_strain)),
        ("yarn_1200", Setting::Fast(yarn(1200.0))),
        ("yarn_2400", Setting::Fast(yarn(2400.0))),
        (ACCURATE, Setting::Fast(accurate)),
        ("gauss_seidel", Setting::Fast(gauss_seidel)),
        (TWIN, Setting::Twin(twin)),
        ("twin_pressure", Setting::Twin(pressure)),
        ("twin_accelerated", Setting::Twin(accelerated)),
        ("twin_same_start", Setting::Twin(same_start)),
    ]
}

impl Study for Transfer {
    const NAME: &'static str = "transfer";

    fn scene(&self) -> Option<&SceneOptions> {
        Some(&self.scene)
    }

    fn run(&self, context: &Context) -> Result<Report, StudyError> {
        let mut config = self.scene.read()?;
        self.scene.set_mesh(&mut config, 33)?;
        let (scene, _) = set_up(&config, |share| (context.progress)(share, "falling"))?;
        let mut env = self.scene.env(Some(QUICKSTART));
        env.stencil_mm = stencil_mm(&scene.lamina, env.stencil_mm);
        let paths = generate(&scene, &env, self.count.into(), self.seed)?;
        if paths.len() < 2 {
            return Err(StudyError::FastDiverged);
        }
        let rows = play_all(&scene, &env, &paths, context)?;
        Ok(report(&scene, &paths, &rows))
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
            all.extend(found.map(|vertices| Sequence { order, vertices }));
        }
    }
    Ok(all)
}

/// Plays all sequences under all settings.
fn play_all(
    scene: &Arc<Scene>,
    env: &EnvConfig,
    sequences: &[Sequence],
    context: &Context,
) -> Result<Vec<Row>, StudyError> {
    let region = env.region(&scene.lamina)?.vertices;
    let lists: Vec<&[u32]> = sequences.iter().map(|s| &*s.vertices).collect();
    let config = twin_config(&scene.config)?;
    (context.progress)(0.0, "the twin's fall");
    let rest = fallen(scene, &config)?.positions();

    let settings = settings();
    let mut played = Vec::new();
    for (done, &(name, setting)) in settings.iter().enumerate() {
        (context.progress)(done as f64 / settings.len() as f64, name);
        played.push(match setting {
            Setting::Fast(fast) => {
                let (scene, env) = changed(scene, env, fast);
                let start = ProcessTime::now();
                let ends = replay(&scene, &env, &lists)?;
                (ends, start.elapsed().as_secs_f64())
            }
            Setting::Twin(setting) => replay_in_twin(scene, env, &config, &rest, setting, &lists)?,
        });
    }
    let of = |wanted: &str| {
        let index = settings.iter().position(|(name, _)| *name == wanted);
        &played[index.expect("a setting of this name")].0
    };
    let is_inside = |v: usize| region.contains(v);
    let judge = Judge {
        balanced: of(BALANCED),
        accurate: of(ACCURATE),
        twin: of(TWIN),
        sequences,
        is_inside: &is_inside,
    };
    let rows = settings.iter().zip(&played);
    Ok(rows
        .map(|((name, _), (ends, cpu_s))| judge.row(name, *cpu_s, ends))
        .collect())
}

/// The scene and the environment stepped as `fast`.
fn changed(scene: &Arc<Scene>, env: &EnvConfig, fast: FastSetting) -> (Arc<Scene>, EnvConfig) {
    let (mut scene, mut env) = (scene.clone(), env.clone());
    let mut physics = scene.config.physics.clone();
    if physics.solver != fast.solver {
        physics.solver = fast.solver;
        scene = Arc::new(scene.with_physics(physics));
    }
    env.set_stepping(fast.stepping);
    env.precision = fast.precision;
    if fast.any_strain {
        env.drape_strain = ANY_STRAIN;
    }
    (scene, env)
}

/// Plays lists of presses in the fast solver, side by side in the lanes; none where it diverges.
fn replay(
    scene: &Arc<Scene>,
    env: &EnvConfig,
    lists: &[&[u32]],
) -> Result<Vec<Option<End>>, ValueError> {
    let mut draping = Draping::new(scene.clone(), env, lists.len())?;
    let mut halves = vec![0.0; lists.len()];
    let mut ends = vec![None; lists.len()];
    draping.replay(lists, |draping, index, presses| {
        let count = lists[index].len();
        if presses == count.div_ceil(2) {
            halves[index] = draping.region_distance(&draping.state(index));
        }
        if presses == count {
            let state = draping.state(index);
            ends[index] = Some(End {
                half: halves[index],
                left: draping.region_distance(&state),
                positions: state.position,
            });
        }
    });
    Ok(ends)
}

/// Plays lists of presses in the twin, each on a thread, from where it has fallen to (`rest`) or
/// from the fast solver's state. Gives their CPU time [s] too.
fn replay_in_twin(
    scene: &Scene,
    env: &EnvConfig,
    config: &TwinConfig,
    rest: &[[f64; 3]],
    setting: TwinSetting,
    lists: &[&[u32]],
) -> Result<(Vec<Option<End>>, f64), StudyError> {
    let region = env.region(&scene.lamina)?.vertices;
    let press = press_config(env, setting.hold, SPEED);
    let config = match setting.accelerated {
        true => config.accelerated(ACCELERATION),
        false => config.clone(),
    };
    let start = match setting.starts_as_fast {
        true => &scene.initial.position,
        false => rest,
    };
    let side = 1e-3 * env.stencil_mm;
    let play = |list: &&[u32]| {
        let began = ThreadTime::now();
        let mut twin = lying(scene, &config, start)?;
        let (lamina, tool) = (&scene.lamina, &scene.tool);
        let measure = |twin: &Twin| distance(tool, region.ones(), &twin.positions());
        let (mut pressed, mut half) = (0, measure(&twin));
        let watch = |twin: &Twin| {
            pressed += 1;
            if pressed == list.len().div_ceil(2) {
                half = measure(twin);
            }
        };
        let ended = twin.replay(lamina, tool, &press, (*list, side), watch);
        let end = ended.diverged.is_none().then(|| End {
            half,
            left: measure(&twin),
            positions: twin.positions(),
        });
        // The time of those that diverge is no figure.
        let seconds = end.as_ref().map_or(0.0, |_| began.elapsed().as_secs_f64());
        Ok((end, seconds))
    };
    let ended: Result<Vec<_>, StudyError> = lists.par_iter().map(play).collect();
    let (ends, seconds): (Vec<_>, Vec<f64>) = ended?.into_iter().unzip();
    Ok((ends, seconds.iter().sum()))
}

/// How a setting judges the sequences, by the distance left at some time.
#[derive(Clone, Debug)]
struct Agreement {
    /// Summed distance left in the region, mean and standard deviation over the sequences [m].
    left_m: Option<[f64; 2]>,
    /// Spearman's with the accurate setting and with the twin, by the distance left.
    rank_accurate: Option<f64>,
    rank_twin: Option<f64>,
    /// The middle 90 % of the latter over resampled sequences, and of how much more it is than
    /// that of `balanced` in the same resamples.
    rank_twin_interval: Option<[f64; 2]>,
    more_than_balanced: Option<[f64; 2]>,
    /// The correlation with the twin among the sequences of each order.
    rank_twin_by_order: [Option<f64>; 3],
    /// More distance left in the twin [m], on average over all pairs of sequences, when the one
    /// that this setting finds better is taken, than by the better one.
    lost_m: Option<f64>,
    /// The same when either is taken by chance.
    lost_by_chance_m: Option<f64>,
    /// More distance left in the twin by this setting's best sequence than by the twin's best [m],
    /// and its rank in the twin, 1 for the best.
    best_lost_m: Option<f64>,
    best_rank_twin: Option<f64>,
    /// Distance left by every sequence [m].
    all_m: Vec<Option<f64>>,
}

/// What a setting has found.
#[derive(Clone, Debug)]
struct Row {
    name: &'static str,
    /// Sequences in which the simulation diverged; they count in no figure.
    diverged: usize,
    /// After half of the presses, and after all.
    half: Agreement,
    end: Agreement,
    /// Mean distance of the same vertices from where the twin and the accurate setting have them
    /// in the end, inside and outside the region [mm].
    off_twin_mm: [Option<f64>; 2],
    off_accurate_mm: [Option<f64>; 2],
    /// CPU time of all presses of all sequences [s].
    cpu_s: f64,
}

/// What settings are held against.
struct Judge<'a> {
    balanced: &'a [Option<End>],
    accurate: &'a [Option<End>],
    twin: &'a [Option<End>],
    sequences: &'a [Sequence],
    is_inside: &'a dyn Fn(usize) -> bool,
}

impl Judge<'_> {
    fn row(&self, name: &'static str, cpu_s: f64, ends: &[Option<End>]) -> Row {
        let off = |other: &[Option<End>]| {
            [true, false]
                .map(|inside| mean_distance(ends, other, |v| (self.is_inside)(v) == inside))
        };
        Row {
            name,
            diverged: ends.iter().filter(|end| end.is_none()).count(),
            half: self.agreement(ends, |end| end.half),
            end: self.agreement(ends, |end| end.left),
            off_twin_mm: off(self.twin),
            off_accurate_mm: off(self.accurate),
            cpu_s,
        }
    }

    fn agreement(&self, ends: &[Option<End>], left: fn(&End) -> f64) -> Agreement {
        let all_m: Vec<Option<f64>> = ends.iter().map(|end| end.as_ref().map(left)).collect();
        let found: Vec<f64> = all_m.iter().flatten().copied().collect();
        // Distances left by the chosen sequences that both have brought to an end.
        let pairs = |other: &[Option<End>], is_chosen: &dyn Fn(usize) -> bool| {
            let both = ends.iter().zip(other).enumerate();
            both.filter(|(index, _)| is_chosen(*index))
                .filter_map(|(_, (a, b))| Some((left(a.as_ref()?), left(b.as_ref()?))))
                .unzip::<f64, f64, Vec<f64>, Vec<f64>>()
        };
        let (own, twin) = pairs(self.twin, &|_| true);
        let (same, accurate) = pairs(self.accurate, &|_| true);
        let of_order = |order| {
            let (own, twin) = pairs(self.twin, &|index| self.sequences[index].order == order);
            spearman(&own, &twin)
        };
        // Those that all three have brought to an end.
        let three: Vec<[f64; 3]> = (ends.iter().zip(self.balanced).zip(self.twin))
            .map(|((a, b), c)| [a, b, c].map(|end| end.as_ref().map(left)))
            .filter_map(|[a, b, c]| Some([a?, b?, c?]))
            .collect();
        let resampled = |drawn: &[usize], k: usize| {
            let of = |k: usize| drawn.iter().map(|&i| three[i][k]).collect::<Vec<f64>>();
            spearman(&of(k), &of(2))
        };
        let best = least(&own);
        Agreement {
            left_m: (!found.is_empty()).then(|| mean_and_deviation(&found)),
            rank_accurate: spearman(&same, &accurate),
            rank_twin: spearman(&own, &twin),
            rank_twin_interval: interval(three.len(), |drawn| resampled(drawn, 0)),
            more_than_balanced: interval(three.len(), |drawn| {
                Some(resampled(drawn, 0)? - resampled(drawn, 1)?)
            }),
            rank_twin_by_order: Order::ALL.map(of_order),
            lost_m: pair_loss(&own, &twin),
            lost_by_chance_m: pair_loss(&vec![0.0; twin.len()], &twin),
            best_lost_m: best
                .zip(least(&twin))
                .map(|(own, best)| twin[own] - twin[best]),
            best_rank_twin: best.map(|best| ranks(&twin)[best]),
            all_m,
        }
    }
}

/// Mean distance between the same vertices [mm], over the sequences that both have ended.
fn mean_distance(a: &[Option<End>], b: &[Option<End>], has: impl Fn(usize) -> bool) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for (a, b) in a.iter().zip(b) {
        if let (Some(a), Some(b)) = (a, b) {
            for (v, (x, y)) in a.positions.iter().zip(&b.positions).enumerate() {
                if has(v) {
                    sum += 1e3 * (Vec3::from(*x) - Vec3::from(*y)).norm();
                    count += 1;
                }
            }
        }
    }
    (count > 0).then(|| sum / f64::from(count))
}

fn report(scene: &Scene, paths: &[Sequence], rows: &[Row]) -> Report {
    let presses: usize = paths.iter().map(|path| path.vertices.len()).sum();
    let title = format!(
        "After half of the presses: {} vertices, {} paths of {:.1} presses on average",
        scene.lamina.vertex_count(),
        paths.len(),
        presses as f64 / paths.len() as f64
    );
    let half = agreements("half", title, rows, |row| &row.half);
    let end = agreements("end", "After all presses".into(), rows, |row| &row.end);
    let title =
        "Where the vertices lie then, mean distance from the same ones of the twin and of accurate";
    let places = Table::of("places", title, rows)
        .text("setting", |row| row.name)
        .text("diverged", |row| row.diverged)
        .number("off the twin inside", "mm", 3, |row| row.off_twin_mm[0])
        .number("outside", "mm", 3, |row| row.off_twin_mm[1])
        .number("off accurate inside", "mm", 3, |row| row.off_accurate_mm[0])
        .number("accurate outside", "mm", 3, |row| row.off_accurate_mm[1])
        .number("CPU", "s", 2, |row| row.cpu_s)
        .end();
    let all: Vec<(&Row, usize)> = (rows.iter())
        .flat_map(|row| (0..paths.len()).map(move |path| (row, path)))
        .collect();
    let all = Table::of("paths", "", &all)
        .text("setting", |(row, _)| row.name)
        .text("path", |(_, path)| *path)
        .text("order", |(_, path)| paths[*path].order.name())
        .text("presses", |(_, path)| paths[*path].vertices.len())
        .hidden("half way", "m", |(row, path)| row.half.all_m[*path])
        .hidden("left", "m", |(row, path)| row.end.all_m[*path])
        .end_hidden();
    let mut report = Report::new([half, end, places, all]);
    report.notes.push(
        "rank: correlation with the accurate setting and with the twin, 90 % of it over resampled \
         paths, and of how much it is more than that of balanced; lost: left more in the twin by \
         this setting's choice of two paths, and by a choice by chance; best: by its best path"
            .into(),
    );
    report.fact("vertices", scene.lamina.vertex_count());
    let lists: Vec<_> = paths.iter().map(|path| &path.vertices).collect();
    report.fact("sequences", lists);
    let halves = scatter(paths, rows, "after half of the presses", |row| &row.half);
    let ends = scatter(paths, rows, "after all presses", |row| &row.end);
    report.image("scatter.png", Image::beside(&[halves, ends]));
    report
}

fn agreements(
    name: &'static str,
    title: String,
    rows: &[Row],
    of: fn(&Row) -> &Agreement,
) -> Table {
    let span = |interval: Option<[f64; 2]>| {
        interval.map_or("-".into(), |[low, high]| format!("{low:.2} .. {high:.2}"))
    };
    let table = Table::of(name, title, rows)
        .text("setting", |row| row.name)
        .number("left", "m", 4, |row| of(row).left_m.map(|left| left[0]))
        .number("deviation", "m", 4, |row| {
            of(row).left_m.map(|left| left[1])
        })
        .number("rank accurate", "", 3, |row| of(row).rank_accurate)
        .number("rank twin", "", 3, |row| of(row).rank_twin)
        .text("rank twin 90 %", |row| span(of(row).rank_twin_interval))
        .text("over balanced 90 %", |row| span(of(row).more_than_balanced))
        .number("lost", "m", 4, |row| of(row).lost_m)
        .number("by chance", "m", 4, |row| of(row).lost_by_chance_m)
        .number("best lost", "m", 4, |row| of(row).best_lost_m)
        .number("best rank", "", 1, |row| of(row).best_rank_twin);
    let by_order = Order::ALL.into_iter().enumerate();
    let table = by_order.fold(table, |table, (k, order)| {
        table.hidden(format!("rank twin {}", order.name()), "", move |row| {
            of(row).rank_twin_by_order[k]
        })
    });
    table.end()
}

/// Every path as a dot: distance left in the twin over that in the fast solver.
fn scatter(paths: &[Sequence], rows: &[Row], when: &str, of: fn(&Row) -> &Agreement) -> Image {
    let row = |name: &str| {
        let row = rows.iter().find(|row| row.name == name);
        &of(row.expect("the study has this setting")).all_m
    };
    let (fast, twin) = (row(BALANCED), row(TWIN));
    let mut series = Vec::new();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (order, color) in Order::ALL.into_iter().zip(SERIES) {
        let mut points = Vec::new();
        for ((fast, twin), path) in fast.iter().zip(twin).zip(paths) {
            if let (Some(x), Some(y), true) = (*fast, *twin, path.order == order) {
                // A dot is a curve of one point.
                points.extend([[x, y], [f64::NAN; 2]]);
                (low, high) = (low.min(x).min(y), high.max(x).max(y));
            }
        }
        series.push(Series {
            label: order.name().into(),
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

#[cfg(test)]
mod tests;
