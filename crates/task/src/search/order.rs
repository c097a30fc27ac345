use std::f64::consts::TAU;

use crate::env::{Draping, Tasks};
use drape_cloth::math::Stream;

/// An order in which an episode presses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    Random,
    Sweep,
    Outwards,
}

impl Order {
    pub const ALL: [Self; 3] = [Self::Random, Self::Sweep, Self::Outwards];

    /// As in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Sweep => "sweeps",
            Self::Outwards => "outwards",
        }
    }
}

/// The allowed action of one environment that comes first in `order`; `share` 0..1 of the episodes
/// came before.
pub fn choose(env: &Draping, index: usize, order: Order, share: f64, stream: &mut Stream) -> u32 {
    let mask = &env.observation(index).mask;
    let shape = env.shape();
    let (columns, rows) = (shape.columns as f64, shape.rows as f64);
    let first = |rank: &dyn Fn(f64, f64) -> f64| {
        let rank = |p: usize| rank((p % shape.columns) as f64, (p / shape.columns) as f64);
        mask.ones().min_by(|&a, &b| rank(a).total_cmp(&rank(b)))
    };
    let chosen = match order {
        Order::Random => mask.ones().nth(stream.below(mask.count_ones(..))),
        Order::Sweep => {
            let (sin, cos) = (TAU * share).sin_cos();
            first(&|x, y| cos * x + sin * y)
        }
        Order::Outwards => {
            let place = 49.0 * share;
            let (across, along) = ((place % 7.0).floor() / 6.0, (place / 7.0).floor() / 6.0);
            first(&|x, y| (x - across * (columns - 1.0)).hypot(y - along * (rows - 1.0)))
        }
    };
    chosen.expect("a mask is never empty") as u32
}
