//! The proof of a run's best paths: what eval and train print and keep of it.

use std::path::Path;
use std::sync::Arc;

use super::Failure;
use super::output::Progress;
use super::result::{Recorder, rollout_failure};
use super::study::{failure, read_run};
use crate::run::{BestSequence, PlayedEpisode, Proved, Rules, RunFolder, replay};
use drape_cloth::scene::Scene;
use drape_cloth::sim::Accuracy;
use drape_study::proof::{Row, prove};
use drape_study::study::Context;
use drape_task::env::{Draping, EnvConfig};

/// Proves the best sequences of a run against `count` random orders, see [`prove`], and keeps the
/// best of them in the run folder. None if all diverge.
pub(super) fn proved(
    folder: &RunFolder,
    scene: &Arc<Scene>,
    env: &EnvConfig,
    (count, twin): (usize, bool),
    json: bool,
) -> Result<(Vec<Row>, Option<Proved>), Failure> {
    let best = folder.read_best_sequence()?;
    let others = best.others.iter().map(|other| other.vertices.clone());
    let paths: Vec<Vec<u32>> = std::iter::once(best.vertices.clone())
        .chain(others)
        .collect();
    let progress = Progress::new("proof", json);
    let context = Context {
        progress: &|share, doing| progress.tell(share, doing),
        read_run: &read_run,
    };
    let found = prove(scene, env, &paths, count, twin, &context);
    drop(progress);
    let place = folder.config().display().to_string();
    let found = found.map_err(|error| failure(error, Some(place)))?;
    let proved = found.best.map(|(index, score)| Proved {
        physics: found.physics,
        path: BestSequence {
            vertices: paths[index].clone(),
            score,
            others: Vec::new(),
            ..best
        },
        proof: found.rows.clone(),
    });
    match &proved {
        Some(proved) => folder.write_proof(proved)?,
        None => eprintln!("warning: all of the best paths diverge where they are to be proved"),
    }
    Ok((found.rows, proved))
}

/// Plays a proved path as a robot presses it, at `accurate`, whether or not the twin has proved
/// it too. With its frames, and the environment as it has left it.
pub(super) fn play(
    proved: &Proved,
    scene: &Arc<Scene>,
    env: &EnvConfig,
    place: &Path,
) -> Result<(PlayedEpisode, Recorder, Draping), Failure> {
    let mut env = env.clone();
    env.set_accuracy(Accuracy::Accurate);
    let mut draping = Draping::new(scene.clone(), &env, 1)?;
    let mut recorder = Recorder::default();
    let watch = |draping: &Draping, points: &[_]| recorder.watch(draping, points);
    let played = replay(&mut draping, &proved.path.vertices, Rules::Robot, watch)
        .map_err(|error| rollout_failure(error, place))?;
    Ok((played, recorder, draping))
}

/// A line for each row.
pub(super) fn text(rows: &[Row]) -> String {
    let line = |row: &Row| {
        let name = row.physics.name();
        let count = format!("{:>3} {}", row.count, row.order);
        match &row.figures {
            None => format!("proof, {name}: {count:<12} all diverged"),
            Some(f) => format!(
                "proof, {name}: {count:<12} {:.4} +- {:.4} m off the tool (least {:.4}), {:.2} +- \
                 {:.2} mm surplus a yarn (least {:.2}), score {:.2} +- {:.2} % (best {:.2}), \
                 {:.1} undraped, shear at most {:.0} degrees",
                f.distance_m,
                f.deviation_distance_m,
                f.least_distance_m,
                1e3 * f.surplus_m,
                1e3 * f.deviation_surplus_m,
                1e3 * f.least_surplus_m,
                100.0 * f.score,
                100.0 * f.deviation_score,
                100.0 * f.best_score,
                f.undraped,
                f.shear_deg
            ),
        }
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}
