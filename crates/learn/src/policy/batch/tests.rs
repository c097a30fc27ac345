//! Tests of what is kept on a device, on one that is always there.

use super::super::masked;
use super::super::{ActorCritic, NetworkConfig, PolicyConfig, UnetConfig};
use super::{Batch, Images};
use burn::tensor::{Device, Tensor, TensorData};
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::sim::{ALLOWED, Observations};
use drape_task::env::{ImageShape, Terrain};
use fixedbitset::FixedBitSet;

const SHAPE: ImageShape = ImageShape {
    rows: 16,
    columns: 17,
};

/// Observations of noise on view 0 or 1; each allows something.
fn noise(count: usize) -> Observations {
    let pixels = SHAPE.pixel_count();
    let mut stream = Stream::new(3, Purpose::Evaluation, 0);
    let mut marks: Vec<u8> = (0..count * pixels)
        .map(|_| stream.below(16) as u8)
        .collect();
    marks
        .iter_mut()
        .step_by(pixels)
        .for_each(|mark| *mark |= ALLOWED);
    let distance = (0..count * pixels).map(|i| 1e-5 * i as f32).collect();
    let views = (0..count as u16).map(|k| k % 2).collect();
    Observations::new(views, distance, marks)
}

fn terrain(slope: f32) -> Terrain {
    let mut inside = FixedBitSet::with_capacity(SHAPE.pixel_count());
    inside.insert_range(5..200);
    Terrain {
        inside,
        height: (0..SHAPE.pixel_count()).map(|i| slope * i as f32).collect(),
        slope: vec![[slope, -slope]; SHAPE.pixel_count()],
    }
}

fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().unwrap()
}

/// Rows of several observations arrive in the order in which they are asked for.
#[test]
fn rows_arrive_in_their_order() {
    let (a, b) = (noise(3), noise(5));
    for rows in [vec![(&a, 2), (&b, 4), (&a, 0), (&a, 0)], vec![(&b, 1)]] {
        let images = Images::new(&rows, &Device::flex());
        let [_, distance, ..] = images.planes(2.0);
        let expected = rows.iter().flat_map(|(seen, row)| seen.row(*row).distance);
        assert!(numbers(distance).into_iter().eq(expected.map(|d| 2.0 * d)));
        assert!(
            images
                .views
                .iter()
                .eq(rows.iter().map(|(seen, row)| &seen.views[*row]))
        );
    }
}

/// Every network is asked for the same numbers wherever its observations are encoded.
#[test]
fn networks_see_the_same_on_a_device() {
    let (all, terrains) = (noise(5), [terrain(0.1), terrain(-0.2)]);
    let terrains: Vec<&Terrain> = terrains.iter().collect();
    let unet = NetworkConfig::Unet(UnetConfig {
        channels: 4,
        levels: 2,
        value_hidden: 8,
    });
    let unet = PolicyConfig {
        network: unet,
        ..PolicyConfig::compact()
    };
    for config in [PolicyConfig::paper(), PolicyConfig::compact(), unet] {
        let made = ActorCritic::new(&config, SHAPE, &terrains, 1, &Device::flex());
        let actor_critic = made.unwrap().valid();
        let there = Batch::Device((0..5).map(|row| (&all, row)).collect());
        let [here, there] = [Batch::Host(all.rows().collect()), there].map(|batch| {
            let (prediction, invalid) = actor_critic.predict(&batch);
            let logits = masked::log_softmax(prediction.logits, invalid);
            (numbers(logits), numbers(prediction.value))
        });
        assert_eq!(here, there, "{config:?}");
    }
}

/// Rows are drawn from as single ones are, but where rounding decides; what is masked never is, even where
/// nothing is a number.
#[test]
fn rows_are_drawn_as_one_by_one() {
    let count = 150;
    let mut stream = Stream::new(5, Purpose::Evaluation, 0);
    let (mut logits, mut masks, mut uniform) = (Vec::new(), Vec::new(), Vec::new());
    for row in 0..200 {
        let mut mask = FixedBitSet::with_capacity(count);
        mask.extend((0..count).filter(|_| stream.uniform() < 0.3));
        mask.insert(row % count);
        logits.extend((0..count).map(|_| (4.0 * stream.uniform()) as f32));
        masks.push(mask);
        uniform.push(match row % 10 {
            0 => 0.0,
            1 => 1.0 - f64::EPSILON,
            _ => stream.uniform(),
        });
    }
    let device = Device::flex();
    let invalid: Vec<bool> = (masks.iter())
        .flat_map(|mask| (0..count).map(|k| !mask.contains(k)))
        .collect();
    let shape = [masks.len(), count];
    let invalid =
        Tensor::<2, burn::tensor::Bool>::from_data(TensorData::new(invalid, shape), &device);
    let draw = |logits: Vec<f32>| {
        let logits = Tensor::from_data(TensorData::new(logits, shape), &device);
        let log_probs = masked::log_softmax(logits, invalid.clone());
        let drawn = masked::draw_rows(log_probs.clone(), invalid.clone(), &uniform);
        (numbers(log_probs), numbers(drawn.float()))
    };
    let (log_probs, drawn) = draw(logits);
    let mut others = 0;
    for (row, mask) in masks.iter().enumerate() {
        let drawn = drawn[row] as usize;
        assert!(mask.contains(drawn), "row {row}: {drawn}");
        let allowed = (0..count as u32).filter(|&action| mask.contains(action as usize));
        let expected = masked::draw(&log_probs[row * count..][..count], allowed, uniform[row]);
        others += usize::from(drawn != expected as usize);
    }
    assert!(others <= 2, "{others} rows differ");
    let (_, drawn) = draw(vec![f32::NAN; masks.len() * count]);
    let lowest = masks.iter().map(|mask| mask.minimum().unwrap() as f32);
    assert!(drawn.into_iter().eq(lowest));
}
