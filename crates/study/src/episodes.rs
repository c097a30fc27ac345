//! Whole episodes in fixed orders of pressing: whether the states they end in can be believed,
//! and how much the order matters.
//!
//! Three orders: masked random; straight sweeps, one direction an episode; and outwards from a
//! place, one place of a 7 x 7 grid an episode (some twice where there are more episodes). All are played under the rules of the task, on
//! the allowed vertex that comes first, by rows and columns.

use std::f64::consts::TAU;
use std::sync::Arc;

use serde::Serialize;

use drape_cloth::math::{Isa, Purpose, Stream};
use drape_cloth::scene::{Scene, Summary};
use drape_cloth::sim::{Snapshot, alone};
use drape_task::env::{Draping, End, EnvConfig, EnvError, Episode, Tasks};

/// Time to come to rest after an episode [s].
const REST: f64 = 0.25;

/// An order in which an episode presses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    Random,
    Sweep,
    Outwards,
}

impl Order {
    /// All orders.
    pub const ALL: [Self; 3] = [Self::Random, Self::Sweep, Self::Outwards];
}

/// The state after an episode.
#[derive(Clone, Debug, Serialize)]
pub struct Ended {
    /// Whether the simulation was lost.
    pub diverged: bool,
    pub steps: usize,
    /// Summed distance of the region to the tool [m].
    pub region_m: f64,
    /// Touched vertices which are not draped.
    pub undraped: usize,
    #[serde(flatten)]
    pub summary: Summary,
    /// Root mean square speed [mm/s] a quarter of a second later.
    pub rest_v_rms_mm_s: f64,
    /// Greatest tensile strain of a yarn edge [-] then.
    pub rest_tension_max: f64,
    /// Share of the blank's yarn edges compressed by more than 5 %: crushed surplus.
    pub crushed_share: f64,
}

/// What an order has led to.
#[derive(Clone, Debug, Serialize)]
pub struct Played {
    pub order: Order,
    /// Summed distance of the region at the start [m].
    pub initial_m: f64,
    pub episodes: Vec<Ended>,
}

/// Plays `count` episodes in `order`. `progress` is told the number of steps taken.
pub fn play(
    scene: &Arc<Scene>,
    config: &EnvConfig,
    order: Order,
    count: usize,
    seed: u64,
    progress: impl FnMut(usize),
) -> Result<Played, EnvError> {
    let mut ended: Vec<Option<Ended>> = vec![None; count];
    let orders = (order, count, seed);
    let env = play_out(scene, config, orders, progress, |env, index, episode| {
        let finished = env.finished(index).expect("an episode has ended");
        let undraped = finished.touched.difference(&finished.draped).count();
        ended[index] = Some(Ended {
            diverged: episode.end == End::Diverged,
            steps: episode.actions.len(),
            region_m: env.region_distance(&finished.state),
            undraped,
            ..measure(scene, config, &finished.state)
        });
    })?;
    Ok(Played {
        order,
        initial_m: env.initial_distance(),
        episodes: ended.into_iter().flatten().collect(),
    })
}

/// The vertices that `count` episodes in `order` press, each in its order. Without those in
/// which the simulation was lost.
pub fn sequences(
    scene: &Arc<Scene>,
    config: &EnvConfig,
    order: Order,
    count: usize,
    seed: u64,
) -> Result<Vec<Vec<u32>>, EnvError> {
    let mut pressed = vec![Vec::new(); count];
    let orders = (order, count, seed);
    play_out(
        scene,
        config,
        orders,
        |_| {},
        |env, index, episode| {
            if episode.end != End::Diverged {
                let vertices = episode.actions.iter().map(|&action| env.vertex(action));
                pressed[index] = vertices.flatten().collect();
            }
        },
    )?;
    pressed.retain(|sequence| !sequence.is_empty());
    Ok(pressed)
}

/// Plays `count` episodes in an order under a seed. `progress` is told the number of steps
/// taken, `ended` the first episode of every environment when it ends.
fn play_out(
    scene: &Arc<Scene>,
    config: &EnvConfig,
    (order, count, seed): (Order, usize, u64),
    mut progress: impl FnMut(usize),
    mut ended: impl FnMut(&Draping, usize, &Episode),
) -> Result<Draping, EnvError> {
    let mut env = Draping::new(scene.clone(), config, count)?;
    let mut streams: Vec<Stream> = (0..count)
        .map(|index| Stream::new(seed, Purpose::Evaluation, index as u32))
        .collect();
    let mut is_over = vec![false; count];
    let mut steps = 0;
    while is_over.contains(&false) {
        let choose = |(index, stream): (usize, &mut Stream)| {
            let share = index as f64 / count as f64;
            choose(&env, index, order, share, stream)
        };
        let actions: Vec<u32> = streams.iter_mut().enumerate().map(choose).collect();
        for (index, outcome) in env.step(&actions).into_iter().enumerate() {
            if let (Some(episode), false) = (outcome.episode, is_over[index]) {
                ended(&env, index, &episode);
                is_over[index] = true;
            }
        }
        steps += 1;
        progress(steps);
    }
    Ok(env)
}

/// The allowed action that comes first in `order`; `share` 0..1 of the episodes came before.
fn choose(env: &Draping, index: usize, order: Order, share: f64, stream: &mut Stream) -> u32 {
    let mask = &env.observation(index).mask;
    let shape = env.shape();
    let (columns, rows) = (shape.columns as f64, shape.rows as f64);
    let pixel = |p: usize| ((p % shape.columns) as f64, (p / shape.columns) as f64);
    let first = |rank: &dyn Fn(f64, f64) -> f64| {
        let by_rank = |a: &usize, b: &usize| {
            let [a, b] = [*a, *b].map(|p| {
                let (x, y) = pixel(p);
                rank(x, y)
            });
            a.total_cmp(&b)
        };
        mask.ones().min_by(by_rank)
    };
    let chosen = match order {
        Order::Random => mask.ones().nth(stream.below(mask.count_ones(..))),
        Order::Sweep => {
            let (sin, cos) = (TAU * share).sin_cos();
            first(&|x, y| cos * x + sin * y)
        }
        Order::Outwards => {
            let place = 49.0 * share;
            let (across, along) = ((place % 7.0).floor() / 6.0, (place / 7.0).floor() / 6.0);
            first(&|x, y| (x - across * (columns - 1.0)).hypot(y - along * (rows - 1.0)))
        }
    };
    chosen.expect("a mask is never empty") as u32
}

fn measure(scene: &Scene, config: &EnvConfig, state: &Snapshot) -> Ended {
    let strain = scene.lamina.yarn_strain(&state.position);
    let crushed = strain.iter().filter(|&&strain| strain < -0.05).count();
    let mut cloth = alone(&scene.model, Isa::best());
    cloth.load(0, state);
    let control = config.stepping().control(REST);
    cloth.step(&scene.model, &scene.tool, &control, &[]);
    let rested = cloth.snapshot(0);
    let strain = scene.lamina.yarn_strain(&rested.position);
    Ended {
        diverged: false,
        steps: 0,
        region_m: 0.0,
        undraped: 0,
        summary: scene.summary(state),
        rest_v_rms_mm_s: 1e3 * rested.v_rms(),
        rest_tension_max: strain.iter().copied().fold(0.0, f64::max),
        crushed_share: crushed as f64 / strain.len() as f64,
    }
}
