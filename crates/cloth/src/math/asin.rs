//! Arc sine in plain arithmetic, so that it is vectorised and has the same bits everywhere: to two
//! units in the last place by the rational approximation of fdlibm's `e_asin.c`.

use std::f64::consts::FRAC_PI_2;

use super::lanes::{Lanes, polynomial};

/// asin x = x + x t P(t) / Q(t) with t = x^2, up to 1/2.
pub(crate) const P: [f64; 6] = [
    0.166_666_666_666_666_66,
    -0.325_565_818_622_400_9,
    0.201_212_532_134_862_93,
    -0.040_055_534_500_679_41,
    0.000_791_534_994_289_814_5,
    3.479_331_075_960_212e-5,
];
/// From its second coefficient on; the first is 1.
pub(crate) const Q: [f64; 4] = [
    -2.403_394_911_734_414,
    2.020_945_760_233_505_7,
    -0.688_283_971_605_453_3,
    0.077_038_150_555_901_94,
];

/// Arc sine [rad] of numbers between -1 and 1. Beyond 1/2 it is pi/2 - 2 asin sqrt((1 - x) / 2).
#[inline(always)]
pub(crate) fn asin<V: Lanes>(x: V) -> V {
    let (one, half) = (V::of(1.0), V::of(0.5));
    let size = x.max(-x);
    let is_small = size.lt(half);
    let t = V::select(is_small, size * size, half * (one - size));
    let base = V::select(is_small, size, t.sqrt());
    let ratio = t * polynomial(&P, t) / (one + t * polynomial(&Q, t));
    let arc = base + base * ratio;
    let angle = V::select(is_small, arc, V::of(FRAC_PI_2) - (arc + arc));
    V::select(x.lt(V::zero()), -angle, angle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_the_arc_sine() {
        for k in -1000..=1000 {
            let x = f64::from(k) / 1000.0;
            assert!((asin(x) - x.asin()).abs() < 4e-16, "{x}");
            let single = x as f32;
            let off = f64::from(asin(single)) - f64::from(single).asin();
            assert!(off.abs() < 3e-7, "{x}");
        }
    }
}
