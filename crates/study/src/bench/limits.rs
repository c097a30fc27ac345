//! What the machine can do at most, measured with the same lanes as the simulation.

use std::hint::black_box;
use std::time::Duration;

use cpu_time::ThreadTime;
use serde::Serialize;

use drape_cloth::math::{Kernel, Lanes};

/// Rates of one thread, counted over all lanes.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Limits {
    /// Multiplications and additions, half of each; the kernels fuse none either [1/s].
    pub operations_per_second: f64,
    /// [1/s]
    pub divisions_per_second: f64,
    /// Square roots [1/s].
    pub roots_per_second: f64,
    /// Bytes read and written by a pass over memory as large as the state of a group [B/s].
    pub bytes_per_second: f64,
}

/// Operations of each chain in a measurement, about a millisecond.
const ROUNDS: usize = 200_000;

/// Bytes that a measurement of memory moves, about two milliseconds.
const BYTES: usize = 128 << 20;

impl Limits {
    /// Before anything is measured.
    pub const NONE: Self = Self {
        operations_per_second: 0.0,
        divisions_per_second: 0.0,
        roots_per_second: 0.0,
        bytes_per_second: 0.0,
    };

    /// Measures once: some ten milliseconds. `numbers` is the size of an environment's state.
    pub fn measure<V: Lanes>(numbers: usize) -> Self {
        // The best number of chains depends on registers and latencies.
        let operations = [
            rate::<V, MultiplyAdd, 4>(2),
            rate::<V, MultiplyAdd, 6>(2),
            rate::<V, MultiplyAdd, 8>(2),
            rate::<V, MultiplyAdd, 12>(2),
        ];
        Self {
            operations_per_second: operations.into_iter().fold(0.0, f64::max),
            divisions_per_second: rate::<V, Divide, 8>(1),
            roots_per_second: rate::<V, Root, 8>(1),
            bytes_per_second: bandwidth::<V>(numbers),
        }
    }

    /// The larger of each: a limit is the most that was ever seen.
    pub fn max(self, other: Self) -> Self {
        Self {
            operations_per_second: self.operations_per_second.max(other.operations_per_second),
            divisions_per_second: self.divisions_per_second.max(other.divisions_per_second),
            roots_per_second: self.roots_per_second.max(other.roots_per_second),
            bytes_per_second: self.bytes_per_second.max(other.bytes_per_second),
        }
    }
}

/// What is done over and over to `N` pairs of numbers which do not depend on each other.
trait Link {
    fn link<V: Lanes, const N: usize>(x: &mut [V; N], y: &mut [V; N], constants: [V; 2]);
}

struct MultiplyAdd;
impl Link for MultiplyAdd {
    #[inline(always)]
    fn link<V: Lanes, const N: usize>(x: &mut [V; N], y: &mut [V; N], [near_one, small]: [V; 2]) {
        for k in 0..N {
            x[k] = x[k] * near_one;
            y[k] = y[k] + small;
        }
    }
}

struct Divide;
impl Link for Divide {
    #[inline(always)]
    fn link<V: Lanes, const N: usize>(x: &mut [V; N], _: &mut [V; N], [near_one, _]: [V; 2]) {
        for x in x {
            *x = near_one / *x;
        }
    }
}

struct Root;
impl Link for Root {
    #[inline(always)]
    fn link<V: Lanes, const N: usize>(x: &mut [V; N], _: &mut [V; N], [near_one, _]: [V; 2]) {
        for x in x {
            // The sum keeps away from 1, whose root some processors know at once.
            *x = (*x + near_one).sqrt();
        }
    }
}

/// A link `ROUNDS` times.
struct Chains<'a, V, L, const N: usize> {
    seeds: [[f64; N]; 2],
    end: &'a mut V,
    link: std::marker::PhantomData<L>,
}

impl<V: Lanes, L: Link, const N: usize> Kernel for Chains<'_, V, L, N> {
    #[inline(always)]
    fn run(self) {
        let constants = [V::of(black_box(1.0 + 1e-7)), V::of(black_box(1e-7))];
        let mut x = [V::zero(); N];
        let mut y = [V::zero(); N];
        for k in 0..N {
            x[k] = V::of(self.seeds[0][k]);
            y[k] = V::of(self.seeds[1][k]);
        }
        for _ in 0..ROUNDS {
            L::link(&mut x, &mut y, constants);
        }
        for k in 0..N {
            *self.end = *self.end + x[k] + y[k];
        }
    }
}

/// Operations a second over all lanes, with `per_link` in each of `N` chains.
fn rate<V: Lanes, L: Link, const N: usize>(per_link: usize) -> f64 {
    // Different numbers that the compiler does not know: equal chains would become one.
    let seeds = black_box([0.3, 0.4].map(|low| std::array::from_fn(|k| low + k as f64)));
    let mut end = V::zero();
    let start = ThreadTime::now();
    V::vectorize(Chains::<V, L, N> {
        seeds,
        end: &mut end,
        link: std::marker::PhantomData,
    });
    let seconds = start.elapsed();
    black_box(end.as_slice());
    per_second(ROUNDS * N * per_link * V::COUNT, seconds)
}

/// Adds to every element, `passes` times.
struct Sweep<'a, V> {
    memory: &'a mut [V],
    passes: usize,
}

impl<V: Lanes> Kernel for Sweep<'_, V> {
    #[inline(always)]
    fn run(self) {
        let small = V::of(black_box(1e-7));
        for _ in 0..self.passes {
            // Or the passes would become one.
            for x in black_box(&mut *self.memory) {
                *x = *x + small;
            }
        }
    }
}

/// Bytes a second that passes over the state of a group read and write.
fn bandwidth<V: Lanes>(numbers: usize) -> f64 {
    let mut memory = vec![V::zero(); numbers];
    let moved = 2 * std::mem::size_of_val(&memory[..]);
    let passes = (BYTES / moved).max(1);
    V::vectorize(Sweep {
        memory: &mut memory,
        passes: 1,
    });
    let start = ThreadTime::now();
    V::vectorize(Sweep {
        memory: &mut memory,
        passes,
    });
    let seconds = start.elapsed();
    black_box(&memory);
    per_second(moved * passes, seconds)
}

fn per_second(count: usize, duration: Duration) -> f64 {
    // A clock that stands still must not make a limit infinite.
    count as f64 / duration.as_secs_f64().max(1e-9)
}
