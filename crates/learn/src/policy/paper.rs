use super::config::PaperConfig;
use super::features::{Layer, StageKind, features};
use super::layer::{Conv, Dense, Initializer, POLICY_GAIN, RELU_GAIN, VALUE_GAIN};
use super::prediction::Prediction;
use burn::module::Module;
use burn::tensor::Tensor;
use burn::tensor::activation::relu;

/// The paper's networks (Section 4.3): the policy's and the value's share nothing.
#[derive(Module, Debug)]
pub struct PaperNetwork {
    policy: Vgg,
    value: Vgg,
    rows: usize,
    columns: usize,
}

impl PaperNetwork {
    pub fn new(
        config: &PaperConfig,
        rows: usize,
        columns: usize,
        initializer: &mut Initializer,
    ) -> Self {
        let actions = rows * columns;
        let mut vgg = |outputs, gain| Vgg::new(config, rows, columns, outputs, gain, initializer);
        Self {
            policy: vgg(actions, POLICY_GAIN),
            value: vgg(1, VALUE_GAIN),
            rows,
            columns,
        }
    }

    /// `planes` `[batch, 3 * rows * columns]`.
    pub fn forward(&self, planes: Tensor<2>) -> Prediction {
        let batch = planes.dims()[0];
        let image = planes.reshape([batch, 3, self.rows, self.columns]);
        Prediction {
            logits: self.policy.forward(image.clone()),
            value: self.value.forward(image).reshape([batch]),
        }
    }
}

/// VGG blocks, then dense layers.
#[derive(Module, Debug)]
struct Vgg {
    blocks: Vec<[Conv; 2]>,
    dense: Vec<Dense>,
    head: Dense,
}

impl Vgg {
    fn new(
        config: &PaperConfig,
        rows: usize,
        columns: usize,
        outputs: usize,
        gain: f64,
        initializer: &mut Initializer,
    ) -> Self {
        let mut inputs = 3;
        let mut blocks = Vec::new();
        for &channels in &config.channels {
            let first = initializer.conv(inputs, channels, RELU_GAIN);
            blocks.push([first, initializer.conv(channels, channels, RELU_GAIN)]);
            inputs = channels;
        }
        inputs *= (rows >> blocks.len()) * (columns >> blocks.len());
        let mut dense = Vec::new();
        for &hidden in &config.hidden {
            dense.push(initializer.dense(inputs, hidden, RELU_GAIN));
            inputs = hidden;
        }
        Self {
            blocks,
            dense,
            head: initializer.dense(inputs, outputs, gain),
        }
    }

    /// `[batch, 3, rows, columns]` to `[batch, outputs]`.
    fn forward(&self, image: Tensor<4>) -> Tensor<2> {
        let layers = self.blocks.iter().flat_map(|[first, second]| {
            let layer = |conv, kind| Layer { conv, kind };
            [
                layer(first, StageKind::Plain),
                layer(second, StageKind::Pool),
            ]
        });
        let mut x = features(image, &layers.collect::<Vec<_>>());
        for dense in &self.dense {
            x = relu(dense.forward(x));
        }
        self.head.forward(x)
    }
}
