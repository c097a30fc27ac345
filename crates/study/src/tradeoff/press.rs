use std::f64::consts::TAU;
use std::sync::Arc;

use cpu_time::ProcessTime;

use crate::nearest;
use drape_cloth::fabric::Lamina;
use drape_cloth::math::{Isa, Purpose, Stream};
use drape_cloth::scene::Scene;
use drape_cloth::sim::Precision;
use drape_task::env::{Draping, EnvConfig, EnvError};

/// Fixed sequences of presses, the same places in every one.
pub(super) const SEQUENCES: usize = 8;

/// Environments stepped together at least, as training does.
const ENVIRONMENTS: usize = 16;

/// What the sequences have led to.
pub(super) struct Pressed {
    /// CPU time of an environment step, the median over the steps [us].
    pub microseconds: f64,
    /// The first sequence after its first row of presses.
    pub early: Option<Vec<[f64; 3]>>,
    /// The end of every sequence; none where a state was lost.
    pub ends: Vec<Option<Vec<[f64; 3]>>>,
}

/// Places on the flat blank [m], in the order of pressing: every second row and column of the
/// region. The first is a straight sweep along the rows, then follow sweeps the other way, along the
/// columns, along a diagonal, from the middle and back, and two random orders.
pub(super) fn sequences(lamina: &Lamina, env: &EnvConfig) -> Result<Vec<Vec<[f64; 2]>>, EnvError> {
    let region = env.region(lamina)?;
    let mut vertices: Vec<usize> = region.vertices.ones().collect();
    let every_second = |v: &usize| lamina.place(*v as u32).iter().all(|k| k % 2 == 0);
    if vertices.iter().any(every_second) {
        vertices.retain(every_second);
    }
    let middle = [&region.rows, &region.columns].map(|r| (r.start + r.end - 1) as f64 / 2.0);
    let order = |number: usize| {
        let mut sorted = vertices.clone();
        let place = |v: usize| lamina.place(v as u32).map(|k| k as f64);
        let rank = |v: usize| {
            let [row, column] = place(v);
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
pub(super) fn press(
    scene: &Arc<Scene>,
    env: &EnvConfig,
    sequences: &[Vec<[f64; 2]>],
) -> Result<Pressed, EnvError> {
    let count = match env.precision {
        Precision::F32 => ENVIRONMENTS.max(Isa::best().lanes()),
        Precision::F64 => sequences.len(),
    };
    let mut draping = Draping::new(scene.clone(), env, count)?;
    let vertices: Vec<Vec<u32>> = sequences
        .iter()
        .map(|places| {
            places
                .iter()
                .map(|at| nearest(&scene.lamina.rest, *at))
                .collect()
        })
        .collect();
    let length = vertices[0].len();
    let row = (length as f64).sqrt().round() as usize;
    let mut pressed = Pressed {
        microseconds: f64::NAN,
        early: None,
        ends: vec![None; sequences.len()],
    };
    let mut times = Vec::with_capacity(length);
    let mut is_sound = vec![true; sequences.len()];
    let positions = |draping: &Draping, is_sound: &[bool], index: usize| {
        is_sound[index].then(|| draping.state(index).position)
    };
    for step in 0..length {
        let sequences = vertices.iter().cycle().take(count);
        let actions: Vec<Option<u32>> = sequences.map(|sequence| Some(sequence[step])).collect();
        let start = ProcessTime::now();
        let sound = draping.press(&actions);
        times.push(1e6 * start.elapsed().as_secs_f64() / count as f64);
        for (known, sound) in is_sound.iter_mut().zip(sound) {
            *known &= sound;
        }
        if step + 1 == row {
            pressed.early = positions(&draping, &is_sound, 0);
        }
    }
    times.sort_by(f64::total_cmp);
    pressed.microseconds = times[length / 2];
    for (index, end) in pressed.ends.iter_mut().enumerate() {
        *end = positions(&draping, &is_sound, index);
    }
    Ok(pressed)
}
