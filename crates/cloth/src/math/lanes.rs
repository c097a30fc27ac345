//! SIMD lanes. The instruction set is a matter of which type implements [`Lanes`]. Nothing fuses a
//! multiplication with an addition but [`Lanes::mul_add`], which always does: IEEE 754 then fixes
//! every result, and a lane computes the same bits whichever instruction set carries it.

use std::ops::{Add, Div, Mul, Neg, Range, Sub};

/// A floating-point number that a solver can be built on: f32 or f64.
pub trait Real: Lanes<Scalar = Self> + PartialOrd + std::fmt::Debug {
    /// Nearest number to `x`.
    fn from_f64(x: f64) -> Self;
    /// This number in f64.
    fn to_f64(self) -> f64;
}

/// Code to be compiled for the instruction set of a [`Lanes`] type.
pub trait Kernel {
    /// Runs the code. Must be `#[inline(always)]`, like all that it calls, or it is compiled
    /// without the instruction set.
    fn run(self);
}

/// `COUNT` numbers that are computed with in lockstep.
pub trait Lanes:
    Copy
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Type of one lane.
    type Scalar: Real;
    /// One truth value a lane.
    type Mask: Copy + Send + Sync;
    /// Number of lanes.
    const COUNT: usize;
    /// Makes lane i of number j lane j of number i, of as many numbers as there are lanes; none
    /// where that is not worth its code.
    const TRANSPOSE: Option<fn(&mut [Self])> = None;

    /// One number in every lane.
    fn splat(x: Self::Scalar) -> Self;
    /// `self` times `factor` plus `addend`, rounded once. Slow where the processor cannot fuse them.
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Smaller of two; `other` where one is NaN.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::select(self.lt(other), self, other)
    }
    /// Larger of two; `other` where one is NaN.
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(other.lt(self), self, other)
    }
    /// Where `self` < `other`; false where one is NaN.
    fn lt(self, other: Self) -> Self::Mask;
    /// `yes` where the mask is set, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Whether the mask is set in any lane.
    fn any(mask: Self::Mask) -> bool;
    /// Runs a kernel compiled for this type's instruction set.
    fn vectorize<K: Kernel>(kernel: K) {
        kernel.run();
    }

    /// Rounds numbers from 0 to 2^24 down; what is no number, or less, becomes 0.
    #[inline(always)]
    fn floor(self) -> Self {
        let mut found = Self::zero();
        for (found, x) in found.as_mut_slice().iter_mut().zip(self.as_slice()) {
            *found = Self::Scalar::from_f64(f64::from(x.to_f64() as u32));
        }
        found
    }

    /// For whole numbers i, j, k >= 0 in every lane what its table holds at i + row j + layer k + p, and next
    /// to it, for p of 0, row, layer and their sum. Outside the table it is any other number of it.
    #[inline(always)]
    fn look_up(tables: &Tables, [i, j, k]: [Self; 3]) -> [[Self; 2]; 4] {
        let mut found = [[Self::zero(); 2]; 4];
        for lane in 0..Self::COUNT {
            let [row, layer] = [tables.row[lane], tables.layer[lane]].map(|x| x as usize);
            let at = k.get(lane) as usize * layer + j.get(lane) as usize * row;
            let at = (at + i.get(lane) as usize).min(tables.last[lane] as usize);
            let samples = &tables.samples[tables.first[lane] as usize + at..][..row + layer + 2];
            for (found, at) in found.iter_mut().zip([0, row, layer, row + layer]) {
                found[0].set(lane, f64::from(samples[at]));
                found[1].set(lane, f64::from(samples[at + 1]));
            }
        }
        found
    }

    /// The lanes of all numbers, one after the other.
    #[inline(always)]
    fn flat_mut(all: &mut [Self]) -> &mut [Self::Scalar] {
        // SAFETY: as in `as_slice`.
        unsafe { std::slice::from_raw_parts_mut(all.as_mut_ptr().cast(), all.len() * Self::COUNT) }
    }

    /// The number in one lane [f64].
    #[inline(always)]
    fn get(&self, lane: usize) -> f64 {
        self.as_slice()[lane].to_f64()
    }

    /// Replaces the number in one lane.
    #[inline(always)]
    fn set(&mut self, lane: usize, x: f64) {
        self.as_mut_slice()[lane] = Self::Scalar::from_f64(x);
    }

    /// The lanes as a slice.
    #[inline(always)]
    fn as_slice(&self) -> &[Self::Scalar] {
        // SAFETY: every implementor is exactly COUNT scalars, without padding.
        unsafe { std::slice::from_raw_parts(std::ptr::from_ref(self).cast(), Self::COUNT) }
    }

    /// The lanes as a mutable slice.
    #[inline(always)]
    fn as_mut_slice(&mut self) -> &mut [Self::Scalar] {
        // SAFETY: as above.
        unsafe { std::slice::from_raw_parts_mut(std::ptr::from_mut(self).cast(), Self::COUNT) }
    }

    /// Zero in every lane.
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(Self::Scalar::from_f64(0.0))
    }

    /// One number in every lane, rounded from f64.
    #[inline(always)]
    fn of(x: f64) -> Self {
        Self::splat(Self::Scalar::from_f64(x))
    }
}

/// Lanes of the widest instruction set.
pub(crate) const WIDEST: usize = 16;

/// A table in every lane, of numbers that all share, each with strides of its own.
pub struct Tables<'a> {
    samples: &'a [f32],
    /// Where each begins.
    first: [i32; WIDEST],
    row: [i32; WIDEST],
    layer: [i32; WIDEST],
    /// Where a look-up begins at most, from there.
    last: [i32; WIDEST],
}

impl<'a> Tables<'a> {
    /// For each lane where its table lies among `samples`, and the strides of its rows and layers.
    ///
    /// # Panics
    /// If one has no room for a look-up, or there are more than 2^31 numbers.
    pub fn new(samples: &'a [f32], all: impl Iterator<Item = (Range<usize>, [usize; 2])>) -> Self {
        let none = [0; WIDEST];
        let mut tables = Self {
            samples,
            first: none,
            row: none,
            layer: none,
            last: none,
        };
        for (lane, (own, [row, layer])) in all.enumerate() {
            let last = samples[own.clone()].len().checked_sub(2 + row + layer);
            assert!(i32::try_from(own.end).is_ok(), "indices of 32 bits");
            tables.first[lane] = own.start as i32;
            tables.row[lane] = row as i32;
            tables.layer[lane] = layer as i32;
            tables.last[lane] = last.expect("room for a look-up") as i32;
        }
        tables
    }
}

macro_rules! scalar {
    ($t:ty) => {
        impl Real for $t {
            #[inline(always)]
            fn from_f64(x: f64) -> Self {
                x as $t
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                self as f64
            }
        }
        impl Lanes for $t {
            type Scalar = $t;
            type Mask = bool;
            const COUNT: usize = 1;
            #[inline(always)]
            fn splat(x: $t) -> Self {
                x
            }
            #[inline(always)]
            fn mul_add(self, factor: Self, addend: Self) -> Self {
                <$t>::mul_add(self, factor, addend)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                <$t>::sqrt(self)
            }
            #[inline(always)]
            fn lt(self, other: Self) -> bool {
                self < other
            }
            #[inline(always)]
            fn select(mask: bool, yes: Self, no: Self) -> Self {
                if mask { yes } else { no }
            }
            #[inline(always)]
            fn any(mask: bool) -> bool {
                mask
            }
        }
    };
}
scalar!(f32);
scalar!(f64);

/// Eight f32 lanes in plain code: for processors without AVX2.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
pub struct Portable([f32; 8]);

macro_rules! portable_operator {
    ($trait:ident, $method:ident) => {
        impl $trait for Portable {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(std::array::from_fn(|i| self.0[i].$method(other.0[i])))
            }
        }
    };
}
portable_operator!(Add, add);
portable_operator!(Sub, sub);
portable_operator!(Mul, mul);
portable_operator!(Div, div);

impl Neg for Portable {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|x| -x))
    }
}

impl Lanes for Portable {
    type Scalar = f32;
    type Mask = [bool; 8];
    const COUNT: usize = 8;
    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self([x; 8])
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self(std::array::from_fn(|i| {
            self.0[i].mul_add(factor.0[i], addend.0[i])
        }))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> [bool; 8] {
        std::array::from_fn(|i| self.0[i] < other.0[i])
    }
    #[inline(always)]
    fn select(mask: [bool; 8], yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|i| {
            if mask[i] { yes.0[i] } else { no.0[i] }
        }))
    }
    #[inline(always)]
    fn any(mask: [bool; 8]) -> bool {
        mask.contains(&true)
    }
}

#[cfg(target_arch = "x86_64")]
pub use x86::{F32x8, F32x16, F64x4, F64x8};

#[cfg(target_arch = "x86_64")]
mod x86;

/// An instruction set for groups of environments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Isa {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Isa {
    /// The instruction sets that this processor can run, widest last.
    pub fn available() -> Vec<Self> {
        #[allow(unused_mut)]
        let mut sets = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                sets.push(Self::Avx2);
            }
            if is_x86_feature_detected!("avx512f") {
                sets.push(Self::Avx512);
            }
        }
        sets
    }

    /// The widest instruction set that this processor can run.
    pub fn best() -> Self {
        *Self::available().last().expect("portable code always runs")
    }

    /// Number of f32 lanes.
    pub fn lanes(self) -> usize {
        match self {
            Self::Portable => Portable::COUNT,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => F32x8::COUNT,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => F32x16::COUNT,
        }
    }
}

/// The sum of c[k] x^k, by Horner. Where many are computed, `c` is narrowed to the lanes' precision
/// once: it is borrowed, as a copy would be narrowed each time.
#[inline(always)]
pub(crate) fn polynomial<V: Lanes, const N: usize>(c: &[f64; N], x: V) -> V {
    let mut sum = V::of(c[N - 1]);
    for k in (0..N - 1).rev() {
        sum = sum * x + V::of(c[k]);
    }
    sum
}

/// A vector in space in every lane.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Vec3x<V>(pub [V; 3]);

impl<V: Lanes> Vec3x<V> {
    /// Zero in every lane.
    #[inline(always)]
    pub fn zero() -> Self {
        Self([V::zero(); 3])
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> V {
        let ([a, b, c], [d, e, f]) = (self.0, other.0);
        a * d + b * e + c * f
    }

    /// Vector product.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        let ([a, b, c], [d, e, f]) = (self.0, other.0);
        Self([b * f - c * e, c * d - a * f, a * e - b * d])
    }

    /// Each component times `s`.
    #[inline(always)]
    pub fn scale(self, s: V) -> Self {
        let [a, b, c] = self.0;
        Self([a * s, b * s, c * s])
    }

    /// `yes` where the mask is set, else `no`.
    #[inline(always)]
    pub fn select(mask: V::Mask, yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|k| V::select(mask, yes.0[k], no.0[k])))
    }

    /// The components of all vectors, one after the other.
    #[inline(always)]
    pub fn components_mut(all: &mut [Self]) -> &mut [V] {
        // SAFETY: a vector is exactly three numbers.
        unsafe { std::slice::from_raw_parts_mut(all.as_mut_ptr().cast(), 3 * all.len()) }
    }

    /// The vector in one lane [f64].
    pub fn get(&self, lane: usize) -> [f64; 3] {
        std::array::from_fn(|k| self.0[k].get(lane))
    }

    /// Replaces the vector in one lane.
    pub fn set(&mut self, lane: usize, x: [f64; 3]) {
        for (component, x) in self.0.iter_mut().zip(x) {
            component.set(lane, x);
        }
    }
}

impl<V: Lanes> Add for Vec3x<V> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let ([a, b, c], [d, e, f]) = (self.0, other.0);
        Self([a + d, b + e, c + f])
    }
}

impl<V: Lanes> Sub for Vec3x<V> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let ([a, b, c], [d, e, f]) = (self.0, other.0);
        Self([a - d, b - e, c - f])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct LookUp<'a, V> {
        table: &'a [f32],
        found: &'a mut [[V; 2]; 4],
    }

    impl<V: Lanes> Kernel for LookUp<'_, V> {
        #[inline(always)]
        fn run(self) {
            let own = (0..V::COUNT).map(|_| (0..self.table.len(), [1, 2]));
            *self.found = V::look_up(&Tables::new(self.table, own), [V::zero(); 3]);
        }
    }

    struct Fuse<V>(V);

    impl<V: Lanes> Kernel for &mut Fuse<V> {
        #[inline(always)]
        fn run(self) {
            let [one, small] = [V::of(1.0), self.0];
            self.0 = (one + small).mul_add(one - small, V::zero() - one);
        }
    }

    /// (1 + x) (1 - x) - 1 = -x^2, of which nothing is left where the product is rounded.
    #[test]
    fn fused_products_are_rounded_once() {
        fn fused<V: Lanes>(x: f64) -> bool {
            let mut fuse = Fuse(V::of(x));
            V::vectorize(&mut fuse);
            fuse.0
                .as_slice()
                .iter()
                .all(|found| found.to_f64() == -x * x)
        }
        let [x32, x64] = [20, 40].map(|bits| 0.5f64.powi(bits));
        for isa in Isa::available() {
            let all_are = match isa {
                Isa::Portable => fused::<Portable>(x32) && fused::<f32>(x32) && fused::<f64>(x64),
                #[cfg(target_arch = "x86_64")]
                Isa::Avx2 => fused::<F32x8>(x32) && fused::<F64x4>(x64),
                #[cfg(target_arch = "x86_64")]
                Isa::Avx512 => fused::<F32x16>(x32) && fused::<F64x8>(x64),
            };
            assert!(all_are, "{isa:?}");
        }
    }

    type Pairs = [[f64; 2]; 4];

    /// What the first lane finds at the start of a table.
    fn look_up<V: Lanes>(table: &[f32]) -> Pairs {
        let mut found = [[V::zero(); 2]; 4];
        V::vectorize(LookUp {
            table,
            found: &mut found,
        });
        found.map(|pair| pair.map(|x| x.as_slice()[0].to_f64()))
    }

    /// A gather reads wherever it is told to, so a table without the last pair is refused first.
    #[test]
    fn tables_without_the_last_pair_are_not_read() {
        for isa in Isa::available() {
            let kinds: &[fn(&[f32]) -> Pairs] = match isa {
                Isa::Portable => &[look_up::<Portable>, look_up::<f32>, look_up::<f64>],
                #[cfg(target_arch = "x86_64")]
                Isa::Avx2 => &[look_up::<F32x8>, look_up::<F64x4>],
                #[cfg(target_arch = "x86_64")]
                Isa::Avx512 => &[look_up::<F32x16>, look_up::<F64x8>],
            };
            let table = [1.0, 2.0, 3.0, 4.0, 5.0];
            let expected = [[1.0, 2.0], [2.0, 3.0], [3.0, 4.0], [4.0, 5.0]];
            for look_up in kinds {
                assert_eq!(look_up(&table), expected, "{isa:?}");
                for length in 0..table.len() {
                    let found = std::panic::catch_unwind(|| look_up(&table[..length]));
                    assert!(found.is_err(), "{length} numbers on {isa:?}");
                }
            }
        }
    }
}
