use super::compact::CompactNetwork;
use super::config::{NetworkConfig, PolicyConfig};
use super::layer::Initializer;
use super::masked;
use super::paper::PaperNetwork;
use super::parameters;
use super::pixels::{PLANES, Patches, terrain_planes, write_all, write_planes};
use super::prediction::Prediction;
use super::seen::{Batch, Seen};
use super::shown::Shown;
use super::unet::UnetNetwork;
use burn::module::Module;
use burn::tensor::{Bool, Device, Tensor, TensorData};
use drape_cloth::file::ValueError;
use drape_task::env::{ImageShape, Observation, Tasks, Terrain};
use rayon::prelude::*;
use std::sync::Arc;

/// The parameters of a policy and a value.
#[derive(Module, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "a training holds a handful of them"
)]
pub enum Network {
    Paper(PaperNetwork),
    Compact(CompactNetwork),
    Unet(UnetNetwork),
}

/// How an observation becomes the numbers that the network takes.
#[derive(Clone, Debug)]
enum Encoding {
    /// Draped, distance, touched.
    Planes,
    /// Draped, distance, touched, allowed, cut into patches.
    Patches {
        patches: Patches,
        /// See [`Patches::sources`].
        sources: Arc<[i32]>,
    },
    /// Draped, distance, touched, allowed, and the terrain's four planes.
    All { terrains: Arc<[Vec<f32>]> },
}

/// A policy and its value function, with all that is needed to ask them.
#[derive(Clone, Debug)]
pub struct ActorCritic {
    /// Its parameters: replaced by the learner.
    pub network: Network,
    encoding: Encoding,
    /// Distance to the tool to number seen [1/m].
    distance_scale: f32,
    pixel_count: usize,
    device: Device,
    /// Whether observations stay on the device from when they are seen to when they are learned from.
    pub(crate) keeps_observations: bool,
}

impl ActorCritic {
    /// A network with initial weights under `seed`, able to learn, for images of `rows` x
    /// `columns` pixels on `terrains`. The weights are drawn on the host: the same on every device.
    pub fn new(
        config: &PolicyConfig,
        ImageShape { rows, columns }: ImageShape,
        terrains: &[&Terrain],
        seed: u64,
        device: &Device,
    ) -> Result<Self, ValueError> {
        config.validate(rows, columns)?;
        let initializer = &mut Initializer::new(seed, &device.clone().autodiff());
        let (network, encoding) = match &config.network {
            NetworkConfig::Paper(paper) => (
                Network::Paper(PaperNetwork::new(paper, rows, columns, initializer)),
                Encoding::Planes,
            ),
            NetworkConfig::Compact(compact) => (
                Network::Compact(CompactNetwork::new(compact, rows, columns, initializer)),
                {
                    let patches = Patches::new(rows, columns, compact.patch, compact.border);
                    let sources = patches.sources().into();
                    Encoding::Patches { patches, sources }
                },
            ),
            NetworkConfig::Unet(unet) => (
                Network::Unet(UnetNetwork::new(unet, rows, columns, initializer)),
                Encoding::All {
                    terrains: terrains.iter().map(|t| terrain_planes(t)).collect(),
                },
            ),
        };
        Ok(Self {
            network,
            encoding,
            distance_scale: 1000.0 / config.distance_scale_mm,
            pixel_count: rows * columns,
            device: device.clone(),
            keeps_observations: false,
        })
    }

    /// A copy for inference: the same parameters, no gradients.
    pub fn valid(&self) -> Self {
        Self {
            network: self.network.valid(),
            ..self.clone()
        }
    }

    /// Device of constants such as advantages. Numbers put there meet the network without
    /// gradients of their own.
    pub fn device(&self) -> Device {
        match self.network.devices().first() {
            Some(device) => device.clone(),
            None => self.device.clone(),
        }
    }

    /// Number of pixels, and so of actions.
    pub fn pixel_count(&self) -> usize {
        self.pixel_count
    }

    /// Logits and values of a batch.
    pub(crate) fn predict(&self, batch: &Batch) -> Prediction {
        let input = match batch {
            Batch::Host(observations) => self.encode(observations),
            Batch::Device(shown) => self.encode_there(shown),
        };
        match &self.network {
            Network::Paper(network) => network.forward(input),
            Network::Compact(network) => network.forward(input),
            Network::Unet(network) => {
                let inside = input
                    .clone()
                    .narrow(1, 4 * self.pixel_count, self.pixel_count);
                let share = inside.clone() / inside.sum_dim(1);
                network.forward(input, share.unsqueeze_dim(1))
            }
        }
    }

    /// What tasks show, where this network wants it.
    pub(crate) fn look<T: Tasks>(&self, tasks: &T) -> Seen {
        if !self.keeps_observations {
            let seen = (0..tasks.count()).map(|task| tasks.observation(task).clone());
            return Seen::Host(seen.collect());
        }
        let shown = self.sight(tasks, 0).unwrap_or_else(|| {
            let seen = (0..tasks.count()).map(|task| tasks.observation(task));
            Shown::upload(&seen.collect::<Vec<_>>(), &self.inner_device())
        });
        Seen::Device(Arc::new(shown))
    }

    /// Values of what some tasks showed when the step just taken ended their episodes.
    pub(crate) fn last_values<T: Tasks>(&self, tasks: &T, ended: &[usize]) -> Vec<f32> {
        if ended.is_empty() {
            return Vec::new();
        }
        if self.keeps_observations
            && let Some(shown) = self.sight(tasks, 1)
        {
            return self.values(&Batch::Device(shown.select(ended)));
        }
        let value = |&task: &usize| self.values(&Batch::Host(vec![tasks.last(task)]))[0];
        ended.iter().map(value).collect()
    }

    /// One of [`Tasks::sights`] of all scenes, if it is where this network is.
    #[cfg(feature = "gpu")]
    fn sight<T: Tasks>(&self, tasks: &T, which: usize) -> Option<Shown> {
        let sights = tasks.sights()?;
        let sights: Vec<_> = sights.into_iter().map(|pair| pair[which].clone()).collect();
        Shown::of(&sights, &self.inner_device())
    }

    #[cfg(not(feature = "gpu"))]
    fn sight<T: Tasks>(&self, _: &T, _: usize) -> Option<Shown> {
        None
    }

    /// Draws an action for each row by a number in [0, 1): the action, its log-probability, and the value.
    ///
    /// # Panics
    ///
    /// If an observation allows no action.
    pub(crate) fn choose(&self, batch: &Batch, uniform: &[f64]) -> Vec<(u32, f32, f32)> {
        match batch {
            Batch::Host(seen) => {
                let (log_probs, values) = self.evaluate(seen);
                let rows = log_probs.chunks_exact(self.pixel_count).zip(values);
                let rows = rows.zip(seen).zip(uniform);
                rows.map(|(((row, value), seen), &uniform)| {
                    let action = masked::draw(row, &seen.mask, uniform);
                    (action, row[action as usize], value)
                })
                .collect()
            }
            Batch::Device(shown) => {
                let Prediction { logits, value } = self.predict(batch);
                let invalid = shown.invalid();
                let log_probs = masked::log_softmax(logits, invalid.clone());
                let actions = masked::draw_rows(log_probs.clone(), invalid, uniform);
                let log_probs = masked::log_prob(log_probs, actions.clone());
                // In one transfer; single precision has all actions.
                let all = to_host(Tensor::cat(vec![actions.float(), log_probs, value], 0));
                let count = batch.rows();
                let row = |k: usize| {
                    let action = all[k] as usize;
                    assert!(action < self.pixel_count, "an observation allows no action");
                    (action as u32, all[count + k], all[2 * count + k])
                };
                (0..count).map(row).collect()
            }
        }
    }

    /// Log-probabilities `[batch * pixel]` and values `[batch]` on the host; masked actions
    /// have a log-probability of about [`masked::FILL`].
    ///
    /// # Panics
    ///
    /// If an observation allows no action.
    pub fn evaluate(&self, batch: &[&Observation]) -> (Vec<f32>, Vec<f32>) {
        let batch = Batch::Host(batch.to_vec());
        let Prediction { logits, value } = self.predict(&batch);
        let log_probs = masked::log_softmax(logits, self.invalid(&batch));
        (to_host(log_probs), to_host(value))
    }

    /// Values `[batch]` on the host. Their masks may be empty.
    pub(crate) fn values(&self, batch: &Batch) -> Vec<f32> {
        to_host(self.predict(batch).value)
    }

    /// Actions not allowed, `[batch, pixel]`.
    ///
    /// # Panics
    ///
    /// If an observation on the host allows no action: the softmax would silently allow them all.
    pub(crate) fn invalid(&self, batch: &Batch) -> Tensor<2, Bool> {
        let batch = match batch {
            Batch::Host(observations) => observations,
            Batch::Device(shown) => return shown.invalid(),
        };
        let mut invalid = vec![true; batch.len() * self.pixel_count];
        for (seen, invalid) in batch.iter().zip(invalid.chunks_exact_mut(self.pixel_count)) {
            assert!(!seen.mask.is_clear(), "an observation allows no action");
            seen.mask.ones().for_each(|i| invalid[i] = false);
        }
        let data = TensorData::new(invalid, [batch.len(), self.pixel_count]);
        Tensor::from_data(data, &self.device())
    }

    /// All parameters, by name: the same bytes for the same network on any device.
    pub fn save(&self) -> Vec<u8> {
        parameters::save(&self.network)
    }

    /// Takes the parameters that [`ActorCritic::save`] wrote. Fails with a reason, changing
    /// nothing, if they are of another network or not finite.
    pub fn load(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.network = parameters::load(self.network.clone(), bytes)?;
        Ok(())
    }

    fn encode(&self, batch: &[&Observation]) -> Tensor<2> {
        let scale = self.distance_scale;
        let width = match &self.encoding {
            Encoding::Planes => 3 * self.pixel_count,
            Encoding::Patches { patches, .. } => patches.count() * patches.width(),
            Encoding::All { .. } => PLANES * self.pixel_count,
        };
        let mut numbers = vec![0.0; batch.len() * width];
        let rows = numbers.par_chunks_exact_mut(width).zip(batch);
        rows.for_each(|(row, seen)| match &self.encoding {
            Encoding::Planes => write_planes(seen, scale, row),
            Encoding::Patches { patches, .. } => patches.write(seen, scale, row),
            Encoding::All { terrains } => {
                write_all(seen, &terrains[usize::from(seen.scene)], scale, row);
            }
        });
        let data = TensorData::new(numbers, [batch.len(), width]);
        Tensor::from_data(data, &self.device())
    }

    /// The same numbers, where the observations are.
    fn encode_there(&self, shown: &Shown) -> Tensor<2> {
        let device = shown.device();
        let [draped, distance, touched, allowed] = shown.planes(self.distance_scale);
        match &self.encoding {
            Encoding::Planes => Tensor::cat(vec![draped, distance, touched], 1),
            Encoding::Patches { sources, .. } => {
                let nothing = draped.clone().narrow(1, 0, 1).zeros_like();
                let all = Tensor::cat(vec![draped, distance, touched, allowed, nothing], 1);
                let sources = TensorData::new(sources.to_vec(), [sources.len()]);
                all.select(1, Tensor::from_data(sources, &device))
            }
            Encoding::All { terrains } => {
                let width = terrains[0].len();
                let fixed = TensorData::new(terrains.concat(), [terrains.len(), width]);
                let fixed = Tensor::<2>::from_data(fixed, &device);
                let scenes: Vec<i32> = shown.scenes().iter().map(|&k| i32::from(k)).collect();
                let scenes = TensorData::new(scenes, [shown.scenes().len()]);
                let fixed = fixed.select(0, Tensor::from_data(scenes, &device));
                Tensor::cat(vec![draped, distance, touched, allowed, fixed], 1)
            }
        }
    }

    /// Where observations are kept: without gradients.
    fn inner_device(&self) -> Device {
        self.device().inner()
    }
}

/// The numbers of `tensor`, row by row.
fn to_host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().expect("numbers are f32")
}
