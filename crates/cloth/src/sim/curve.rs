//! Shear by a curve of several slopes.
//!
//! The chord of [`super::shear`] is taken where forces have drawn a cell within the substep; of a law
//! that bends it would be another's than where the cell comes to rest. So a cell answers with its
//! force as it lay at the start of the substep, and from there on with a slope:
//! force = f + s (C - C_old). At rest nothing moves, and every cell meets the curve, whatever the
//! substep and whatever s > 0. That is the greatest slope so far: under a curve that gets softer the
//! tangent would let a cell that is let go swing beyond rest; more only slows it within a substep.

use super::edges::{EdgeClass, EdgeResponse, Projected};
use super::line::{Along, Chain, LineLaw, Response, solve};
use super::physics::PhysicsConfig;
use crate::fabric::{Curve, Lamina};
use crate::math::{Lanes, Vec3x, asin};

/// Sine of the greatest angle of a curve, [`Curve::MAX_ANGLE`]. Beyond it forces grow with the slope
/// that they have there.
pub(super) const MAX_SINE: f64 = 0.985_449_729_988_460_2;

/// The law of cells whose curve has more than one slope.
#[derive(Clone, Debug)]
pub(super) struct ShearCurve {
    /// sin gamma over l^2 / l0^2 - 1 of a diagonal.
    pub per_growth: f64,
    /// By the sign of the angle.
    pub kinks: [Vec<Kink>; 2],
}

/// Where the slope of a curve changes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kink {
    /// [rad], > 0.
    pub angle: f64,
    /// What the slope gains there, over the first.
    pub gain: f64,
    /// What the greatest slope so far gains.
    pub rise: f64,
}

/// The curve of a lamina's shear, with its locking if listed; none of a straight one, which costs
/// less and whose locking is a constraint of its own.
pub(super) fn shear_curve(lamina: &Lamina, physics: &PhysicsConfig) -> Option<ShearCurve> {
    let shear = &lamina.material.shear;
    let bends = physics.shear && shear.bends();
    let [a, b] = lamina.cell();
    bends.then(|| ShearCurve {
        per_growth: (a * a + b * b) / (2.0 * a * b),
        kinks: shear.curves(physics.shear_locking).map(|c| kinks(&c)),
    })
}

fn kinks(curve: &Curve) -> Vec<Kink> {
    let (mut slope, mut greatest) = (1.0, 1.0f64);
    let kink = |[angle, next]: [f64; 2]| {
        let (gain, rise) = (next - slope, (next - greatest).max(0.0));
        (slope, greatest) = (next, greatest.max(next));
        Kink { angle, gain, rise }
    };
    curve.kinks().into_iter().map(kink).collect()
}

/// How a diagonal answers, over its compliance and its length at rest.
struct Answer<V> {
    /// Less than 0 where the shear is negative.
    sine: V,
    /// Length less force over slope: what it would be without force.
    without_force: V,
    slope: V,
}

impl ShearCurve {
    /// Force and slope of a constraint that is the sine of the shear angle, over its stiffness at
    /// rest; `sine` is within [`MAX_SINE`].
    ///
    /// The energy is the integral of the stress tau by the angle, so the force is tau / cos, and its
    /// slope (tau' + tau sin / cos) / cos^2.
    #[inline(always)]
    pub fn of_sine<V: Lanes>(&self, sine: V) -> [V; 2] {
        let one = V::of(1.0);
        let inverse = one / (one - sine * sine).sqrt();
        let angle = asin(sine);
        let (mut stress, mut slope) = (angle, one);
        for (kinks, sign) in self.kinks.iter().zip([1.0, -1.0]) {
            for kink in kinks {
                let beyond = angle * V::of(sign) - V::of(kink.angle);
                let is_beyond = V::zero().lt(beyond);
                let more = beyond * V::of(sign * kink.gain);
                stress = stress + V::select(is_beyond, more, V::zero());
                slope = slope + V::select(is_beyond, V::of(kink.rise), V::zero());
            }
        }
        let turn = stress * inverse;
        [turn, (slope + turn * sine) * (inverse * inverse)]
    }

    /// Of a diagonal with the square of its length, and the inverse of that at rest [1/m].
    ///
    /// With l^2 = l0^2 (1 + sin / p), p being `per_growth`, the force on the diagonal is that on the
    /// sine times l / (2 p l0), and its slope that of the sine times l^2 / l0^2, plus force / (2 p).
    #[inline(always)]
    fn of_diagonal<V: Lanes>(&self, square: V, inverse_rest: V) -> Answer<V> {
        let per_growth = V::of(self.per_growth);
        let sine = within(square * (inverse_rest * inverse_rest * per_growth) - per_growth);
        let square = sine * V::of(1.0 / self.per_growth) + V::of(1.0);
        let [force, slope] = self.of_sine(sine);
        let half = force * V::of(0.5 / self.per_growth);
        let slope = slope * square + half.max(V::zero());
        Answer {
            sine,
            without_force: square.sqrt() * (V::of(1.0) - half / slope),
            slope,
        }
    }
}

/// A sine within what a curve may have.
#[inline(always)]
pub(super) fn within<V: Lanes>(sine: V) -> V {
    sine.min(V::of(MAX_SINE)).max(V::of(-MAX_SINE))
}

/// The compliance of the sign of the shear.
#[inline(always)]
pub(super) fn of_sign<V: Lanes>([positive, negative]: [V; 2], sine: V) -> V {
    V::select(sine.lt(V::zero()), negative, positive)
}

/// A curve and where vertices were at the start of the substep [m].
pub(super) struct Lagged<'a, V> {
    pub curve: &'a ShearCurve,
    pub previous: &'a [Vec3x<V>],
}

impl<V: Lanes> Lagged<'_, V> {
    #[inline(always)]
    fn square(&self, [a, b]: [u32; 2]) -> V {
        let d = self.previous[b as usize] - self.previous[a as usize];
        d.dot(d)
    }
}

impl<V: Lanes> EdgeResponse<V> for Lagged<'_, V> {
    #[inline(always)]
    fn at(&self, class: &EdgeClass, edge: Projected<V>) -> [V; 2] {
        let rest = class.rest_length[edge.i];
        let square = self.square(class.vertices[edge.i]);
        let answer = self.curve.of_diagonal(square, V::of(1.0 / rest));
        let c = edge.c + (V::of(1.0) - answer.without_force) * V::of(rest);
        [c, of_sign(edge.law, answer.sine) / answer.slope]
    }
}

/// Solves a row of diagonals together.
#[inline(always)]
pub(super) fn shear_by_curve<V: Lanes, C: Chain<V>>(row: Along<V, C>, curve: &ShearCurve) {
    let (line, previous) = (row.line, row.previous);
    let vertices = line.vertices();
    let lagged = Lagged { curve, previous };
    solve(row, &mut OfRow { lagged, vertices });
}

struct OfRow<'a, V> {
    lagged: Lagged<'a, V>,
    vertices: &'a [u32],
}

impl<V: Lanes> Response<V> for OfRow<'_, V> {
    #[inline(always)]
    fn at(&self, law: &LineLaw<V>, j: usize, _: V, length: V) -> [V; 2] {
        let [rest, inverse_rest] = law.rest;
        let square = self.lagged.square([self.vertices[j], self.vertices[j + 1]]);
        let answer = self.lagged.curve.of_diagonal(square, inverse_rest);
        let compliance = of_sign(law.compliance, answer.sine) / answer.slope;
        [compliance, length - answer.without_force * rest]
    }
}

#[cfg(test)]
mod tests;
