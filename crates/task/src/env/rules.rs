//! What is the same for all environments of a draping task: where it presses, what it sees, when
//! a vertex is draped.

use std::sync::Arc;

use fixedbitset::FixedBitSet;
use serde::{Deserialize, Serialize};

use super::config::{EnvConfig, EnvError, Precision, Region};
use super::reward::Reward;
use super::task::{ImageShape, Observation};
use drape_cloth::fabric::Lamina;
use drape_cloth::math::Isa;
use drape_cloth::scene::Scene;
use drape_cloth::sim::{Batch, Control, Snapshot, alone, alone_f64, batch};
/// What is the same for all environments.
pub(super) struct Task {
    pub scene: Arc<Scene>,
    pub config: EnvConfig,
    pub region: Region,
    /// The pixels that the agent sees something at, ascending, and the vertex of each.
    pub pixels: Vec<usize>,
    pub seen: Vec<u32>,
    pub press: Control,
    pub descent: usize,
    pub settle: Option<Control>,
    /// The next vertices on the yarns of each vertex, and the length between them [m] beyond
    /// which the yarn pulls the vertex off the tool.
    pub ties: Vec<Vec<(u32, f64)>>,
    pub reward: Reward,
    /// The state after a reset.
    pub start: Slot,
    /// Summed distance of the region at the start [m].
    pub initial_distance: f64,
}

/// One environment, without its cloth.
#[derive(Clone)]
pub(super) struct Slot {
    pub progress: Progress,
    pub observation: Observation,
    pub finished: Option<EndState>,
}

/// The cloth at the end of an episode, before the reset.
#[derive(Clone, Debug, PartialEq)]
pub struct EndState {
    pub state: Snapshot,
    /// One bit a vertex of the blank.
    pub draped: FixedBitSet,
    pub touched: FixedBitSet,
}

/// What an episode has done so far. Bits are one a vertex of the blank.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Progress {
    #[serde(with = "drape_cloth::math::bits")]
    pub draped: FixedBitSet,
    #[serde(with = "drape_cloth::math::bits")]
    pub touched: FixedBitSet,
    pub actions: Vec<u32>,
    /// Sum of the rewards.
    pub total_reward: f32,
    /// The vertices under the stencil in the last step.
    pub stencil: Vec<u32>,
}

impl Task {
    pub fn new(scene: Arc<Scene>, config: &EnvConfig) -> Result<Self, EnvError> {
        let region = config.region(&scene.lamina)?;
        let stepping = config.stepping();
        let press = stepping.control(config.press_s);
        let count = scene.lamina.vertex_count();
        let progress = Progress {
            draped: FixedBitSet::with_capacity(count),
            touched: FixedBitSet::with_capacity(count),
            actions: Vec::new(),
            total_reward: 0.0,
            stencil: Vec::new(),
        };
        let mut task = Self {
            press,
            descent: ((press.substeps as f64 * config.descent).round() as usize).max(1),
            settle: (config.settle_s > 0.0).then(|| stepping.control(config.settle_s)),
            ties: ties(&scene.lamina, config.drape_strain),
            reward: Reward::default(),
            start: Slot {
                observation: Observation {
                    draped: FixedBitSet::new(),
                    distance: Vec::new(),
                    touched: FixedBitSet::new(),
                    mask: FixedBitSet::new(),
                },
                progress,
                finished: None,
            },
            initial_distance: 0.0,
            scene: scene.clone(),
            config: config.clone(),
            region,
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
        // As the environments hold it.
        let mut cloth = task.cloth(1);
        cloth.load(0, &scene.initial);
        let distances = cloth.distances(&scene.tool, &task.seen);
        task.start.observation = task.observe(&task.start.progress, |k| distances[k]);
        task.initial_distance = task.distance(|v| cloth.position(0, v));
        Ok(task)
    }

    /// The cloth of some of `count` environments.
    pub fn cloth(&self, count: usize) -> Box<dyn Batch> {
        let model = &self.scene.model;
        match self.config.precision {
            Precision::F64 => alone_f64(model, Isa::best()),
            Precision::F32 if count > 1 => batch(model, Isa::best()),
            Precision::F32 => alone(model, Isa::best()),
        }
    }

    pub fn shape(&self) -> ImageShape {
        let Region { rows, columns, .. } = &self.region;
        if self.config.crop {
            ImageShape {
                rows: rows.len(),
                columns: columns.len(),
            }
        } else {
            ImageShape {
                rows: self.scene.lamina.rows,
                columns: self.scene.lamina.columns,
            }
        }
    }

    /// First row and column of the image.
    pub fn corner(&self) -> [usize; 2] {
        if self.config.crop {
            [self.region.rows.start, self.region.columns.start]
        } else {
            [0, 0]
        }
    }

    /// The vertex at a pixel of the image.
    pub fn vertex(&self, pixel: u32) -> Option<u32> {
        let width = self.shape().columns;
        let [row, column] = self.corner();
        let (down, right) = (pixel as usize / width, pixel as usize % width);
        self.scene.lamina.vertex_at(row + down, column + right)
    }

    /// The pixel of a vertex; none outside the image.
    pub fn pixel(&self, vertex: u32) -> Option<u32> {
        let ImageShape { rows, columns } = self.shape();
        let (place, corner) = (self.scene.lamina.place(vertex), self.corner());
        let down = place[0].checked_sub(corner[0]).filter(|&d| d < rows)?;
        let right = place[1].checked_sub(corner[1]).filter(|&r| r < columns)?;
        Some((down * columns + right) as u32)
    }

    pub fn vertices(&self) -> impl Iterator<Item = u32> + '_ {
        self.region.vertices.ones().map(|v| v as u32)
    }

    /// Summed distance of the region to the tool [m].
    pub fn distance(&self, position: impl Fn(u32) -> [f64; 3]) -> f64 {
        let distance = |v| self.scene.tool.distance(position(v)).0.max(0.0);
        self.vertices().map(distance).sum()
    }

    /// The agent's view: zero outside the focus region and where the blank has been cut away.
    /// `distance` is that to the tool [m] of `self.seen[k]`.
    pub fn observe(&self, progress: &Progress, distance: impl Fn(usize) -> f64) -> Observation {
        let count = self.shape().pixel_count();
        let mut observation = Observation {
            draped: FixedBitSet::with_capacity(count),
            distance: vec![0.0; count],
            touched: FixedBitSet::with_capacity(count),
            mask: self.mask(progress),
        };
        for (k, &pixel) in self.pixels.iter().enumerate() {
            let vertex = self.seen[k] as usize;
            let touched = progress.touched.contains(vertex);
            observation.touched.set(pixel, touched);
            observation
                .draped
                .set(pixel, progress.draped.contains(vertex));
            observation.distance[pixel] = distance(k).max(0.0) as f32;
        }
        observation
    }

    /// The allowed actions: untouched vertices of the region next to those pressed last.
    pub fn mask(&self, progress: &Progress) -> FixedBitSet {
        let lamina = &self.scene.lamina;
        let mut near = FixedBitSet::with_capacity(lamina.vertex_count());
        for &pressed in &progress.stencil {
            near.extend(lamina.neighbors(pressed).map(|v| v as usize));
        }
        let untouched = || {
            let pixels = self.pixels.iter().copied().zip(&self.seen);
            let vertices = pixels.map(|(pixel, &v)| (pixel, v as usize));
            vertices.filter(|&(_, v)| !progress.touched.contains(v))
        };
        let mut mask = FixedBitSet::with_capacity(self.shape().pixel_count());
        mask.extend(
            untouched()
                .filter(|&(_, v)| near.contains(v))
                .map(|(pixel, _)| pixel),
        );
        if mask.is_clear() {
            // The stroke is at its end: any untouched vertex of the region may begin a new one.
            mask.extend(untouched().map(|(pixel, _)| pixel));
        }
        mask
    }

    /// Every vertex of the region has been under the stencil.
    pub fn is_over(&self, progress: &Progress) -> bool {
        self.region.vertices.is_subset(&progress.touched)
    }
}

fn ties(lamina: &Lamina, strain: f64) -> Vec<Vec<(u32, f64)>> {
    let mut ties = vec![Vec::new(); lamina.vertex_count()];
    for yarn in &lamina.yarns {
        let length = yarn.rest_length * (1.0 + strain);
        for pair in yarn.vertices.windows(2) {
            ties[pair[0] as usize].push((pair[1], length));
            ties[pair[1] as usize].push((pair[0], length));
        }
    }
    ties
}
