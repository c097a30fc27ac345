use super::family::{first, outward, sweep};
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
    let (seen, shape) = (env.observation(index), env.shape());
    let at = |pixel: usize| [pixel % shape.columns, pixel / shape.columns].map(|x| x as f64);
    match order {
        Order::Random => {
            let drawn = stream.below(seen.allowed().count());
            seen.allowed().nth(drawn).expect("something is allowed")
        }
        Order::Sweep => {
            let rank = sweep(share);
            first(seen, |pixel| rank(at(pixel)))
        }
        Order::Outwards => {
            let place = 49.0 * share;
            let rank = outward(shape, [place % 7.0, place / 7.0].map(|x| x.floor() / 6.0));
            first(seen, |pixel| rank(at(pixel)))
        }
    }
}
