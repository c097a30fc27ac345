use std::cell::OnceCell;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::config::{EnvConfig, Region};
use super::group::{Group, groups};
use super::memory::check_memory;
use super::reward::{Reward, Taken, score};
use super::rules::Task;
use super::scatter::{ScatteredWorld, Worlds};
use super::task::{End, Episode, ImageShape, StepOutcome, Tasks};
use super::terrain::Terrain;
use crate::cluster::{Cluster, Shared};
use crate::path::PressedPoint;
use drape_cloth::file::ValueError;
use drape_cloth::measure::Measures;
use drape_cloth::scene::Scene;
use drape_cloth::sim::{Backend, Observations, Observed, Own, Presses, Snapshot, World};

/// Environments on one of the scenes that a [`Draping`] has.
#[derive(Clone)]
pub struct Member {
    pub scene: Arc<Scene>,
    pub config: EnvConfig,
    /// How many environments.
    pub count: usize,
    /// Every episode is in a world of its own, drawn from these round the scene, if there are some.
    pub worlds: Option<Arc<Worlds>>,
}

/// Draping tasks on one or several scenes, stepped together: as many at once on a [`Backend`] as differ
/// by their [`Own`] alone.
pub struct Draping {
    /// One a scene.
    tasks: Vec<Task>,
    /// What worlds are drawn from, a scene each.
    scattered: Vec<Option<Scattered>>,
    groups: Vec<Batch>,
    slots: Vec<Slot>,
    now: OnceLock<Observed>,
    /// What was seen after the last step, before any episode was reset.
    last: Option<Observations>,
    reward: Reward,
    keeps_ends: bool,
    is_shared: bool,
}

/// Environments that one backend computes, and its world.
struct Batch {
    world: World,
    first: usize,
    cloth: Box<dyn Backend>,
}

/// Worlds round a scene.
struct Scattered {
    worlds: Arc<Worlds>,
    /// The task from each lie of the blank, and the number of that lie among the starts of its group.
    lies: Vec<(Task, u16)>,
}

/// One environment without its cloth.
#[derive(Clone)]
struct Slot {
    /// Number of its scene.
    scene: usize,
    /// How its blank lies; as the scene says if that is all there is.
    lie: Option<usize>,
    /// What it has of its own where nothing scatters.
    own: Own,
    episode: Running,
    /// How the last episode ended, before the reset.
    finished: Option<EpisodeState>,
}

/// An episode that goes on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Running {
    /// Vertices that have been pressed, and where they were [m]; all at the origin where ends are
    /// forgotten and nothing costs.
    presses: Presses,
    /// Sum of the rewards.
    total_reward: f32,
    /// Episodes before it.
    number: u64,
}

/// Where an episode has come to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeState {
    episode: Running,
    cloth: Snapshot,
}

impl EpisodeState {
    /// Where presses made elsewhere have led to.
    pub fn new(presses: Presses, cloth: Snapshot) -> Self {
        let episode = Running {
            presses,
            ..Running::default()
        };
        Self { episode, cloth }
    }

    /// The cloth.
    pub fn cloth(&self) -> &Snapshot {
        &self.cloth
    }

    /// Vertices that have been pressed, and where they were [m].
    pub fn presses(&self) -> &[(u32, [f64; 3])] {
        &self.episode.presses
    }
}

impl Draping {
    /// `count` environments on `scene`, each at its start.
    pub fn new(scene: Arc<Scene>, config: &EnvConfig, count: usize) -> Result<Self, ValueError> {
        let config = config.clone();
        let member = Member {
            scene,
            config,
            count,
            worlds: None,
        };
        Self::on(vec![member], &Cluster::default())
    }

    /// Environments on several scenes that are seen alike, those of one world after the other, simulated
    /// by the processes of a cluster together.
    ///
    /// # Errors
    /// If images differ in size, a value is out of range, or the device does not compute a scene.
    pub fn on(members: Vec<Member>, cluster: &Cluster) -> Result<Self, ValueError> {
        let vertices = |member: &Member| member.count * member.scene.lamina.vertex_count();
        check_memory(1, members.iter().map(vertices).sum())?;
        let task = |member: &Member| Task::new(member.scene.clone(), &member.config);
        let tasks: Vec<Task> = members.iter().map(task).collect::<Result<_, _>>()?;
        let expected = tasks[0].shape();
        let size = |ImageShape { rows, columns }| format!("{rows} x {columns} pixels");
        for (k, task) in tasks.iter().enumerate() {
            let found = format!("{} in member {k}", size(task.shape()));
            let is_alike = task.shape() == expected;
            ValueError::unless(is_alike, "scenes", found, size(expected))?;
        }
        let counts: Vec<usize> = members.iter().map(|member| member.count).collect();
        let worlds: Vec<_> = members.into_iter().map(|member| member.worlds).collect();
        let mut scattered: Vec<Option<Scattered>> = tasks.iter().map(|_| None).collect();
        let (mut batches, mut slots) = (Vec::new(), Vec::new());
        for group in groups(&tasks, &counts, &worlds) {
            let Group {
                world,
                environments,
                owns,
                scenes,
                lies,
            } = group;
            for (number, starts) in lies {
                let Some(worlds) = &worlds[number] else {
                    continue;
                };
                let lying = worlds.scenes().map(|scene| tasks[number].lying(scene));
                scattered[number] = Some(Scattered {
                    worlds: worlds.clone(),
                    lies: lying.zip(starts).collect(),
                });
            }
            let config = &tasks[scenes[0]].config;
            let open = |count| {
                let opened = config.device.open(&world, count, config.precision);
                let refused = |error| {
                    let expected = format!("cpu: {error}");
                    ValueError::new("env.device", config.device, expected)
                };
                opened.map_err(refused)
            };
            batches.push(Batch {
                cloth: Shared::open(cluster, environments.len(), open)?,
                first: environments.start,
                world,
            });
            let slot = |(own, scene)| Slot {
                scene,
                lie: None,
                own,
                episode: Running::default(),
                finished: None,
            };
            slots.extend(owns.into_iter().zip(scenes).map(slot));
        }
        let mut draping = Self {
            tasks,
            scattered,
            groups: batches,
            now: OnceLock::new(),
            last: None,
            reward: Reward::default(),
            keeps_ends: true,
            is_shared: cluster.size() > 1,
            slots,
        };
        for index in 0..draping.count() {
            draping.begin(index, 0);
        }
        Ok(draping)
    }

    /// These environments without [`Draping::finished`], for learners, who do not ask: on a GPU the
    /// cloth then stays there.
    pub fn forgetting_ends(mut self) -> Self {
        self.keeps_ends = false;
        self
    }

    /// These environments with another reward than the paper's.
    pub fn with_reward(mut self, reward: Reward) -> Self {
        self.reward = reward;
        self
    }

    /// All tasks, one a scene.
    pub fn tasks(&self) -> &[Task] {
        &self.tasks
    }

    /// The task of an environment, in the world that it is in.
    pub fn task(&self, index: usize) -> &Task {
        let Slot { scene, lie, .. } = self.slots[index];
        match (lie, &self.scattered[scene]) {
            (Some(lie), Some(of)) => &of.lies[lie].0,
            _ => &self.tasks[scene],
        }
    }

    /// Numbers of the environments on a scene.
    pub fn environments(&self, scene: usize) -> impl Iterator<Item = usize> + '_ {
        let slots = self.slots.iter().enumerate();
        slots.filter_map(move |(index, slot)| (slot.scene == scene).then_some(index))
    }

    /// The vertex of the first scene's blank that an action presses.
    pub fn vertex(&self, action: u32) -> Option<u32> {
        self.tasks[0].vertex(action)
    }

    /// The action that presses a vertex there.
    pub fn action(&self, vertex: u32) -> Option<u32> {
        self.tasks[0].action(vertex)
    }

    /// The first scene.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.tasks[0].scene
    }

    /// The focus region there.
    pub fn region(&self) -> &Region {
        &self.tasks[0].region
    }

    /// The task's configuration there.
    pub fn config(&self) -> &EnvConfig {
        &self.tasks[0].config
    }

    /// The cloth of one environment as it is now.
    pub fn state(&self, index: usize) -> Snapshot {
        let (group, place) = self.place(index);
        self.groups[group].cloth.snapshot(place)
    }

    /// Where on the tool an environment has been pressed so far.
    pub fn points(&self, index: usize) -> Vec<PressedPoint> {
        self.task(index).points(&self.slots[index].episode.presses)
    }

    /// How many presses an episode has so far.
    pub(crate) fn pressed(&self, index: usize) -> usize {
        self.slots[index].episode.presses.len()
    }

    /// How the last episode of an environment ended; none before the first, and none where they are
    /// forgotten.
    pub fn finished(&self, index: usize) -> Option<&EpisodeState> {
        self.slots[index].finished.as_ref()
    }

    /// Whether the cloth of one environment can be that of an episode's end, see
    /// [`EnvConfig::max_tension`].
    pub fn is_believable(&self, index: usize) -> bool {
        self.task(index).is_believable(&self.measure(&[index])[0])
    }

    /// Every vertex of the region has been under the stencil in one environment.
    pub fn is_over(&self, index: usize) -> bool {
        self.observed().left[index] == 0
    }

    /// Puts one environment to the start of its next episode, in another world where these scatter.
    pub fn reset(&mut self, index: usize) {
        self.begin(index, self.slots[index].episode.number + 1);
    }

    fn begin(&mut self, index: usize, number: u64) {
        let scattered = self.scattered[self.slots[index].scene].as_ref();
        let count = self.count() as u64;
        let world = scattered.map(|of| of.worlds.world(number * count + index as u64));
        self.enter(index, world.as_ref());
        if world.is_some() {
            self.slots[index].episode.number = number;
        }
    }

    /// Puts one environment to the start in a world drawn from its worlds, or in that of its scene.
    ///
    /// # Panics
    /// If there are no such worlds.
    pub fn enter(&mut self, index: usize, world: Option<&ScatteredWorld>) {
        let (group, place) = self.place(index);
        let slot = &mut self.slots[index];
        let mut own = slot.own.clone();
        slot.lie = world.map(|world| world.lie);
        if let Some(ScatteredWorld { lie, parameters }) = world {
            let of = self.scattered[slot.scene]
                .as_ref()
                .expect("worlds to draw from");
            own.start = of.lies[*lie].1;
            own.parameters = own.parameters.and(parameters);
        }
        self.groups[group].cloth.reset(place, &own);
        slot.episode = Running::default();
        self.now = OnceLock::new();
    }

    /// Scores of all environments as they are now, see [`score`].
    pub fn scores(&self) -> Vec<f64> {
        // In order: other processes may have to be asked.
        let states: Vec<Snapshot> = (0..self.count()).map(|index| self.state(index)).collect();
        let all = states.par_iter().enumerate();
        all.map(|(index, state)| self.task(index).score(state))
            .collect()
    }

    /// Where the episode of an environment has come to.
    pub fn episode(&self, index: usize) -> EpisodeState {
        EpisodeState {
            episode: self.slots[index].episode.clone(),
            cloth: self.state(index),
        }
    }

    /// Lets one environment go on exactly from where any environment of the same world was.
    pub fn go_on(&mut self, index: usize, from: &EpisodeState) {
        let (group, place) = self.place(index);
        self.groups[group].cloth.load(place, &from.cloth);
        let slot = &mut self.slots[index];
        let of = self.scattered[slot.scene].as_ref();
        let is_start = |(_, start): &(Task, u16)| *start == from.cloth.own.start;
        slot.lie = of.and_then(|of| of.lies.iter().position(is_start));
        slot.episode = from.episode.clone();
        self.now = OnceLock::new();
    }

    /// Presses on a vertex in every environment, whatever the masks allow; where there is none,
    /// time passes all the same. No episode begins or ends by it: it is for lists of presses that were made
    /// elsewhere. Tells which are finite.
    ///
    /// # Panics
    /// If there is not one entry an environment.
    pub fn press(&mut self, vertices: &[Option<u32>]) -> Vec<bool> {
        self.apply(vertices);
        self.of_groups(|batch| batch.cloth.finite()).concat()
    }

    fn apply(&mut self, vertices: &[Option<u32>]) {
        assert_eq!(vertices.len(), self.count(), "one entry an environment");
        let pressed = self.of_groups(|batch| {
            let own = batch.first..batch.first + batch.cloth.count();
            batch.cloth.press(&vertices[own])
        });
        self.now = OnceLock::new();
        let places = pressed.iter().flat_map(|places| match self.keeps_ends {
            true => places.host().as_chunks().0.to_vec(),
            false => Vec::new(),
        });
        let mut places = places.collect::<Vec<_>>().into_iter();
        for (slot, vertex) in self.slots.iter_mut().zip(vertices) {
            let place = places.next().unwrap_or_default();
            let pressed = vertex.map(|vertex| (vertex, place));
            slot.episode.presses.extend(pressed);
        }
    }

    /// What a function gives for every group, in parallel where no other process waits for its turn.
    fn of_groups<T: Send>(&mut self, of: impl Fn(&mut Batch) -> T + Sync + Send) -> Vec<T> {
        match &mut self.groups[..] {
            [one] => vec![of(one)],
            all if self.is_shared => all.iter_mut().map(of).collect(),
            all => all.par_iter_mut().map(of).collect(),
        }
    }

    /// The group that an environment is computed in, and its number there.
    fn place(&self, index: usize) -> (usize, usize) {
        let group = self.groups.partition_point(|batch| batch.first <= index) - 1;
        (group, index - self.groups[group].first)
    }

    fn observed(&self) -> &Observed {
        self.now.get_or_init(|| {
            let observe = |batch: &Batch| batch.cloth.observe();
            Observed::joined(match self.is_shared {
                true => self.groups.iter().map(observe).collect(),
                false => self.groups.par_iter().map(observe).collect(),
            })
        })
    }

    /// Measures some environments, ascending.
    fn measure(&self, environments: &[usize]) -> Vec<Measures> {
        let all = self.groups.iter().flat_map(|batch| {
            let own = batch.first..batch.first + batch.cloth.count();
            let own = environments.iter().filter(|index| own.contains(index));
            let own: Vec<usize> = own.map(|index| index - batch.first).collect();
            match own.is_empty() {
                true => Vec::new(),
                false => batch.cloth.measure(&own),
            }
        });
        all.collect()
    }

    /// Why the episode of an environment is over, if it is, as far as presses tell.
    fn end(&self, index: usize) -> Option<End> {
        let observed = self.observed();
        let limit = self.task(index).config.max_steps.unwrap_or(usize::MAX);
        match observed.finite[index] {
            false => Some(End::Diverged),
            true if observed.left[index] == 0 => Some(End::Terminated),
            true => (self.slots[index].episode.presses.len() >= limit).then_some(End::Truncated),
        }
    }

    /// What the step of one environment has brought. Its episode is reset when it is over; `measures` are
    /// those of its end.
    fn conclude(
        &mut self,
        index: usize,
        end: Option<End>,
        measures: Option<Measures>,
    ) -> StepOutcome {
        let task = self.task(index);
        let is_whole = end != Some(End::Diverged)
            && measures.is_none_or(|measures| task.is_believable(&measures));
        let end = end.map(|end| if is_whole { end } else { End::Diverged });
        let Running {
            presses,
            total_reward,
            ..
        } = &self.slots[index].episode;
        let left = OnceCell::new();
        let left = || {
            *left.get_or_init(|| {
                let found = || self.measure(&[index])[0];
                task.left(&measures.unwrap_or_else(found))
            })
        };
        // A step in which the simulation diverges takes back what was earned.
        let reward = match end {
            Some(End::Diverged) => 0.0 - total_reward,
            _ => self.reward.of(&Taken {
                config: &task.config,
                end,
                steps: presses.len(),
                initial: task.initial,
                left: &left,
            }),
        };
        let total_reward = total_reward + reward;
        let keeps = end.is_some() && self.keeps_ends;
        let state = keeps.then(|| self.state(index));
        let score = |end| match end {
            End::Diverged => None,
            _ => Some(score(task.initial, left())),
        };
        let episode = end.map(|end| Episode {
            end,
            actions: presses
                .iter()
                .filter_map(|&(v, _)| task.action(v))
                .collect(),
            total_reward,
            score: score(end),
        });
        self.slots[index].episode.total_reward = total_reward;
        if let Some(cloth) = state {
            let episode = self.slots[index].episode.clone();
            self.slots[index].finished = Some(EpisodeState { episode, cloth });
        }
        StepOutcome { reward, episode }
    }
}

impl Tasks for Draping {
    fn shape(&self) -> ImageShape {
        self.tasks[0].shape()
    }

    fn count(&self) -> usize {
        self.slots.len()
    }

    fn reward_scale(&self, index: usize) -> f32 {
        self.tasks[self.slots[index].scene].initial as f32
    }

    fn terrains(&self) -> Vec<&Terrain> {
        self.tasks.iter().map(|task| &*task.terrain).collect()
    }

    fn observations(&self) -> &Observations {
        &self.observed().seen
    }

    fn last(&self) -> &Observations {
        self.last.as_ref().expect("a step has been taken")
    }

    fn step(&mut self, actions: &[u32]) -> Vec<StepOutcome> {
        assert_eq!(actions.len(), self.count(), "one action an environment");
        let allowed = self.observations().allow(actions);
        if let Some(index) = allowed.iter().position(|allowed| !allowed) {
            panic!("action {} is masked out", actions[index]);
        }
        let vertices = actions.iter().enumerate();
        let vertices = vertices.map(|(index, &action)| self.task(index).vertex(action));
        self.apply(&vertices.collect::<Vec<_>>());
        self.last = Some(self.observations().clone());
        let ends: Vec<Option<End>> = (0..self.count()).map(|index| self.end(index)).collect();
        let ended: Vec<usize> = (0..ends.len()).filter(|&k| ends[k].is_some()).collect();
        let mut measures = self.measure(&ended).into_iter();
        let outcomes = ends.into_iter().enumerate().map(|(index, end)| {
            let measures = end.and_then(|_| measures.next());
            self.conclude(index, end, measures)
        });
        let outcomes = outcomes.collect();
        ended.into_iter().for_each(|index| self.reset(index));
        outcomes
    }

    fn save(&self) -> Vec<u8> {
        let saved = (0..self.count()).map(|index| self.episode(index));
        let saved: Vec<EpisodeState> = saved.collect();
        postcard::to_allocvec(&saved).expect("plain data is serialisable")
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Vec<EpisodeState> =
            postcard::from_bytes(bytes).map_err(|e| format!("not saved environments: {e}"))?;
        if saved.len() != self.count() {
            let (found, expected) = (saved.len(), self.count());
            return Err(format!("{found} environments saved, expected {expected}"));
        }
        for (index, EpisodeState { episode, cloth }) in saved.iter().enumerate() {
            let lamina = &self.task(index).scene.lamina;
            let is_action = |&(v, _): &(u32, _)| {
                (v as usize) < lamina.vertex_count() && self.task(index).action(v).is_some()
            };
            let fits = self.groups[self.place(index).0].world.fits(cloth)
                && cloth.own.view == self.slots[index].own.view
                && episode.presses.iter().all(is_action);
            if !fits {
                let count = lamina.vertex_count();
                return Err(format!(
                    "environment {index} is not of a blank of {count} vertices"
                ));
            }
        }
        for (index, saved) in saved.iter().enumerate() {
            self.go_on(index, saved);
            self.slots[index].finished = None;
        }
        Ok(())
    }
}
