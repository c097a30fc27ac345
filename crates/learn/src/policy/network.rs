use super::batch::{Batch, Images};
use super::compact::CompactNetwork;
use super::config::{NetworkConfig, PolicyConfig};
use super::layer::Initializer;
use super::masked;
use super::paper::PaperNetwork;
use super::parameters;
use super::pixels::{PLANES, Patches, SEEN, terrain_planes, write_all, write_planes};
use super::prediction::Prediction;
use super::unet::UnetNetwork;
use burn::module::Module;
use burn::tensor::{Bool, Device, Tensor, TensorData};
use drape_cloth::file::ValueError;
use drape_cloth::sim::{Observation, Observations};
use drape_task::env::{ImageShape, Terrain};
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
    /// Draped, distance, touched, allowed, under the last press, and the terrain's four planes.
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
    /// Whether observations are encoded on the device.
    pub(crate) encodes_there: bool,
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
            encodes_there: false,
        })
    }

    /// A copy for inference: the same parameters, no gradients.
    pub fn valid(&self) -> Self {
        Self {
            network: self.network.valid(),
            ..self.clone()
        }
    }

    /// The same parameters in a graph of gradients of its own, so that threads do not wait for each other.
    pub(crate) fn fork(&self) -> Self {
        Self {
            network: self.network.clone().fork(&self.device()),
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

    /// Rows of observations, where this network wants them.
    pub(crate) fn batch<'a>(
        &self,
        rows: impl Iterator<Item = (&'a Observations, usize)>,
    ) -> Batch<'a> {
        match self.encodes_there {
            true => Batch::Device(rows.collect()),
            false => Batch::Host(rows.map(|(seen, row)| seen.row(row)).collect()),
        }
    }

    /// Logits and values of a batch, and the actions that are not allowed `[batch, pixel]`.
    ///
    /// # Panics
    ///
    /// If an observation on the host allows no action: the softmax would silently allow them all.
    pub(crate) fn predict(&self, batch: &Batch) -> (Prediction, Tensor<2, Bool>) {
        match batch {
            Batch::Host(rows) => (self.forward(self.encode(rows)), self.invalid(rows)),
            Batch::Device(rows) => {
                let images = Images::new(rows, &self.device().inner());
                let prediction = self.forward(self.encode_on_device(&images));
                (prediction, images.invalid())
            }
        }
    }

    fn forward(&self, input: Tensor<2>) -> Prediction {
        match &self.network {
            Network::Paper(network) => network.forward(input),
            Network::Compact(network) => network.forward(input),
            Network::Unet(network) => {
                let inside = input
                    .clone()
                    .narrow(1, SEEN * self.pixel_count, self.pixel_count);
                let share = inside.clone() / inside.sum_dim(1);
                network.forward(input, share.unsqueeze_dim(1))
            }
        }
    }

    /// Draws an action for each row by a number in [0, 1): the action, its log-probability, and the value.
    ///
    /// # Panics
    ///
    /// If an observation allows no action.
    pub(crate) fn choose(&self, batch: &Batch, uniform: &[f64]) -> Vec<(u32, f32, f32)> {
        match batch {
            Batch::Host(rows) => {
                let (log_probs, values) = self.evaluate(rows);
                let each = log_probs.chunks_exact(self.pixel_count).zip(values);
                let each = each.zip(rows).zip(uniform);
                each.map(|(((log_probs, value), seen), &uniform)| {
                    let action = masked::draw(log_probs, seen.allowed(), uniform);
                    (action, log_probs[action as usize], value)
                })
                .collect()
            }
            Batch::Device(_) => {
                let (Prediction { logits, value }, invalid) = self.predict(batch);
                let log_probs = masked::log_softmax(logits, invalid.clone());
                let actions = masked::draw_rows(log_probs.clone(), invalid, uniform);
                let log_probs = masked::log_prob(log_probs, actions.clone());
                // In one transfer; single precision has all actions.
                let all = to_host(Tensor::cat(vec![actions.float(), log_probs, value], 0));
                let count = batch.len();
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
    pub fn evaluate(&self, batch: &[Observation]) -> (Vec<f32>, Vec<f32>) {
        let (Prediction { logits, value }, invalid) = self.predict(&Batch::Host(batch.to_vec()));
        (
            to_host(masked::log_softmax(logits, invalid)),
            to_host(value),
        )
    }

    /// Values `[batch]` on the host. Their masks may be empty.
    pub(crate) fn values(&self, batch: &Batch) -> Vec<f32> {
        to_host(match batch {
            Batch::Host(rows) => self.forward(self.encode(rows)).value,
            Batch::Device(_) => self.predict(batch).0.value,
        })
    }

    /// Values of some rows; each on the host is asked for by itself.
    pub(crate) fn values_of(&self, seen: &Observations, rows: &[usize]) -> Vec<f32> {
        let together = if self.encodes_there { rows.len() } else { 1 };
        let some = rows.chunks(together.max(1));
        some.flat_map(|some| self.values(&self.batch(some.iter().map(|&row| (seen, row)))))
            .collect()
    }

    fn invalid(&self, rows: &[Observation]) -> Tensor<2, Bool> {
        let mut invalid = vec![true; rows.len() * self.pixel_count];
        for (seen, invalid) in rows.iter().zip(invalid.chunks_exact_mut(self.pixel_count)) {
            let mut allowed = seen.allowed().peekable();
            assert!(allowed.peek().is_some(), "an observation allows no action");
            allowed.for_each(|action| invalid[action as usize] = false);
        }
        let data = TensorData::new(invalid, [rows.len(), self.pixel_count]);
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

    fn encode(&self, batch: &[Observation]) -> Tensor<2> {
        let scale = self.distance_scale;
        let width = match &self.encoding {
            Encoding::Planes => 3 * self.pixel_count,
            Encoding::Patches { patches, .. } => patches.count() * patches.width(),
            Encoding::All { .. } => PLANES * self.pixel_count,
        };
        let mut numbers = vec![0.0; batch.len() * width];
        let rows = numbers.par_chunks_exact_mut(width).zip(batch);
        rows.for_each(|(row, &seen)| match &self.encoding {
            Encoding::Planes => write_planes(seen, scale, row),
            Encoding::Patches { patches, .. } => patches.write(seen, scale, row),
            Encoding::All { terrains } => {
                write_all(seen, &terrains[usize::from(seen.view)], scale, row);
            }
        });
        let data = TensorData::new(numbers, [batch.len(), width]);
        Tensor::from_data(data, &self.device())
    }

    /// The numbers of [`Self::encode`], computed on the device.
    fn encode_on_device(&self, images: &Images) -> Tensor<2> {
        let [draped, distance, touched, allowed, last] = images.planes(self.distance_scale);
        let device = draped.device();
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
                let views: Vec<i32> = images.views.iter().map(|&k| i32::from(k)).collect();
                let views = TensorData::new(views, [images.views.len()]);
                let fixed = fixed.select(0, Tensor::from_data(views, &device));
                Tensor::cat(vec![draped, distance, touched, allowed, last, fixed], 1)
            }
        }
    }
}

/// The numbers of `tensor`, row by row.
fn to_host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().expect("numbers are f32")
}
