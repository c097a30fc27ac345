use std::cell::OnceCell;
use std::sync::Arc;

use fixedbitset::FixedBitSet;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::config::{EnvConfig, Region};
use super::judge::{Judge, Judged};
#[cfg(feature = "gpu")]
use super::look::Sight;
use super::reward::{Reward, Taken, score};
use super::rules::{Slot, Task};
use super::task::{End, Episode, ImageShape, Observation, StepOutcome, Tasks};
use super::terrain::Terrain;
use super::views::{After, Views};
use crate::cluster::{Cluster, Shared};
use crate::path::PressedPoint;
use drape_cloth::file::ValueError;
use drape_cloth::math::Vec3;
use drape_cloth::scene::{Scene, surplus};
use drape_cloth::sim::{Backend, Snapshot};

/// What an environment keeps of a vertex: its state, the last observation, the end of the last
/// episode, and all of that again where a checkpoint is written [bytes].
const VERTEX_BYTES: f64 = 300.0;
/// Most memory of environments, and as much again for rollouts [MiB].
pub const MOST_MIB: f64 = 16_384.0;

/// Refuses more environments than [`MOST_MIB`] hold, each with a blank of `vertex_count`.
pub fn check_memory(count: usize, vertex_count: usize) -> Result<(), ValueError> {
    let mib = count as f64 * vertex_count as f64 * VERTEX_BYTES / f64::from(1 << 20);
    let found = format!("{count} of {vertex_count} vertices, {mib:.0} MiB");
    let expected = format!("at most {MOST_MIB} MiB");
    ValueError::unless(mib <= MOST_MIB, "environments", found, expected)
}

/// N draping tasks on one scene, stepped together on one [`Backend`].
pub struct Draping {
    task: Task,
    cloth: Box<dyn Backend>,
    slots: Vec<Slot>,
    views: Views,
    judge: Judge,
    keeps_ends: bool,
}

impl Draping {
    /// `count` environments on `scene`, each at its start.
    pub fn new(scene: Arc<Scene>, config: &EnvConfig, count: usize) -> Result<Self, ValueError> {
        Self::shared(scene, config, count, &Cluster::default())
    }

    /// The same, simulated by the processes of a cluster together.
    pub fn shared(
        scene: Arc<Scene>,
        config: &EnvConfig,
        count: usize,
        cluster: &Cluster,
    ) -> Result<Self, ValueError> {
        check_memory(count, scene.lamina.vertex_count())?;
        let task = Task::new(scene, config)?;
        let start = &task.world.start.pressed;
        let cloth = Shared::open(cluster, count, start, |count| task.cloth(count))?;
        Ok(Self {
            slots: vec![Slot::default(); count],
            views: Views::new(&task, &*cloth),
            judge: Judge::new(&task, &*cloth),
            keeps_ends: true,
            cloth,
            task,
        })
    }

    /// The same environments without [`Draping::finished`], for learners, who do not ask: on a GPU the cloth then
    /// stays there.
    pub fn forgetting_ends(mut self) -> Self {
        self.keeps_ends = false;
        self
    }

    /// The same environments with another reward than the paper's.
    pub fn with_reward(mut self, reward: Reward) -> Self {
        self.task.reward = reward;
        self
    }

    /// The same environments with the costs of paths taken off scores.
    pub fn costly(mut self) -> Self {
        self.task.is_costly = true;
        self
    }

    /// Numbers its scene among several.
    pub(super) fn set_scene_index(&mut self, index: u16) {
        self.task.scene_index = index;
        self.task.observation.scene = index;
        self.views.set_scene(index);
    }

    /// The vertex of the blank that an action presses; none where the blank has been cut away.
    pub fn vertex(&self, action: u32) -> Option<u32> {
        self.task.vertex(action)
    }

    /// The action that presses a vertex; none outside the image.
    pub fn action(&self, vertex: u32) -> Option<u32> {
        self.task.pixel(vertex)
    }

    /// The focus region.
    pub fn region(&self) -> &Region {
        &self.task.region
    }

    /// The scene that the tasks are set in.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.task.scene
    }

    /// The objective at the start [m].
    pub fn initial_objective(&self) -> f64 {
        self.task.initial
    }

    /// Summed distance to the tool of the region [m].
    pub fn region_distance(&self, state: &Snapshot) -> f64 {
        let (region, position) = (&self.task.region.vertices, &state.position);
        self.scene().tool.summed_distance(region.ones(), position)
    }

    /// How well presses on `vertices` that have ended in `state` were done: see [`score`], less their [`Costs`]
    /// where these count.
    ///
    /// [`Costs`]: super::costs::Costs
    pub fn score(&self, vertices: &[u32], state: &Snapshot) -> f64 {
        self.task.score(vertices, state)
    }

    /// Surplus of the region, see [`surplus`] [m].
    pub fn region_surplus(&self, state: &Snapshot) -> f64 {
        let Scene { lamina, tool, .. } = &*self.task.scene;
        surplus(lamina, tool, &state.position, &self.task.region.vertices)
    }

    /// Vertices of the region, ascending.
    pub fn region_vertices(&self) -> impl Iterator<Item = u32> + '_ {
        self.task.region.vertices.ones().map(|v| v as u32)
    }

    /// The cloth of one environment as it is now.
    pub fn state(&self, index: usize) -> Snapshot {
        self.cloth.snapshot(index)
    }

    /// The task's configuration.
    pub fn config(&self) -> &EnvConfig {
        &self.task.config
    }

    /// Vertices of the whole blank that are draped now.
    pub fn draped(&self, index: usize) -> &FixedBitSet {
        &self.cloth.pressed()[index].draped
    }

    /// Vertices of the whole blank that have been under the stencil by now.
    pub fn touched(&self, index: usize) -> &FixedBitSet {
        &self.cloth.pressed()[index].touched
    }

    /// How the last episode of an environment ended; none before the first, and none where they are forgotten.
    pub fn finished(&self, index: usize) -> Option<&Snapshot> {
        self.slots[index].finished.as_ref()
    }

    /// Whether the mask allows an action after the presses that an environment has had, those of a
    /// replayed list too.
    pub fn allows(&self, index: usize, action: u32) -> bool {
        let mask = self.task.mask(&self.cloth.pressed()[index]);
        mask.contains(action as usize)
    }

    /// Whether the cloth of one environment can be that of an episode's end, see
    /// [`EnvConfig::max_tension`].
    pub fn is_believable(&self, index: usize) -> bool {
        self.task.is_believable(&self.state(index))
    }

    /// Every vertex of the region has been under the stencil in one environment.
    pub fn is_over(&self, index: usize) -> bool {
        self.task.is_over(&self.cloth.pressed()[index])
    }

    /// Puts one environment back to the start.
    pub fn reset(&mut self, index: usize) {
        self.restart(index, false);
    }

    fn restart(&mut self, index: usize, ended: bool) {
        self.cloth.reset(index);
        self.views.change(index, &self.task.observation, ended);
        let finished = self.slots[index].finished.take();
        self.slots[index] = Slot {
            finished,
            ..Slot::default()
        };
    }

    /// Where on the tool a press on `vertex` would land in one environment now.
    pub fn pressed_point(&self, index: usize, vertex: u32) -> PressedPoint {
        let x = Vec3::from(self.state(index).position[vertex as usize]);
        let surface = self.task.scene.tool.surface.project(x);
        PressedPoint {
            vertex,
            position: surface.position,
            normal: surface.normal,
        }
    }

    /// Scores of all environments as they are now, see [`Draping::score`].
    pub fn scores(&self) -> Vec<f64> {
        let states: Vec<Snapshot> = (0..self.count()).map(|index| self.state(index)).collect();
        let all = states.par_iter().enumerate();
        all.map(|(index, state)| {
            let actions = self.slots[index].actions.iter();
            let vertices = actions.filter_map(|&action| self.vertex(action));
            self.score(&vertices.collect::<Vec<_>>(), state)
        })
        .collect()
    }

    /// One environment in the middle of its episode.
    pub fn branch(&self, index: usize) -> Branch {
        Branch {
            slot: Slot {
                finished: None,
                ..self.slots[index].clone()
            },
            observation: self.observation(index).clone(),
            cloth: self.state(index),
        }
    }

    /// Lets one environment go on exactly from where any environment of the same task was.
    pub fn go_on(&mut self, index: usize, from: &Branch) {
        self.cloth.load(index, &from.cloth);
        self.views.change(index, &from.observation, false);
        let finished = self.slots[index].finished.take();
        self.slots[index] = Slot {
            finished,
            ..from.slot.clone()
        };
    }

    /// Presses on a vertex in every environment, whatever the masks allow; where there is none,
    /// time passes all the same. No episode begins or ends by it, and observations stay as they
    /// were: it is for lists of presses that were made elsewhere. Tells which are finite.
    ///
    /// # Panics
    /// If there is not one entry an environment.
    pub fn press(&mut self, vertices: &[Option<u32>]) -> Vec<bool> {
        self.views.keep(&self.task, &*self.cloth);
        self.cloth.press(vertices);
        self.cloth.finite()
    }

    /// Why the episode of an environment is over, if it is, as far as presses tell.
    fn end(&self, index: usize, After { finite, is_over }: After) -> Option<End> {
        let limit = self.task.config.max_steps.unwrap_or(usize::MAX);
        match finite {
            false => Some(End::Diverged),
            true if is_over => Some(End::Terminated),
            true => (self.slots[index].actions.len() >= limit).then_some(End::Truncated),
        }
    }

    /// What the step of one environment has brought. Its episode is reset when it is over.
    fn conclude(&mut self, index: usize, end: Option<End>, judged: Option<Judged>) -> StepOutcome {
        let (task, slot) = (&self.task, &mut self.slots[index]);
        let judged = judged.as_ref();
        let finite = end != Some(End::Diverged) && judged.is_none_or(|judged| judged.is_believable);
        let end = end.map(|end| if finite { end } else { End::Diverged });
        let objective = OnceCell::new();
        let objective = || *objective.get_or_init(|| task.objective(&self.cloth.snapshot(index)));
        let left = || judged.map_or_else(objective, |judged| judged.left);
        // A step in which the simulation diverges takes back what was earned.
        let reward = match end {
            Some(End::Diverged) => 0.0 - slot.total_reward,
            _ => task.reward.of(&Taken {
                config: &task.config,
                end,
                steps: slot.actions.len(),
                initial: task.initial,
                left: &left,
            }),
        };
        slot.total_reward += reward;
        let episode = end.map(|end| Episode {
            end,
            actions: slot.actions.clone(),
            total_reward: slot.total_reward,
            score: judged.filter(|_| finite).map(|judged| {
                let actions = slot.actions.iter();
                let vertices: Vec<u32> = actions.filter_map(|&a| task.vertex(a)).collect();
                let cost = judged
                    .state
                    .as_ref()
                    .map(|state| task.cost(&vertices, state));
                score(task.initial, judged.left) - cost.unwrap_or(0.0)
            }),
        });
        if episode.is_some() {
            if self.keeps_ends {
                slot.finished = judged.and_then(|judged| judged.state.clone());
            }
            self.restart(index, true);
        }
        StepOutcome { reward, episode }
    }
}

/// Where an episode has come to: what [`Draping::branch`] takes and [`Draping::go_on`] puts back.
#[derive(Clone)]
pub struct Branch {
    slot: Slot,
    observation: Observation,
    cloth: Snapshot,
}

impl Branch {
    /// What the environment showed.
    pub fn observation(&self) -> &Observation {
        &self.observation
    }
}

/// One environment in a saved state.
#[derive(Serialize, Deserialize)]
struct Saved {
    actions: Vec<u32>,
    total_reward: f32,
    cloth: Snapshot,
}

impl Tasks for Draping {
    fn shape(&self) -> ImageShape {
        self.task.shape()
    }

    fn count(&self) -> usize {
        self.slots.len()
    }

    fn reward_scale(&self, _: usize) -> f32 {
        self.task.initial as f32
    }

    fn terrains(&self) -> Vec<&Terrain> {
        vec![&self.task.terrain]
    }

    fn observation(&self, index: usize) -> &Observation {
        self.views.now(index, &self.task, &*self.cloth)
    }

    fn last(&self, index: usize) -> &Observation {
        self.views.last(index, &*self.cloth)
    }

    #[cfg(feature = "gpu")]
    fn sights(&self) -> Option<Vec<[Sight; 2]>> {
        let sights = self.views.sights(&self.task, &*self.cloth);
        sights.map(|sights| vec![sights])
    }

    fn step(&mut self, actions: &[u32]) -> Vec<StepOutcome> {
        assert_eq!(actions.len(), self.count(), "one action an environment");
        self.views.check(actions);
        for (slot, &action) in self.slots.iter_mut().zip(actions) {
            slot.actions.push(action);
        }
        let vertices: Vec<_> = actions.iter().map(|&a| self.task.vertex(a)).collect();
        self.cloth.press(&vertices);
        let after = self.views.look(&self.task, &*self.cloth).into_iter();
        let ends: Vec<Option<End>> = after
            .enumerate()
            .map(|(k, after)| self.end(k, after))
            .collect();
        let ended: Vec<usize> = (0..ends.len()).filter(|&k| ends[k].is_some()).collect();
        let keeps = self.keeps_ends || self.task.is_costly;
        let judged = self.judge.judge(&self.task, &*self.cloth, &ended, keeps);
        let mut judged = judged.into_iter();
        let ends = ends.into_iter().enumerate();
        ends.map(|(index, end)| {
            let judged = end.and_then(|_| judged.next());
            self.conclude(index, end, judged)
        })
        .collect()
    }

    fn save(&self) -> Vec<u8> {
        let saved: Vec<Saved> = (0..self.count())
            .map(|index| Saved {
                actions: self.slots[index].actions.clone(),
                total_reward: self.slots[index].total_reward,
                cloth: self.state(index),
            })
            .collect();
        postcard::to_allocvec(&saved).expect("plain data is serialisable")
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Vec<Saved> =
            postcard::from_bytes(bytes).map_err(|e| format!("not saved environments: {e}"))?;
        if saved.len() != self.count() {
            let (found, expected) = (saved.len(), self.count());
            return Err(format!("{found} environments saved, expected {expected}"));
        }
        let count = self.task.scene.lamina.vertex_count();
        let pixels = self.shape().pixel_count() as u32;
        for (index, Saved { actions, cloth, .. }) in saved.iter().enumerate() {
            let fits = self.task.scene.model.fits(cloth) && actions.iter().all(|&a| a < pixels);
            if !fits {
                return Err(format!(
                    "environment {index} is not of a blank of {count} vertices"
                ));
            }
        }
        for (index, saved) in saved.into_iter().enumerate() {
            self.cloth.load(index, &saved.cloth);
            self.slots[index] = Slot {
                actions: saved.actions,
                total_reward: saved.total_reward,
                finished: None,
            };
        }
        self.views.look(&self.task, &*self.cloth);
        Ok(())
    }
}
