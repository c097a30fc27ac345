//! Whether a path holds: played in worlds that chose none, in finer steps and in the twin, beside orders
//! that anybody could think of.

use std::sync::{Arc, Mutex};

use cpu_time::ProcessTime;
use serde::{Deserialize, Serialize};

use crate::orders::sequences;
use crate::presses::{replay_in_twin, resting_in_twin};
use crate::twin::twin_of;
use crate::{Listener, ProofError};
use drape_cloth::math::mean_and_deviation;
use drape_cloth::measure::sheared;
use drape_cloth::scene::{Misplacement, Scene};
use drape_cloth::sim::Parameters;
use drape_task::env::{
    EnvConfig, EpisodeState, Quantity, Scatter, Task, Worlds, mean_and_worst_quarter,
};
use drape_task::path::PathFigures;
use drape_task::recording::Recording;
use drape_task::search::{Job, Judge, Order};

/// Where a path is proved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Physics {
    /// The fast solver, in the steps by which paths are judged.
    #[serde(alias = "accurate")]
    Solver,
    /// The finite-element twin, from its own fall.
    Twin,
}

impl Physics {
    /// As in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Solver => "solver",
            Self::Twin => "twin",
        }
    }
}

/// What is to be proved: a task on a scene, and how its worlds scatter.
#[derive(Clone, Copy)]
pub struct Case<'a> {
    pub scene: &'a Arc<Scene>,
    pub env: &'a EnvConfig,
    pub scatter: &'a Scatter,
    /// Worlds are drawn under it, and random orders.
    pub seed: u64,
}

/// What paths are held against, and by whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Method {
    /// Random orders; sweeps are a quarter as many and orders outwards half as many.
    pub random: usize,
    /// Who has the last word on the best path, and proves it last.
    pub judge: Physics,
}

/// Paths of one origin in one physics.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    pub physics: Physics,
    /// `path` for those that are proved, else `random`, `sweep` or `outwards`.
    pub order: String,
    /// Paths that the best was chosen from, and those of them that diverged in some world.
    pub count: usize,
    pub diverged: usize,
    /// Of the scores of all of them, in the worlds that the best was chosen by [-].
    pub mean_score: f64,
    pub deviation_score: f64,
    /// Worlds that the best was then pressed in; it was chosen by none of them.
    pub worlds: usize,
    /// No numbers if it diverged in one of these.
    #[serde(flatten)]
    pub best: Figures,
}

/// What the best path leaves, on average over worlds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// See [`score`](drape_task::env::score), without costs [-]; of the worst quarter of worlds, of the worst
    /// one, and in that of the scene, too.
    pub score: f64,
    pub worst_quarter_score: f64,
    pub worst_score: f64,
    pub nominal_score: f64,
    /// Summed distance of the region to the tool [m], and mean surplus of its yarns [m].
    pub distance_m: f64,
    pub surplus_m: f64,
    /// Inner vertices of the region farther than `env.drape_threshold_mm` from the tool.
    pub undraped_inner: f64,
    /// Greatest shear angle in the region [deg].
    pub shear_deg: f64,
    /// The path over the tool in the world of the scene, and how long a robot takes [s].
    pub path: PathFigures,
    pub robot_s: f64,
}

/// What [`prove`] has found, by physics and order.
#[derive(Clone, Debug, PartialEq)]
pub struct Proof {
    pub rows: Vec<Row>,
    /// None if all paths have diverged.
    pub best: Option<Best>,
    /// The best path in the twin, if that has proved it.
    pub recording: Option<Recording>,
}

/// The path that is chosen, and its score where it was proved last [-].
#[derive(Clone, Debug, PartialEq)]
pub struct Best {
    pub path: Vec<u32>,
    pub physics: Physics,
    pub score: f64,
}

/// What one quantity alone does to a path.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sensitivity {
    pub quantity: Quantity,
    pub worlds: usize,
    /// Over worlds in which nothing else varies [-].
    pub score: f64,
    pub worst_score: f64,
}

/// What a path has left in a world.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Left {
    distance_m: f64,
    surplus_m: f64,
    score: f64,
    /// Score less costs.
    worth: f64,
    undraped_inner: usize,
    shear_deg: f64,
    path: PathFigures,
}

/// Worlds that the best of each origin is chosen by, all in the first and the better in the others too,
const CHOOSING: [u64; 2] = [3, 6];
/// paths that the twin chooses from if it is asked, and worlds in which it does,
const TWIN_CHOOSING: [usize; 2] = [8, 3];
/// those that it is then proved in, and lies of the blank among them,
const PROVING: usize = 24;
const LIES: usize = 16;
/// and those of the twin.
const TWIN: usize = 6;
/// Worlds of one quantity.
const SENSITIVITY: usize = 8;
/// What sets seeds apart: no world that a path was found in is one that it is chosen or proved by.
const SEEDS: [u64; 3] = [0x63_686f_6f73, 0x70_726f_7665, 0x73_656e_7365];

/// What is to be proved: the best of some paths, and of orders that anybody could think of.
#[derive(Clone, Debug)]
pub struct Choice {
    /// The best path, none if all have diverged. A caller may take presses out of it.
    pub path: Option<Vec<u32>>,
    groups: Vec<(&'static str, Vec<Vec<u32>>, usize)>,
    chosen: Vec<Chosen>,
}

/// Chooses the best of `paths` and of the orders that they are held against, found in the task's own steps. Where
/// nothing scatters there is one world. The twin as judge has the last word on the path, among the best by the fast
/// solver.
///
/// # Errors
/// If the scene has what the twin has nothing for, or a fall diverges.
pub fn choose(
    case: Case,
    paths: &[Vec<u32>],
    method: Method,
    watch: Listener,
) -> Result<Choice, ProofError> {
    let Case { scene, env, .. } = case;
    if method.judge == Physics::Twin {
        // Refused before the work.
        twin_of(scene)?;
    }
    let mut groups = vec![("path", paths.to_vec(), paths.len())];
    for (name, order, count) in [
        ("random", Order::Random, method.random),
        ("sweep", Order::Sweep, method.random.div_ceil(4)),
        ("outwards", Order::Outwards, method.random.div_ceil(2)),
    ] {
        groups.push((name, sequences(scene, env, order, count, case.seed)?, count));
    }
    let chosen = best_of(case, &groups, method.judge, watch)?;
    Ok(Choice {
        path: chosen[0].0.map(|k| paths[k].clone()),
        groups,
        chosen,
    })
}

/// Proves what was chosen in worlds that chose none of it, and with the twin as judge in the twin's too.
///
/// # Errors
/// If the scene has what the twin has nothing for, or a fall diverges.
pub fn prove(
    case: Case,
    choice: &Choice,
    judge: Physics,
    watch: Listener,
) -> Result<Proof, ProofError> {
    let Case { scene, env, .. } = case;
    let Choice { groups, chosen, .. } = choice;
    let others = groups.iter().zip(chosen).skip(1);
    let others = others.map(|((_, lists, _), (best, _))| best.map_or(&[][..], |k| &lists[k]));
    let path = choice.path.as_deref().unwrap_or_default();
    let lists: Vec<&[u32]> = std::iter::once(path).chain(others).collect();
    let worlds = case.worlds(LIES, SEEDS[1], watch)?;
    let row = |physics, k: usize, left: &[Option<Left>]| {
        let scores: Vec<f64> = chosen[k].1.iter().flatten().copied().collect();
        let [mean_score, deviation_score] = mean_and_deviation(&scores);
        let (name, _, count) = groups[k];
        Row {
            physics,
            order: name.into(),
            count,
            diverged: count - scores.len(),
            mean_score,
            deviation_score,
            worlds: left.len().saturating_sub(1).max(1),
            best: Figures::new(left, env),
        }
    };
    let mut rows = Vec::new();
    let numbers: Vec<Option<u64>> = case.numbers(0..PROVING as u64);
    let mut solver = Judge::new(scene, &worlds, &[case.scatter.finest(env)])?;
    let told = |done, all| watch.count(done, all, "proving");
    let found = pressed(&mut solver, &lists, &numbers, told);
    rows.extend(
        found
            .iter()
            .enumerate()
            .map(|(k, left)| row(Physics::Solver, k, left)),
    );
    let mut best = choice.path.clone().map(|path| Best {
        path,
        physics: Physics::Solver,
        score: rows[0].best.score,
    });
    let mut recording = None;
    if let (Physics::Twin, Some(path)) = (judge, &mut best) {
        let numbers = case.numbers(0..TWIN as u64);
        let (found, seen) = in_twin(case, &worlds, &lists, &numbers, watch)?;
        rows.extend(
            found
                .iter()
                .enumerate()
                .map(|(k, left)| row(Physics::Twin, k, left)),
        );
        let figures = Figures::new(&found[0], env);
        if figures.score.is_finite() {
            (path.physics, path.score) = (Physics::Twin, figures.score);
            recording = seen;
        }
    }
    Ok(Proof {
        rows,
        best,
        recording,
    })
}

/// What a path leaves in the worlds in which [`prove`] proves what was chosen.
///
/// # Errors
/// If a fall diverges.
pub fn figures(case: Case, path: &[u32], watch: Listener) -> Result<Figures, ProofError> {
    let worlds = case.worlds(LIES, SEEDS[1], watch)?;
    let mut judge = Judge::new(case.scene, &worlds, &[case.scatter.finest(case.env)])?;
    let numbers = case.numbers(0..PROVING as u64);
    let told = |done, all| watch.count(done, all, "proving");
    let left = pressed(&mut judge, &[path], &numbers, told).remove(0);
    Ok(Figures::new(&left, case.env))
}

/// What each quantity that scatters does to a path by itself, what hurts most first.
///
/// # Errors
/// If a fall diverges.
pub fn sensitivity(
    case: Case,
    path: &[u32],
    watch: Listener,
) -> Result<Vec<Sensitivity>, ProofError> {
    let quantities: Vec<Quantity> = case.scatter.spreads.keys().copied().collect();
    let of = |&quantity: &Quantity| {
        let scatter = case.scatter.only(quantity);
        let alone = Case {
            scatter: &scatter,
            ..case
        };
        let worlds = alone.worlds(SENSITIVITY, SEEDS[2], Listener::QUIET)?;
        let mut judge = Judge::new(case.scene, &worlds, &[case.scatter.finest(case.env)])?;
        let numbers: Vec<Option<u64>> = (0..SENSITIVITY as u64).map(Some).collect();
        let left = pressed(&mut judge, &[path], &numbers, |_, _| ()).remove(0);
        let scores: Vec<f64> = left
            .iter()
            .map(|left| left.map_or(f64::NAN, |l| l.score))
            .collect();
        Ok(Sensitivity {
            quantity,
            worlds: SENSITIVITY,
            score: scores.iter().sum::<f64>() / scores.len() as f64,
            worst_score: scores
                .iter()
                .copied()
                .min_by(f64::total_cmp)
                .unwrap_or(f64::NAN),
        })
    };
    // One after the other: each takes all cores.
    let told = |k: usize| watch.count(k, quantities.len(), "");
    let each = quantities.iter().enumerate();
    let all = each.map(|(k, quantity)| of(quantity).inspect(|_| told(k + 1)));
    let mut all: Vec<Sensitivity> = all.collect::<Result<_, ProofError>>()?;
    all.sort_by(|a, b| a.worst_score.total_cmp(&b.worst_score));
    Ok(all)
}

impl Case<'_> {
    /// Worlds in which no path is proved.
    ///
    /// # Errors
    /// If a fall diverges.
    pub fn other_worlds(&self, watch: Listener) -> Result<Arc<Worlds>, ProofError> {
        self.worlds(LIES, SEEDS[0], watch)
    }

    /// Worlds in which paths are proved.
    ///
    /// # Errors
    /// If a fall diverges.
    pub fn proving_worlds(&self, watch: Listener) -> Result<Arc<Worlds>, ProofError> {
        self.worlds(LIES, SEEDS[1], watch)
    }

    /// Scores of lists in the first `count` worlds, stepped as `env` says, `[list][world]` [-], 0 for what diverges; and the
    /// CPU time of a list and world [s].
    ///
    /// # Errors
    /// If the task cannot be.
    pub fn scores(
        &self,
        lists: &[&[u32]],
        worlds: &Arc<Worlds>,
        count: usize,
        env: EnvConfig,
        watch: Listener,
    ) -> Result<(Vec<Vec<f64>>, f64), ProofError> {
        let doing = format!("{} substeps a second", env.stepping().substep_rate);
        let mut judge = Judge::new(self.scene, worlds, &[env])?;
        let numbers: Vec<Option<u64>> = (0..count as u64).map(Some).collect();
        let began = ProcessTime::now();
        let told = |done, all| watch.count(done, all, &doing);
        let left = pressed(&mut judge, lists, &numbers, told);
        let seconds = began.elapsed().as_secs_f64() / (lists.len() * count) as f64;
        Ok((scores(&left), seconds))
    }

    /// Scores of lists in these worlds of the twin, as [`scores`](Self::scores).
    ///
    /// # Errors
    /// If the scene has what the twin has nothing for, or a fall diverges.
    pub fn scores_in_twin(
        &self,
        lists: &[&[u32]],
        worlds: &Worlds,
        count: usize,
        watch: Listener,
    ) -> Result<Vec<Vec<f64>>, ProofError> {
        let numbers: Vec<Option<u64>> = (0..count as u64).map(Some).collect();
        let (left, _) = in_twin(*self, worlds, lists, &numbers, watch)?;
        Ok(scores(&left))
    }

    /// Worlds to draw from, under a seed of their own.
    fn worlds(&self, lies: usize, seed: u64, watch: Listener) -> Result<Arc<Worlds>, ProofError> {
        let told = |share| watch.tell(share, "falling");
        let worlds = Worlds::new(self.scene, self.scatter, lies, self.seed ^ seed, told)?;
        Ok(worlds.into())
    }

    /// The world of the scene, and where others differ these.
    fn numbers(&self, worlds: std::ops::Range<u64>) -> Vec<Option<u64>> {
        let others = worlds
            .map(Some)
            .filter(|_| !self.scatter.spreads.is_empty());
        std::iter::once(None).chain(others).collect()
    }
}

/// Of each origin the number of the best list, and the scores of all [-]; none where one diverges.
type Chosen = (Option<usize>, Vec<Option<f64>>);

/// The best list of each origin; of the first by the twin, if that is asked.
fn best_of(
    case: Case,
    groups: &[(&str, Vec<Vec<u32>>, usize)],
    judge: Physics,
    watch: Listener,
) -> Result<Vec<Chosen>, ProofError> {
    let worlds = case.worlds(CHOOSING.iter().sum::<u64>() as usize, SEEDS[0], watch)?;
    let mut solver = Judge::new(case.scene, &worlds, &[case.scatter.finest(case.env)])?;
    let all: Vec<(usize, usize)> = (groups.iter().enumerate())
        .flat_map(|(group, (_, paths, _))| (0..paths.len()).map(move |k| (group, k)))
        .collect();
    let [few, more] = match worlds.differ() {
        true => [0..CHOOSING[0], CHOOSING[0]..CHOOSING[0] + CHOOSING[1]],
        false => [0..1, 0..0],
    };
    let told = |done, all| watch.count(done, all, "choosing");
    let mut press = |those: &[(usize, usize)], worlds: std::ops::Range<u64>| {
        let lists: Vec<&[u32]> = those
            .iter()
            .map(|&(group, k)| &*groups[group].1[k])
            .collect();
        let numbers: Vec<Option<u64>> = worlds.map(Some).collect();
        pressed(&mut solver, &lists, &numbers, told)
    };
    let of = |left: &[Option<Left>], value: fn(&Left) -> f64| -> Option<Vec<f64>> {
        left.iter().map(|left| left.as_ref().map(value)).collect()
    };
    let first = press(&all, few);
    let judged =
        |left: &[Option<Left>]| of(left, |left| left.worth).map(|all| case.scatter.judge(&all));
    let mut found: Vec<Chosen> = Vec::new();
    let mut ranked: Vec<Vec<usize>> = Vec::new();
    for group in 0..groups.len() {
        let own: Vec<usize> = (0..all.len())
            .filter(|&place| all[place].0 == group)
            .collect();
        let scores = own.iter().map(|&place| {
            let scores = of(&first[place], |left| left.score)?;
            Some(scores.iter().sum::<f64>() / scores.len() as f64)
        });
        let scores = scores.collect();
        let mut ended: Vec<usize> = own
            .iter()
            .copied()
            .filter(|&place| judged(&first[place]).is_some())
            .collect();
        ended.sort_by(|&a, &b| {
            let [a, b] = [a, b].map(|place| judged(&first[place]).unwrap_or(f64::NAN));
            b.total_cmp(&a)
        });
        ended.truncate(ended.len().div_ceil(4).max(2));
        let lists: Vec<(usize, usize)> = ended.iter().map(|&place| all[place]).collect();
        let second = press(&lists, more.clone());
        let whole = ended.iter().zip(second).map(|(&place, second)| {
            let left = [&first[place][..], &second].concat();
            (all[place].1, judged(&left).unwrap_or(f64::NEG_INFINITY))
        });
        let mut whole: Vec<(usize, f64)> = whole.collect();
        whole.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        ranked.push(whole.into_iter().map(|(k, _)| k).collect());
        found.push((ranked[group].first().copied(), scores));
    }
    if judge == Physics::Twin && ranked[0].len() > 1 {
        ranked[0].truncate(TWIN_CHOOSING[0]);
        let lists: Vec<&[u32]> = ranked[0].iter().map(|&k| &*groups[0].1[k]).collect();
        let best = best_in_twin(case, &worlds, &lists, watch)?;
        found[0].0 = best.map(|place| ranked[0][place]).or(found[0].0);
    }
    Ok(found)
}

/// The list that the twin judges best, the first of equal ones; none if all diverge there.
fn best_in_twin(
    case: Case,
    worlds: &Worlds,
    lists: &[&[u32]],
    watch: Listener,
) -> Result<Option<usize>, ProofError> {
    let mut numbers = case.numbers(0..TWIN_CHOOSING[1] as u64);
    if numbers.len() > 1 {
        // The world of the scene is no draw.
        numbers.remove(0);
    }
    let (left, _) = in_twin(case, worlds, lists, &numbers, watch)?;
    let worth = |left: &[Option<Left>]| -> Option<f64> {
        let all: Option<Vec<f64>> = left.iter().map(|left| Some(left.as_ref()?.worth)).collect();
        Some(case.scatter.judge(&all?))
    };
    let judged = left.iter().enumerate();
    let judged = judged.filter_map(|(place, left)| Some((place, worth(left)?)));
    let best = judged.rev().max_by(|a, b| a.1.total_cmp(&b.1));
    Ok(best.map(|(place, _)| place))
}

/// What lists leave in some worlds, `[list][world]`.
fn pressed(
    judge: &mut Judge,
    lists: &[&[u32]],
    worlds: &[Option<u64>],
    told: impl Fn(usize, usize) + Sync,
) -> Vec<Vec<Option<Left>>> {
    let jobs = lists
        .iter()
        .flat_map(|list| worlds.iter().map(|&world| Job::new(list, world)));
    let jobs: Vec<Job> = jobs.collect();
    let all = jobs.len();
    let ended = judge.press(0, jobs, Left::new, |count| told(count, all));
    let ended = ended.into_iter();
    let left: Vec<Option<Left>> = ended.map(|one| one.found).collect();
    let row = |k: usize| left[k * worlds.len()..(k + 1) * worlds.len()].to_vec();
    (0..lists.len()).map(row).collect()
}

/// What lists leave in the same worlds of the twin, `[list][world]`, and the first list as it was pressed in the
/// first world.
#[allow(clippy::type_complexity)]
fn in_twin(
    case: Case,
    worlds: &Worlds,
    lists: &[&[u32]],
    numbers: &[Option<u64>],
    watch: Listener,
) -> Result<(Vec<Vec<Option<Left>>>, Option<Recording>), ProofError> {
    let Case { scene, env, .. } = case;
    watch.tell(0.0, "the twin's falls");
    let drawn: Vec<(Misplacement, Parameters)> = (numbers.iter())
        .map(|number| {
            let world = number.map(|number| worlds.world(number));
            let off = world.as_ref().map(|world| worlds.misplacement(world.lie));
            let parameters = world.map(|world| world.parameters);
            (off.unwrap_or_default(), parameters.unwrap_or_default())
        })
        .collect();
    let falls = watch.each(&drawn, |(off, fabric)| resting_in_twin(scene, off, fabric));
    let falls: Vec<_> = falls.into_iter().collect::<Result<_, ProofError>>()?;
    let tasks = falls.into_iter().zip(&drawn).map(|(scene, (_, fabric))| {
        let mut env = env.clone();
        env.parameters = env.parameters.and(fabric);
        Task::new(scene, &env)
    });
    let tasks: Vec<Task> = tasks.collect::<Result<_, _>>()?;
    let recording = Mutex::new(Recording::new(&tasks[0], true));
    let see = |pressed: usize, episode: &EpisodeState| {
        if pressed == 0 {
            let mut recording = recording.lock().expect("nobody panics");
            recording.see(&tasks[0], episode);
        }
    };
    let jobs = lists
        .iter()
        .flat_map(|list| tasks.iter().map(move |task| (task, *list)));
    let (ends, _) = replay_in_twin(&jobs.collect::<Vec<_>>(), &see, watch)?;
    let left = ends
        .iter()
        .enumerate()
        .map(|(k, end)| Left::new(&tasks[k % tasks.len()], end.as_ref()?));
    let left: Vec<Option<Left>> = left.collect();
    let rows = left.chunks(tasks.len()).map(<[_]>::to_vec).collect();
    Ok((rows, recording.into_inner().ok()))
}

/// `[list][world]`, 0 for what diverges.
fn scores(left: &[Vec<Option<Left>>]) -> Vec<Vec<f64>> {
    let score = |left: &Option<Left>| left.map_or(0.0, |left| left.score);
    let row = |left: &Vec<Option<Left>>| left.iter().map(score).collect();
    left.iter().map(row).collect()
}

impl Left {
    /// What presses have left that have ended so; none if that is beyond belief.
    fn new(task: &Task, end: &EpisodeState) -> Option<Self> {
        let worth = task.worth(end)?;
        let (cloth, path) = (end.cloth(), task.figures(&task.points(end.presses())));
        let sheared = sheared(
            &task.scene.lamina,
            &cloth.position,
            &task.region.vertices,
            f64::INFINITY,
        );
        Some(Self {
            distance_m: task.distance(cloth),
            surplus_m: task.surplus(cloth),
            score: task.score(cloth),
            worth,
            undraped_inner: task.undraped_inner(cloth),
            shear_deg: sheared.max.to_degrees(),
            path,
        })
    }
}

impl Figures {
    /// Of what is left in the world of the scene and then in others, if there are some.
    fn new(left: &[Option<Left>], env: &EnvConfig) -> Self {
        let all: Option<Vec<Left>> = left.iter().copied().collect();
        let all = all.unwrap_or_default();
        let (nominal, others) = match &all[..] {
            [nominal, others @ ..] if !others.is_empty() => (Some(nominal), others),
            one => (one.first(), one),
        };
        let of = |value: fn(&Left) -> f64| -> Vec<f64> { others.iter().map(value).collect() };
        let mean = |value| mean_and_deviation(&of(value))[0];
        let scores = of(|left| left.score);
        let [score, worst_quarter_score] = mean_and_worst_quarter(&scores);
        let path = nominal.map(|left| left.path).unwrap_or_default();
        Self {
            score,
            worst_quarter_score,
            worst_score: scores
                .iter()
                .copied()
                .min_by(f64::total_cmp)
                .unwrap_or(f64::NAN),
            nominal_score: nominal.map_or(f64::NAN, |left| left.score),
            distance_m: mean(|left| left.distance_m),
            surplus_m: mean(|left| left.surplus_m),
            undraped_inner: mean(|left| left.undraped_inner as f64),
            shear_deg: mean(|left| left.shear_deg),
            robot_s: env.costs.seconds(&path),
            path,
        }
    }
}

#[cfg(test)]
mod tests;
