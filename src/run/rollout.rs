use std::sync::Arc;

use serde::Serialize;

use crate::env::{Draping, End, EnvConfig, EnvError, Tasks};
use crate::math::{Purpose, Stream, Vec3};
use crate::path::{PressedPoint, strokes};
use crate::scene::Scene;
use crate::sim::Snapshot;

/// How an episode went.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EpisodeSummary {
    /// 1 - D_T / D_init of the region [-].
    pub score: f64,
    /// Summed distance of the region to the tool at the start and at the end [m].
    pub region_initial_m: f64,
    pub region_final_m: f64,
    /// The same of the whole sheet [m].
    pub sheet_initial_m: f64,
    pub sheet_final_m: f64,
    /// Vertices of the region, all eight neighbours within it, that are not draped.
    pub undraped_inner: usize,
    /// Presses.
    pub steps: usize,
    /// Presses that the stencil did not reach in contact.
    pub jumps: usize,
    /// 95th percentile and maximum of the absolute yarn strain of the whole sheet [-].
    pub strain_p95: f64,
    pub strain_max: f64,
    /// Root mean square speed at the end [mm/s].
    pub v_rms_mm_s: f64,
    /// Wall-clock time of the episode, without watching it; of several at once, its share.
    pub seconds: f64,
}

/// An episode played out.
#[derive(Clone, Debug)]
pub struct Played {
    pub summary: EpisodeSummary,
    /// Vertices in the order they were pressed.
    pub vertices: Vec<u32>,
    /// Where on the tool each was pressed.
    pub points: Vec<PressedPoint>,
    /// The cloth at the end.
    pub state: Snapshot,
}

/// An episode that did not come to its end.
#[derive(Debug, thiserror::Error)]
pub enum RolloutError {
    #[error(transparent)]
    Env(#[from] EnvError),
    #[error("the simulation diverged after {steps} steps")]
    Diverged { steps: usize },
    #[error(
        "step {step} (from 0) of the sequence presses vertex {vertex}, which is not allowed there"
    )]
    Forbidden { step: usize, vertex: u32 },
    #[error("the sequence ends after {steps} steps, before the episode does")]
    Short { steps: usize },
    #[error("the episode is over after {steps} steps, the sequence has {found}")]
    Long { steps: usize, found: usize },
}

/// Presses farther apart than this many stencils are joined by a jump.
const JUMP: f64 = 1.0;

/// Where on the tool a press on `vertex` lands.
fn pressed(draping: &Draping, index: usize, vertex: u32) -> PressedPoint {
    let x = Vec3::from(draping.position(index, vertex));
    let surface = draping.scene().tool.surface.project(x);
    PressedPoint {
        vertex,
        position: surface.position,
        normal: surface.normal,
    }
}

/// Plays one episode in the only environment of `draping`, from its start. `choose` gives the
/// action for what is seen, `watch` is called before each press and at the end.
pub fn play(
    draping: &mut Draping,
    mut choose: impl FnMut(&Draping, usize) -> Result<u32, RolloutError>,
    mut watch: impl FnMut(&Draping, &[PressedPoint]),
) -> Result<Played, RolloutError> {
    let mut seconds = 0.0;
    draping.reset(0);
    let mut points = Vec::new();
    let mut vertices = Vec::new();
    loop {
        watch(draping, &points);
        let start = std::time::Instant::now();
        let action = choose(draping, points.len())?;
        let vertex = draping
            .vertex(action)
            .expect("allowed actions have a vertex");
        points.push(pressed(draping, 0, vertex));
        vertices.push(vertex);
        let outcome = draping.step(&[action]).swap_remove(0);
        seconds += start.elapsed().as_secs_f64();
        match outcome.episode.map(|episode| episode.end) {
            None => {}
            Some(End::Terminated | End::Truncated) => break,
            Some(End::Diverged) => {
                return Err(RolloutError::Diverged {
                    steps: points.len(),
                });
            }
        }
    }
    let mut summary = summarise(draping, 0, &points);
    summary.seconds = seconds;
    let state = draping
        .finished(0)
        .expect("the episode is over")
        .state
        .clone();
    Ok(Played {
        summary,
        vertices,
        points,
        state,
    })
}

/// How far a loosely replayed sequence was followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Followed {
    /// Presses of the sequence.
    pub stored: usize,
    /// Those of them that were played, in their order.
    pub followed: usize,
    /// Presses that were played after them, on what they had left untouched.
    pub added: usize,
}

impl Followed {
    /// Compares a sequence with what [`replay_loosely`] or [`replay`] has made of it.
    pub fn of(sequence: &[u32], played: &[u32]) -> Self {
        let mut rest = sequence.iter();
        // A press that was left out is never the next one played: that one was allowed.
        let is_next = |vertex: &&u32| rest.any(|stored| stored == *vertex);
        let followed = played.iter().take_while(is_next).count();
        Self {
            stored: sequence.len(),
            followed,
            added: played.len() - followed,
        }
    }

    /// Whether what was played is the sequence.
    pub fn is_whole(&self) -> bool {
        self.followed == self.stored && self.added == 0
    }
}

/// Plays a sequence of vertices under other physics than it was found in, where the stencil
/// may cover other vertices and strokes may end elsewhere: a vertex that is not allowed when its
/// turn comes is left out, and what the sequence leaves untouched is pressed after it, in the
/// order of the vertices. [`Followed`] counts both.
pub fn replay_loosely(
    draping: &mut Draping,
    sequence: &[u32],
    watch: impl FnMut(&Draping, &[PressedPoint]),
) -> Result<Played, RolloutError> {
    let mut rest = sequence.iter();
    let choose = |draping: &Draping, _| {
        let mask = &draping.observation(0).mask;
        let allowed = |&vertex: &u32| {
            let action = draping.action(vertex)?;
            mask.contains(action as usize).then_some(action)
        };
        let lowest = || mask.minimum().expect("a mask is never empty") as u32;
        Ok(rest.by_ref().find_map(allowed).unwrap_or_else(lowest))
    };
    play(draping, choose, watch)
}

/// Plays a sequence of vertices again.
pub fn replay(
    draping: &mut Draping,
    sequence: &[u32],
    watch: impl FnMut(&Draping, &[PressedPoint]),
) -> Result<Played, RolloutError> {
    let choose = |draping: &Draping, step: usize| {
        let vertex = *sequence
            .get(step)
            .ok_or(RolloutError::Short { steps: step })?;
        draping
            .action(vertex)
            .filter(|&action| draping.observation(0).mask.contains(action as usize))
            .ok_or(RolloutError::Forbidden { step, vertex })
    };
    let played = play(draping, choose, watch)?;
    let (steps, found) = (played.vertices.len(), sequence.len());
    if steps < found {
        return Err(RolloutError::Long { steps, found });
    }
    Ok(played)
}

/// `count` episodes of the masked random policy: what learning has to beat.
pub fn random_episodes(
    scene: &Arc<Scene>,
    config: &EnvConfig,
    count: usize,
    seed: u64,
) -> Result<Vec<EpisodeSummary>, RolloutError> {
    let choose = |draping: &Draping, streams: &mut [Stream]| -> Vec<u32> {
        let draw = |(index, stream): (usize, &mut Stream)| {
            let mask = &draping.observation(index).mask;
            let chosen = stream.below(mask.count_ones(..));
            mask.ones().nth(chosen).expect("a mask is never empty") as u32
        };
        streams.iter_mut().enumerate().map(draw).collect()
    };
    parallel_episodes(scene, config, count, seed, choose)
}

/// `count` episodes at once, each with a random stream of its own. `choose` gives one action
/// an environment. Diverged episodes are left out.
pub fn parallel_episodes(
    scene: &Arc<Scene>,
    config: &EnvConfig,
    count: usize,
    seed: u64,
    mut choose: impl FnMut(&Draping, &mut [Stream]) -> Vec<u32>,
) -> Result<Vec<EpisodeSummary>, RolloutError> {
    if count == 0 {
        return Ok(Vec::new());
    }
    let start = std::time::Instant::now();
    let mut draping = Draping::new(scene.clone(), config, count)?;
    let mut streams: Vec<Stream> = (0..count)
        .map(|index| Stream::new(seed, Purpose::Evaluation, index as u32))
        .collect();
    let mut points: Vec<Vec<PressedPoint>> = vec![Vec::new(); count];
    let mut summaries: Vec<Option<EpisodeSummary>> = vec![None; count];
    let mut open = count;
    let mut over = vec![false; count];
    while open > 0 {
        let actions = choose(&draping, &mut streams);
        for (index, &action) in actions.iter().enumerate() {
            let vertex = draping
                .vertex(action)
                .expect("allowed actions have a vertex");
            points[index].push(pressed(&draping, index, vertex));
        }
        let outcomes = draping.step(&actions);
        for (index, outcome) in outcomes.into_iter().enumerate() {
            let Some(episode) = outcome.episode else {
                continue;
            };
            if !over[index] {
                over[index] = true;
                open -= 1;
                if episode.end != End::Diverged {
                    let mut summary = summarise(&draping, index, &points[index]);
                    summary.seconds = start.elapsed().as_secs_f64() / count as f64;
                    summaries[index] = Some(summary);
                }
            }
            points[index].clear();
        }
    }
    Ok(summaries.into_iter().flatten().collect())
}

/// Measures the episode that has just ended in environment `index`.
fn summarise(draping: &Draping, index: usize, points: &[PressedPoint]) -> EpisodeSummary {
    let scene = draping.scene();
    let finished = draping.finished(index).expect("the episode is over");
    let at_start = scene.summary(&scene.initial);
    let at_end = scene.summary(&finished.state);
    let region_initial_m = draping.initial_distance();
    let region_final_m = draping.region_distance(&finished.state);
    let region: std::collections::BTreeSet<u32> = draping.region_vertices().collect();
    let inner = |&v: &u32| {
        let mut near = scene.lamina.neighbors(v);
        scene.lamina.neighbors(v).count() == 8 && near.all(|n| region.contains(&n))
    };
    let undraped = |v: &u32| !finished.draped.contains(*v as usize);
    let join = JUMP * draping.config().stencil_mm * 1e-3;
    let strokes =
        strokes(points, join).map_or(0, |path| path.iter().filter(|p| p.starts_stroke).count());
    EpisodeSummary {
        score: 1.0 - region_final_m / region_initial_m,
        region_initial_m,
        region_final_m,
        sheet_initial_m: at_start.distance_m,
        sheet_final_m: at_end.distance_m,
        undraped_inner: region.iter().filter(|v| undraped(v) && inner(v)).count(),
        steps: points.len(),
        jumps: strokes.saturating_sub(1),
        strain_p95: at_end.strain_p95,
        strain_max: at_end.strain_max,
        v_rms_mm_s: at_end.v_rms_mm_s,
        seconds: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presses_that_were_left_out_and_added_are_counted() {
        for (played, followed, added) in [
            (&[7, 3, 9, 1][..], 4, 0),
            // 3 was not allowed any more, and what it had left was pressed last.
            (&[7, 9, 1, 2, 3], 3, 2),
            // The episode was over before the sequence.
            (&[7, 3], 2, 0),
            // Nothing but the first was allowed: 9 as an addition is no part of the sequence.
            (&[7, 0, 9], 1, 2),
            (&[0], 0, 1),
        ] {
            let found = Followed::of(&[7, 3, 9, 1], played);
            let expected = Followed {
                stored: 4,
                followed,
                added,
            };
            assert_eq!(found, expected);
            assert_eq!(found.is_whole(), (followed, added) == (4, 0));
        }
    }
}
