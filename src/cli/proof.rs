//! The proof of a run's best paths: what train, eval and export print and keep of it.

use std::path::Path;
use std::sync::Arc;

use super::Failure;
use super::failure::{OrInvalid, proof_failure};
use super::output::Progress;
use super::result::{self, episode_progress, rollout_failure, write_recording};
use super::terminal::tell;
use crate::run::{
    self, BestSequence, PlayedEpisode, Proved, Rules, RunConfig, RunFolder, path_points, replay,
};
use drape_cloth::scene::Scene;
use drape_proof::{Case, Listener, Method, Physics, Proof, Row, Sensitivity, choose, prove};
use drape_report::{Format, Table};
use drape_task::env::Draping;
use drape_task::path::{Frame, write_json};
use drape_task::recording::Recording;

/// Proves the best sequences of a run, see [`prove`], and keeps the
/// best of them in the run folder with its draping points, recording and pictures, unless all diverge. What
/// the twin has proved stays until it proves another, or the path is among the best no more.
pub(super) fn proved(
    folder: &RunFolder,
    scene: &Arc<Scene>,
    config: &RunConfig,
    mut best: BestSequence,
    method: Method,
) -> Result<Vec<Row>, Failure> {
    best.others.truncate(2 * config.proof_paths - 1);
    let paths: Vec<Vec<u32>> = best.all().cloned().collect();
    let (case, place) = (case(scene, config), folder.config.display().to_string());
    let prune = |path: &mut Vec<u32>| pressable(path, scene, config, &folder.config);
    let found = found(case, &paths, method, Some(place), prune)?;
    let Some(chosen) = found.best else {
        tell("warning: all of the best paths diverge where they are to be proved");
        return Ok(found.rows);
    };
    // A damaged one is replaced.
    let old = folder.read_proof().ok().flatten().filter(|old| {
        (old.physics, chosen.physics) == (Physics::Twin, Physics::Solver)
            && old.path.config_digest == best.config_digest
            && (paths.contains(&old.path.vertices) || chosen.path == old.path.vertices)
    });
    let proved = match old {
        Some(old) => old,
        None => folder.write_proof(Proved {
            physics: chosen.physics,
            path: BestSequence {
                vertices: chosen.path,
                score: chosen.score,
                others: Vec::new(),
                ..best
            },
            proof: found.rows.clone(),
        })?,
    };
    let played = play(&proved.path.vertices, case, &folder.proof)?.recording;
    let frame = Frame::tool(&scene.config.tool.pose);
    write_json(&folder.trajectory, &result::path(&played)?, &frame)?;
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

/// Takes out of a path what the robot of a run does not press as it comes to it: searches ask a grid, which errs by half its
/// spacing, but no point that is proved is one that the program leaves out.
fn pressable(
    path: &mut Vec<u32>,
    scene: &Arc<Scene>,
    config: &RunConfig,
    place: &Path,
) -> Result<(), Failure> {
    let Some(cell) = &config.cell else {
        return Ok(());
    };
    let name = place.display().to_string();
    let cell = run::cell(cell, scene).or_invalid_in(&name)?;
    let mut without = 0;
    loop {
        let played = play(path, case(scene, config), place)?.recording;
        let points = path_points(&result::path(&played)?, scene);
        let failed = cell.plan(&points, |_| ()).or_invalid_in(&name)?.failed;
        let pressed = played.vertices().into_iter().enumerate();
        let left = pressed.filter(|(k, _)| failed.iter().all(|point| point.index != *k));
        *path = left.map(|(_, vertex)| vertex).collect();
        without += failed.len();
        // Where points are gone others are joined, and what was pressed may not be.
        if failed.is_empty() || path.is_empty() {
            break;
        }
    }
    if without > 0 {
        let left = path.len();
        tell(format!(
            "presses of the best path that the robot cannot make as it comes to them: {without}; the {left} others are proved"
        ));
    }
    Ok(())
}

/// What a proof of `paths` says, see [`prove`]; nothing is kept. The best of the paths is
/// `pruned` before; where it diverges in a world of the proof the next best takes its place. Errors name the `place` of
/// the scene.
pub(super) fn found(
    case: Case,
    paths: &[Vec<u32>],
    method: Method,
    place: Option<String>,
    pruned: impl Fn(&mut Vec<u32>) -> Result<(), Failure>,
) -> Result<Proof, Failure> {
    let progress = Progress::new("proof");
    let told = |share: f64, doing: &str| progress.tell(share, doing);
    let failure = |error| proof_failure(error, place.clone());
    let mut choice = choose(case, paths, method, Listener(&told)).map_err(failure)?;
    loop {
        if let Some(path) = &mut choice.path {
            pruned(path)?;
        }
        let proof = prove(case, &choice, method.judge, Listener(&told)).map_err(failure)?;
        if !proof.is_lost() || !choice.go_on() {
            return Ok(proof);
        }
        tell("the best path diverges in a world of the proof: the next best is proved");
    }
}

/// The score of a path where paths are proved, NaN if it diverges there.
pub(super) fn score(case: Case, path: &[u32]) -> Result<f64, Failure> {
    let progress = Progress::new("the old path");
    let told = |share: f64, doing: &str| progress.tell(share, doing);
    let found = drape_proof::figures(case, path, Listener(&told));
    Ok(found.map_err(|error| proof_failure(error, None))?.score)
}

/// See [`sensitivity`](drape_proof::sensitivity).
pub(super) fn sensitivity(case: Case, path: &[u32]) -> Result<Vec<Sensitivity>, Failure> {
    let progress = Progress::new("one quantity at a time");
    let told = |share: f64, doing: &str| progress.tell(share, doing);
    let found = drape_proof::sensitivity(case, path, Listener(&told));
    found.map_err(|error| proof_failure(error, None))
}

/// A line of a quantity, with a bar as long as what it takes at worst.
pub(super) fn of_one(one: &Sensitivity) -> String {
    let lost = 100.0 * (1.0 - one.worst_score);
    let bar = "#".repeat((2.0 * lost).clamp(0.0, 60.0) as usize);
    format!(
        "{:>16} alone: {:.2} %, worst {:.2} of {} worlds {bar}",
        one.quantity.name(),
        100.0 * one.score,
        100.0 * one.worst_score,
        one.worlds
    )
}

/// As trainings and searches prove what they have found: by the fast solver.
pub(super) fn by_solver(config: &RunConfig) -> Method {
    Method {
        random: config.proof_paths,
        judge: Physics::Solver,
    }
}

/// What is to be proved of a run.
pub(super) fn case<'a>(scene: &'a Arc<Scene>, config: &'a RunConfig) -> Case<'a> {
    Case {
        scene,
        env: &config.env,
        scatter: &config.scatter,
        seed: config.seed,
    }
}

/// Plays a path as a robot presses it, in the fast solver and the world of the scene, whether or not
/// the twin has proved it too.
pub(super) fn play(path: &[u32], case: Case, place: &Path) -> Result<PlayedEpisode, Failure> {
    let mut draping = Draping::new(case.scene.clone(), &case.scatter.finest(case.env), 1)?;
    let told = episode_progress(&draping);
    let played = replay(&mut draping, path, Rules::Robot, told);
    played.map_err(|error| rollout_failure(error, place))
}

/// A table for the solver and one for the twin, a row an order.
pub(super) fn text(rows: &[Row]) -> String {
    let mut parts = Vec::new();
    for physics in [Physics::Solver, Physics::Twin] {
        let rows: Vec<&Row> = rows.iter().filter(|row| row.physics == physics).collect();
        let Some(first) = rows.first() else { continue };
        let title = format!(
            "proof by the {}, worlds: {}; the best of each order: scores in %, surplus in mm, robot in s",
            physics.name(),
            first.worlds
        );
        // In one world they are all the same.
        let several = match first.worlds {
            1 => Format::Hidden,
            _ => Format::Fixed(2),
        };
        let table = Table::of("proof", title, &rows)
            .text("order", |row| row.order.clone())
            .text("count", |row| row.count)
            .number("score", 2, |row| 100.0 * row.best.score)
            .number("worst quarter", several, |row| {
                100.0 * row.best.worst_quarter_score
            })
            .number("worst", several, |row| 100.0 * row.best.worst_score)
            .number("nominal", several, |row| 100.0 * row.best.nominal_score)
            .number("surplus", 2, |row| 1e3 * row.best.surplus_m)
            .number("undraped", 1, |row| row.best.undraped_inner)
            .number("presses", 0, |row| row.best.path.presses)
            .number("strokes", 0, |row| row.best.path.strokes)
            .number("robot", 0, |row| row.best.robot_s);
        parts.push(table.end().text());
        // What has diverged has no score.
        let better = |row: &&&Row| first.order == "path" && row.best.score > first.best.score;
        if let Some(other) = rows.iter().find(better) {
            parts.push(format!(
                "order {} scores more, costs apart: give training or search more steps",
                other.order
            ));
        }
        let diverged = rows.iter().filter(|row| row.diverged > 0);
        let line = |row: &&Row| {
            format!(
                "of the {} of order {}, {} diverged",
                row.count, row.order, row.diverged
            )
        };
        parts.extend(diverged.map(line));
        let lost = |row: &&&Row| row.best.score.is_nan() && row.diverged < row.count;
        let line = |row: &&Row| format!("the best of order {} diverges in this proof", row.order);
        parts.extend(rows.iter().filter(lost).map(line));
    }
    parts.join("\n")
}
