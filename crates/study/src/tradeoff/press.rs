//! Fixed sequences of presses, and what they lead to.

use std::f64::consts::TAU;
use std::sync::Arc;

use cpu_time::ProcessTime;

use crate::points::nearest;
use drape_cloth::fabric::Lamina;
use drape_cloth::file::ValueError;
use drape_cloth::math::{Isa, Purpose, Stream};
use drape_cloth::scene::Scene;
use drape_cloth::sim::Precision;
use drape_task::env::{Draping, EnvConfig};

/// Sequences, the same places in every one.
const SEQUENCES: usize = 8;

/// Environments stepped together at least, as training does.
const ENVIRONMENTS: usize = 16;

/// What the sequences have led to.
pub struct Pressed {
    pub scene: Arc<Scene>,
    /// CPU time of an environment step, the median over the steps [us].
    pub microseconds: f64,
    /// The first sequence after its first row of presses.
    pub early: Option<Vec<[f64; 3]>>,
    /// The end of every sequence; none where it diverged.
    pub ends: Vec<Option<Vec<[f64; 3]>>>,
}

/// Places on the flat blank [m], in the order of pressing: every second row and column of the
/// region. The first is a straight sweep along the rows, then follow sweeps the other way, along
/// the columns, along a diagonal, from the middle and back, and two random orders.
pub fn sequences(lamina: &Lamina, env: &EnvConfig) -> Result<Vec<Vec<[f64; 2]>>, ValueError> {
    let region = env.region(lamina)?;
    let mut vertices: Vec<usize> = region.vertices.ones().collect();
    let every_second = |v: &usize| lamina.place(*v as u32).iter().all(|k| k % 2 == 0);
    if vertices.iter().any(every_second) {
        vertices.retain(every_second);
    }
    let middle = [&region.rows, &region.columns].map(|r| (r.start + r.end - 1) as f64 / 2.0);
    let order = |number: usize| {
        let mut sorted = vertices.clone();
        let rank = |v: usize| {
            let [row, column] = lamina.place(v as u32).map(|k| k as f64);
            let outwards = (row - middle[0]).hypot(column - middle[1]);
            let (sin, cos) = (0.11 * TAU).sin_cos();
            match number {
                0 => row,
                1 => -row,
                2 => column,
                3 => cos * column + sin * row,
                4 => outwards,
                _ => -outwards,
            }
        };
        // Ties stay row by row.
        sorted.sort_by(|&a, &b| rank(a).total_cmp(&rank(b)));
        if number > 5 {
            Stream::new(1, Purpose::Evaluation, number as u32).shuffle(&mut sorted);
        }
        sorted.into_iter().map(|v| lamina.rest[v]).collect()
    };
    Ok((0..SEQUENCES).map(order).collect())
}

/// Presses along every sequence from the scene's initial state. A group of lanes is timed as
/// training would step it, in f64 one environment alone.
pub fn press(
    scene: Arc<Scene>,
    env: &EnvConfig,
    sequences: &[Vec<[f64; 2]>],
) -> Result<Pressed, ValueError> {
    let count = match env.precision {
        Precision::F32 => ENVIRONMENTS.max(Isa::best().lanes()),
        Precision::F64 => sequences.len(),
    };
    let on_mesh = |places: &Vec<[f64; 2]>| {
        let nearest = places.iter().map(|at| nearest(&scene.lamina.rest, *at));
        nearest.collect::<Vec<u32>>()
    };
    let vertices: Vec<Vec<u32>> = sequences.iter().map(on_mesh).collect();
    let lists = vertices.iter().map(|list| &**list).cycle().take(count);
    let lists: Vec<&[u32]> = lists.collect();
    let length = lists[0].len();
    let row = (length as f64).sqrt().round() as usize;

    let mut draping = Draping::new(scene.clone(), env, count)?;
    let (mut early, mut ends) = (None, vec![None; sequences.len()]);
    let mut times = Vec::with_capacity(length);
    // What is observed of the last press is over; between it and the next is the step itself.
    let mut last = ProcessTime::now();
    draping.replay(&lists, |draping, index, presses| {
        if presses > times.len() {
            times.push(1e6 * last.elapsed().as_secs_f64() / count as f64);
        }
        if presses == row && index == 0 {
            early = Some(draping.state(0).position);
        }
        if presses == length && index < ends.len() {
            ends[index] = Some(draping.state(index).position);
        }
        last = ProcessTime::now();
    });
    times.sort_by(f64::total_cmp);
    Ok(Pressed {
        microseconds: times.get(times.len() / 2).copied().unwrap_or(f64::NAN),
        scene,
        early,
        ends,
    })
}
