use super::compact::CompactNetwork;
use super::config::{NetworkConfig, PolicyConfig};
use super::layer::Initializer;
use super::masked;
use super::paper::PaperNetwork;
use super::parameters;
use super::pixels::{PLANES, Patches, terrain_planes, write_all, write_planes};
use super::prediction::Prediction;
use super::unet::UnetNetwork;
use burn::module::Module;
use burn::tensor::{Bool, Device, Tensor, TensorData};
use drape_cloth::file::ValueError;
use drape_task::env::{ImageShape, Observation, Terrain};
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
    Patches(Patches),
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
                Encoding::Patches(Patches::new(rows, columns, compact.patch, compact.border)),
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
    pub fn predict(&self, batch: &[&Observation]) -> Prediction {
        let input = self.encode(batch);
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

    /// Log-probabilities `[batch * pixel]` and values `[batch]` on the host; masked actions
    /// have a log-probability of about [`masked::FILL`].
    ///
    /// # Panics
    ///
    /// If an observation allows no action.
    pub fn evaluate(&self, batch: &[&Observation]) -> (Vec<f32>, Vec<f32>) {
        let Prediction { logits, value } = self.predict(batch);
        let log_probs = masked::log_softmax(logits, self.invalid(batch));
        (to_host(log_probs), to_host(value))
    }

    /// Values `[batch]` on the host. Their masks may be empty.
    pub fn values(&self, batch: &[&Observation]) -> Vec<f32> {
        to_host(self.predict(batch).value)
    }

    /// Actions not allowed, `[batch, pixel]`.
    ///
    /// # Panics
    ///
    /// If an observation allows no action: the softmax would silently allow them all.
    pub fn invalid(&self, batch: &[&Observation]) -> Tensor<2, Bool> {
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
            Encoding::Patches(patches) => patches.count() * patches.width(),
            Encoding::All { .. } => PLANES * self.pixel_count,
        };
        let mut numbers = vec![0.0; batch.len() * width];
        let rows = numbers.par_chunks_exact_mut(width).zip(batch);
        rows.for_each(|(row, seen)| match &self.encoding {
            Encoding::Planes => write_planes(seen, scale, row),
            Encoding::Patches(patches) => patches.write(seen, scale, row),
            Encoding::All { terrains } => {
                write_all(seen, &terrains[usize::from(seen.scene)], scale, row);
            }
        });
        let data = TensorData::new(numbers, [batch.len(), width]);
        Tensor::from_data(data, &self.device())
    }
}

/// The numbers of `tensor`, row by row.
fn to_host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().expect("numbers are f32")
}
