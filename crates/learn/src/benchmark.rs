//! A training step to be timed, by our convolutions and by burn's.

use crate::policy::convolutions::{
    Conv, Dense, Initializer, Layer, StageKind, burn_features, features,
};
use crate::ppo::Adam;
use burn::module::Module;
use burn::optim::GradientsParams;
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor, TensorData};
use drape_cloth::math::{Purpose, Stream};

/// Whose convolutions and pooling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Implementation {
    Ours,
    /// burn's, of its backend `flex`.
    Flex,
}

impl Implementation {
    pub const ALL: [Self; 2] = [Self::Ours, Self::Flex];

    pub fn name(self) -> &'static str {
        match self {
            Self::Ours => "ours",
            Self::Flex => "flex",
        }
    }
}

/// A network that learns from noise.
pub struct Benchmark {
    network: Network,
    adam: Adam,
    images: Tensor<4>,
    implementation: Implementation,
}

impl Benchmark {
    /// A network for `batch` images of three channels and `side` x `side` pixels.
    pub fn new(side: usize, batch: usize, implementation: Implementation) -> Self {
        let device = Device::flex().autodiff();
        let network = Network::new(side, &device);
        let mut stream = Stream::new(1, Purpose::Evaluation, 0);
        let shape = [batch, 3, side, side];
        let numbers = (0..shape.iter().product()).map(|_| stream.uniform() as f32);
        let images = TensorData::new(numbers.collect::<Vec<_>>(), shape);
        Self {
            adam: Adam::new(&network, 1e-8),
            network,
            images: Tensor::from_data(images, &device),
            implementation,
        }
    }

    /// One step of training: forward, backward, Adam.
    pub fn step(&mut self) {
        let [logits, value] = self
            .network
            .forward(self.images.clone(), self.implementation);
        let loss = logits.square().mean() + value.square().mean();
        let gradients = GradientsParams::from_grads(loss.backward(), &self.network);
        let network = self.network.clone();
        self.network = self.adam.step(network, gradients, 1.0, 1e-4);
    }
}

/// Three times 3x3 convolution, ReLU and 2x2 max-pooling, two dense layers, and a logit a pixel
/// beside a value.
#[derive(Module, Debug)]
struct Network {
    convolutions: Vec<Conv>,
    dense: Vec<Dense>,
    policy: Dense,
    value: Dense,
}

impl Network {
    fn new(side: usize, device: &Device) -> Self {
        let mut initializer = Initializer::new(1, device);
        let sizes = [(3, 16), (16, 32), (32, 32)];
        let pixels = (side >> sizes.len()).pow(2);
        let mut dense = |inputs, outputs| initializer.dense(inputs, outputs, 1.0);
        Self {
            dense: vec![dense(32 * pixels, 256), dense(256, 256)],
            policy: dense(256, side * side),
            value: dense(256, 1),
            convolutions: sizes
                .map(|(inputs, outputs)| initializer.conv(inputs, outputs, 1.0))
                .into(),
        }
    }

    fn forward(&self, images: Tensor<4>, implementation: Implementation) -> [Tensor<2>; 2] {
        let layer = |conv| Layer {
            conv,
            kind: StageKind::Pool,
        };
        let layers: Vec<Layer> = self.convolutions.iter().map(layer).collect();
        let features = match implementation {
            Implementation::Ours => features(images, &layers),
            Implementation::Flex => burn_features(images, &layers),
        };
        let dense = |x, dense: &Dense| relu(dense.forward(x));
        let x = self.dense.iter().fold(features, dense);
        [self.policy.forward(x.clone()), self.value.forward(x)]
    }
}
