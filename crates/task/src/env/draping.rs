use std::cell::OnceCell;
use std::sync::Arc;

use fixedbitset::FixedBitSet;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::config::{EnvConfig, Region};
use super::reward::{Reward, Taken};
use super::rules::{Slot, Task};
use super::task::{End, Episode, ImageShape, Observation, StepOutcome, Tasks};
use super::terrain::Terrain;
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
        Ok(Self {
            cloth: Shared::open(cluster, count, start, |count| task.cloth(count))?,
            slots: vec![task.start.clone(); count],
            task,
        })
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
        self.task.start.observation.scene = index;
        for slot in &mut self.slots {
            slot.observation.scene = index;
        }
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

    /// How the last episode of an environment ended; none before the first.
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
        self.cloth.reset(index);
        let slot = &mut self.slots[index];
        let finished = slot.finished.take();
        *slot = self.task.start.clone();
        slot.finished = finished;
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
        let Slot {
            actions,
            total_reward,
            observation,
            finished: _,
        } = &self.slots[index];
        Branch {
            slot: Slot {
                actions: actions.clone(),
                total_reward: *total_reward,
                observation: observation.clone(),
                finished: None,
            },
            cloth: self.state(index),
        }
    }

    /// Lets one environment go on exactly from where any environment of the same task was.
    pub fn go_on(&mut self, index: usize, from: &Branch) {
        self.cloth.load(index, &from.cloth);
        let finished = self.slots[index].finished.take();
        self.slots[index] = from.slot.clone();
        self.slots[index].finished = finished;
    }

    /// Presses on a vertex in every environment, whatever the masks allow; where there is none,
    /// time passes all the same. No episode begins or ends by it, and observations stay as they
    /// were: it is for lists of presses that were made elsewhere. Tells which are finite.
    ///
    /// # Panics
    /// If there is not one entry an environment.
    pub fn press(&mut self, vertices: &[Option<u32>]) -> Vec<bool> {
        self.cloth.press(vertices);
        self.cloth.finite()
    }

    /// Shows each environment that is `finite` what it looks like now.
    fn observe(&mut self, finite: &[bool]) {
        let (task, pressed) = (&self.task, self.cloth.pressed());
        let distances = self.cloth.distances(&task.seen);
        let distances = distances.par_chunks(task.seen.len());
        let all = self.slots.par_iter_mut().zip(distances).zip(pressed);
        all.zip(finite)
            .for_each(|(((slot, distance), pressed), finite)| {
                if *finite {
                    slot.observation = task.observe(pressed, distance);
                }
            });
    }

    /// What the step of one environment has brought. Its episode is reset when it is over.
    fn conclude(&mut self, index: usize, finite: bool) -> StepOutcome {
        let (task, slot) = (&self.task, &mut self.slots[index]);
        let limit = task.config.max_steps.unwrap_or(usize::MAX);
        let end = match finite {
            // The last finite observation stands for the state after it.
            false => Some(End::Diverged),
            true if task.is_over(&self.cloth.pressed()[index]) => Some(End::Terminated),
            true => (slot.actions.len() >= limit).then_some(End::Truncated),
        };
        let state = OnceCell::new();
        let state = || state.get_or_init(|| self.cloth.snapshot(index));
        let finite = finite && (end.is_none() || task.is_believable(state()));
        let end = end.map(|end| if finite { end } else { End::Diverged });
        let left = OnceCell::new();
        let left = || *left.get_or_init(|| task.objective(state()));
        let vertices = || -> Vec<u32> {
            let actions = slot.actions.iter();
            actions.filter_map(|&action| task.vertex(action)).collect()
        };
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
            score: finite.then(|| task.score(&vertices(), state())),
            last: slot.observation.clone(),
        });
        if episode.is_some() {
            slot.finished = Some(state().clone());
            self.reset(index);
        }
        StepOutcome { reward, episode }
    }
}

/// Where an episode has come to: what [`Draping::branch`] takes and [`Draping::go_on`] puts back.
#[derive(Clone)]
pub struct Branch {
    slot: Slot,
    cloth: Snapshot,
}

impl Branch {
    /// What the environment showed.
    pub fn observation(&self) -> &Observation {
        &self.slot.observation
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
        &self.slots[index].observation
    }

    fn step(&mut self, actions: &[u32]) -> Vec<StepOutcome> {
        assert_eq!(actions.len(), self.count(), "one action an environment");
        for (slot, &action) in self.slots.iter_mut().zip(actions) {
            let allowed = slot.observation.mask.contains(action as usize);
            assert!(allowed, "action {action} is masked out");
            slot.actions.push(action);
        }
        let vertices: Vec<_> = actions.iter().map(|&a| self.task.vertex(a)).collect();
        let finite = self.press(&vertices);
        self.observe(&finite);
        let all = finite.iter().enumerate();
        all.map(|(index, &finite)| self.conclude(index, finite))
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
                ..self.task.start.clone()
            };
        }
        self.observe(&vec![true; self.count()]);
        Ok(())
    }
}
