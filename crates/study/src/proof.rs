//! Whether paths are as good as their training has it: played in a finer physics, beside orders
//! that anybody could think of.

use std::sync::{Arc, Mutex};

use serde::{Deserialize, Serialize};

use crate::episodes::sequences;
use crate::presses::{replay, replay_in_twin, resting};
use crate::ranking::extremes;
use crate::study::{Context, StudyError};
use crate::twin::fall::{fallen, twin_config};
use drape_cloth::math::mean_and_deviation;
use drape_cloth::measure::sheared;
use drape_cloth::scene::Scene;
use drape_cloth::sim::{Accuracy, Stepping};
use drape_task::env::{Draping, EnvConfig, EpisodeState, Task};
use drape_task::path::PathFigures;
use drape_task::recording::Recording;
use drape_task::search::Order;

/// Where a path is proved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Physics {
    /// The fast solver in steps at least as fine as this preset's.
    Accurate,
    /// The finite-element twin, from its own fall.
    Twin,
}

impl Physics {
    /// As in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Accurate => "accurate",
            Self::Twin => "twin",
        }
    }
}

/// What paths of one origin leave in one physics.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    pub physics: Physics,
    /// `path` for those that are proved, else `random`, `sweep` or `outwards`.
    pub order: String,
    /// Paths that came to their end.
    pub count: usize,
    /// Paths in which the simulation diverged, here or where they were found; they count in no
    /// figure.
    pub diverged: usize,
    #[serde(flatten)]
    pub figures: Figures,
}

/// Means over paths with their standard deviations, and the best of each; no numbers if there is
/// no path.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Figures {
    /// Summed distance of the region to the tool [m].
    pub distance_m: f64,
    pub deviation_distance_m: f64,
    pub least_distance_m: f64,
    /// Mean surplus of its yarns [m].
    pub surplus_m: f64,
    pub deviation_surplus_m: f64,
    pub least_surplus_m: f64,
    /// See [`score`](drape_task::env::score), less the costs of the path [-].
    pub score: f64,
    pub deviation_score: f64,
    pub best_score: f64,
    /// Inner vertices of the region farther than `env.drape_threshold_mm` from the tool.
    pub undraped_inner: f64,
    /// Greatest shear angle in the region [deg].
    pub shear_deg: f64,
    pub deviation_shear_deg: f64,
    /// Of the paths over the tool: means, and those of the best score.
    #[serde(flatten)]
    pub path: PathFigures,
    pub best_path: PathFigures,
    /// Inner vertices that the path of the best score leaves undraped.
    pub best_undraped_inner: usize,
}

/// What [`prove`] has found, by physics and order; nothing is best if all paths have diverged.
#[derive(Clone, Debug, PartialEq)]
pub struct Proof {
    pub rows: Vec<Row>,
    pub best: Option<Best>,
    /// The best path in the twin, if that has proved it.
    pub recording: Option<Recording>,
}

/// The best path, by its number among those given, in the last physics in which one came to its
/// end, and its score there [-].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Best {
    pub index: usize,
    pub physics: Physics,
    pub score: f64,
}

/// What a path has left.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Left {
    distance_m: f64,
    surplus_m: f64,
    score: f64,
    undraped_inner: usize,
    shear_deg: f64,
    path: PathFigures,
}

/// Paths taken on to the twin, where one costs minutes.
const TWIN_PATHS: usize = 4;

/// Paths of one origin: its name, those that were found, and those that were looked for.
type Group<'a> = (&'a str, Vec<Vec<u32>>, usize);

/// The task in steps as fine as `accurate`, or its own if they are finer.
pub fn finely(env: &EnvConfig) -> EnvConfig {
    let (mut env, own) = (env.clone(), env.stepping());
    let fine = Accuracy::Accurate.stepping();
    env.set_stepping(Stepping {
        substep_rate: own.substep_rate.max(fine.substep_rate),
        contact_rate: own.contact_rate.max(fine.contact_rate),
    });
    env
}

/// Plays `paths` at `accurate` and with `twin` the best of them in the twin too, beside `count`
/// random orders (in the twin a quarter of them), a quarter as many sweeps and half as many
/// outwards, all found in the task's own steps.
///
/// # Errors
/// If the scene has what the twin has nothing for, or the twin's fall diverges.
pub fn prove(
    scene: &Arc<Scene>,
    env: &EnvConfig,
    paths: &[Vec<u32>],
    (count, twin): (usize, bool),
    context: &Context,
) -> Result<Proof, StudyError> {
    if twin {
        // Refused before the work.
        twin_config(&scene.config)?;
    }
    let quarter = count.div_ceil(4);
    let mut groups: Vec<Group> = vec![("path", paths.to_vec(), paths.len())];
    for (name, order, count) in [
        ("random", Order::Random, count),
        ("sweep", Order::Sweep, quarter),
        ("outwards", Order::Outwards, count.div_ceil(2)),
    ] {
        groups.push((name, sequences(scene, env, order, count, 0)?, count));
    }
    let mut draping = Draping::new(scene.clone(), &finely(env), listed(&groups).len())?;
    let longest = listed(&groups).iter().map(|list| list.len()).max();
    let ends = replay(&mut draping, &listed(&groups), |presses| {
        let share = presses as f64 / longest.unwrap_or(0) as f64;
        (context.progress)(share, "proving at accurate");
    });
    let left = all_left(draping.task(0), &ends);
    let mut rows = summed(Physics::Accurate, &groups, &left);
    let mut chosen = ranked(&left[..paths.len()]);
    let best = |physics, &(index, score): &(usize, f64)| Best {
        index,
        physics,
        score,
    };
    let mut recording = None;
    let mut found = chosen.first().map(|first| best(Physics::Accurate, first));
    if twin && found.is_some() {
        chosen.truncate(TWIN_PATHS);
        let those = chosen.iter().map(|&(k, _)| paths[k].clone());
        groups[0] = ("path", those.collect(), chosen.len());
        groups[1].1.truncate(quarter);
        groups[1].2 = quarter;
        (context.progress)(0.0, "the twin's fall");
        let fallen = fallen(scene, &twin_config(&scene.config)?)?;
        let scene = resting(scene, fallen.positions());
        let task = Task::new(scene.clone(), env)?;
        let recordings = vec![Recording::new(&task, true); chosen.len()];
        let recordings: Vec<_> = recordings.into_iter().map(Mutex::new).collect();
        let see = |list: usize, episode: &EpisodeState| {
            if let Some(recording) = recordings.get(list) {
                recording.lock().expect("nobody panics").see(&task, episode);
            }
        };
        let (ends, _) = replay_in_twin(&scene, env, &listed(&groups), &see, context)?;
        let left = all_left(&task, &ends);
        rows.extend(summed(Physics::Twin, &groups, &left));
        if let Some(&(k, score)) = ranked(&left[..chosen.len()]).first() {
            found = Some(best(Physics::Twin, &(chosen[k].0, score)));
            let mut all = recordings.into_iter();
            recording = all.nth(k).and_then(|one| one.into_inner().ok());
        }
    }
    Ok(Proof {
        rows,
        best: found,
        recording,
    })
}

fn listed<'a>(groups: &'a [Group]) -> Vec<&'a [u32]> {
    let lists = groups.iter().flat_map(|(_, paths, _)| paths);
    lists.map(|path| &**path).collect()
}

/// A row a group of what all paths have left.
fn summed(physics: Physics, groups: &[Group], mut left: &[Option<Left>]) -> Vec<Row> {
    let rows = groups.iter().map(|(order, paths, count)| {
        let (own, after) = left.split_at(paths.len());
        left = after;
        let ended: Vec<Left> = own.iter().copied().flatten().collect();
        Row {
            physics,
            order: (*order).into(),
            count: ended.len(),
            diverged: count - ended.len(),
            figures: figures(&ended),
        }
    });
    rows.collect()
}

fn figures(ended: &[Left]) -> Figures {
    let of = |value: fn(&Left) -> f64| {
        let values: Vec<f64> = ended.iter().map(value).collect();
        (mean_and_deviation(&values), extremes(&values))
    };
    let mut f = Figures::default();
    (
        [f.distance_m, f.deviation_distance_m],
        [f.least_distance_m, _],
    ) = of(|left| left.distance_m);
    ([f.surplus_m, f.deviation_surplus_m], [f.least_surplus_m, _]) = of(|left| left.surplus_m);
    ([f.score, f.deviation_score], [_, f.best_score]) = of(|left| left.score);
    let paths: Vec<PathFigures> = ended.iter().map(|left| left.path).collect();
    f.path = PathFigures::mean(&paths);
    let best = ended.iter().max_by(|a, b| a.score.total_cmp(&b.score));
    if let Some(best) = best {
        (f.best_path, f.best_undraped_inner) = (best.path, best.undraped_inner);
    }
    ([f.undraped_inner, _], _) = of(|left| left.undraped_inner as f64);
    ([f.shear_deg, f.deviation_shear_deg], _) = of(|left| left.shear_deg);
    f
}

/// Index and score of those that have come to their end, best first.
fn ranked(left: &[Option<Left>]) -> Vec<(usize, f64)> {
    let ended = left.iter().enumerate();
    let ended = ended.filter_map(|(k, left)| Some((k, left.as_ref()?.score)));
    let mut ended: Vec<(usize, f64)> = ended.collect();
    ended.sort_by(|a, b| b.1.total_cmp(&a.1));
    ended
}

/// Measures what lists of presses leave.
fn all_left(task: &Task, ends: &[Option<EpisodeState>]) -> Vec<Option<Left>> {
    let Scene { lamina, .. } = &*task.scene;
    let vertices = &task.region.vertices;
    let left = |end: &EpisodeState| {
        let (cloth, path) = (end.cloth(), task.figures(&task.points(end.presses())));
        let at = &cloth.position;
        Left {
            distance_m: task.distance(cloth),
            surplus_m: task.surplus(cloth),
            score: task.score(cloth) - task.cost(&path, cloth),
            undraped_inner: task.undraped_inner(cloth),
            shear_deg: sheared(lamina, at, vertices, f64::INFINITY)
                .max
                .to_degrees(),
            path,
        }
    };
    ends.iter().map(|end| end.as_ref().map(left)).collect()
}

#[cfg(test)]
mod tests;
