//! Lists of presses, played in the fast solver and in the twin.

use cpu_time::ThreadTime;

use crate::study::{Context, StudyError};
use crate::twin::fall::{lying, press_config, twin_config};
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::scene::Scene;
use drape_cloth::twin::Hold;
use drape_task::env::{Draping, EnvConfig};
use drape_task::path::{PathFigures, PressedPoint};

/// Where every vertex is [m].
pub type Positions = Vec<[f64; 3]>;

/// Where a list of presses has led to.
#[derive(Clone)]
pub struct Pressed {
    pub positions: Positions,
    /// Of the path over the tool; the twin does not tell them.
    pub path: PathFigures,
}

/// Plays lists of presses in the fast solver, side by side in the lanes; none where it diverges.
/// `observe` is told the number of presses made, after each of every list.
pub fn replay(
    draping: &mut Draping,
    lists: &[&[u32]],
    mut observe: impl FnMut(usize),
) -> Vec<Option<Pressed>> {
    let mut ends = vec![None; lists.len()];
    let mut points: Vec<Vec<PressedPoint>> = vec![Vec::new(); lists.len()];
    let join = draping.config().join_distance();
    draping.replay(lists, |draping, index, presses| {
        observe(presses);
        match lists[index].get(presses) {
            Some(&next) => points[index].push(draping.pressed_point(index, next)),
            None => {
                ends[index] = Some(Pressed {
                    positions: draping.state(index).position,
                    path: PathFigures::new(&points[index], join),
                });
            }
        }
    });
    ends
}

/// Plays lists of presses in the twin, each on a thread from rest at `start`; none where it
/// diverges. Gives the CPU time of the others [s] too.
pub fn replay_in_twin(
    scene: &Scene,
    env: &EnvConfig,
    start: &[[f64; 3]],
    lists: &[&[u32]],
    context: &Context,
) -> Result<(Vec<Option<Pressed>>, f64), StudyError> {
    let config = twin_config(&scene.config)?;
    let press = press_config(env, Hold::Fixed);
    let played = context.each(lists, |list| {
        let began = ThreadTime::now();
        let mut twin = lying(scene, &config, start)?;
        let presses = (*list, 1e-3 * env.stencil_mm);
        let ended = twin.replay(&scene.lamina, &scene.tool, &press, presses, |_| ());
        let pressed = ended.diverged.is_none().then(|| Pressed {
            positions: twin.positions(),
            path: PathFigures::default(),
        });
        Ok((pressed, began.elapsed().as_secs_f64()))
    });
    let played: Vec<_> = played.into_iter().collect::<Result<_, StudyError>>()?;
    let ended = played.iter().filter(|(pressed, _)| pressed.is_some());
    let seconds = ended.map(|(_, seconds)| seconds).sum();
    let ends = played.into_iter().map(|(pressed, _)| pressed);
    Ok((ends.collect(), seconds))
}

/// `positions` with every vertex that is not clamped pushed, normally distributed with a
/// micrometre: what that alone changes in the end, no error can be told below.
pub fn pushed(scene: &Scene, mut positions: Positions, stream: u32) -> Positions {
    const PUSH: f64 = 1e-6;
    let mut stream = Stream::new(1, Purpose::Evaluation, stream);
    for (v, x) in positions.iter_mut().enumerate() {
        if !scene.initial.fixed.contains(v) {
            *x = x.map(|x| x + PUSH * stream.normal());
        }
    }
    positions
}
