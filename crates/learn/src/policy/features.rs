//! Convolutions as one operation of burn's: on a CPU ours ([`super::stages`]), elsewhere burn's own.

use super::conv::Plane;
use super::layer::Conv;
pub use super::stages::StageKind;
use super::stages::{NetworkStage, Pullback, forward};
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::NoCheckpointing;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, DispatchKindConversion, DispatchTensor, Flex};
use burn::tensor::activation::relu;
use burn::tensor::module::max_pool2d;
use burn::tensor::ops::MaxPoolOptions;
use burn::tensor::{Device, Tensor, TensorData};
use drape_cloth::math::Isa;

/// A convolution with what comes before and after it.
pub struct Layer<'a> {
    pub conv: &'a Conv,
    pub kind: StageKind,
}

/// Features `[batch, channel * row * column]` of images `[batch, channel, row, column]`. There is
/// no gradient for the images.
pub fn features(images: Tensor<4>, layers: &[Layer]) -> Tensor<2> {
    // Without vectors that fuse multiplication and addition burn's operations are faster.
    match Isa::best() {
        Isa::Portable => None,
        isa => own_features(&images, layers, isa),
    }
    .unwrap_or_else(|| burn_features(images, layers))
}

/// Features by burn's own operations.
pub fn burn_features(images: Tensor<4>, layers: &[Layer]) -> Tensor<2> {
    let mut kept: Vec<Tensor<4>> = Vec::new();
    let convolved = layers.iter().fold(images, |mut x, layer| {
        if layer.kind == StageKind::Up {
            let finer = kept.pop().expect("every Up has its Down");
            let [_, _, rows, columns] = finer.dims();
            x = squares(x).narrow(2, 0, rows).narrow(3, 0, columns) + finer;
        }
        let x = layer.conv.forward(x);
        match layer.kind {
            StageKind::Linear => x,
            StageKind::Plain | StageKind::Up => relu(x),
            StageKind::Pool => max_pool2d(relu(x), MaxPoolOptions::new([2, 2])),
            StageKind::Down => {
                let x = relu(x);
                kept.push(x.clone());
                max_pool2d(even(x), MaxPoolOptions::new([2, 2]))
            }
        }
    });
    convolved.flatten(1, 3)
}

/// Images with a row and a column of zeros more where they have an odd number.
fn even(x: Tensor<4>) -> Tensor<4> {
    let [_, _, rows, columns] = x.dims();
    x.pad((0, columns % 2, 0, rows % 2), 0.0)
}

/// Images with a square of 2 x 2 pixels for each.
fn squares(x: Tensor<4>) -> Tensor<4> {
    let [batch, channels, rows, columns] = x.dims();
    x.reshape([batch * channels, rows, 1, columns, 1])
        .repeat(&[1, 1, 2, 1, 2])
        .reshape([batch, channels, 2 * rows, 2 * columns])
}

/// Features by ours; none unless `images` are on the CPU, in burn's `flex`.
fn own_features(images: &Tensor<4>, layers: &[Layer], isa: Isa) -> Option<Tensor<2>> {
    let tracked = images.clone().try_into_primitive::<Autodiff<Flex>>();
    let inner = match &tracked {
        Ok(tracked) => tracked.primitive().clone(),
        Err(_) => images.clone().try_into_primitive::<Flex>().ok()?,
    };
    let inner = inner.to_contiguous();
    let numbers = inner.as_slice().expect("contiguous numbers are f32");
    let [batch, _, rows, columns] = images.dims();
    if batch == 0 {
        return None;
    }

    let stages = layers.iter().map(|layer| {
        let [outputs, inputs, ..] = layer.conv.weight.dims();
        let kind = layer.kind;
        NetworkStage {
            inputs,
            outputs,
            kind,
        }
    });
    let parameters = layers.iter().flat_map(|layer| {
        let (weight, bias) = (layer.conv.weight.val(), layer.conv.bias.val());
        [weight.reshape([-1]), bias]
    });
    let parameters = Tensor::cat(parameters.collect::<Vec<Tensor<1>>>(), 0);
    let values = parameters.to_data().try_into_vec::<f32>();
    let values = values.expect("parameters are f32");
    let plane = Plane { rows, columns };
    let (features, pullback) = forward(stages.collect(), plane, &values, numbers, isa);

    let shape = [batch, features.len() / batch];
    let features = Tensor::from_data(TensorData::new(features, shape), &Device::flex());
    if tracked.is_err() {
        return Some(features);
    }
    let features = primitive::<Flex, 2>(features);
    let parameters = primitive::<Autodiff<Flex>, 1>(parameters);
    let node = Gradient.prepare::<NoCheckpointing>([parameters.node()]);
    let features = match node.compute_bound().stateful() {
        OpsKind::Tracked(node) => node.finish(Kept(pullback), features),
        OpsKind::UnTracked(node) => node.finish(features),
    };
    Some(Tensor::from_primitive::<Autodiff<Flex>>(features))
}

fn primitive<B: Backend, const D: usize>(tensor: Tensor<D>) -> FloatTensor<B>
where
    DispatchTensor: DispatchKindConversion<B>,
{
    let primitive = tensor.try_into_primitive::<B>();
    primitive.expect("parameters are where images are")
}

/// The node of the features in the graph of gradients.
#[derive(Debug)]
struct Gradient;

#[derive(Clone)]
struct Kept(Pullback);

impl std::fmt::Debug for Kept {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("Kept")
    }
}

impl Backward<Flex, 1> for Gradient {
    type State = Kept;

    fn backward(self, ops: Ops<Kept, 1>, gradients: &mut Gradients, _: &mut Checkpointer) {
        let gradient = gradients.consume::<Flex>(&ops.node).to_contiguous();
        let numbers = gradient.as_slice().expect("contiguous numbers are f32");
        let [Some(parameters)] = ops.parents else {
            return;
        };
        let found = (ops.state.0)(numbers);
        let shape = [found.len()];
        let found = Tensor::<1>::from_data(TensorData::new(found, shape), &Device::flex());
        gradients.register::<Flex>(parameters.id, primitive::<Flex, 1>(found));
    }
}

#[cfg(test)]
mod tests {
    use super::super::layer::Initializer;
    use super::*;
    use burn::module::{Module, Param};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Convolutions with biases, so that some outputs are above 0 and some are not.
    fn convolutions(channels: &[usize], device: &Device) -> Vec<Conv> {
        let mut initializer = Initializer::new(3, device);
        let pairs = channels.windows(2);
        let conv = |pair: &[usize]| {
            let mut conv = initializer.conv(pair[0], pair[1], 1.5);
            let bias: Vec<f32> = (0..pair[1]).map(|k| 0.1 - 0.02 * k as f32).collect();
            let bias = Tensor::from_data(TensorData::new(bias, [pair[1]]), device);
            conv.bias = Param::from_tensor(bias);
            conv
        };
        pairs.map(conv).collect()
    }

    /// The last image is of zeros and ones, as most are: equal numbers compete for the maximum.
    fn noise(shape: [usize; 4], device: &Device) -> Tensor<4> {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let count: usize = shape.iter().product();
        let flat = count - count / shape[0];
        let numbers = (0..count).map(|k| match k < flat {
            true => rng.random::<f32>() - 0.5,
            false => f32::from(u8::from(k % shape[3] > shape[3] / 2)),
        });
        let numbers: Vec<f32> = numbers.collect();
        Tensor::from_data(TensorData::new(numbers, shape), device)
    }

    /// Features, then the gradients of all weights and biases of a loss.
    fn run(
        convolutions: &[Conv],
        images: Tensor<4>,
        kinds: &[StageKind],
        features: fn(Tensor<4>, &[Layer]) -> Tensor<2>,
    ) -> Vec<Vec<f32>> {
        let layers = convolutions.iter().zip(kinds);
        let layers = layers.map(|(conv, &kind)| Layer { conv, kind });
        let features = features(images, &layers.collect::<Vec<_>>());
        let gradients = (features.clone().square().sum() + features.clone().sum()).backward();
        let mut all: Vec<Vec<f32>> = vec![features.into_data().try_into_vec().unwrap()];
        for conv in convolutions {
            let weight = conv.weight.val().grad(&gradients).unwrap();
            let bias = conv.bias.val().grad(&gradients).unwrap();
            all.push(weight.into_data().try_into_vec().unwrap());
            all.push(bias.into_data().try_into_vec().unwrap());
        }
        all
    }

    fn assert_close(found: &[Vec<f32>], expected: &[Vec<f32>], place: &str) {
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert_eq!(found.len(), expected.len(), "{place}");
            let scale = expected.iter().fold(1e-3f32, |max, x| max.max(x.abs()));
            for (a, b) in found.iter().zip(expected) {
                assert!((a - b).abs() < 2e-5 * scale, "{place}: {a} {b}");
            }
        }
    }

    #[test]
    fn features_and_gradients_are_those_of_burn() {
        let device = Device::flex().autodiff();
        use StageKind::{Down, Linear, Plain, Pool, Up};
        let ours = |images: Tensor<4>, layers: &[Layer]| {
            own_features(&images, layers, Isa::best()).expect("flex has ours")
        };
        for (side, kinds) in [
            (65, &[Pool, Pool, Pool][..]),
            (33, &[Pool, Pool, Pool]),
            (17, &[Pool, Pool, Plain]),
            (9, &[Pool, Plain, Plain]),
            (3, &[Pool, Plain, Plain]),
            (1, &[Plain, Plain, Plain]),
            (33, &[Down, Up, Linear]),
            (9, &[Down, Down, Plain, Up, Up, Linear]),
        ] {
            for channels in [&[3, 16, 32, 32][..], &[1, 1, 1, 1], &[2, 7, 3, 5]] {
                let mut channels = channels.to_vec();
                if kinds.contains(&Up) {
                    // What is added to each other has equally many.
                    channels = vec![channels[1]; kinds.len() + 1];
                }
                let convolutions = convolutions(&channels, &device);
                let images = noise([5, channels[0], side, side], &device);
                let found = run(&convolutions, images.clone(), kinds, ours);
                let expected = run(&convolutions, images, kinds, burn_features);
                assert_close(&found, &expected, &format!("{side} {channels:?}"));
            }
        }
    }

    /// As with burn's operations: the trainer stops at the first loss that is not finite.
    #[test]
    fn what_is_not_finite_shows() {
        let device = Device::flex().autodiff();
        let convolutions = convolutions(&[1, 2, 2], &device);
        for number in [f32::NAN, f32::INFINITY] {
            for kind in [StageKind::Plain, StageKind::Pool, StageKind::Down] {
                let mut numbers = vec![0.0; 64];
                numbers[27] = number;
                let images = TensorData::new(numbers, [1, 1, 8, 8]);
                let images = Tensor::from_data(images, &device);
                let layers: Vec<Layer> = convolutions
                    .iter()
                    .map(|conv| Layer { conv, kind })
                    .collect();
                let found = own_features(&images, &layers, Isa::best()).unwrap();
                let found = found.into_data().try_into_vec::<f32>().unwrap();
                assert!(found.iter().any(|x| !x.is_finite()), "{number} {kind:?}");
            }
        }
    }

    #[test]
    fn inference_gives_the_bits_of_training() {
        let device = Device::flex().autodiff();
        let convolutions = convolutions(&[3, 8, 8], &device);
        let images = noise([3, 3, 9, 9], &device);
        let numbers = |convolutions: &[Conv], images| {
            let layer = |conv| Layer {
                conv,
                kind: StageKind::Pool,
            };
            let layers: Vec<Layer> = convolutions.iter().map(layer).collect();
            let features = own_features(&images, &layers, Isa::best())
                .unwrap()
                .into_data();
            features.try_into_vec::<f32>().unwrap()
        };
        let valid: Vec<Conv> = convolutions.iter().map(|conv| conv.valid()).collect();
        let expected = numbers(&convolutions, images.clone());
        assert_eq!(numbers(&valid, images.inner()), expected);
    }
}
