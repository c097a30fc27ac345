//! Lists of presses, played in the fast solver and in the twin.

use std::sync::{Arc, Mutex};

use cpu_time::ThreadTime;

use crate::twin::{fallen, lying, press_config, twin_config, twin_of};
use crate::{Listener, ProofError};
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::scene::{Misplacement, Scene};
use drape_cloth::sim::{Parameters, Presses, Snapshot};
use drape_cloth::twin::{Hold, Twin};
use drape_task::env::{Draping, EpisodeState, Task};
use drape_task::recording::Recording;

/// Where every vertex is [m].
pub type Positions = Vec<[f64; 3]>;

/// Presses lists of vertices in the fast solver, side by side in the lanes; none where it diverges.
/// `observe` is told the number of presses made, after each of every list.
pub fn replay(
    draping: &mut Draping,
    lists: &[&[u32]],
    mut observe: impl FnMut(usize),
) -> Vec<Option<EpisodeState>> {
    let mut ends = vec![None; lists.len()];
    draping.replay(lists, |draping, index, presses| {
        observe(presses);
        if presses == lists[index].len() {
            ends[index] = Some(draping.episode(index));
        }
    });
    ends
}

/// Presses lists of vertices in the twin, each on a thread from rest at the start of its task; none where it
/// diverges. `observe` is shown the number of a list and where it has come to, at its start and after each
/// press. Gives the CPU time of all that have come to their end [s] too.
pub fn replay_in_twin(
    lists: &[(&Task, &[u32])],
    observe: &(dyn Fn(usize, &EpisodeState) + Sync),
    listener: Listener,
) -> Result<(Vec<Option<EpisodeState>>, f64), ProofError> {
    let numbered: Vec<usize> = (0..lists.len()).collect();
    let played = listener.each(&numbered, |&number| {
        let (task, list) = lists[number];
        let (scene, env) = (&task.scene, &task.config);
        let mut config = twin_config(&scene.config)?;
        config.parameters = env.parameters.clone();
        let press = press_config(env, Hold::Fixed);
        let began = ThreadTime::now();
        let mut twin = lying(scene, &config, &scene.initial.position)?;
        let state =
            |twin: &Twin, presses: &Presses| EpisodeState::new(presses.clone(), twin.snapshot());
        let shown = |twin: &Twin, presses: &Presses| observe(number, &state(twin, presses));
        let (lamina, tool, side) = (&scene.lamina, &scene.tool, 1e-3 * env.stencil_mm);
        let ended = twin.replay(lamina, tool, &press, list, side, shown);
        let ended = ended.ok().map(|presses| state(&twin, &presses));
        Ok((ended, began.elapsed().as_secs_f64()))
    });
    let played: Vec<_> = played.into_iter().collect::<Result<_, ProofError>>()?;
    let ended = played.iter().filter(|(ended, _)| ended.is_some());
    let seconds = ended.map(|(_, seconds)| seconds).sum();
    let ends = played.into_iter().map(|(ended, _)| ended);
    Ok((ends.collect(), seconds))
}

/// `scene` with its blank at rest in other places [m], clamps where they are there.
pub fn resting(scene: &Scene, position: Positions) -> Arc<Scene> {
    let fixed = scene.initial.fixed.clone();
    let at_rest = Snapshot::at_rest(position);
    let initial = Snapshot { fixed, ..at_rest };
    Arc::new(Scene {
        initial: initial.into(),
        ..scene.clone()
    })
}

/// `scene` with its blank where it comes to rest in the twin, so far off its place and of such a fabric.
///
/// # Errors
/// If the scene has what the twin has nothing for, or the fall diverges.
pub fn resting_in_twin(
    scene: &Scene,
    off: &Misplacement,
    fabric: &Parameters,
) -> Result<Arc<Scene>, ProofError> {
    let mut config = twin_of(scene)?;
    config.parameters = fabric.clone();
    Ok(resting(scene, fallen(scene, &config, off)?.positions()))
}

/// Presses what was recorded again, from where it began, in the same physics.
///
/// # Errors
/// If it diverges, or was recorded on another blank than that of `scene`.
pub fn again(
    recording: &Recording,
    scene: &Scene,
    listener: Listener,
) -> Result<Recording, ProofError> {
    if recording.rest != scene.lamina.rest || recording.tool != scene.tool.mesh {
        let fault = "recorded on another blank or tool than the scene's";
        return Err(ProofError::Invalid(fault));
    }
    if !scene.model.fits(&recording.start) {
        let fault = "its start is none of the scene's blank";
        return Err(ProofError::Invalid(fault));
    }
    let (env, vertices) = (&recording.env, recording.vertices());
    let begun = Arc::new(Scene {
        initial: recording.start.clone().into(),
        ..scene.clone()
    });
    // Scores count from where the twin rests, or from the start of the scene, of which the solver's own
    // is rounded.
    let of_scores = match recording.by_twin {
        true => begun.clone(),
        false => Arc::new(scene.clone()),
    };
    let task = Task::new(of_scores, env)?;
    let again = Mutex::new(Recording {
        by_twin: recording.by_twin,
        ..Recording::new(&task)
    });
    let see = |_: usize, episode: &EpisodeState| {
        let mut again = again.lock().expect("nobody panics");
        again.see(&task, episode);
        let share = again.presses.len() as f64 / vertices.len().max(1) as f64;
        listener.tell(share, "pressing again");
    };
    let has_ended = match recording.by_twin {
        true => replay_in_twin(&[(&task, &vertices)], &see, listener)?.0[0].is_some(),
        false => {
            let mut draping = Draping::new(begun, env, 1)?;
            let watch = |draping: &Draping, index, _| see(index, &draping.episode(index));
            draping.replay(&[&vertices], watch)[0].is_ok()
        }
    };
    match has_ended {
        true => Ok(again.into_inner().expect("nobody panics")),
        false => Err(ProofError::SolverDiverged),
    }
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
