//! Lists of presses, judged in worlds that differ.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use rayon::prelude::*;

use crate::cluster::Cluster;
use crate::env::{Draping, EnvConfig, EpisodeState, Member, Task, Tasks, Worlds};
use drape_cloth::file::ValueError;
use drape_cloth::scene::Scene;
use drape_cloth::sim::Device;

/// Environments that go in step on a CPU: as many as the lanes of its widest registers. Others would wait
/// for the longest list.
const ON_CPU: usize = 16;
/// And on a GPU.
const ON_GPU: usize = 1024;

/// A list to be pressed in a world.
#[derive(Clone)]
pub struct Job<'a> {
    pub list: &'a [u32],
    /// Number of the world; none for that of the scene.
    pub world: Option<u64>,
    /// Where a list with the same beginning has come to in that world, if it is known.
    pub from: Option<Arc<EpisodeState>>,
}

/// How a list has ended.
pub struct Ended<T> {
    /// What was asked of its end; none if the simulation diverged or the end is beyond belief.
    pub found: Option<T>,
    /// States on the way, before the first press and after each so many.
    pub states: Vec<Arc<EpisodeState>>,
}

/// Environments in which lists are pressed, each in a world of its own, on all cores.
pub struct Judge {
    /// With the number of their rate. All of one rate take from one queue.
    benches: Vec<(usize, Draping)>,
    rates: usize,
    worlds: Arc<Worlds>,
    /// Presses made so far.
    spent: u64,
}

impl Judge {
    /// For the task on `scene`, in `worlds` round it that take the steps of the `rated` tasks in turn, as
    /// [`Scatter::rated`](crate::env::Scatter::rated) gives them, or of one alone.
    ///
    /// # Errors
    /// If a value is out of range, or the device does not compute the scene.
    ///
    /// # Panics
    /// If no task is given.
    pub fn new(
        scene: &Arc<Scene>,
        worlds: &Arc<Worlds>,
        rated: &[EnvConfig],
    ) -> Result<Self, ValueError> {
        let (copies, count) = match rated[0].device {
            Device::Cpu => (rayon::current_num_threads(), ON_CPU),
            Device::Gpu(_) => (1, ON_GPU),
        };
        let mut benches = Vec::new();
        for (rate, config) in rated.iter().enumerate() {
            // Worlds of a rate that stands twice come to the benches of the first.
            if rated[..rate].contains(config) {
                continue;
            }
            for _ in 0..copies {
                let member = Member {
                    scene: scene.clone(),
                    config: config.clone(),
                    count,
                    worlds: Some(worlds.clone()),
                };
                benches.push((rate, Draping::on(vec![member], &Cluster::default())?));
            }
        }
        Ok(Self {
            benches,
            rates: rated.len(),
            worlds: worlds.clone(),
            spent: 0,
        })
    }

    /// The task as the scene says.
    pub fn task(&self) -> &Task {
        &self.benches[0].1.tasks()[0]
    }

    /// By what worlds scatter, and how they are judged.
    pub fn worlds(&self) -> &Worlds {
        &self.worlds
    }

    /// Presses made so far.
    pub fn spent(&self) -> u64 {
        self.spent
    }

    /// Presses lists, as many at once as there are lanes, and asks `of` the end of each in the task of its
    /// world. With a `stride` gives the states before the first press and after each so many. `told` hears
    /// how many presses are made, of how many.
    ///
    /// What is found depends on lists and worlds alone.
    pub fn press<T: Send>(
        &mut self,
        jobs: &[Job],
        stride: Option<usize>,
        of: impl Fn(&Task, &EpisodeState) -> Option<T> + Sync,
        told: impl Fn(u64, u64) + Sync,
    ) -> Vec<Ended<T>> {
        let begun = |job: &Job| job.from.as_ref().map_or(0, |from| from.presses().len());
        let left = |job: &Job| job.list.len() - begun(job);
        let all = jobs.iter().map(|job| left(job) as u64).sum();
        let mut order: Vec<usize> = (0..jobs.len()).collect();
        order.sort_by_key(|&k| std::cmp::Reverse(left(&jobs[k])));
        // By the first of equal rates.
        let mut queues: Vec<Mutex<VecDeque<usize>>> = Vec::new();
        queues.resize_with(self.rates, Mutex::default);
        let rate = |world: Option<u64>| {
            let rate = (world.unwrap_or(0) % self.rates as u64) as usize;
            let known = self.benches.iter().map(|(known, _)| *known);
            known
                .filter(|&known| known <= rate)
                .max()
                .expect("the first is there")
        };
        for k in order {
            let queue = queues[rate(jobs[k].world)].get_mut();
            queue.expect("nobody has panicked").push_back(k);
        }
        let made = AtomicU64::new(0);
        let worlds = &self.worlds;
        let work = |(rate, env): &mut (usize, Draping)| {
            let next = || queues[*rate].lock().expect("nobody panics").pop_front();
            let mut ended = Vec::new();
            let mut open: Vec<Option<(usize, Ended<T>)>> = Vec::new();
            open.resize_with(env.count(), || None);
            loop {
                for (index, lane) in open.iter_mut().enumerate() {
                    while lane.is_none() {
                        let Some(k) = next() else { break };
                        let job = &jobs[k];
                        match &job.from {
                            Some(from) => env.go_on(index, from),
                            None => {
                                let world = job.world.map(|number| worlds.world(number));
                                env.enter(index, world.as_ref());
                            }
                        }
                        let mut one = Ended {
                            found: None,
                            states: Vec::new(),
                        };
                        if stride.is_some() {
                            one.states.push(Arc::new(env.episode(index)));
                        }
                        if left(job) == 0 {
                            one.found = of(env.task(index), &env.episode(index));
                            ended.push((k, one));
                            continue;
                        }
                        *lane = Some((k, one));
                    }
                }
                let pressed = |(index, lane): (usize, &Option<(usize, Ended<T>)>)| {
                    let (k, _) = lane.as_ref()?;
                    Some(jobs[*k].list[env.pressed(index)])
                };
                let vertices: Vec<Option<u32>> = open.iter().enumerate().map(pressed).collect();
                if vertices.iter().all(Option::is_none) {
                    return ended;
                }
                let finite = env.press(&vertices);
                for (index, lane) in open.iter_mut().enumerate() {
                    let Some((k, one)) = lane else { continue };
                    made.fetch_add(1, Ordering::Relaxed);
                    let (count, is_last) = {
                        let count = env.pressed(index);
                        (count, count == jobs[*k].list.len())
                    };
                    let is_kept = stride.is_some_and(|stride| count.is_multiple_of(stride));
                    if finite[index] && (is_last || is_kept) {
                        let state = env.episode(index);
                        if is_last {
                            one.found = of(env.task(index), &state);
                        }
                        if is_kept {
                            one.states.push(Arc::new(state));
                        }
                    }
                    if is_last || !finite[index] {
                        ended.extend(lane.take());
                    }
                }
                told(made.load(Ordering::Relaxed), all);
            }
        };
        let ended: Vec<(usize, Ended<T>)> =
            self.benches.par_iter_mut().flat_map_iter(work).collect();
        self.spent += made.into_inner();
        let mut sorted: Vec<Option<Ended<T>>> = Vec::new();
        sorted.resize_with(jobs.len(), || None);
        for (k, one) in ended {
            sorted[k] = Some(one);
        }
        let sorted: Option<Vec<Ended<T>>> = sorted.into_iter().collect();
        sorted.expect("every queue has a bench")
    }

    /// Scores of lists, each in the same worlds, less what they cost, `[list][world]`; -1 where the simulation
    /// diverges.
    pub fn scores(
        &mut self,
        lists: &[&[u32]],
        worlds: &[u64],
        told: impl Fn(u64, u64) + Sync,
    ) -> Vec<Vec<f64>> {
        let jobs = lists.iter().flat_map(|list| {
            worlds.iter().map(|&world| Job {
                list,
                world: Some(world),
                from: None,
            })
        });
        let jobs: Vec<Job> = jobs.collect();
        let ended = self.press(&jobs, None, Task::worth, told).into_iter();
        let scores: Vec<f64> = ended.map(|one| one.found.unwrap_or(DIVERGED)).collect();
        let row = |k: usize| scores[k * worlds.len()..(k + 1) * worlds.len()].to_vec();
        (0..lists.len()).map(row).collect()
    }

    /// The best of some lists, best first, with what they come to: all are pressed in three worlds, then the
    /// better half, but as many as are to be `kept`, in twice as many others, and so on. `worlds` are the
    /// numbers of the first and of one behind the last.
    pub fn race(
        &mut self,
        lists: &[&[u32]],
        worlds: Range<u64>,
        kept: usize,
        told: impl Fn(u64, u64) + Sync,
    ) -> Vec<(usize, f64)> {
        let mut left: Vec<usize> = (0..lists.len()).collect();
        let mut scores: Vec<Vec<f64>> = vec![Vec::new(); lists.len()];
        // Where worlds do not differ one is enough.
        let end = match self.worlds.differ() {
            true => worlds.end,
            false => worlds.start + 1,
        };
        let (mut from, mut count) = (worlds.start, 3);
        loop {
            let to = (from + count).min(end);
            let own: Vec<&[u32]> = left.iter().map(|&k| lists[k]).collect();
            let new: Vec<u64> = (from..to).collect();
            for (&k, more) in left.iter().zip(self.scores(&own, &new, &told)) {
                scores[k].extend(more);
            }
            let worth = |k: usize| self.worlds.scatter.judge(&scores[k]);
            left.sort_by(|&a, &b| worth(b).total_cmp(&worth(a)));
            if to == end {
                return left.into_iter().map(|k| (k, worth(k))).collect();
            }
            left.truncate(left.len().div_ceil(2).max(kept));
            (from, count) = (to, 2 * count);
        }
    }
}

/// Score of a list that diverges.
pub(super) const DIVERGED: f64 = -1.0;
