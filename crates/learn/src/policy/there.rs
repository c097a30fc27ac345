//! Tests of what is kept on a device, on one that is always there.

use super::masked;
use super::seen::{Batch, History, Seen};
use super::shown::Shown;
use super::{ActorCritic, NetworkConfig, PolicyConfig, UnetConfig};
use burn::tensor::{Device, Tensor, TensorData};
use drape_cloth::math::{Purpose, Stream};
use drape_task::env::{ImageShape, Observation, Terrain};
use fixedbitset::FixedBitSet;
use std::sync::Arc;

const SHAPE: ImageShape = ImageShape {
    rows: 16,
    columns: 17,
};

/// Observations of noise on scene 0 or 1; each allows something.
fn noise(count: usize) -> Vec<Observation> {
    let pixels = SHAPE.pixel_count();
    let mut stream = Stream::new(3, Purpose::Evaluation, 0);
    let mut bits = |share: f64| {
        let mut set = FixedBitSet::with_capacity(pixels);
        set.extend((0..pixels).filter(|_| stream.uniform() < share));
        set
    };
    (0..count)
        .map(|k| {
            let mut mask = bits(if k % 3 == 0 { 0.0 } else { 0.2 });
            mask.insert(7 * k % pixels);
            Observation {
                scene: (k % 2) as u16,
                draped: bits(0.3),
                touched: bits(0.5),
                mask,
                distance: (0..pixels).map(|i| 1e-3 * (i * k) as f32).collect(),
            }
        })
        .collect()
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

#[test]
fn observations_come_back_in_any_order_from_any_piece() {
    let all = noise(7);
    let shown = |rows: &[usize]| {
        let rows: Vec<&Observation> = rows.iter().map(|&row| &all[row]).collect();
        Seen::Device(Arc::new(Shown::upload(&rows, &Device::flex())))
    };
    let steps = || vec![shown(&[0, 1, 2]), shown(&[3, 4, 5])];
    let mut apart = History::default();
    steps().into_iter().for_each(|piece| apart.push(piece));
    for history in [apart, steps().into()] {
        for rows in [vec![4, 0, 5, 5, 2], vec![1], vec![3, 4]] {
            let expected: Vec<&Observation> = rows.iter().map(|&row| &all[row]).collect();
            let batch = history.pick(&rows).with([&all[6]].into_iter());
            let Batch::Device(found) = &batch else {
                panic!("it stays on its device")
            };
            let found = found.fetch();
            assert!(found[..rows.len()].iter().eq(expected));
            assert_eq!(
                (&found[rows.len()], batch.rows()),
                (&all[6], rows.len() + 1)
            );
            assert!(rows.iter().all(|&row| history.scene(row) == all[row].scene));
        }
    }
}

/// Every network is asked for the same numbers wherever its observations are.
#[test]
fn networks_see_the_same_on_a_device() {
    let (all, terrains) = (noise(5), [terrain(0.1), terrain(-0.2)]);
    let all: Vec<&Observation> = all.iter().collect();
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
        let shown = Batch::Device(Shown::upload(&all, &Device::flex()));
        let [here, there] = [Batch::Host(all.clone()), shown].map(|batch| {
            let prediction = actor_critic.predict(&batch);
            let invalid = actor_critic.invalid(&batch);
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
        let expected = masked::draw(&log_probs[row * count..][..count], mask, uniform[row]);
        others += usize::from(drawn != expected as usize);
    }
    assert!(others <= 2, "{others} rows differ");
    let (_, drawn) = draw(vec![f32::NAN; masks.len() * count]);
    let lowest = masks.iter().map(|mask| mask.minimum().unwrap() as f32);
    assert!(drawn.into_iter().eq(lowest));
}
