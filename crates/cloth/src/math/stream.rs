use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// What a random stream is used for. Each consumer draws from its own stream, so that one
/// more draw in one place changes nothing in another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Initial weights of the networks.
    Weights,
    /// Actions drawn during training.
    Actions,
    /// Order of the samples in an update.
    Shuffle,
    /// Actions drawn during an evaluation, and by the random baseline.
    Evaluation,
    /// Actions drawn in a search.
    Search,
    /// Numbers of scenes that are learned on together.
    Scenes,
    /// Where presses land.
    Presses,
    /// Worlds that differ by what no shop can hold.
    Worlds,
}

/// A seeded random stream whose position can be stored and restored exactly.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stream(ChaCha8Rng);

impl Stream {
    /// The stream number `index` of `purpose` under `seed`. Streams of different purpose or
    /// index never overlap (ChaCha's stream counter separates them).
    pub fn new(seed: u64, purpose: Purpose, index: u32) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(((purpose as u64) << 32) | u64::from(index));
        Self(rng)
    }

    /// A number in [0, 1), uniformly.
    pub fn uniform(&mut self) -> f64 {
        self.0.random()
    }

    /// A whole number in 0..`limit`, uniformly. `limit` must not be 0.
    pub fn below(&mut self, limit: usize) -> usize {
        self.0.random_range(0..limit)
    }

    /// A standard normal number (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// Puts `items` into a uniformly random order (Fisher and Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i + 1));
        }
    }

    /// 64 random bits, for seeding somebody else's generator.
    pub fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_are_apart_and_repeat() {
        let draw = |purpose, index| {
            let mut stream = Stream::new(7, purpose, index);
            [stream.bits(), stream.bits()]
        };
        assert_eq!(draw(Purpose::Actions, 3), draw(Purpose::Actions, 3));
        assert_ne!(draw(Purpose::Actions, 3), draw(Purpose::Actions, 4));
        assert_ne!(draw(Purpose::Actions, 3), draw(Purpose::Shuffle, 3));
    }

    #[test]
    fn restored_stream_goes_on_where_it_was() {
        let mut stream = Stream::new(1, Purpose::Weights, 0);
        stream.normal();
        let bytes = postcard::to_allocvec(&stream).unwrap();
        let mut again: Stream = postcard::from_bytes(&bytes).unwrap();
        assert_eq!(stream.bits(), again.bits());
    }

    #[test]
    fn normal_has_mean_zero_and_unit_deviation() {
        let mut stream = Stream::new(5, Purpose::Weights, 0);
        let draws: Vec<f64> = (0..20_000).map(|_| stream.normal()).collect();
        let mean = draws.iter().sum::<f64>() / 20_000.0;
        let variance = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 20_000.0;
        // Four standard errors of the mean and of the variance.
        assert!(mean.abs() < 0.0283 && (variance - 1.0).abs() < 0.04);
    }
}
