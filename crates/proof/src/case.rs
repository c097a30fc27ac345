//! A task in worlds that scatter, and what lists of presses leave there, in the fast solver and in the twin.

use std::sync::{Arc, Mutex};

use cpu_time::ProcessTime;
use serde::Serialize;

use crate::presses::{replay_in_twin, resting_in_twin};
use crate::{Listener, ProofError};
use drape_cloth::math::mean_and_deviation;
use drape_cloth::measure::sheared;
use drape_cloth::scene::{Misplacement, Scene};
use drape_cloth::sim::Parameters;
use drape_task::env::{EnvConfig, EpisodeState, Scatter, Task, Worlds, mean_and_worst_quarter};
use drape_task::path::PathFigures;
use drape_task::recording::Recording;
use drape_task::search::{Job, Judge};

/// What is to be proved: a task on a scene, and how its worlds scatter.
#[derive(Clone, Copy)]
pub struct Case<'a> {
    pub scene: &'a Arc<Scene>,
    pub env: &'a EnvConfig,
    pub scatter: &'a Scatter,
    /// Worlds are drawn under it, and random orders.
    pub seed: u64,
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

/// What a path has left in a world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Left {
    pub distance_m: f64,
    pub surplus_m: f64,
    pub score: f64,
    /// Score less costs.
    pub worth: f64,
    pub undraped_inner: usize,
    pub shear_deg: f64,
    pub path: PathFigures,
}

/// Lies of the blank among the worlds of a proof.
pub(crate) const LIES: usize = 16;
/// What sets seeds apart: no world that a path was found in is one that it is chosen or proved by.
pub(crate) const SEEDS: [u64; 3] = [0x63_686f_6f73, 0x70_726f_7665, 0x73_656e_7365];

impl Case<'_> {
    /// Worlds in which no path is proved.
    ///
    /// # Errors
    /// If a fall diverges.
    pub fn other_worlds(&self, listener: Listener) -> Result<Arc<Worlds>, ProofError> {
        self.worlds(LIES, SEEDS[0], listener)
    }

    /// Worlds in which paths are proved.
    ///
    /// # Errors
    /// If a fall diverges.
    pub fn proving_worlds(&self, listener: Listener) -> Result<Arc<Worlds>, ProofError> {
        self.worlds(LIES, SEEDS[1], listener)
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
        listener: Listener,
    ) -> Result<(Vec<Vec<f64>>, f64), ProofError> {
        let doing = format!("{} substeps a second", env.stepping().substep_rate);
        let mut judge = Judge::new(self.scene, worlds, &[env])?;
        let numbers: Vec<Option<u64>> = (0..count as u64).map(Some).collect();
        let began = ProcessTime::now();
        let told = |done, all| listener.count(done, all, &doing);
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
        listener: Listener,
    ) -> Result<Vec<Vec<f64>>, ProofError> {
        let numbers: Vec<Option<u64>> = (0..count as u64).map(Some).collect();
        let (left, _) = in_twin(*self, worlds, lists, &numbers, listener)?;
        Ok(scores(&left))
    }

    /// Worlds to draw from, under a seed of their own.
    pub(crate) fn worlds(
        &self,
        lies: usize,
        seed: u64,
        listener: Listener,
    ) -> Result<Arc<Worlds>, ProofError> {
        let told = |share| listener.tell(share, "falling");
        let worlds = Worlds::new(self.scene, self.scatter, lies, self.seed ^ seed, told)?;
        Ok(worlds.into())
    }

    /// The world of the scene, and where others differ these.
    pub(crate) fn numbers(&self, worlds: std::ops::Range<u64>) -> Vec<Option<u64>> {
        let others = worlds
            .map(Some)
            .filter(|_| !self.scatter.spreads.is_empty());
        std::iter::once(None).chain(others).collect()
    }
}

/// What lists leave in some worlds, `[list][world]`.
pub(crate) fn pressed(
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
pub(crate) fn in_twin(
    case: Case,
    worlds: &Worlds,
    lists: &[&[u32]],
    numbers: &[Option<u64>],
    listener: Listener,
) -> Result<(Vec<Vec<Option<Left>>>, Option<Recording>), ProofError> {
    let Case { scene, env, .. } = case;
    listener.tell(0.0, "the twin's falls");
    let drawn: Vec<(Misplacement, Parameters)> = (numbers.iter())
        .map(|number| {
            let world = number.map(|number| worlds.world(number));
            let off = world.as_ref().map(|world| worlds.misplacement(world.lie));
            let parameters = world.map(|world| world.parameters);
            (off.unwrap_or_default(), parameters.unwrap_or_default())
        })
        .collect();
    let falls = listener.each(&drawn, |(off, fabric)| resting_in_twin(scene, off, fabric));
    let falls: Vec<_> = falls.into_iter().collect::<Result<_, ProofError>>()?;
    let tasks = falls.into_iter().zip(&drawn).map(|(scene, (_, fabric))| {
        let mut env = env.clone();
        env.parameters = env.parameters.and(fabric);
        Task::new(scene, &env)
    });
    let tasks: Vec<Task> = tasks.collect::<Result<_, _>>()?;
    let recording = Mutex::new(Recording {
        by_twin: true,
        ..Recording::new(&tasks[0])
    });
    let see = |pressed: usize, episode: &EpisodeState| {
        if pressed == 0 {
            let mut recording = recording.lock().expect("nobody panics");
            recording.see(&tasks[0], episode);
        }
    };
    let jobs = lists
        .iter()
        .flat_map(|list| tasks.iter().map(move |task| (task, *list)));
    let (ends, _) = replay_in_twin(&jobs.collect::<Vec<_>>(), &see, listener)?;
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
    pub fn new(task: &Task, end: &EpisodeState) -> Option<Self> {
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
    pub(crate) fn new(left: &[Option<Left>], env: &EnvConfig) -> Self {
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
