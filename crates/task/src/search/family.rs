//! Families of orders that follow from the region alone, one an episode. An order is a rank for each
//! pixel of the image: under the rules of the task the allowed one of least rank comes first, so that
//! a stroke ends only where nothing beside it is untouched.

use std::collections::HashSet;
use std::f64::consts::TAU;

use super::arena::Arena;
use crate::env::{Draping, ImageShape, Tasks};
use drape_cloth::sim::Observation;

/// A rank for each pixel.
pub(super) type Ranks = Vec<f64>;

/// Plays an episode in every order, in one environment each, until there is none left or the steps
/// are spent. Orders that rank the region as one before them are left out. True if all were played.
pub fn in_order(arena: &mut Arena, orders: impl IntoIterator<Item = Ranks>) -> bool {
    let pixels = region(arena.env).pixels;
    let mut seen = HashSet::new();
    let mut orders = orders.into_iter().filter(|ranks| {
        let mut sorted = pixels.clone();
        sorted.sort_by(|&a, &b| ranks[a].total_cmp(&ranks[b]));
        seen.insert(sorted)
    });
    let mut own: Vec<Option<Ranks>> = (0..arena.env.count()).map(|_| orders.next()).collect();
    while own.iter().any(Option::is_some) {
        let env = &*arena.env;
        let next = |(index, ranks): (usize, &Option<Ranks>)| {
            let ranks = ranks.as_ref()?;
            Some(first(env.observation(index), |pixel| ranks[pixel]))
        };
        let actions: Vec<Option<u32>> = own.iter().enumerate().map(next).collect();
        let Some(ended) = arena.step(&actions) else {
            return false;
        };
        for (own, _) in own.iter_mut().zip(ended).filter(|(_, end)| end.is_some()) {
            *own = orders.next();
        }
    }
    true
}

/// Plays episodes of random allowed actions until the steps are spent.
pub fn at_random(arena: &mut Arena, seed: u64) {
    let mut streams = arena.streams(seed);
    loop {
        let each = streams.iter_mut().enumerate();
        let actions = each.map(|(index, stream)| {
            let allowed = arena.env.observation(index).allowed();
            let drawn = allowed.map(|action| (stream.uniform(), action));
            drawn
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .map(|(_, action)| action)
        });
        let actions: Vec<Option<u32>> = actions.collect();
        if arena.step(&actions).is_none() {
            return;
        }
    }
}

/// The allowed action of least rank, the lowest of equals.
pub(super) fn first(seen: Observation, rank: impl Fn(usize) -> f64) -> u32 {
    let rank = |action: u32| rank(action as usize);
    let least = seen.allowed().min_by(|&a, &b| rank(a).total_cmp(&rank(b)));
    least.expect("something is allowed")
}

/// The pixels of the focus region in their image.
struct Region {
    columns: usize,
    rows: usize,
    /// Ascending.
    pixels: Vec<usize>,
}

impl Region {
    /// Column and row of a pixel.
    fn at(&self, pixel: usize) -> [f64; 2] {
        [pixel % self.columns, pixel / self.columns].map(|x| x as f64)
    }

    fn ranks(&self, rank: impl Fn([f64; 2]) -> f64) -> Ranks {
        let count = self.columns * self.rows;
        (0..count).map(|pixel| rank(self.at(pixel))).collect()
    }

    /// Half a pixel, seen from across the region [rad]: directions nearer to each other order it
    /// alike.
    fn angle(&self) -> f64 {
        0.5 / (self.columns as f64).hypot(self.rows as f64)
    }
}

fn region(env: &Draping) -> Region {
    let shape = env.shape();
    let task = &env.tasks()[0];
    let pixels = task.pressable_vertices().filter_map(|v| task.action(v));
    let mut pixels: Vec<usize> = pixels.map(|pixel| pixel as usize).collect();
    pixels.sort_unstable();
    Region {
        columns: shape.columns,
        rows: shape.rows,
        pixels,
    }
}

/// 0, 1/2, 1/4, 3/4, 1/8, ...: every new one lies in the middle of a greatest gap. As many as
/// refine to `least`, at most 2^16.
fn refined(least: f64) -> impl Iterator<Item = f64> {
    let levels = (1.0 / least).log2().ceil().clamp(0.0, 16.0) as u32;
    (0..1u32 << levels).map(|k| f64::from(k.reverse_bits()) / 2f64.powi(32))
}

/// Ranks of pixels at `[column, row]` swept over straight, in a direction that is a share of a turn.
pub(super) fn sweep(share: f64) -> impl Fn([f64; 2]) -> f64 {
    let (sin, cos) = (TAU * share).sin_cos();
    move |[x, y]| cos * x + sin * y
}

/// Ranks of pixels at `[column, row]` outwards from a place, given as shares of the way across the
/// image and down.
pub(super) fn outward(shape: ImageShape, [across, down]: [f64; 2]) -> impl Fn([f64; 2]) -> f64 {
    let [right, bottom] = [shape.columns, shape.rows].map(|count| count as f64 - 1.0);
    move |[x, y]| (x - across * right).hypot(y - down * bottom)
}

/// Straight sweeps, a direction an episode.
pub fn sweeps(env: &Draping) -> impl Iterator<Item = Ranks> + use<> {
    let region = region(env);
    refined(region.angle() / TAU).map(move |share| region.ranks(sweep(share)))
}

/// Outwards from a place, which comes from finer and finer grids over the image, down to half a
/// pixel.
pub fn outwards(env: &Draping) -> impl Iterator<Item = Ranks> + use<> {
    let region = region(env);
    let longest = region.columns.max(region.rows) as f64;
    let levels = (2.0 * longest).log2().ceil() as u32;
    let places = (0..=levels).flat_map(|level| {
        let cells = 1u32 << level;
        let places = (0..=cells).flat_map(move |j| (0..=cells).map(move |i| [i, j]));
        let is_new = move |[i, j]: &[u32; 2]| level == 0 || i % 2 == 1 || j % 2 == 1;
        let share = move |place: [u32; 2]| place.map(|k| f64::from(k) / f64::from(cells));
        places.filter(is_new).map(share)
    });
    let shape = env.shape();
    places.map(move |place| region.ranks(outward(shape, place)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refinement_halves_the_gaps() {
        let found: Vec<f64> = refined(0.2).collect();
        assert_eq!(found, [0.0, 0.5, 0.25, 0.75, 0.125, 0.625, 0.375, 0.875]);
        assert_eq!(refined(1.0).count(), 1);
    }
}
