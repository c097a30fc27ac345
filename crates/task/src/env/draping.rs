use std::sync::Arc;

use fixedbitset::FixedBitSet;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::config::{EnvConfig, EnvError, Precision, Region};
use super::reward::{Reward, Taken, score};
use super::rules::{EndState, Progress, Slot, Task};
use super::stencil::under_stencil;
use super::task::{End, Episode, ImageShape, Observation, StepOutcome, Tasks};
use drape_cloth::math::{Isa, Vec3};
use drape_cloth::scene::Scene;
use drape_cloth::sim::{Batch, Press, Snapshot};

/// N draping tasks on one scene, stepped together in groups of SIMD lanes over rayon.
pub struct Draping {
    task: Task,
    groups: Vec<Group>,
    count: usize,
}

/// Environments in lockstep.
struct Group {
    batch: Box<dyn Batch>,
    slots: Vec<Slot>,
}

impl Draping {
    /// `count` environments on `scene`, each at its start. One environment alone is computed
    /// with its lines in the lanes; the results are the same bits.
    pub fn new(scene: Arc<Scene>, config: &EnvConfig, count: usize) -> Result<Self, EnvError> {
        let task = Task::new(scene, config)?;
        let lanes = match config.precision {
            Precision::F32 if count > 1 => Isa::best().lanes(),
            _ => 1,
        };
        let groups = (0..count.div_ceil(lanes))
            .map(|group| {
                let mut batch = task.cloth(count);
                // Lanes that nobody uses hold a state that can be stepped as well.
                for lane in 0..batch.lanes() {
                    batch.load(lane, &task.scene.initial);
                }
                let used = lanes.min(count - group * lanes);
                Group {
                    batch,
                    slots: vec![task.start.clone(); used],
                }
            })
            .collect();
        Ok(Self {
            task,
            groups,
            count,
        })
    }

    /// The same environments with another reward than the paper's.
    pub fn with_reward(mut self, reward: Reward) -> Self {
        self.task.reward = reward;
        self
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

    /// Summed distance to the tool of the region at the start [m].
    pub fn initial_distance(&self) -> f64 {
        self.task.initial_distance
    }

    /// Summed distance to the tool of the region [m].
    pub fn region_distance(&self, state: &Snapshot) -> f64 {
        self.task.distance(|v| state.position[v as usize])
    }

    /// How well presses that have ended in `state` were done, see [`score`].
    pub fn score(&self, state: &Snapshot) -> f64 {
        score(self.initial_distance(), self.region_distance(state))
    }

    /// Vertices of the region, ascending.
    pub fn region_vertices(&self) -> impl Iterator<Item = u32> + '_ {
        self.task.vertices()
    }

    /// The cloth of one environment as it is now.
    pub fn state(&self, index: usize) -> Snapshot {
        let (group, lane) = self.place(index);
        self.groups[group].batch.snapshot(lane)
    }

    /// Position of a vertex of the blank in one environment [m].
    pub fn position(&self, index: usize, vertex: u32) -> [f64; 3] {
        let (group, lane) = self.place(index);
        self.groups[group].batch.position(lane, vertex)
    }

    /// The task's configuration.
    pub fn config(&self) -> &EnvConfig {
        &self.task.config
    }

    /// Vertices of the whole blank that are draped now.
    pub fn draped(&self, index: usize) -> &FixedBitSet {
        &self.slot(index).progress.draped
    }

    /// Vertices of the whole blank that have been under the stencil by now.
    pub fn touched(&self, index: usize) -> &FixedBitSet {
        &self.slot(index).progress.touched
    }

    /// How the last episode of an environment ended; none before the first.
    pub fn finished(&self, index: usize) -> Option<&EndState> {
        self.slot(index).finished.as_ref()
    }

    /// Whether the mask allows an action after the presses that an environment has had, those of a
    /// replayed list too.
    pub fn allows(&self, index: usize, action: u32) -> bool {
        let mask = self.task.mask(&self.slot(index).progress);
        mask.contains(action as usize)
    }

    /// Every vertex of the region has been under the stencil in one environment.
    pub fn is_over(&self, index: usize) -> bool {
        self.task.is_over(&self.slot(index).progress)
    }

    /// Puts one environment back to the start.
    pub fn reset(&mut self, index: usize) {
        let (group, lane) = self.place(index);
        self.groups[group].reset(&self.task, lane);
    }

    /// Presses on a vertex in every environment, whatever the masks allow; where there is none,
    /// time passes all the same. No episode begins or ends by it, and observations stay as they
    /// were: it is for lists of presses that were made elsewhere. Tells which are finite.
    ///
    /// # Panics
    /// If there is not one entry an environment.
    pub fn press(&mut self, vertices: &[Option<u32>]) -> Vec<bool> {
        assert_eq!(vertices.len(), self.count, "one entry an environment");
        let lanes = self.groups[0].batch.lanes();
        let task = &self.task;
        self.groups
            .par_iter_mut()
            .zip(vertices.par_chunks(lanes))
            .flat_map_iter(|(group, vertices)| {
                group.press(task, vertices);
                let mut finite = group.batch.sound();
                finite.truncate(vertices.len());
                finite
            })
            .collect()
    }

    fn place(&self, index: usize) -> (usize, usize) {
        let lanes = self.groups[0].batch.lanes();
        (index / lanes, index % lanes)
    }

    fn slot(&self, index: usize) -> &Slot {
        let (group, lane) = self.place(index);
        &self.groups[group].slots[lane]
    }
}

impl Group {
    fn reset(&mut self, task: &Task, lane: usize) {
        self.batch.load(lane, &task.scene.initial);
        let finished = self.slots[lane].finished.take();
        self.slots[lane] = task.start.clone();
        self.slots[lane].finished = finished;
    }

    /// One action in every environment of the group.
    fn step(&mut self, task: &Task, actions: &[u32]) -> Vec<StepOutcome> {
        let mut vertices = Vec::with_capacity(actions.len());
        for (slot, &action) in self.slots.iter_mut().zip(actions) {
            let allowed = slot.observation.mask.contains(action as usize);
            assert!(allowed, "action {action} is masked out");
            slot.progress.actions.push(action);
            vertices.push(task.vertex(action));
        }
        self.press(task, &vertices);
        let tool = &task.scene.tool;
        let finite = self.batch.sound();
        let distances = self.batch.distances(tool, &task.seen);
        (0..actions.len())
            .map(|lane| {
                let slot = &mut self.slots[lane];
                if finite[lane] {
                    let distance = |k| distances[k * finite.len() + lane];
                    slot.observation = task.observe(&slot.progress, distance);
                }
                self.conclude(task, lane, finite[lane])
            })
            .collect()
    }

    /// A press on a vertex in every environment of the group, or time without one.
    fn press(&mut self, task: &Task, vertices: &[Option<u32>]) {
        let Scene {
            tool,
            lamina,
            model,
            ..
        } = &*task.scene;
        let side = task.config.stencil_mm * 1e-3;
        let threshold = task.config.drape_threshold_mm * 1e-3;

        let mut presses = Vec::with_capacity(vertices.len());
        for (lane, &vertex) in vertices.iter().enumerate() {
            let Some(pressed) = vertex else { continue };
            let position = |v| self.batch.position(lane, v);
            let (vertices, height) = under_stencil(lamina, tool, pressed, side, position);
            self.slots[lane].progress.stencil.clone_from(&vertices);
            presses.push(Press {
                lane,
                vertices,
                height,
                descent: task.descent,
            });
        }
        self.batch.step(model, tool, &task.press, &presses);

        for press in presses {
            let lane = press.lane;
            let progress = &mut self.slots[lane].progress;
            let mut touched = press.vertices;
            touched.retain(|&v| !progress.draped.contains(v as usize));
            for &v in &touched {
                progress.touched.insert(v as usize);
                let x = self.batch.position(lane, v);
                let (phi, normal) = tool.distance(x);
                // Tangent planes are a few substeps old: what they let in goes out again.
                if phi < 0.0 && !task.scene.initial.fixed.contains(v as usize) {
                    let at = [0, 1, 2].map(|k| x[k] - phi * normal[k]);
                    self.batch.place(lane, v, at);
                }
            }
            for v in touched {
                let x = self.batch.position(lane, v);
                let beside = task.ties[v as usize].iter().map(|&(w, _)| w);
                let held = beside.chain([v]).all(|v| self.is_slack(task, lane, v));
                if held && tool.distance(x).0 <= threshold {
                    self.slots[lane].progress.draped.insert(v as usize);
                    self.batch.fix(lane, v);
                }
            }
        }
        if let Some(settle) = &task.settle {
            self.batch.step(model, tool, settle, &[]);
        }
    }

    /// No yarn of a vertex is stretched so much that it would pull it off the tool.
    fn is_slack(&self, task: &Task, lane: usize, vertex: u32) -> bool {
        let position = |v| Vec3::from(self.batch.position(lane, v));
        let x = position(vertex);
        let mut ties = task.ties[vertex as usize].iter();
        ties.all(|&(w, length)| (x - position(w)).norm() <= length)
    }

    /// What the step of one environment has brought. Its episode is reset when it is over.
    fn conclude(&mut self, task: &Task, lane: usize, finite: bool) -> StepOutcome {
        let Slot {
            progress,
            observation,
            finished,
        } = &mut self.slots[lane];
        let limit = task.config.max_steps.unwrap_or(usize::MAX);
        let end = match finite {
            // The last finite observation stands for the state after it.
            false => Some(End::Diverged),
            true if task.is_over(progress) => Some(End::Terminated),
            true => (progress.actions.len() >= limit).then_some(End::Truncated),
        };
        let distance = || task.distance(|v| self.batch.position(lane, v));
        let reward = task.reward.of(&Taken {
            end,
            steps: progress.actions.len(),
            initial_distance: task.initial_distance,
            distance: &distance,
        });
        progress.total_reward += reward;
        let episode = end.map(|end| Episode {
            end,
            actions: progress.actions.clone(),
            total_reward: progress.total_reward,
            score: finite.then(|| score(task.initial_distance, distance())),
            last: observation.clone(),
        });
        if episode.is_some() {
            *finished = Some(EndState {
                state: self.batch.snapshot(lane),
                draped: progress.draped.clone(),
                touched: progress.touched.clone(),
            });
            self.reset(task, lane);
        }
        StepOutcome { reward, episode }
    }
}

/// One environment in a saved state.
#[derive(Serialize, Deserialize)]
struct Saved {
    progress: Progress,
    cloth: Snapshot,
}

impl Tasks for Draping {
    fn shape(&self) -> ImageShape {
        self.task.shape()
    }

    fn count(&self) -> usize {
        self.count
    }

    fn reward_scale(&self) -> f32 {
        self.task.initial_distance as f32
    }

    fn observation(&self, index: usize) -> &Observation {
        &self.slot(index).observation
    }

    fn step(&mut self, actions: &[u32]) -> Vec<StepOutcome> {
        assert_eq!(actions.len(), self.count, "one action an environment");
        let lanes = self.groups[0].batch.lanes();
        let task = &self.task;
        self.groups
            .par_iter_mut()
            .zip(actions.par_chunks(lanes))
            .flat_map_iter(|(group, actions)| group.step(task, actions))
            .collect()
    }

    fn save(&self) -> Vec<u8> {
        let saved: Vec<Saved> = (0..self.count)
            .map(|index| Saved {
                progress: self.slot(index).progress.clone(),
                cloth: self.state(index),
            })
            .collect();
        postcard::to_allocvec(&saved).expect("plain data is serialisable")
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Vec<Saved> =
            postcard::from_bytes(bytes).map_err(|e| format!("not saved environments: {e}"))?;
        if saved.len() != self.count {
            let (found, expected) = (saved.len(), self.count);
            return Err(format!("{found} environments saved, expected {expected}"));
        }
        let count = self.task.scene.lamina.vertex_count();
        let pixels = self.shape().pixel_count() as u32;
        for (index, Saved { progress, cloth }) in saved.iter().enumerate() {
            let fits = [&progress.draped, &progress.touched]
                .iter()
                .all(|b| b.len() == count)
                && cloth.position.len() == count
                && cloth.velocity.len() == count
                && cloth.force_density.len() <= 2 * count
                && cloth.fixed.len() <= count
                && cloth.is_finite()
                && progress.actions.iter().all(|&a| a < pixels)
                && progress.stencil.iter().all(|&v| (v as usize) < count);
            if !fits {
                return Err(format!(
                    "environment {index} is not of a blank of {count} vertices"
                ));
            }
        }
        for (index, Saved { progress, cloth }) in saved.into_iter().enumerate() {
            let (group, lane) = self.place(index);
            let Group { batch, slots } = &mut self.groups[group];
            batch.load(lane, &cloth);
            slots[lane] = Slot {
                progress,
                ..self.task.start.clone()
            };
        }
        let tool = &self.task.scene.tool;
        for Group { batch, slots } in &mut self.groups {
            let distances = batch.distances(tool, &self.task.seen);
            for (lane, slot) in slots.iter_mut().enumerate() {
                let distance = |k: usize| distances[k * batch.lanes() + lane];
                slot.observation = self.task.observe(&slot.progress, distance);
            }
        }
        Ok(())
    }
}
