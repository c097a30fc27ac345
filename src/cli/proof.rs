//! The proof of a run's best paths: what train, eval and export print and keep of it.

use std::path::Path;
use std::sync::Arc;

use super::Failure;
use super::failure::study_failure;
use super::output::Progress;
use super::result::{episode_progress, path, rollout_failure, write_recording};
use crate::run::{BestSequence, PlayedEpisode, Proved, Rules, RunConfig, RunFolder, replay};
use drape_cloth::scene::Scene;
use drape_study::proof::{Physics, Proof, Row, finely, prove};
use drape_study::study::Context;
use drape_task::env::{Draping, EnvConfig};
use drape_task::path::write_json;
use drape_task::recording::Recording;

/// Proves the best sequences of a run against `count` random orders, see [`prove`], and keeps the
/// best of them in the run folder with its draping points, recording and pictures, unless all diverge. What
/// the twin has proved stays until it proves another, or the path is among the best no more.
pub(super) fn proved(
    folder: &RunFolder,
    (scene, config): (&Arc<Scene>, &RunConfig),
    mut best: BestSequence,
    (count, twin): (usize, bool),
    json: bool,
) -> Result<Vec<Row>, Failure> {
    best.others.truncate(2 * config.proof_paths - 1);
    let paths: Vec<Vec<u32>> = best.all().cloned().collect();
    let (env, place) = (&config.env, folder.config.display().to_string());
    let found = found((scene, env), &paths, (count, twin), Some(place), json)?;
    let Some(chosen) = found.best else {
        eprintln!("warning: all of the best paths diverge where they are to be proved");
        return Ok(found.rows);
    };
    // A damaged one is replaced.
    let old = folder.read_proof().ok().flatten().filter(|old| {
        (old.physics, chosen.physics) == (Physics::Twin, Physics::Accurate)
            && old.path.config_digest == best.config_digest
            && paths.contains(&old.path.vertices)
    });
    let proved = match old {
        Some(old) => old,
        None => folder.write_proof(Proved {
            physics: chosen.physics,
            path: BestSequence {
                vertices: paths[chosen.index].clone(),
                score: chosen.score,
                others: Vec::new(),
                ..best
            },
            proof: found.rows.clone(),
        })?,
    };
    let played = play(&proved, scene, env, &folder.proof, json)?.recording;
    write_json(&folder.trajectory, &path(&played)?)?;
    let old = Recording::read(&folder.recording).ok();
    let is_proof = |recording: &Recording| {
        proved.physics == Physics::Twin
            && recording.by_twin
            && recording.vertices() == proved.path.vertices
    };
    let recording = found.recording.or(old).filter(is_proof).unwrap_or(played);
    write_recording(&recording, scene, &folder.pictures, "proved path")?;
    Ok(found.rows)
}

/// What a proof of `paths` against some random orders says, see [`prove`]; nothing is kept. Errors name the
/// `place` of the scene.
pub(super) fn found(
    (scene, env): (&Arc<Scene>, &EnvConfig),
    paths: &[Vec<u32>],
    orders: (usize, bool),
    place: Option<String>,
    json: bool,
) -> Result<Proof, Failure> {
    let progress = Progress::new("proof", json);
    let context = Context {
        progress: &|share, doing| progress.tell(share, doing),
        ..Context::quiet()
    };
    let found = prove(scene, env, paths, orders, &context);
    found.map_err(|error| study_failure(error, place))
}

/// Plays a proved path as a robot presses it, in the fast solver, whether or not the twin has
/// proved it too.
pub(super) fn play(
    proved: &Proved,
    scene: &Arc<Scene>,
    env: &EnvConfig,
    place: &Path,
    json: bool,
) -> Result<PlayedEpisode, Failure> {
    let mut draping = Draping::new(scene.clone(), &finely(env), 1)?;
    let told = episode_progress(&draping, json);
    let played = replay(&mut draping, &proved.path.vertices, Rules::Robot, told);
    played.map_err(|error| rollout_failure(error, place))
}

/// A line for each row.
pub(super) fn text(rows: &[Row]) -> String {
    let line = |row: &Row| {
        let (f, name) = (&row.figures, row.physics.name());
        let begin = format!("proof, {name}: {:>3} {:<8}", row.count, row.order);
        let more = match (row.count, row.diverged) {
            (0, _) => return format!("{begin} all diverged"),
            (_, 0) => String::new(),
            (_, diverged) => format!("; {diverged} more diverged"),
        };
        format!(
            "{begin} {:.4} +- {:.4} m off the tool (least {:.4}), {:.2} +- {:.2} mm surplus a yarn (least \
             {:.2}), score {:.2} +- {:.2} % (best {:.2}), {:.1} inner vertices undraped, shear at most {:.0} \
             degrees{more}; best path {} undraped, {}",
            f.distance_m,
            f.deviation_distance_m,
            f.least_distance_m,
            1e3 * f.surplus_m,
            1e3 * f.deviation_surplus_m,
            1e3 * f.least_surplus_m,
            100.0 * f.score,
            100.0 * f.deviation_score,
            100.0 * f.best_score,
            f.undraped_inner,
            f.shear_deg,
            f.best_undraped_inner,
            f.best_path.text()
        )
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}
