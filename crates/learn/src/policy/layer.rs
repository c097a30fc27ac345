//! Dense and convolution layers with orthogonal initial weights drawn on the host.

use burn::module::{Module, Param};
use burn::tensor::module::conv2d;
use burn::tensor::ops::ConvOptions;
use burn::tensor::{Device, Tensor, TensorData};
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Gain that keeps the variance through a ReLU.
pub const RELU_GAIN: f64 = std::f64::consts::SQRT_2;
/// Gain of the policy head: nearly uniform over the valid actions at first (Andrychowicz et
/// al. 2021, "What matters in on-policy reinforcement learning", Section 3.2).
pub const POLICY_GAIN: f64 = 0.01;
/// Gain of the value head.
pub const VALUE_GAIN: f64 = 1.0;

/// Draws initial weights, on the host, in the order in which layers are made.
pub struct Initializer {
    rng: ChaCha8Rng,
    device: Device,
}

impl Initializer {
    /// Weights under `seed`, to be put on `device`.
    pub fn new(seed: u64, device: &Device) -> Self {
        Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            device: device.clone(),
        }
    }

    /// A dense layer from `inputs` to `outputs` with zero bias.
    pub fn dense(&mut self, inputs: usize, outputs: usize, gain: f64) -> Dense {
        let weight = self.orthogonal(inputs, outputs, gain);
        Dense {
            weight: Param::from_tensor(self.upload(weight, [inputs, outputs])),
            bias: Param::from_tensor(Tensor::zeros([outputs], &self.device)),
        }
    }

    /// A 3x3 convolution with stride 1, padding 1 and zero bias.
    pub fn conv(&mut self, inputs: usize, outputs: usize, gain: f64) -> Conv {
        self.conv_with_gains(inputs, &vec![gain; outputs])
    }

    /// A layer with a gain for each output.
    pub fn conv_with_gains(&mut self, inputs: usize, gains: &[f64]) -> Conv {
        let (outputs, width) = (gains.len(), 9 * inputs);
        let mut weight = self.orthogonal(outputs, width, 1.0);
        for (weight, &gain) in weight.chunks_exact_mut(width).zip(gains) {
            weight.iter_mut().for_each(|x| *x *= gain as f32);
        }
        Conv {
            weight: Param::from_tensor(self.upload(weight, [outputs, inputs, 3, 3])),
            bias: self.zeros([outputs]),
        }
    }

    /// A trainable tensor of zeros.
    pub fn zeros<const D: usize>(&self, shape: [usize; D]) -> Param<Tensor<D>> {
        Param::from_tensor(Tensor::zeros(shape, &self.device))
    }

    /// `gain` times a matrix whose shorter side is orthonormal, row by row; uniform over such
    /// matrices (Saxe et al. 2014; Mezzadri 2007 for the signs).
    fn orthogonal(&mut self, rows: usize, columns: usize, gain: f64) -> Vec<f32> {
        let (long, short) = (rows.max(columns), rows.min(columns));
        let gaussian = DMatrix::from_fn(long, short, |_, _| self.normal());
        let (mut q, r) = gaussian.qr().unpack();
        for (j, mut column) in q.column_iter_mut().enumerate() {
            column *= gain * r[(j, j)].signum();
        }
        // nalgebra stores columns one after the other: a tall matrix has to be transposed.
        let q = if rows >= columns { q.transpose() } else { q };
        q.iter().map(|&x| x as f32).collect()
    }

    /// A standard normal number (Box and Muller).
    fn normal(&mut self) -> f64 {
        let [a, b]: [f64; 2] = self.rng.random();
        (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }

    fn upload<const D: usize>(&self, weight: Vec<f32>, shape: [usize; D]) -> Tensor<D> {
        Tensor::from_data(TensorData::new(weight, shape), &self.device)
    }
}

/// A dense layer: x W + b.
#[derive(Module, Debug)]
pub struct Dense {
    weight: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
}

impl Dense {
    /// Maps `x` `[batch, inputs]` to `[batch, outputs]`.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        x.matmul(self.weight.val()) + self.bias.val().unsqueeze()
    }
}

/// A 3x3 convolution with stride 1 and padding 1.
#[derive(Module, Debug)]
pub struct Conv {
    pub(super) weight: Param<Tensor<4>>,
    pub(super) bias: Param<Tensor<1>>,
}

impl Conv {
    /// Maps `x` `[batch, inputs, rows, columns]` to `[batch, outputs, rows, columns]`.
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let options = ConvOptions::new([1, 1], [1, 1], [1, 1], 1);
        conv2d(x, self.weight.val(), Some(self.bias.val()), options)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shorter_side_is_orthonormal_times_gain() {
        for (rows, columns) in [(3, 5), (5, 3), (4, 4)] {
            let mut initializer = Initializer::new(3, &Device::flex());
            let weight = initializer.orthogonal(rows, columns, 2.0);
            let w = DMatrix::from_row_slice(rows, columns, &weight);
            let gram = if rows < columns {
                &w * w.transpose()
            } else {
                w.transpose() * &w
            };
            let identity = DMatrix::<f32>::identity(gram.nrows(), gram.ncols()) * 4.0;
            assert!((gram - identity).abs().max() < 1e-5);
        }
    }

    #[test]
    fn seed_decides_the_weights() {
        let draw = |seed| Initializer::new(seed, &Device::flex()).orthogonal(4, 6, 1.0);
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
    }
}
