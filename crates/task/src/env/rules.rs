//! What is the same for all environments of a draping task: where it presses, what it sees, when
//! a vertex is draped.

use std::ops::Range;
use std::sync::Arc;

use fixedbitset::FixedBitSet;

use super::config::{EnvConfig, Region};
use super::objective::Goal;
use super::reward::{Reward, score};
use super::task::{ImageShape, Observation};
use super::terrain::Terrain;
use drape_cloth::file::ValueError;
use drape_cloth::scene::Scene;
use drape_cloth::sim::{Backend, Control, Pressed, Snapshot, Stencil, World};

/// Solves of the yarns' lengths in a substep under the roller, which pulls on all that it presses
/// at once: with one, paths rank less as in finite elements (docs/NOTES.md).
const PRESS_SWEEPS: usize = 2;

/// What is the same for all environments.
pub(super) struct Task {
    pub scene: Arc<Scene>,
    pub config: EnvConfig,
    pub region: Region,
    pub goal: Goal,
    /// Rows and columns of the lamina that the image shows.
    image: [Range<usize>; 2],
    /// The pixels that the agent sees something at, ascending, and the vertex of each.
    pub pixels: Vec<usize>,
    pub seen: Vec<u32>,
    /// What the backend is given.
    pub world: World,
    pub reward: Reward,
    pub terrain: Terrain,
    /// Number of the scene among those that are learned on together.
    pub scene_index: u16,
    /// What is shown after a reset.
    pub observation: Observation,
    /// The objective at the start [m].
    pub initial: f64,
    /// What a path costs is taken off its score.
    pub is_costly: bool,
}

/// One environment, without its cloth and what it shows.
#[derive(Clone, Default)]
pub(super) struct Slot {
    /// Those of the episode so far.
    pub actions: Vec<u32>,
    /// Sum of their rewards.
    pub total_reward: f32,
    /// How the last episode ended, before the reset.
    pub finished: Option<Snapshot>,
}

impl Task {
    pub fn new(scene: Arc<Scene>, config: &EnvConfig) -> Result<Self, ValueError> {
        let region = config.region(&scene.lamina)?;
        let image = match config.crop {
            true => [region.rows.clone(), region.columns.clone()],
            false => [0..scene.lamina.rows, 0..scene.lamina.columns],
        };
        let stepping = config.stepping();
        let stencil = Stencil {
            side: 1e-3 * config.stencil_mm,
            threshold: config.drape_threshold(),
            max_strain: config.drape_strain,
            roller: config.roller(),
            press: Control {
                sweeps: PRESS_SWEEPS,
                ..stepping.control(config.press_s)
            },
            settle: (config.settle_s > 0.0).then(|| stepping.control(config.settle_s)),
        };
        let nothing = Observation {
            scene: 0,
            draped: FixedBitSet::new(),
            distance: Vec::new(),
            touched: FixedBitSet::new(),
            mask: FixedBitSet::new(),
        };
        let mut task = Self {
            world: World {
                model: scene.model.clone(),
                tool: scene.tool.clone(),
                start: scene.initial.clone(),
                presses: Some((scene.lamina.clone(), stencil)),
            },
            observation: nothing,
            reward: Reward::default(),
            is_costly: false,
            terrain: Terrain::default(),
            initial: 0.0,
            scene_index: 0,
            goal: Goal::new(
                config.objective,
                scene.clone(),
                region.vertices.clone(),
                &scene.initial.position,
            ),
            scene,
            config: config.clone(),
            region,
            image,
            pixels: Vec::new(),
            seen: Vec::new(),
        };
        for pixel in 0..task.shape().pixel_count() {
            let vertex = task.vertex(pixel as u32);
            if let Some(v) = vertex.filter(|&v| task.region.vertices.contains(v as usize)) {
                task.pixels.push(pixel);
                task.seen.push(v);
            }
        }
        let seen = task.pixels.iter().copied().zip(task.seen.iter().copied());
        task.terrain = Terrain::new(&task.scene, task.shape().pixel_count(), seen);
        // As the environments hold it.
        let cloth = task.cloth(1)?;
        let distances = cloth.distances(&task.seen);
        task.observation = task.observe(&cloth.pressed()[0], &distances);
        task.initial = task.objective(&task.scene.initial);
        Ok(task)
    }

    /// The cloth of `count` environments.
    ///
    /// # Errors
    /// The configured device is not there or cannot compute the scene.
    pub fn cloth(&self, count: usize) -> Result<Box<dyn Backend>, ValueError> {
        let EnvConfig {
            device, precision, ..
        } = self.config;
        let opened = device.open(&self.world, count, precision);
        opened.map_err(|error| ValueError::new("env.device", device, format!("cpu: {error}")))
    }

    pub fn shape(&self) -> ImageShape {
        let [rows, columns] = self.image.each_ref().map(Range::len);
        ImageShape { rows, columns }
    }

    /// The vertex at a pixel of the image.
    pub fn vertex(&self, pixel: u32) -> Option<u32> {
        let (pixel, [rows, columns]) = (pixel as usize, &self.image);
        let [down, right] = [pixel / columns.len(), pixel % columns.len()];
        let lamina = &self.scene.lamina;
        lamina.vertex_at(rows.start + down, columns.start + right)
    }

    /// The pixel of a vertex; none outside the image.
    pub fn pixel(&self, vertex: u32) -> Option<u32> {
        let ([row, column], [rows, columns]) = (self.scene.lamina.place(vertex), &self.image);
        let is_seen = rows.contains(&row) && columns.contains(&column);
        is_seen.then(|| ((row - rows.start) * columns.len() + column - columns.start) as u32)
    }

    /// How well presses on `vertices` that have ended in `state` were done.
    pub fn score(&self, vertices: &[u32], state: &Snapshot) -> f64 {
        score(self.initial, self.objective(state)) - self.cost(vertices, state)
    }

    /// What is taken off the score for the path; 0 unless costs count.
    pub fn cost(&self, vertices: &[u32], state: &Snapshot) -> f64 {
        match self.is_costly {
            true => {
                let (scene, region) = (&self.scene, &self.region);
                self.config.cost(scene, region, vertices, &state.position)
            }
            false => 0.0,
        }
    }

    /// What episodes are judged by [m].
    pub fn objective(&self, state: &Snapshot) -> f64 {
        self.goal.left(&state.position)
    }

    /// Whether the state at the end of an episode can be that of a fabric: no yarn stretched and no vertex
    /// sunk into the tool beyond belief, by the bounds of the configuration.
    pub fn is_believable(&self, state: &Snapshot) -> bool {
        let Scene { lamina, tool, .. } = &*self.scene;
        let strain = lamina.yarn_strain(&state.position);
        let depths = state.position.iter().map(|&x| -tool.distance(x).0);
        strain.iter().all(|&strain| self.can_be(strain, f64::MIN)) && { depths }
            .all(|depth| self.can_be(-1.0, depth))
    }

    /// The same of the greatest strain [-] and of how deep the deepest vertex is [m].
    pub fn can_be(&self, strain: f64, depth: f64) -> bool {
        strain <= self.config.max_tension && depth <= 1e-3 * self.config.max_depth_mm
    }

    /// The agent's view: zero outside the focus region and where the blank has been cut away.
    /// `distance` is that to the tool [m] of `self.seen[k]`.
    pub fn observe(&self, pressed: &Pressed, distance: &[f64]) -> Observation {
        let count = self.shape().pixel_count();
        let mut observation = Observation {
            scene: self.scene_index,
            draped: FixedBitSet::with_capacity(count),
            distance: vec![0.0; count],
            touched: FixedBitSet::with_capacity(count),
            mask: self.mask(pressed),
        };
        for (k, &pixel) in self.pixels.iter().enumerate() {
            let vertex = self.seen[k] as usize;
            let of = |set: &FixedBitSet| set.contains(vertex);
            observation.touched.set(pixel, of(&pressed.touched));
            observation.draped.set(pixel, of(&pressed.draped));
            observation.distance[pixel] = distance[k].max(0.0) as f32;
        }
        observation
    }

    /// The allowed actions: untouched vertices of the region next to those pressed last.
    pub fn mask(&self, pressed: &Pressed) -> FixedBitSet {
        let lamina = &self.scene.lamina;
        let mut near = FixedBitSet::with_capacity(lamina.vertex_count());
        for &vertex in &pressed.stencil {
            near.extend(lamina.neighbors(vertex).map(|v| v as usize));
        }
        let untouched = || {
            let pixels = self.pixels.iter().copied().zip(&self.seen);
            let vertices = pixels.map(|(pixel, &v)| (pixel, v as usize));
            vertices.filter(|&(_, v)| !pressed.touched.contains(v))
        };
        let mut mask = FixedBitSet::with_capacity(self.shape().pixel_count());
        let next = untouched().filter(|&(_, v)| near.contains(v));
        mask.extend(next.map(|(pixel, _)| pixel));
        if mask.is_clear() {
            // The stroke is at its end: any untouched vertex of the region may begin a new one.
            mask.extend(untouched().map(|(pixel, _)| pixel));
        }
        mask
    }

    /// Every vertex of the region has been under the stencil.
    pub fn is_over(&self, pressed: &Pressed) -> bool {
        self.region.vertices.is_subset(&pressed.touched)
    }
}
