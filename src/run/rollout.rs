use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::Serialize;

use drape_cloth::file::ValueError;
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::measure::{sheared, surplus};
use drape_cloth::scene::Scene;
use drape_cloth::sim::{Observation, Snapshot};
use drape_task::env::{
    Draping, End, EnvConfig, EpisodeState, Played, ReplayDiverged, Task, Tasks, most_environments,
};
use drape_task::path::PathFigures;
use drape_task::recording::Recording;

/// How an episode went.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EpisodeSummary {
    /// The share of the objective that is removed, see [`drape_task::env::score`].
    pub score: f64,
    /// Summed distance of the region to the tool at the start and at the end [m].
    pub region_initial_m: f64,
    pub region_final_m: f64,
    /// Mean surplus of the region's yarns at the start and at the end [m], see
    /// [`drape_cloth::measure::surplus`].
    pub surplus_initial_m: f64,
    pub surplus_final_m: f64,
    /// Distance of the whole sheet and mean surplus of all its yarns [m]: what was pushed out of
    /// the region is still there.
    pub sheet_initial_m: f64,
    pub sheet_final_m: f64,
    pub sheet_surplus_initial_m: f64,
    pub sheet_surplus_final_m: f64,
    /// Inner vertices of the region farther than `env.drape_threshold_mm` from the tool.
    pub undraped_inner: usize,
    /// Presses.
    pub steps: usize,
    /// Presses that the stencil did not reach in contact.
    pub jumps: usize,
    /// Of its path.
    #[serde(flatten)]
    pub path: PathFigures,
    /// 95th percentile and maximum of the absolute yarn strain of the whole sheet [-].
    pub strain_p95: f64,
    pub strain_max: f64,
    /// Greatest shear angle of the sheet [deg], and the share of its area that is sheared beyond
    /// locking [-]; none where the material does not say when that is.
    pub shear_max_deg: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub locked_share: Option<f64>,
    /// Places where the sheet passes through itself.
    pub self_intersections: usize,
    /// Root mean square speed at the end [mm/s].
    pub v_rms_mm_s: f64,
    /// Wall-clock time of the episode, without watching it; of several at once, its share.
    pub seconds: f64,
}

/// An episode played out.
#[derive(Clone, Debug)]
pub struct PlayedEpisode {
    pub summary: EpisodeSummary,
    pub recording: Recording,
}

/// An episode that did not come to its end.
#[derive(Debug, thiserror::Error)]
pub enum RolloutError {
    #[error(transparent)]
    Env(#[from] ValueError),
    #[error(transparent)]
    Diverged(#[from] ReplayDiverged),
    #[error(
        "step {step} (from 0) of the sequence presses vertex {vertex}, which is not allowed there"
    )]
    Forbidden { step: usize, vertex: u32 },
    #[error("the sequence ends after {steps} steps, before the episode does")]
    Short { steps: usize },
    #[error("the episode is over after {steps} steps, the sequence has {found}")]
    Long { steps: usize, found: usize },
}

/// Of [`parallel_episodes`]: every run is compared with the same random episodes.
const SEED: u64 = 0;

/// Plays one episode in the only environment of `draping`, from its start. `choose` gives the
/// action for what is seen, `told` hears the number of presses so far.
pub fn play(
    draping: &mut Draping,
    mut choose: impl FnMut(&Draping) -> u32,
    mut told: impl FnMut(usize),
) -> Result<PlayedEpisode, RolloutError> {
    let (start, mut watching) = (Instant::now(), Duration::ZERO);
    let mut recording = Recording::new(draping.task(0));
    let mut played = draping.play(|draping| {
        let before = Instant::now();
        told(recording.frames.len());
        recording.see(draping.task(0), &draping.episode(0));
        watching += before.elapsed();
        vec![choose(draping)]
    });
    let seconds = (start.elapsed() - watching).as_secs_f64();
    let Played { episode, end } = played.remove(0);
    if episode.end == End::Diverged {
        let presses = episode.actions.len();
        return Err(ReplayDiverged { presses }.into());
    }
    recording.see(draping.task(0), &end);
    let summary = summarise(draping.task(0), &end, seconds);
    Ok(PlayedEpisode { summary, recording })
}

/// By which rules a list of vertices is pressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rules {
    /// Those of an episode: the list must be one that an agent could have played, and whole.
    Episode,
    /// None: as a robot does, all presses in their order, whatever the masks allow.
    Robot,
}

/// Presses a list of vertices again, in the only environment of `draping`, from its start.
/// `told` hears the number of presses so far.
///
/// # Errors
/// If a vertex is outside the image, the simulation diverges, or the rules are broken.
pub fn replay(
    draping: &mut Draping,
    vertices: &[u32],
    rules: Rules,
    mut told: impl FnMut(usize),
) -> Result<PlayedEpisode, RolloutError> {
    let count = draping.scene().lamina.vertex_count();
    let outside = |&v: &u32| v as usize >= count || draping.action(v).is_none();
    if let Some(step) = vertices.iter().position(outside) {
        let vertex = vertices[step];
        return Err(RolloutError::Forbidden { step, vertex });
    }
    let limit = draping.config().max_steps.unwrap_or(usize::MAX);
    let mut broken = None;
    let mut recording = Recording::new(draping.task(0));
    let mut seconds = 0.0;
    let mut start = Instant::now();
    let ends = draping.replay(&[vertices], |draping, _, step| {
        seconds += start.elapsed().as_secs_f64();
        if rules == Rules::Episode && broken.is_none() {
            broken = fault(draping, vertices, step, limit);
        }
        told(step);
        recording.see(draping.task(0), &draping.episode(0));
        start = Instant::now();
    });
    broken.map_or(Ok(()), Err)?;
    ends.into_iter().collect::<Result<(), _>>()?;
    let summary = summarise(draping.task(0), &draping.episode(0), seconds);
    Ok(PlayedEpisode { summary, recording })
}

/// How a list breaks the rules of an episode once `step` of its presses are done.
fn fault(draping: &Draping, vertices: &[u32], step: usize, limit: usize) -> Option<RolloutError> {
    let found = vertices.len();
    match (draping.is_over(0) || step >= limit, vertices.get(step)) {
        (true, None) => None,
        (true, Some(_)) => Some(RolloutError::Long { steps: step, found }),
        (false, None) => Some(RolloutError::Short { steps: step }),
        (false, Some(&vertex)) => {
            let is_allowed = draping.observation(0).allows(draping.action(vertex)?);
            (!is_allowed).then_some(RolloutError::Forbidden { step, vertex })
        }
    }
}

/// `count` episodes of the masked random policy: what learning has to beat. `progress` is told
/// about what share 0..1 is done.
pub fn random_episodes(
    scene: &Arc<Scene>,
    config: &EnvConfig,
    count: usize,
    progress: impl FnMut(f64),
) -> Result<Vec<EpisodeSummary>, RolloutError> {
    let choose = |seen: Observation, stream: &mut Stream| {
        let chosen = stream.below(seen.allowed().count());
        let action = seen.allowed().nth(chosen);
        action.expect("some action is allowed")
    };
    parallel_episodes(scene, config, count, choose, progress)
}

/// `count` episodes at once, each with a random stream of its own, by which `choose` gives the action
/// for what is seen. `progress` is told about what share 0..1 is done. Diverged episodes are left out.
pub fn parallel_episodes(
    scene: &Arc<Scene>,
    config: &EnvConfig,
    count: usize,
    mut choose: impl FnMut(Observation, &mut Stream) -> u32,
    mut progress: impl FnMut(f64),
) -> Result<Vec<EpisodeSummary>, RolloutError> {
    let start = Instant::now();
    let most = most_environments(scene.lamina.vertex_count());
    let stream = |index| Stream::new(SEED, Purpose::Evaluation, index);
    let mut streams: Vec<Stream> = (0..count as u32).map(stream).collect();
    let mut steps = 0.0;
    let choose = |draping: &Draping, first: usize| {
        let expected = draping.task(0).expected_presses() as f64;
        let share = f64::min(steps / expected, 1.0);
        progress((first as f64 + share * draping.count() as f64) / count as f64);
        steps += 1.0;
        let each = streams[first..]
            .iter_mut()
            .take(draping.count())
            .enumerate();
        let each = each.map(|(k, stream)| choose(draping.observation(k), stream));
        each.collect()
    };
    let ended = |task: &Task, one: Played| {
        let is_whole = one.episode.end != End::Diverged;
        is_whole.then(|| summarise(task, &one.end, 0.0))
    };
    let all = Draping::play_all(scene, config, count, most, choose, ended)?;
    let mut summaries: Vec<EpisodeSummary> = all.into_iter().flatten().collect();
    let seconds = start.elapsed().as_secs_f64() / count as f64;
    summaries.iter_mut().for_each(|one| one.seconds = seconds);
    Ok(summaries)
}

/// Measures how presses have ended.
fn summarise(task: &Task, end: &EpisodeState, seconds: f64) -> EpisodeSummary {
    let path = task.figures(&task.points(end.presses()));
    let (scene, steps, end) = (&task.scene, end.presses().len(), end.cloth());
    let [strain_p95, strain_max] = scene.strain(end);
    let mut sheet = task.region.vertices.clone();
    sheet.insert_range(..);
    let sheet_surplus =
        |state: &Snapshot| surplus(&scene.lamina, &scene.tool, &state.position, &sheet);
    let locking = scene.lamina.material.shear.locking;
    let limit = locking.map_or(f64::INFINITY, |locking| locking.angle_rad);
    let sheared = sheared(&scene.lamina, &end.position, &sheet, limit);
    EpisodeSummary {
        score: task.score(end),
        region_initial_m: task.distance(&scene.initial),
        region_final_m: task.distance(end),
        surplus_initial_m: task.surplus(&scene.initial),
        surplus_final_m: task.surplus(end),
        sheet_initial_m: scene.distance(&scene.initial),
        sheet_final_m: scene.distance(end),
        sheet_surplus_initial_m: sheet_surplus(&scene.initial),
        sheet_surplus_final_m: sheet_surplus(end),
        undraped_inner: task.undraped_inner(end),
        steps,
        jumps: (path.strokes as usize).saturating_sub(1),
        path,
        strain_p95,
        strain_max,
        shear_max_deg: sheared.max.to_degrees(),
        locked_share: locking.map(|_| sheared.share_beyond),
        self_intersections: scene.lamina.mesh(&end.position).self_intersection_count(),
        v_rms_mm_s: 1e3 * end.v_rms(),
        seconds,
    }
}
