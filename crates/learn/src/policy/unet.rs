//! A convolutional network that gives a logit for each pixel from the features there.
//!
//! Convolutions go down to coarse images, where the whole is seen, and up again; on the way up they
//! are given what was seen on the way down as well (Ronneberger et al. 2015, with sums as in
//! Chaurasia and Culurciello 2017). The value is read from features in the mean over the region.
//! No weight belongs to a place: what is learnt at one place is known at all, and the same weights
//! play on images of any size.

use super::config::UnetConfig;
use super::features::{Layer, StageKind, features};
use super::layer::{Conv, Dense, Initializer, POLICY_GAIN, RELU_GAIN, VALUE_GAIN};
use super::pixels::PLANES;
use super::prediction::Prediction;
use burn::module::Module;
use burn::tensor::Tensor;
use burn::tensor::activation::relu;

/// Features whose means the value is read from.
const VALUE_CHANNELS: usize = 7;

/// Convolutions down and up, a head a pixel and a value of all.
#[derive(Module, Debug)]
pub struct UnetNetwork {
    down: Vec<Conv>,
    bottom: Conv,
    up: Vec<Conv>,
    head: Conv,
    hidden: Dense,
    value: Dense,
    rows: usize,
    columns: usize,
}

impl UnetNetwork {
    pub fn new(
        config: &UnetConfig,
        rows: usize,
        columns: usize,
        initializer: &mut Initializer,
    ) -> Self {
        let channels = config.channels;
        let mut conv = |inputs| initializer.conv(inputs, channels, RELU_GAIN);
        let down = (0..config.levels).map(|level| match level {
            0 => conv(PLANES),
            _ => conv(channels),
        });
        let down = down.collect();
        let bottom = conv(channels);
        let up = (0..config.levels).map(|_| conv(channels)).collect();
        let mut gains = [RELU_GAIN; 1 + VALUE_CHANNELS];
        gains[0] = POLICY_GAIN;
        Self {
            down,
            bottom,
            up,
            head: initializer.conv_with_gains(channels, &gains),
            hidden: initializer.dense(VALUE_CHANNELS, config.value_hidden, RELU_GAIN),
            value: initializer.dense(config.value_hidden, 1, VALUE_GAIN),
            rows,
            columns,
        }
    }

    /// `planes` `[batch, PLANES * rows * columns]`; of `[batch, 1, rows * columns]` the share of
    /// each pixel in the value's means.
    pub fn forward(&self, planes: Tensor<2>, share: Tensor<3>) -> Prediction {
        let [batch, pixels] = [planes.dims()[0], self.rows * self.columns];
        let image = planes.reshape([batch, PLANES, self.rows, self.columns]);
        let layer = |kind| move |conv| Layer { conv, kind };
        let layers = self.down.iter().map(layer(StageKind::Down));
        let layers = layers.chain([&self.bottom].map(layer(StageKind::Plain)));
        let layers = layers.chain(self.up.iter().map(layer(StageKind::Up)));
        let layers = layers.chain([&self.head].map(layer(StageKind::Linear)));
        let x = features(image, &layers.collect::<Vec<_>>());
        let x = x.reshape([batch, 1 + VALUE_CHANNELS, pixels]);
        let logits = x.clone().narrow(1, 0, 1).reshape([batch, pixels]);
        let seen = relu(x.narrow(1, 1, VALUE_CHANNELS)) * share;
        let means = seen.sum_dim(2).reshape([batch, VALUE_CHANNELS]);
        let value = self.value.forward(relu(self.hidden.forward(means)));
        Prediction {
            logits,
            value: value.reshape([batch]),
        }
    }
}
