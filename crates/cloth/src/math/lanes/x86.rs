//! The vectors of AVX2 and AVX-512.

use super::{Add, Div, Kernel, Lanes, Mul, Neg, Sub, Tables};
use std::arch::x86_64::*;

// SAFETY, for every intrinsic below: values of these types exist only behind the
// feature test in `Isa::best`, and the operations are inlined into the function that
// `vectorize` compiles with the feature enabled.
macro_rules! operator {
    ($name:ident, $trait:ident, $method:ident, $intrinsic:ident) => {
        impl $trait for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}

macro_rules! vector {
    ($name:ident, $scalar:ty, $inner:ty, $count:literal, $feature:literal, $mask:ty,
     $splat:ident, $add:ident, $sub:ident, $mul:ident, $div:ident, $mul_add:ident, $sqrt:ident, $min:ident, $max:ident,
     |$a:ident, $b:ident| $lt:expr, |$m:ident, $y:ident, $n:ident| $select:expr, |$k:ident| $any:expr, { $($special:item)* }) => {
        #[doc = concat!(stringify!($count), " ", stringify!($scalar), " lanes on ", $feature, ".")]
        #[derive(Clone, Copy)]
        #[repr(transparent)]
        pub struct $name($inner);

        operator!($name, Add, add, $add);
        operator!($name, Sub, sub, $sub);
        operator!($name, Mul, mul, $mul);
        operator!($name, Div, div, $div);
        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self(unsafe { $sub($splat(-0.0), self.0) })
            }
        }
        impl Lanes for $name {
            type Scalar = $scalar;
            type Mask = $mask;
            const COUNT: usize = $count;
            #[inline(always)]
            fn splat(x: $scalar) -> Self {
                Self(unsafe { $splat(x) })
            }
            #[inline(always)]
            fn mul_add(self, factor: Self, addend: Self) -> Self {
                Self(unsafe { $mul_add(self.0, factor.0, addend.0) })
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                Self(unsafe { $min(self.0, other.0) })
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                Self(unsafe { $max(self.0, other.0) })
            }
            #[inline(always)]
            fn lt(self, other: Self) -> $mask {
                let ($a, $b) = (self.0, other.0);
                unsafe { $lt }
            }
            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                let ($m, $y, $n) = (mask, yes.0, no.0);
                Self(unsafe { $select })
            }
            #[inline(always)]
            fn any(mask: $mask) -> bool {
                let $k = mask;
                #[allow(unused_unsafe)]
                unsafe {
                    $any
                }
            }
            $($special)*
            fn vectorize<K: Kernel>(kernel: K) {
                #[target_feature(enable = $feature)]
                fn compiled<K: Kernel>(kernel: K) {
                    kernel.run();
                }
                // SAFETY: as above.
                unsafe { compiled(kernel) }
            }
        }
    };
}

vector!(
    F32x8,
    f32,
    __m256,
    8,
    "avx2,fma",
    __m256,
    _mm256_set1_ps,
    _mm256_add_ps,
    _mm256_sub_ps,
    _mm256_mul_ps,
    _mm256_div_ps,
    _mm256_fmadd_ps,
    _mm256_sqrt_ps,
    _mm256_min_ps,
    _mm256_max_ps,
    |a, b| _mm256_cmp_ps::<_CMP_LT_OQ>(a, b),
    |m, y, n| _mm256_blendv_ps(n, y, m),
    |m| _mm256_movemask_ps(m) != 0,
    {
        const TRANSPOSE: Option<fn(&mut [Self])> = Some(transpose_f32x8);
        #[inline(always)]
        fn floor(self) -> Self {
            // What does not fit becomes the least integer.
            let whole = unsafe { Self(_mm256_cvtepi32_ps(_mm256_cvttps_epi32(self.0))) };
            whole.max(Self::zero())
        }
        #[inline(always)]
        fn look_up(tables: &Tables, [i, j, k]: [Self; 3]) -> [[Self; 2]; 4] {
            // SAFETY: no index is beyond its table, that of the last pair included.
            unsafe {
                let [first, row, layer, last] = [
                    _mm256_loadu_si256(tables.first.as_ptr().cast()),
                    _mm256_loadu_si256(tables.row.as_ptr().cast()),
                    _mm256_loadu_si256(tables.layer.as_ptr().cast()),
                    _mm256_loadu_si256(tables.last.as_ptr().cast()),
                ];
                let [i, j, k] = [
                    _mm256_cvttps_epi32(i.0),
                    _mm256_cvttps_epi32(j.0),
                    _mm256_cvttps_epi32(k.0),
                ];
                let (j, k) = (_mm256_mullo_epi32(j, row), _mm256_mullo_epi32(k, layer));
                let at = _mm256_add_epi32(_mm256_add_epi32(i, j), k);
                let at = _mm256_add_epi32(_mm256_min_epu32(at, last), first);
                let (right, up) = (_mm256_add_epi32(at, row), _mm256_add_epi32(at, layer));
                let from = tables.samples.as_ptr().cast();
                let mut found = [[Self::zero(); 2]; 4];
                for (found, at) in
                    found
                        .iter_mut()
                        .zip([at, right, up, _mm256_add_epi32(right, layer)])
                {
                    let (low, high) = (
                        _mm256_castsi256_si128(at),
                        _mm256_extracti128_si256::<1>(at),
                    );
                    let low = _mm256_castpd_ps(_mm256_i32gather_pd::<4>(from, low));
                    let high = _mm256_castpd_ps(_mm256_i32gather_pd::<4>(from, high));
                    let near = _mm256_castps_pd(_mm256_shuffle_ps::<0x88>(low, high));
                    let far = _mm256_castps_pd(_mm256_shuffle_ps::<0xdd>(low, high));
                    found[0] = Self(_mm256_castpd_ps(_mm256_permute4x64_pd::<0xd8>(near)));
                    found[1] = Self(_mm256_castpd_ps(_mm256_permute4x64_pd::<0xd8>(far)));
                }
                found
            }
        }
    }
);
vector!(
    F32x16,
    f32,
    __m512,
    16,
    "avx512f",
    __mmask16,
    _mm512_set1_ps,
    _mm512_add_ps,
    _mm512_sub_ps,
    _mm512_mul_ps,
    _mm512_div_ps,
    _mm512_fmadd_ps,
    _mm512_sqrt_ps,
    _mm512_min_ps,
    _mm512_max_ps,
    |a, b| _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b),
    |m, y, n| _mm512_mask_blend_ps(m, n, y),
    |m| m != 0,
    {
        const TRANSPOSE: Option<fn(&mut [Self])> = Some(transpose_f32x16);
        #[inline(always)]
        fn floor(self) -> Self {
            // What does not fit becomes the least integer.
            let whole = unsafe { Self(_mm512_cvtepi32_ps(_mm512_cvttps_epi32(self.0))) };
            whole.max(Self::zero())
        }
        #[inline(always)]
        fn look_up(tables: &Tables, [i, j, k]: [Self; 3]) -> [[Self; 2]; 4] {
            // SAFETY: no index is beyond its table, that of the last pair included.
            unsafe {
                let [first, row, layer, last] = [
                    _mm512_loadu_si512(tables.first.as_ptr().cast()),
                    _mm512_loadu_si512(tables.row.as_ptr().cast()),
                    _mm512_loadu_si512(tables.layer.as_ptr().cast()),
                    _mm512_loadu_si512(tables.last.as_ptr().cast()),
                ];
                let [i, j, k] = [
                    _mm512_cvttps_epi32(i.0),
                    _mm512_cvttps_epi32(j.0),
                    _mm512_cvttps_epi32(k.0),
                ];
                let (j, k) = (_mm512_mullo_epi32(j, row), _mm512_mullo_epi32(k, layer));
                let at = _mm512_add_epi32(_mm512_add_epi32(i, j), k);
                let at = _mm512_add_epi32(_mm512_min_epu32(at, last), first);
                let (right, up) = (_mm512_add_epi32(at, row), _mm512_add_epi32(at, layer));
                let even =
                    _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
                let odd = _mm512_add_epi32(even, _mm512_set1_epi32(1));
                let from = tables.samples.as_ptr().cast();
                let mut found = [[Self::zero(); 2]; 4];
                for (found, at) in
                    found
                        .iter_mut()
                        .zip([at, right, up, _mm512_add_epi32(right, layer)])
                {
                    let (low, high) = (
                        _mm512_castsi512_si256(at),
                        _mm512_extracti64x4_epi64::<1>(at),
                    );
                    let low = _mm512_castpd_ps(_mm512_i32gather_pd::<4>(low, from));
                    let high = _mm512_castpd_ps(_mm512_i32gather_pd::<4>(high, from));
                    found[0] = Self(_mm512_permutex2var_ps(low, even, high));
                    found[1] = Self(_mm512_permutex2var_ps(low, odd, high));
                }
                found
            }
        }
    }
);
vector!(
    F64x4,
    f64,
    __m256d,
    4,
    "avx2,fma",
    __m256d,
    _mm256_set1_pd,
    _mm256_add_pd,
    _mm256_sub_pd,
    _mm256_mul_pd,
    _mm256_div_pd,
    _mm256_fmadd_pd,
    _mm256_sqrt_pd,
    _mm256_min_pd,
    _mm256_max_pd,
    |a, b| _mm256_cmp_pd::<_CMP_LT_OQ>(a, b),
    |m, y, n| _mm256_blendv_pd(n, y, m),
    |m| _mm256_movemask_pd(m) != 0,
    {
        const TRANSPOSE: Option<fn(&mut [Self])> = Some(transpose_f64x4);
    }
);
vector!(
    F64x8,
    f64,
    __m512d,
    8,
    "avx512f",
    __mmask8,
    _mm512_set1_pd,
    _mm512_add_pd,
    _mm512_sub_pd,
    _mm512_mul_pd,
    _mm512_div_pd,
    _mm512_fmadd_pd,
    _mm512_sqrt_pd,
    _mm512_min_pd,
    _mm512_max_pd,
    |a, b| _mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b),
    |m, y, n| _mm512_mask_blend_pd(m, n, y),
    |m| m != 0,
    {
        const TRANSPOSE: Option<fn(&mut [Self])> = Some(transpose_f64x8);
    }
);

// Transpositions: pairs of numbers first, then pairs of pairs, then quarters or halves of
// registers. Without, a substep of one environment takes a fifth longer, in f64 a tenth.

#[inline(always)]
fn transpose_f32x16(block: &mut [F32x16]) {
    unsafe {
        for four in block.as_chunks_mut::<4>().0 {
            let [a, b, c, d] = [four[0].0, four[1].0, four[2].0, four[3].0];
            let ab = _mm512_castps_pd(_mm512_unpacklo_ps(a, b));
            let cd = _mm512_castps_pd(_mm512_unpacklo_ps(c, d));
            let ba = _mm512_castps_pd(_mm512_unpackhi_ps(a, b));
            let dc = _mm512_castps_pd(_mm512_unpackhi_ps(c, d));
            *four = [
                F32x16(_mm512_castpd_ps(_mm512_unpacklo_pd(ab, cd))),
                F32x16(_mm512_castpd_ps(_mm512_unpackhi_pd(ab, cd))),
                F32x16(_mm512_castpd_ps(_mm512_unpacklo_pd(ba, dc))),
                F32x16(_mm512_castpd_ps(_mm512_unpackhi_pd(ba, dc))),
            ];
        }
        for c in 0..4 {
            let [s, t, u, v] = [block[c].0, block[c + 4].0, block[c + 8].0, block[c + 12].0];
            let even = _mm512_shuffle_f32x4::<0x88>(s, t);
            let odd = _mm512_shuffle_f32x4::<0xdd>(s, t);
            let even_high = _mm512_shuffle_f32x4::<0x88>(u, v);
            let odd_high = _mm512_shuffle_f32x4::<0xdd>(u, v);
            block[c] = F32x16(_mm512_shuffle_f32x4::<0x88>(even, even_high));
            block[c + 4] = F32x16(_mm512_shuffle_f32x4::<0x88>(odd, odd_high));
            block[c + 8] = F32x16(_mm512_shuffle_f32x4::<0xdd>(even, even_high));
            block[c + 12] = F32x16(_mm512_shuffle_f32x4::<0xdd>(odd, odd_high));
        }
    }
}

#[inline(always)]
fn transpose_f32x8(block: &mut [F32x8]) {
    unsafe {
        for four in block.as_chunks_mut::<4>().0 {
            let [a, b, c, d] = [four[0].0, four[1].0, four[2].0, four[3].0];
            let ab = _mm256_castps_pd(_mm256_unpacklo_ps(a, b));
            let cd = _mm256_castps_pd(_mm256_unpacklo_ps(c, d));
            let ba = _mm256_castps_pd(_mm256_unpackhi_ps(a, b));
            let dc = _mm256_castps_pd(_mm256_unpackhi_ps(c, d));
            *four = [
                F32x8(_mm256_castpd_ps(_mm256_unpacklo_pd(ab, cd))),
                F32x8(_mm256_castpd_ps(_mm256_unpackhi_pd(ab, cd))),
                F32x8(_mm256_castpd_ps(_mm256_unpacklo_pd(ba, dc))),
                F32x8(_mm256_castpd_ps(_mm256_unpackhi_pd(ba, dc))),
            ];
        }
        for c in 0..4 {
            let [low, high] = [block[c].0, block[c + 4].0];
            block[c] = F32x8(_mm256_permute2f128_ps::<0x20>(low, high));
            block[c + 4] = F32x8(_mm256_permute2f128_ps::<0x31>(low, high));
        }
    }
}

#[inline(always)]
fn transpose_f64x8(block: &mut [F64x8]) {
    unsafe {
        for pair in block.as_chunks_mut::<2>().0 {
            let [a, b] = [pair[0].0, pair[1].0];
            *pair = [
                F64x8(_mm512_unpacklo_pd(a, b)),
                F64x8(_mm512_unpackhi_pd(a, b)),
            ];
        }
        for c in 0..2 {
            let [s, t, u, v] = [block[c].0, block[c + 2].0, block[c + 4].0, block[c + 6].0];
            let even = _mm512_shuffle_f64x2::<0x88>(s, t);
            let odd = _mm512_shuffle_f64x2::<0xdd>(s, t);
            let even_high = _mm512_shuffle_f64x2::<0x88>(u, v);
            let odd_high = _mm512_shuffle_f64x2::<0xdd>(u, v);
            block[c] = F64x8(_mm512_shuffle_f64x2::<0x88>(even, even_high));
            block[c + 2] = F64x8(_mm512_shuffle_f64x2::<0x88>(odd, odd_high));
            block[c + 4] = F64x8(_mm512_shuffle_f64x2::<0xdd>(even, even_high));
            block[c + 6] = F64x8(_mm512_shuffle_f64x2::<0xdd>(odd, odd_high));
        }
    }
}

#[inline(always)]
fn transpose_f64x4(block: &mut [F64x4]) {
    unsafe {
        for pair in block.as_chunks_mut::<2>().0 {
            let [a, b] = [pair[0].0, pair[1].0];
            *pair = [
                F64x4(_mm256_unpacklo_pd(a, b)),
                F64x4(_mm256_unpackhi_pd(a, b)),
            ];
        }
        for c in 0..2 {
            let [low, high] = [block[c].0, block[c + 2].0];
            block[c] = F64x4(_mm256_permute2f128_pd::<0x20>(low, high));
            block[c + 2] = F64x4(_mm256_permute2f128_pd::<0x31>(low, high));
        }
    }
}
