//! What a run is measured against, and the files that show what it has found.

use std::path::Path;
use std::sync::Arc;

use anyhow::anyhow;
use serde::Serialize;

use super::Failure;
use super::output::{Progress, write_together};
use super::picture::Studio;
use super::setup::{odd_depth, warn};
use super::terminal::note;
use crate::run::{
    EpisodeSummary, RolloutError, RunFolder, Training, curve, random_episodes, read_metrics,
};
use drape_cloth::math::mean_and_deviation;
use drape_cloth::scene::Scene;
use drape_report::{Camera, Chart, Level, SERIES, Series};
use drape_task::env::{Draping, EnvConfig};
use drape_task::path::{DrapingPoint, strokes};
use drape_task::recording::{RecordedFrame, Recording};

/// Random episodes that a training is compared with.
const BASELINE_EPISODES: usize = 32;
/// Frames of a film, at most.
const FRAMES: usize = 120;
const PICTURE_SIZE: [usize; 2] = [720, 620];
const FILM_SIZE: [usize; 2] = [480, 400];

/// What many episodes of one policy reach.
#[derive(Clone, Debug, Serialize)]
pub(super) struct EpisodeStatistics {
    pub mean_score: f64,
    pub deviation: f64,
    pub best_score: f64,
    /// Episodes in which the simulation diverged; they count in no mean.
    pub diverged: usize,
    pub mean_region_final_m: f64,
    pub deviation_region_final_m: f64,
    pub mean_surplus_final_m: f64,
    pub deviation_surplus_final_m: f64,
    pub episodes: Vec<EpisodeSummary>,
}

impl EpisodeStatistics {
    /// Of `count` episodes that `play` plays, which is given whom to tell the share that is done, and
    /// gives those that have not diverged. Fails if all have.
    pub fn new(
        title: &'static str,
        count: usize,
        play: impl FnOnce(&dyn Fn(f64)) -> Result<Vec<EpisodeSummary>, RolloutError>,
    ) -> Result<Self, Failure> {
        let progress = Progress::new(title);
        let episodes = play(&|share| progress.set(share))?;
        if episodes.is_empty() {
            return Err(anyhow!("all {title} diverged").into());
        }
        let of = |value: fn(&EpisodeSummary) -> f64| {
            mean_and_deviation(&episodes.iter().map(value).collect::<Vec<_>>())
        };
        let [mean_score, deviation] = of(|episode| episode.score);
        let [mean_region_final_m, deviation_region_final_m] = of(|episode| episode.region_final_m);
        let [mean_surplus_final_m, deviation_surplus_final_m] =
            of(|episode| episode.surplus_final_m);
        let scores = episodes.iter().map(|episode| episode.score);
        Ok(Self {
            mean_score,
            deviation,
            diverged: count - episodes.len(),
            best_score: scores.fold(f64::NEG_INFINITY, f64::max),
            mean_region_final_m,
            deviation_region_final_m,
            mean_surplus_final_m,
            deviation_surplus_final_m,
            episodes,
        })
    }

    /// Of the masked random policy.
    pub fn random(scene: &Arc<Scene>, env: &EnvConfig, count: usize) -> Result<Self, Failure> {
        let play = |told: &dyn Fn(f64)| random_episodes(scene, env, count, told);
        Self::new("random episodes", count, play)
    }
}

/// The random baseline of a training.
pub(super) fn baseline(training: &Training) -> Result<EpisodeStatistics, Failure> {
    note(format_args!(
        "playing {BASELINE_EPISODES} random episodes for comparison"
    ));
    let (scene, env) = (training.scene(), &training.config.env);
    EpisodeStatistics::random(scene, env, BASELINE_EPISODES)
}

/// The draping points of an episode.
pub(super) fn path(of: &Recording) -> Result<Vec<DrapingPoint>, Failure> {
    Ok(strokes(&of.presses, of.env.rolling())?)
}

/// Scores over environment steps, with the random policy as a band.
pub(super) fn reward_curve(
    folder: &RunFolder,
    baseline: &EpisodeStatistics,
) -> Result<(), Failure> {
    let metrics = read_metrics(&folder.metrics)?;
    let percent = |(step, score): (u64, f64)| [step as f64, 100.0 * score];
    let series = |label: &str, name: &str, color| Series {
        label: label.into(),
        points: curve(&metrics, name).into_iter().map(percent).collect(),
        color,
    };
    let chart = Chart {
        title: "Share of the objective removed in the focus region".into(),
        x_label: "environment steps".into(),
        y_label: "score [%]".into(),
        series: vec![
            series("last 50 episodes", "mean_score", SERIES[0]),
            series("greedy policy", "greedy_score", SERIES[1]),
            series("best sequence so far", "best_score", SERIES[2]),
        ],
        levels: vec![Level {
            label: "random, mean ± deviation".into(),
            value: 100.0 * baseline.mean_score,
            deviation: 100.0 * baseline.deviation,
            color: SERIES[3],
        }],
        ..Chart::default()
    };
    Ok(chart
        .image()
        .save_png(&folder.pictures.join("reward.png"))?)
}

/// What hears how far an episode is.
pub(super) fn episode_progress(draping: &Draping) -> impl FnMut(usize) + use<> {
    let progress = Progress::new("episode");
    let expected = draping.task(0).expected_presses() as f64;
    move |presses| progress.set((presses as f64 / expected).min(1.0))
}

/// What [`write_recording`] writes.
const RECORDING: [&str; 6] = [
    "recording.drape",
    "before.png",
    "after.png",
    "crushed.png",
    "path.png",
    "rollout.gif",
];

/// Whether a run has all that a training which has proved its path leaves.
pub(super) fn is_proved(folder: &RunFolder) -> bool {
    let drawn = RECORDING.map(|name| folder.pictures.join(name));
    let files = [&folder.proof, &folder.trajectory];
    files.into_iter().chain(&drawn).all(|file| file.exists())
}

/// Writes a recording, its pictures and its film into a folder.
pub(super) fn write_recording(
    recording: &Recording,
    scene: &Scene,
    folder: &Path,
    title: &str,
) -> Result<(), Failure> {
    warn(odd_depth(scene, recording.end()), title);
    let frames = &recording.frames;
    let last = frames.len() - 1;
    let step = last.div_ceil(FRAMES).max(1);
    let chosen: Vec<usize> = (0..last).step_by(step).chain([last]).collect();
    let studio = Studio::new(scene, Camera::isometric, PICTURE_SIZE);
    let shot = |frame: &RecordedFrame, text: &str| studio.distance(&frame.position, text);
    let top = Studio::new(scene, Camera::top, PICTURE_SIZE);
    let film = Studio::new(scene, Camera::isometric, FILM_SIZE);
    write_together(folder, |folder| {
        recording.write(&folder.join("recording.drape"))?;
        shot(&frames[0], "before").save_png(&folder.join("before.png"))?;
        shot(&frames[last], &format!("after, {title}")).save_png(&folder.join("after.png"))?;
        let crushed = studio.crushed(&frames[last].position);
        crushed.save_png(&folder.join("crushed.png"))?;
        let path = top.progress(recording, last);
        path.save_png(&folder.join("path.png"))?;
        film.film(recording, &chosen, &folder.join("rollout.gif"))
    })
}

/// A sequence that cannot be replayed belongs to the user's folder, a diverged one to us.
pub(super) fn rollout_failure(error: RolloutError, place: &Path) -> Failure {
    let is_input = !matches!(error, RolloutError::Diverged(_));
    let error = anyhow::Error::new(error).context(place.display().to_string());
    Failure { error, is_input }
}
