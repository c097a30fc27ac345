//! Whether the preset matters for the task: fixed sequences of presses, played under several
//! settings of the fast solver and in the finite-element twin, and how far the settings agree
//! which sequence is the better one.
//!
//! Settings of the fast solver are the presets, `accurate` in f64, two rates between them and
//! Gauss-Seidel at the rate of `balanced`. All start from one state, that of the scene's fall: a training
//! has no other. The twin starts from where it has fallen itself, and once, for what the presses
//! alone do, from the fast solver's state. Time ends with the last press.

use std::sync::Arc;

use cpu_time::{ProcessTime, ThreadTime};
use rayon::prelude::*;
use serde::Serialize;

use super::episodes::{Order, sequences};
use super::points::distance;
use super::ranking::{interval, least, pair_loss, ranks, spearman};
use super::twin::{ACCELERATION, SPEED, TwinStudyError, fallen, lying, press_config, twin_config};
use drape_cloth::math::{Vec3, mean_and_deviation};
use drape_cloth::scene::Scene;
use drape_cloth::sim::{Accuracy, Solver, Stepping};
use drape_cloth::twin::{Hold, Twin, TwinConfig};
use drape_cloth::sim::Precision;
use drape_task::env::{Draping, EnvConfig, EnvError};

/// A strain that no draped vertex reaches: the rule of strain is off.
const ANY_STRAIN: f64 = 1e5;

/// A list of presses.
#[derive(Clone, Debug, Serialize)]
pub struct Sequence {
    pub order: Order,
    /// Vertices in the order they are pressed.
    pub vertices: Vec<u32>,
}

/// Where a sequence has led to.
#[derive(Clone, Debug, PartialEq)]
pub struct End {
    /// Summed distance left in the region after half of the presses, rounded up [m].
    pub half: f64,
    /// Summed distance left in the region [m].
    pub left: f64,
    /// Position of every vertex [m].
    pub positions: Vec<[f64; 3]>,
}

/// The same presses by whatever computes them.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Setting {
    Fast(Fast),
    Twin(Twinned),
}

/// A way of stepping the fast solver.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Fast {
    solver: Solver,
    stepping: Stepping,
    precision: Precision,
    any_strain: bool,
}

/// A way of pressing in the twin.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Twinned {
    hold: Hold,
    accelerated: bool,
    /// Starts where the fast solver's fall has ended.
    starts_as_fast: bool,
}

/// The preset that trains, under which paths are found.
pub const BALANCED: &str = "balanced";
/// What the rank correlations hold settings against.
const ACCURATE: &str = "accurate";
pub const TWIN: &str = "twin";

fn settings() -> Vec<(&'static str, Setting)> {
    let preset = |preset: Accuracy| Fast {
        solver: Solver::Yarn,
        stepping: preset.stepping(),
        precision: Precision::F32,
        any_strain: false,
    };
    let balanced = preset(Accuracy::Balanced);
    let yarn = |rate| Fast {
        stepping: Stepping::every(rate, 5),
        ..balanced
    };
    let twin = Twinned {
        hold: Hold::Fixed,
        accelerated: false,
        starts_as_fast: false,
    };
    vec![
        ("fast", Setting::Fast(preset(Accuracy::Fast))),
        (BALANCED, Setting::Fast(balanced)),
        (
            "balanced_any_strain",
            Setting::Fast(Fast {
                any_strain: true,
                ..balanced
            }),
        ),
        ("yarn_1200", Setting::Fast(yarn(1200.0))),
        ("yarn_2400", Setting::Fast(yarn(2400.0))),
        (
            ACCURATE,
            Setting::Fast(Fast {
                precision: Precision::F64,
                ..preset(Accuracy::Accurate)
            }),
        ),
        (
            "gauss_seidel",
            Setting::Fast(Fast {
                solver: Solver::GaussSeidel,
                ..balanced
            }),
        ),
        (TWIN, Setting::Twin(twin)),
        (
            "twin_pressure",
            Setting::Twin(Twinned {
                hold: Hold::Pressure,
                ..twin
            }),
        ),
        (
            "twin_accelerated",
            Setting::Twin(Twinned {
                accelerated: true,
                ..twin
            }),
        ),
        (
            "twin_same_start",
            Setting::Twin(Twinned {
                starts_as_fast: true,
                ..twin
            }),
        ),
    ]
}

/// How a setting judges the sequences, by the distance left at some time.
#[derive(Clone, Debug, Serialize)]
pub struct Agreement {
    /// Summed distance left in the region, mean and standard deviation over the sequences [m].
    pub mean_left_m: Option<f64>,
    pub deviation_left_m: Option<f64>,
    /// Spearman's with the accurate setting and with the twin, by the distance left.
    pub rank_correlation_accurate: Option<f64>,
    pub rank_correlation_twin: Option<f64>,
    /// The middle 90 % of the latter over resampled sequences, and of how much more it is than
    /// that of `balanced` in the same resamples.
    pub rank_correlation_twin_interval: Option<[f64; 2]>,
    pub more_than_balanced_interval: Option<[f64; 2]>,
    /// The correlation with the twin among the sequences of each order.
    pub rank_correlation_twin_by_order: Vec<(Order, Option<f64>)>,
    /// More distance left in the twin [m], on average over all pairs of sequences, when the one
    /// that this setting finds better is taken, than by the better one.
    pub lost_m: Option<f64>,
    /// The same when either is taken by chance.
    pub lost_by_chance_m: Option<f64>,
    /// More distance left in the twin by this setting's best sequence than by the twin's best [m].
    pub best_lost_m: Option<f64>,
    /// Rank in the twin of this setting's best sequence, 1 for the best.
    pub best_rank_twin: Option<f64>,
    pub is_best_among_3: Option<bool>,
    /// Distance left by every sequence [m].
    pub left_m: Vec<Option<f64>>,
}

/// What a setting has found.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub name: &'static str,
    /// What it is.
    pub what: String,
    /// Sequences in which the simulation was lost; they count in no figure.
    pub diverged: usize,
    /// Summed distance of the region before the first press [m].
    pub initial_m: f64,
    /// After all presses.
    #[serde(flatten)]
    pub end: Agreement,
    /// After half of them.
    pub halfway: Agreement,
    /// Mean distance of the same vertices from where the twin and the accurate setting have them
    /// in the end, inside and outside the region [mm].
    pub inside_mm: Option<f64>,
    pub outside_mm: Option<f64>,
    pub inside_accurate_mm: Option<f64>,
    pub outside_accurate_mm: Option<f64>,
    /// CPU time of all presses of all sequences [s].
    pub cpu_s: f64,
}

/// What the study has found.
#[derive(Clone, Debug, Serialize)]
pub struct Transfer {
    pub sequences: Vec<Sequence>,
    /// CPU time of the twin's fall [s].
    pub twin_fall_cpu_s: f64,
    pub settings: Vec<Row>,
}

/// About `count` sequences, of every order as many, found under the preset `balanced`.
pub fn generate(
    scene: &Arc<Scene>,
    env: &EnvConfig,
    count: usize,
    seed: u64,
) -> Result<Vec<Sequence>, EnvError> {
    let mut env = env.clone();
    env.set_accuracy(Accuracy::Balanced);
    let mut all = Vec::new();
    for (k, order) in Order::ALL.into_iter().enumerate() {
        let share = (count + Order::ALL.len() - 1 - k) / Order::ALL.len();
        if share > 0 {
            let found = sequences(scene, &env, order, share, seed)?;
            all.extend(
                found
                    .into_iter()
                    .map(|vertices| Sequence { order, vertices }),
            );
        }
    }
    Ok(all)
}

/// Plays lists of presses in the fast solver, side by side in the lanes; none where it is lost.
/// A list without a press ends where it starts.
pub fn replay(
    scene: &Arc<Scene>,
    env: &EnvConfig,
    sequences: &[&[u32]],
) -> Result<Vec<Option<End>>, EnvError> {
    let mut draping = Draping::new(scene.clone(), env, sequences.len())?;
    let starts = sequences.iter().enumerate();
    let mut ends: Vec<Option<End>> = starts
        .map(|(index, sequence)| sequence.is_empty().then(|| ended(&draping, index, None)))
        .collect();
    let mut is_sound = vec![true; sequences.len()];
    let mut halves = vec![None; sequences.len()];
    let longest = sequences.iter().map(|s| s.len()).max().unwrap_or(0);
    for step in 0..longest {
        let vertices: Vec<Option<u32>> = (sequences.iter().zip(&is_sound))
            .map(|(sequence, &sound)| sequence.get(step).copied().filter(|_| sound))
            .collect();
        let sound = draping.press(&vertices);
        for (index, sequence) in sequences.iter().enumerate() {
            is_sound[index] &= sound[index];
            if is_sound[index] && sequence.len().div_ceil(2) == step + 1 {
                halves[index] = Some(draping.region_distance(&draping.state(index)));
            }
            if is_sound[index] && sequence.len() == step + 1 {
                ends[index] = Some(ended(&draping, index, halves[index]));
            }
        }
    }
    Ok(ends)
}

/// An environment's state as an end, `half` as it is now if it was not measured before.
fn ended(draping: &Draping, index: usize, half: Option<f64>) -> End {
    let state = draping.state(index);
    let left = draping.region_distance(&state);
    End {
        half: half.unwrap_or(left),
        left,
        positions: state.position,
    }
}

/// Plays all sequences under all settings. `progress` is told the share that is done.
pub fn transfer(
    scene: &Arc<Scene>,
    env: &EnvConfig,
    sequences: Vec<Sequence>,
    progress: impl Fn(f64),
) -> Result<Transfer, TwinStudyError> {
    let region = env.region(&scene.lamina)?.vertices;
    let lists: Vec<&[u32]> = sequences.iter().map(|s| &*s.vertices).collect();
    let config = twin_config(&scene.config)?;
    let start = ThreadTime::now();
    let rest = fallen(scene, &config)?.positions();
    let twin_fall_cpu_s = start.elapsed().as_secs_f64();

    let settings = settings();
    let mut played = Vec::new();
    for (done, &(_, setting)) in settings.iter().enumerate() {
        progress(done as f64 / settings.len() as f64);
        played.push(match setting {
            Setting::Fast(fast) => {
                let (scene, env) = changed(scene, env, fast);
                let start = ProcessTime::now();
                let ends = replay(&scene, &env, &lists)?;
                (ends, start.elapsed().as_secs_f64())
            }
            Setting::Twin(twinned) => {
                let case = TwinCase {
                    scene,
                    env,
                    config: &config,
                    rest: &rest,
                };
                case.play(twinned, &lists)?
            }
        });
    }
    let initial = |setting| {
        let positions = match setting {
            Setting::Twin(twinned) if !twinned.starts_as_fast => &rest,
            _ => &scene.initial.position,
        };
        distance(&scene.tool, region.ones(), positions)
    };
    let of = |wanted: &str| {
        let index = settings.iter().position(|(name, _)| *name == wanted);
        &played[index.expect("a setting of this name")].0
    };
    let is_inside = |v: usize| region.contains(v);
    let judge = Judge {
        balanced: of(BALANCED),
        accurate: of(ACCURATE),
        twin: of(TWIN),
        sequences: &sequences,
        is_inside: &is_inside,
    };
    let rows = settings.iter().zip(&played);
    let rows = rows.map(|(&(name, setting), (ends, cpu_s))| {
        judge.row(Played {
            name,
            what: describe(setting),
            initial_m: initial(setting),
            cpu_s: *cpu_s,
            ends,
        })
    });
    Ok(Transfer {
        settings: rows.collect(),
        twin_fall_cpu_s,
        sequences,
    })
}

fn describe(setting: Setting) -> String {
    match setting {
        Setting::Fast(fast) => {
            let solver = match fast.solver {
                Solver::Yarn => "yarn",
                Solver::GaussSeidel => "Gauss-Seidel",
            };
            let precision = match fast.precision {
                Precision::F32 => "f32",
                Precision::F64 => "f64",
            };
            let rule = if fast.any_strain {
                ", any strain drapes"
            } else {
                ""
            };
            let rate = fast.stepping.substep_rate;
            let interval = fast.stepping.control(1.0).contact_interval;
            format!("{solver}, {rate} substeps/s, planes every {interval}, {precision}{rule}")
        }
        Setting::Twin(twin) => {
            let hold = match twin.hold {
                Hold::Fixed => "draped vertices fixed",
                Hold::Pressure => "pressure stays",
            };
            let speed = if twin.accelerated {
                ", accelerated"
            } else {
                ""
            };
            let start = if twin.starts_as_fast {
                ", from the fast solver's state"
            } else {
                ""
            };
            format!("twin, {hold}{speed}{start}")
        }
    }
}

/// The scene and the environment stepped as `fast`.
fn changed(scene: &Arc<Scene>, env: &EnvConfig, fast: Fast) -> (Arc<Scene>, EnvConfig) {
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

/// The twin where sequences begin.
struct TwinCase<'a> {
    scene: &'a Scene,
    env: &'a EnvConfig,
    config: &'a TwinConfig,
    /// Where the twin has fallen to.
    rest: &'a [[f64; 3]],
}

impl TwinCase<'_> {
    /// Plays all sequences, each on a thread, with their CPU time [s].
    fn play(
        &self,
        setting: Twinned,
        lists: &[&[u32]],
    ) -> Result<(Vec<Option<End>>, f64), TwinStudyError> {
        let Self {
            scene,
            env,
            config,
            rest,
        } = *self;
        let region = env.region(&scene.lamina)?.vertices;
        let press = press_config(env, setting.hold, SPEED);
        let config = match setting.accelerated {
            true => config.accelerated(ACCELERATION),
            false => config.clone(),
        };
        let start = if setting.starts_as_fast {
            &scene.initial.position
        } else {
            rest
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
            let replay = twin.replay(lamina, tool, &press, (*list, side), watch);
            let end = replay.diverged.is_none().then(|| End {
                half,
                left: measure(&twin),
                positions: twin.positions(),
            });
            // What diverged early says nothing about the time that a list takes.
            let seconds = end.as_ref().map_or(0.0, |_| began.elapsed().as_secs_f64());
            Ok((end, seconds))
        };
        let ended: Result<Vec<_>, TwinStudyError> = lists.par_iter().map(play).collect();
        let (ends, seconds): (_, Vec<f64>) = ended?.into_iter().unzip();
        Ok((ends, seconds.iter().sum()))
    }
}

/// All sequences under a setting.
struct Played<'a> {
    name: &'static str,
    what: String,
    /// Summed distance of the region before the first press [m].
    initial_m: f64,
    /// CPU time of all [s].
    cpu_s: f64,
    ends: &'a [Option<End>],
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
    fn row(&self, played: Played) -> Row {
        let ends = played.ends;
        let away = |other: &[Option<End>], inside: bool| {
            mean_distance(ends, other, |v| (self.is_inside)(v) == inside)
        };
        Row {
            name: played.name,
            what: played.what,
            diverged: ends.iter().filter(|end| end.is_none()).count(),
            initial_m: played.initial_m,
            end: self.agreement(ends, |end| end.left),
            halfway: self.agreement(ends, |end| end.half),
            inside_mm: away(self.twin, true),
            outside_mm: away(self.twin, false),
            inside_accurate_mm: away(self.accurate, true),
            outside_accurate_mm: away(self.accurate, false),
            cpu_s: played.cpu_s,
        }
    }

    fn agreement(&self, ends: &[Option<End>], left: fn(&End) -> f64) -> Agreement {
        let left_m: Vec<Option<f64>> = ends.iter().map(|end| end.as_ref().map(left)).collect();
        let found: Vec<f64> = left_m.iter().flatten().copied().collect();
        let statistics = (!found.is_empty()).then(|| mean_and_deviation(&found));
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
            (order, spearman(&own, &twin))
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
        let best_twin = least(&twin);
        let rank = best.map(|best| ranks(&twin)[best]);
        Agreement {
            mean_left_m: statistics.map(|[mean, _]| mean),
            deviation_left_m: statistics.map(|[_, deviation]| deviation),
            rank_correlation_accurate: spearman(&same, &accurate),
            rank_correlation_twin: spearman(&own, &twin),
            rank_correlation_twin_interval: interval(three.len(), |drawn| resampled(drawn, 0)),
            more_than_balanced_interval: interval(three.len(), |drawn| {
                Some(resampled(drawn, 0)? - resampled(drawn, 1)?)
            }),
            rank_correlation_twin_by_order: Order::ALL.map(of_order).to_vec(),
            lost_m: pair_loss(&own, &twin),
            lost_by_chance_m: pair_loss(&vec![0.0; twin.len()], &twin),
            best_lost_m: (best.zip(best_twin)).map(|(own, best)| twin[own] - twin[best]),
            best_rank_twin: rank,
            is_best_among_3: rank.map(|rank| rank <= 3.0),
            left_m,
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

#[cfg(test)]
mod tests;
