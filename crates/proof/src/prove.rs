//! Whether a path holds: played in worlds that chose none, in finer steps and in the twin, beside orders
//! that anybody could think of.

use serde::{Deserialize, Serialize};

use crate::case::{Case, Figures, LIES, Left, SEEDS, in_twin, pressed};
use crate::orders::sequences;
use crate::twin::twin_of;
use crate::{Listener, ProofError};
use drape_cloth::math::mean_and_deviation;
use drape_task::cluster::Cluster;
use drape_task::env::{Draping, End, Member, Quantity, Task, Tasks, Worlds};
use drape_task::recording::Recording;
use drape_task::search::{Inwards, Judge, Order};

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

/// What paths are held against, and by whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Method {
    /// Random orders, none for no others either; sweeps are a quarter as many and orders outwards half as many. Orders
    /// inwards are nine.
    pub random: usize,
    /// Who has the last word on the best path, and proves it last.
    pub judge: Physics,
}

/// Paths of one origin in one physics.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    pub physics: Physics,
    /// `path` for those that are proved, else `random`, `sweep`, `outwards` or `inwards`; or, see [`looked`], `blind` or
    /// `policy`.
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

/// What [`prove`] has found, by physics and order.
#[derive(Clone, Debug, PartialEq)]
pub struct Proof {
    pub rows: Vec<Row>,
    /// None if all paths have diverged.
    pub best: Option<Best>,
    /// The best path in the twin, if that has proved it.
    pub recording: Option<Recording>,
}

impl Proof {
    /// Whether there is a best path, and it diverges in a world that it is proved in.
    pub fn is_lost(&self) -> bool {
        let lost = |row: &Row| row.order == "path" && row.best.score.is_nan();
        self.best.is_some() && self.rows.iter().any(lost)
    }
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

/// Worlds that the best of each origin is chosen by, all in the first and the better in the others too,
const CHOOSING: [u64; 2] = [3, 6];
/// paths that the twin sees if it is asked, and worlds in which it does,
const TWIN_CHOOSING: [usize; 2] = [12, 3];
/// those that it is then proved in,
const PROVING: usize = 24;
/// and those of the twin.
const TWIN: usize = 6;
/// Places along either side of the region about which orders inwards are held against a path.
const INWARDS: usize = 3;
/// Worlds of one quantity.
const SENSITIVITY: usize = 8;

/// What is to be proved: the best of some paths, and of orders that anybody could think of.
#[derive(Clone, Debug)]
pub struct Choice {
    /// The best path, none if all have diverged. A caller may take presses out of it.
    pub path: Option<Vec<u32>>,
    groups: Vec<(&'static str, Vec<Vec<u32>>, usize)>,
    chosen: Vec<Chosen>,
}

impl Choice {
    /// Gives up the best path, which counts as diverged from now on, for the next best; false if that is unknown.
    pub fn go_on(&mut self) -> bool {
        let Chosen { ranked, scores } = &mut self.chosen[0];
        let Some(&next) = ranked.get(1) else {
            return false;
        };
        scores[ranked.remove(0)] = None;
        self.path = Some(self.groups[0].1[next].clone());
        true
    }
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
    listener: Listener,
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
        if count > 0 {
            groups.push((name, sequences(scene, env, order, count, case.seed)?, count));
        }
    }
    if method.random > 0 {
        let task = Task::new(scene.clone(), env)?;
        let inwards = Inwards::over(&task, INWARDS).into_iter();
        let lists: Vec<Vec<u32>> = inwards.map(|one| one.list(&task)).collect();
        let count = lists.len();
        groups.push(("inwards", lists, count));
    }
    let chosen = best_of(case, &groups, method.judge, listener)?;
    Ok(Choice {
        path: chosen[0].ranked.first().map(|&k| paths[k].clone()),
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
    listener: Listener,
) -> Result<Proof, ProofError> {
    let Case { scene, env, .. } = case;
    let Choice { groups, chosen, .. } = choice;
    let others = groups.iter().zip(chosen).skip(1);
    let others = others.map(|((_, lists, _), chosen)| {
        let best = chosen.ranked.first();
        best.map_or(&[][..], |&k| &lists[k])
    });
    let path = choice.path.as_deref().unwrap_or_default();
    let lists: Vec<&[u32]> = std::iter::once(path).chain(others).collect();
    let worlds = case.worlds(LIES, SEEDS[1], listener)?;
    let row = |physics, k: usize, left: &[Option<Left>]| {
        let scores: Vec<f64> = chosen[k].scores.iter().flatten().copied().collect();
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
    let told = |done, all| listener.count(done, all, "proving");
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
        let (found, seen) = in_twin(case, &worlds, &lists, &numbers, listener)?;
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

/// What looking is worth, in the worlds in which [`prove`] proves: a row `blind` of a path, and a row `policy` of who
/// sees each of the worlds and chooses every press by that. `choose` gives an action to each environment.
///
/// # Errors
/// If a fall diverges.
pub fn looked(
    case: Case,
    path: &[u32],
    mut choose: impl FnMut(&Draping) -> Vec<u32>,
    listener: Listener,
) -> Result<[Row; 2], ProofError> {
    let worlds = case.worlds(LIES, SEEDS[1], listener)?;
    let numbers = case.numbers(0..PROVING as u64);
    let env = case.scatter.finest(case.env);
    let mut judge = Judge::new(case.scene, &worlds, std::slice::from_ref(&env))?;
    let blind = pressed(&mut judge, &[path], &numbers, |_, _| ()).remove(0);
    let member = Member {
        scene: case.scene.clone(),
        config: env,
        count: numbers.len(),
        worlds: Some(worlds.clone()),
    };
    let mut draping = Draping::on(vec![member], &Cluster::default())?;
    for (index, number) in numbers.iter().enumerate() {
        let world = number.map(|number| worlds.world(number));
        draping.enter(index, world.as_ref());
    }
    let task = |index| draping.task(index).clone();
    let tasks: Vec<Task> = (0..numbers.len()).map(task).collect();
    let mut ends: Vec<Option<Option<Left>>> = vec![None; tasks.len()];
    while ends.iter().any(Option::is_none) {
        let actions = choose(&draping);
        for (index, outcome) in draping.step(&actions).into_iter().enumerate() {
            if let (Some(episode), None) = (outcome.episode, &ends[index]) {
                let end = draping.finished(index);
                let end = end.filter(|_| episode.end != End::Diverged);
                ends[index] = Some(end.and_then(|end| Left::new(&tasks[index], end)));
            }
        }
        let ended = ends.iter().flatten().count();
        listener.count(ended, ends.len(), "looking");
    }
    let seen: Vec<Option<Left>> = ends.into_iter().flatten().collect();
    let row = |order: &str, left: &[Option<Left>]| {
        let best = Figures::new(left, case.env);
        Row {
            physics: Physics::Solver,
            order: order.into(),
            count: 1,
            diverged: usize::from(best.score.is_nan()),
            mean_score: best.score,
            deviation_score: 0.0,
            worlds: left.len().saturating_sub(1).max(1),
            best,
        }
    };
    Ok([row("blind", &blind), row("policy", &seen)])
}

/// What a path leaves in the worlds in which [`prove`] proves what was chosen.
///
/// # Errors
/// If a fall diverges.
pub fn figures(case: Case, path: &[u32], listener: Listener) -> Result<Figures, ProofError> {
    let worlds = case.worlds(LIES, SEEDS[1], listener)?;
    let mut judge = Judge::new(case.scene, &worlds, &[case.scatter.finest(case.env)])?;
    let numbers = case.numbers(0..PROVING as u64);
    let told = |done, all| listener.count(done, all, "proving");
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
    listener: Listener,
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
    let told = |k: usize| listener.count(k, quantities.len(), "");
    let each = quantities.iter().enumerate();
    let all = each.map(|(k, quantity)| of(quantity).inspect(|_| told(k + 1)));
    let mut all: Vec<Sensitivity> = all.collect::<Result<_, ProofError>>()?;
    all.sort_by(|a, b| a.worst_score.total_cmp(&b.worst_score));
    Ok(all)
}

/// Of the lists of one origin the numbers of the better ones, the best first, and the scores of all [-]; none where one
/// diverges.
#[derive(Clone, Debug)]
struct Chosen {
    ranked: Vec<usize>,
    scores: Vec<Option<f64>>,
}

/// The better lists of each origin; the best of the first is the twin's choice, if that is asked.
fn best_of(
    case: Case,
    groups: &[(&str, Vec<Vec<u32>>, usize)],
    judge: Physics,
    listener: Listener,
) -> Result<Vec<Chosen>, ProofError> {
    let worlds = case.worlds(CHOOSING.iter().sum::<u64>() as usize, SEEDS[0], listener)?;
    let mut solver = Judge::new(case.scene, &worlds, &[case.scatter.finest(case.env)])?;
    let all: Vec<(usize, usize)> = (groups.iter().enumerate())
        .flat_map(|(group, (_, paths, _))| (0..paths.len()).map(move |k| (group, k)))
        .collect();
    let [few, more] = match worlds.differ() {
        true => [0..CHOOSING[0], CHOOSING[0]..CHOOSING[0] + CHOOSING[1]],
        false => [0..1, 0..0],
    };
    let told = |done, all| listener.count(done, all, "choosing");
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
        let ranked = whole.into_iter().map(|(k, _)| k).collect();
        found.push(Chosen { ranked, scores });
    }
    let ranked = &mut found[0].ranked;
    if judge == Physics::Twin && ranked.len() > 1 {
        let seen = ranked.iter().take(TWIN_CHOOSING[0]);
        let lists: Vec<&[u32]> = seen.map(|&k| &*groups[0].1[k]).collect();
        if let Some(best) = best_in_twin(case, &worlds, &lists, listener)? {
            ranked[..=best].rotate_right(1);
        }
    }
    Ok(found)
}

/// The list that the twin judges best, the first of equal ones: only the better half goes on to the next world. None if
/// all diverge there.
fn best_in_twin(
    case: Case,
    worlds: &Worlds,
    lists: &[&[u32]],
    listener: Listener,
) -> Result<Option<usize>, ProofError> {
    let mut numbers = case.numbers(0..TWIN_CHOOSING[1] as u64);
    if numbers.len() > 1 {
        // The world of the scene is no draw.
        numbers.remove(0);
    }
    let mut left: Vec<(usize, Vec<f64>)> = (0..lists.len()).map(|k| (k, Vec::new())).collect();
    for (round, number) in numbers.into_iter().enumerate() {
        if round > 0 {
            left.truncate(left.len().div_ceil(2).max(3));
        }
        let those: Vec<&[u32]> = left.iter().map(|&(k, _)| lists[k]).collect();
        let (ended, _) = in_twin(case, worlds, &those, &[number], listener)?;
        let more = left.into_iter().zip(ended);
        let more = more.filter_map(|((k, mut worths), ended)| {
            worths.push(ended[0]?.worth);
            Some((k, worths))
        });
        left = more.collect();
        let worth = |(_, worths): &(usize, Vec<f64>)| case.scatter.judge(worths);
        left.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
    }
    Ok(left.first().map(|&(k, _)| k))
}

#[cfg(test)]
mod tests;
