//! Lists of presses, judged in worlds that differ.

use std::cmp::Reverse;
use std::collections::VecDeque;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};

use crate::cluster::Cluster;
use crate::env::{
    Draping, EnvConfig, EpisodeState, Member, Task, Tasks, Worlds, most_environments,
};
use drape_cloth::file::ValueError;
use drape_cloth::scene::Scene;
use drape_cloth::sim::Device;

/// Environments that go in step on a CPU: as many as the lanes of its widest registers. Others would wait
/// for the longest list.
const ON_CPU: usize = 16;
/// And on a GPU.
const ON_GPU: usize = 1024;
/// Score of a list that diverges.
pub(super) const DIVERGED: f64 = -1.0;

/// A list to be pressed in a world.
#[derive(Clone)]
pub struct Job {
    pub list: Arc<[u32]>,
    /// Number of the world; none for that of the scene.
    pub world: Option<u64>,
    /// Where a list with the same beginning has come to in that world, if it is known.
    pub from: Option<Arc<EpisodeState>>,
    /// Keeps the states before the first press and after each so many.
    pub stride: Option<usize>,
}

impl Job {
    /// From the beginning to the end.
    pub fn new(list: &[u32], world: Option<u64>) -> Self {
        Self {
            list: list.into(),
            world,
            from: None,
            stride: None,
        }
    }

    /// Presses that are to be made.
    pub fn left(&self) -> usize {
        let made = self.from.as_ref().map_or(0, |from| from.presses().len());
        self.list.len() - made
    }
}

/// How a list has ended.
pub struct Ended<T> {
    /// What was asked of its end; none if the simulation diverged or the end is beyond belief.
    pub found: Option<T>,
    /// States on the way.
    pub states: Vec<Arc<EpisodeState>>,
}

/// Environments in which lists are pressed, each in a world of its own, on all cores.
pub struct Judge {
    /// Of each rate, one a core.
    benches: Vec<Vec<Draping>>,
    worlds: Arc<Worlds>,
    /// Presses made so far.
    spent: u64,
}

/// A list that is pressed in an environment.
struct Running<K, T> {
    key: K,
    job: Job,
    ended: Ended<T>,
}

/// What all cores take from.
struct Queue<K> {
    waiting: VecDeque<(K, Job)>,
    /// Lists that are pressed now; what ends may bring more.
    running: usize,
    /// A core has panicked, so that what it has will never end.
    has_failed: bool,
}

/// Tells the other cores where one panics: they would wait for ever.
struct Alarm<'a, K, F> {
    shared: &'a Mutex<(Queue<K>, F)>,
    changed: &'a Condvar,
}

impl<K, F> Drop for Alarm<'_, K, F> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let mut shared = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
            shared.0.has_failed = true;
            self.changed.notify_all();
        }
    }
}

impl Judge {
    /// For the task on `scene`, in `worlds` round it, in the steps of the `rated` tasks, as
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
        // What is found does not depend on how many there are.
        let most = most_environments(scene.lamina.vertex_count()) / rated.len();
        let (copies, count) = match rated[0].device {
            Device::Cpu => (
                rayon::current_num_threads().min((most / ON_CPU).max(1)),
                ON_CPU,
            ),
            Device::Gpu(_) => (1, ON_GPU.min(most.max(1))),
        };
        let bench = |config: &EnvConfig| {
            let member = Member {
                scene: scene.clone(),
                config: config.clone(),
                count,
                worlds: Some(worlds.clone()),
            };
            Draping::on(vec![member], &Cluster::default())
        };
        let of_cores = |config| (0..copies).map(|_| bench(config)).collect();
        Ok(Self {
            benches: rated.iter().map(of_cores).collect::<Result<_, _>>()?,
            worlds: worlds.clone(),
            spent: 0,
        })
    }

    /// The task as the scene says.
    pub fn task(&self) -> &Task {
        &self.benches[0][0].tasks()[0]
    }

    /// By what worlds scatter, and how they are judged.
    pub fn worlds(&self) -> &Worlds {
        &self.worlds
    }

    /// Presses made so far.
    pub fn spent(&self) -> u64 {
        self.spent
    }

    /// Substeps [1/s] of each rate.
    pub fn rates(&self) -> Vec<f64> {
        let rate = |bench: &Vec<Draping>| bench[0].tasks()[0].config.stepping().substep_rate;
        self.benches.iter().map(rate).collect()
    }

    /// Presses lists at a rate, as many at once as there are lanes, asks `of` the end of each in the task of its
    /// world, and presses what `then` brings when it is told that. Waits for none but those.
    ///
    /// What is found depends on lists and worlds alone, but not the order in which `then` hears of it. Not to be
    /// called by a thread of rayon's pool, which the simulation needs.
    pub fn press_on<K: Send, T: Send>(
        &mut self,
        rate: usize,
        jobs: Vec<(K, Job)>,
        of: impl Fn(&Task, &EpisodeState) -> Option<T> + Sync,
        then: impl FnMut(K, &Job, Ended<T>) -> Vec<(K, Job)> + Send,
    ) {
        let queue = Queue {
            waiting: jobs.into(),
            running: 0,
            has_failed: false,
        };
        let (shared, changed) = (Mutex::new((queue, then)), Condvar::new());
        let (made, worlds) = (AtomicU64::new(0), &self.worlds);
        let work = |env: &mut Draping| {
            let _alarm = Alarm {
                shared: &shared,
                changed: &changed,
            };
            let lock = || shared.lock().expect("nobody has panicked");
            let mut lanes: Vec<Option<Running<K, T>>> = Vec::new();
            lanes.resize_with(env.count(), || None);
            loop {
                let is_idle = lanes.iter().all(Option::is_none);
                let mut new = Vec::new();
                {
                    // An idle core waits for what others bring.
                    let waits = |(queue, _): &mut (Queue<K>, _)| {
                        let may_come = queue.running > 0 && !queue.has_failed;
                        is_idle && queue.waiting.is_empty() && may_come
                    };
                    let guard = changed.wait_while(lock(), waits);
                    let (queue, _) = &mut *guard.expect("nobody has panicked");
                    if queue.has_failed || (is_idle && queue.waiting.is_empty()) {
                        return;
                    }
                    for (index, _) in lanes.iter().enumerate().filter(|(_, lane)| lane.is_none()) {
                        new.extend(queue.waiting.pop_front().map(|next| (index, next)));
                    }
                    queue.running += new.len();
                }
                for (index, (key, job)) in new {
                    let ended = begin(env, index, &job, worlds);
                    lanes[index] = Some(Running { key, job, ended });
                }
                let ended = press(env, &mut lanes, &of, &made);
                if ended.is_empty() {
                    continue;
                }
                let (queue, then) = &mut *lock();
                for Running { key, job, ended } in ended {
                    queue.running -= 1;
                    queue.waiting.extend(then(key, &job, ended));
                }
                changed.notify_all();
            }
        };
        let work = &work;
        std::thread::scope(|scope| {
            let (own, others) = self.benches[rate].split_first_mut().expect("one a core");
            for env in others {
                // Where no thread can be started there is one less.
                let _ = std::thread::Builder::new().spawn_scoped(scope, move || work(env));
            }
            work(own);
        });
        self.spent += made.into_inner();
    }

    /// Presses lists at a rate. `told` hears how many have ended.
    pub fn press<T: Send>(
        &mut self,
        rate: usize,
        jobs: Vec<Job>,
        of: impl Fn(&Task, &EpisodeState) -> Option<T> + Sync,
        mut told: impl FnMut(usize) + Send,
    ) -> Vec<Ended<T>> {
        let mut all: Vec<Option<Ended<T>>> = Vec::new();
        all.resize_with(jobs.len(), || None);
        let mut keyed: Vec<(usize, Job)> = jobs.into_iter().enumerate().collect();
        keyed.sort_by_key(|(_, job)| Reverse(job.left()));
        let mut count = 0;
        self.press_on(rate, keyed, of, |k, _, ended| {
            all[k] = Some(ended);
            count += 1;
            told(count);
            Vec::new()
        });
        let all: Option<Vec<Ended<T>>> = all.into_iter().collect();
        all.expect("every list has ended")
    }

    /// Scores of lists, each in the same worlds, less what they cost, `[list][world]`; -1 where the simulation
    /// diverges.
    pub fn scores(&mut self, rate: usize, lists: &[&[u32]], worlds: &[u64]) -> Vec<Vec<f64>> {
        let job = |list: &&[u32], world: &u64| Job::new(list, Some(*world));
        let jobs = lists
            .iter()
            .flat_map(|list| worlds.iter().map(|world| job(list, world)));
        let ended = self.press(rate, jobs.collect(), Task::worth, |_| ());
        let scores = ended.into_iter().map(|one| one.found.unwrap_or(DIVERGED));
        let scores: Vec<f64> = scores.collect();
        let row = |k: usize| scores[k * worlds.len()..(k + 1) * worlds.len()].to_vec();
        (0..lists.len()).map(row).collect()
    }

    /// The best of some lists, best first, with what they come to: all are pressed in three worlds, then the
    /// better half, but as many as are to be `kept`, in twice as many others, and so on. `worlds` are the
    /// numbers of the first and of one behind the last.
    pub fn race(
        &mut self,
        rate: usize,
        lists: &[&[u32]],
        worlds: Range<u64>,
        kept: usize,
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
            for (&k, more) in left.iter().zip(self.scores(rate, &own, &new)) {
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

/// Puts an environment to where a job begins.
fn begin<T>(env: &mut Draping, index: usize, job: &Job, worlds: &Worlds) -> Ended<T> {
    match &job.from {
        Some(from) => env.go_on(index, from),
        None => {
            let world = job.world.map(|number| worlds.world(number));
            env.enter(index, world.as_ref());
        }
    }
    let kept = job.stride.map(|_| Arc::new(env.episode(index)));
    Ended {
        found: None,
        states: kept.into_iter().collect(),
    }
}

/// Presses the next of each list, if one is left. Gives those that are over.
fn press<K, T>(
    env: &mut Draping,
    lanes: &mut [Option<Running<K, T>>],
    of: impl Fn(&Task, &EpisodeState) -> Option<T>,
    made: &AtomicU64,
) -> Vec<Running<K, T>> {
    let next = |(index, lane): (usize, &Option<Running<K, T>>)| {
        let list = &lane.as_ref()?.job.list;
        list.get(env.pressed(index)).copied()
    };
    let vertices: Vec<Option<u32>> = lanes.iter().enumerate().map(next).collect();
    made.fetch_add(vertices.iter().flatten().count() as u64, Ordering::Relaxed);
    // A list without presses ends as it began.
    let finite = match vertices.iter().any(Option::is_some) {
        true => env.press(&vertices),
        false => vec![true; lanes.len()],
    };
    let mut over = Vec::new();
    for (index, lane) in lanes.iter_mut().enumerate() {
        let Some(Running { job, ended, .. }) = lane else {
            continue;
        };
        let count = env.pressed(index);
        let is_last = count == job.list.len();
        let is_kept = job
            .stride
            .is_some_and(|stride| count.is_multiple_of(stride));
        if finite[index] && (is_last || is_kept) {
            let state = env.episode(index);
            if is_last {
                ended.found = of(env.task(index), &state);
            }
            if is_kept && vertices[index].is_some() {
                ended.states.push(Arc::new(state));
            }
        }
        if is_last || !finite[index] {
            over.extend(lane.take());
        }
    }
    over
}
