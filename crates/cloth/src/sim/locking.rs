//! Locking: what shear gains where the yarns of a cell have turned until they touch.
//!
//! Beyond the locking angle the slope of the law is `stiffening` times that at rest, so a cell
//! stores (stiffening - 1) G t a b (|gamma| - gamma_L)^2 / 2 more. That is a one-sided constraint
//! of its own, solved from where the shear of [`super::shear`] has left the cloth: C is how much
//! longer, or shorter, a diagonal is than at the locking angle. As one law with shear it would hold
//! cloth far too early, at 0.34 rad under a load for 0.765: the chord is taken where a substep's
//! forces have drawn the diagonal, many times as stiff as where it comes to rest. Split, it rests
//! at 0.751: off by mobility times force, which vanishes with the square of the substep.

use super::edges::{EdgeClass, EdgeResponse, Projected};
use super::law::branch;
use super::line::{Along, Chain, LineLaw, Response, solve};
use super::physics::PhysicsConfig;
use super::shear::{MAX_SINE, POWERS, fit};
use crate::fabric::Lamina;
use crate::math::{Lanes, polynomial};

/// Compliance where nothing is locked [m/N]: no force comes of it and none goes through. A finite
/// one would leave forces along a row that shrink until processors take long over them.
const FREE: f64 = f64::INFINITY;

/// What the law of shear gains at large angles.
#[derive(Clone, Debug)]
pub(super) struct Locking {
    /// That of the locking angle.
    sine: f64,
    /// 1 / (MAX_SINE - sine).
    per_sine: f64,
    /// The compliance of a constraint |sin gamma| - sine, over that of the sine at rest, where it
    /// begins.
    at_onset: f64,
    /// It goes on as 1 + sum of share[k] part^(k + 1), up to MAX_SINE; the part is how far the
    /// sine has come from here to there.
    share: [f64; POWERS],
    /// sin gamma over l^2 / l0^2 - 1.
    per_growth: f64,
    /// Length of a diagonal over that at rest, shortened and lengthened to the locking angle.
    stretch: [f64; 2],
    /// That, shortened to MAX_SINE: any shorter it resists with that compliance.
    least: f64,
}

/// The locking of a lamina, where listed; a curve that bends has it within, see [`super::curve`].
pub(super) fn locking(lamina: &Lamina, physics: &PhysicsConfig) -> Option<Locking> {
    let shear = &lamina.material.shear;
    let law = (shear.locking).filter(|_| physics.shear_locking && !shear.bends())?;
    let (angle, sine) = (law.angle_rad, law.angle_rad.sin());
    // (|sin gamma| - sine) / force, the force being (|gamma| - angle) / cos gamma times moduli.
    let onset = angle.cos().powi(2);
    let chord = |part: f64| {
        let at = sine + (MAX_SINE - sine) * part;
        (at - sine) * (1.0 - at * at).sqrt() / (at.asin() - angle) / onset
    };
    let [a, b] = lamina.cell();
    let per_growth = (a * a + b * b) / (2.0 * a * b);
    let stretch = |sine: f64| (1.0 + sine / per_growth).sqrt();
    Some(Locking {
        sine,
        per_sine: 1.0 / (MAX_SINE - sine),
        at_onset: onset / (law.stiffening - 1.0),
        share: fit(0.0, chord),
        per_growth,
        stretch: [-sine, sine].map(stretch),
        least: stretch(-MAX_SINE),
    })
}

impl Locking {
    /// All its numbers: where a diagonal is locked, as stretches and their squares, and the rest in
    /// order, the fit last.
    #[cfg(feature = "gpu")]
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        let squares = self.stretch.map(|stretch| stretch * stretch);
        let [sine, per_sine] = [self.sine, self.per_sine];
        let rest = [self.least, sine, per_sine, self.at_onset, self.per_growth];
        let bounds = self.stretch.into_iter().chain(squares);
        bounds.chain(rest).chain(self.share)
    }

    /// How far a sine is beyond locking, by its sign, and the compliance of that over the
    /// sine's at rest.
    #[inline(always)]
    pub fn of_sine<V: Lanes>(&self, sine: V) -> [V; 2] {
        let (zero, onset) = (V::zero(), V::of(self.sine));
        let beyond = (sine - onset).max(zero) - (-sine - onset).max(zero);
        [beyond, self.share(sine)]
    }

    #[inline(always)]
    fn share<V: Lanes>(&self, sine: V) -> V {
        let size = sine.max(-sine).min(V::of(MAX_SINE)).max(V::of(self.sine));
        let part = (size - V::of(self.sine)) * V::of(self.per_sine);
        (polynomial(&self.share, part) * part + V::of(1.0)) * V::of(self.at_onset)
    }

    /// How much longer a diagonal is than at locking, over its length at rest and negative where it
    /// is shorter, and the compliance of that over the diagonal's at rest. `stretch` is its
    /// length over that at rest.
    ///
    /// With l^2 - l_L^2 = 2 a b (sin gamma - sine) the chord is that of the sine, times
    /// 2 l0^2 / (l (l + l_L)) as the compliance of a diagonal at rest is that of the sine.
    #[inline(always)]
    fn of_diagonal<V: Lanes>(&self, stretch: V) -> [V; 2] {
        let zero = V::zero();
        let [low, high] = self.stretch.map(V::of);
        let beyond = (stretch - high).max(zero) - (low - stretch).max(zero);
        let onset = V::select(beyond.lt(zero), low, high);
        let stretch = stretch.max(V::of(self.least));
        let sine = (stretch * stretch - V::of(1.0)) * V::of(self.per_growth);
        let twice = self.share(sine) * V::of(2.0);
        [beyond, twice / (stretch * (stretch + onset))]
    }

    // What is rare is computed only where it happens: roots and divisions cost most. No lane may
    // depend on others, so that what decides about all of them also decides about each.

    /// Where a diagonal is locked: more than 0. `square` is that of its length, with the inverse
    /// of its length at rest [1/m].
    #[inline(always)]
    fn excess<V: Lanes>(&self, square: V, inverse_rest: V) -> V {
        let [low, high] = self.stretch.map(|stretch| V::of(stretch * stretch));
        let square = square * (inverse_rest * inverse_rest);
        (square - high).max(V::zero()) + (low - square).max(V::zero())
    }

    /// Where two directions are locked, from their products with each other and themselves.
    #[inline(always)]
    pub fn holds<V: Lanes>(&self, [across, a, b]: [V; 3]) -> V::Mask {
        (a * b * V::of(self.sine * self.sine)).lt(across * across)
    }
}

impl<V: Lanes> EdgeResponse<V> for Locking {
    #[inline(always)]
    fn is_idle(&self, class: &EdgeClass, i: usize, square: V) -> bool {
        let excess = self.excess(square, V::of(1.0 / class.rest_length[i]));
        !V::any(V::zero().lt(excess))
    }

    #[inline(always)]
    fn at(&self, class: &EdgeClass, edge: Projected<V>) -> [V; 2] {
        let rest_length = class.rest_length[edge.i];
        let inverse_rest = V::of(1.0 / rest_length);
        let [beyond, share] = self.of_diagonal(edge.c * inverse_rest + V::of(1.0));
        let is_locked = V::zero().lt(self.excess(edge.square, inverse_rest));
        let beyond = beyond * V::of(rest_length);
        let c_locked = V::select(is_locked, beyond, V::zero());
        [c_locked, branch(edge.law, edge.c) * share]
    }
}

/// Pushes back the diagonals of a row that are locked, together.
#[inline(always)]
pub(super) fn lock<V: Lanes, C: Chain<V>>(row: Along<V, C>, locking: &Locking) {
    let [_, inverse_rest] = row.law.rest;
    let mut excess = V::zero();
    for (j, ends) in row.line.vertices().windows(2).enumerate() {
        let d = row.x[ends[1] as usize] - row.x[ends[0] as usize];
        excess = excess + locking.excess(d.dot(d), inverse_rest) * row.line.has_edge(j);
    }
    if V::any(V::zero().lt(excess)) {
        solve(row, &mut OneSided(locking));
    }
}

/// No force where nothing is locked.
struct OneSided<'a>(&'a Locking);

impl<V: Lanes> Response<V> for OneSided<'_> {
    #[inline(always)]
    fn at(&self, law: &LineLaw<V>, _: usize, square: V, length: V) -> [V; 2] {
        let [rest, inverse_rest] = law.rest;
        let [beyond, share] = self.0.of_diagonal(length * inverse_rest);
        let at_rest = branch(law.compliance, beyond);
        let is_locked = V::zero().lt(self.0.excess(square, inverse_rest));
        [
            V::select(is_locked, at_rest * share, V::of(FREE)),
            V::select(is_locked, beyond * rest, V::zero()),
        ]
    }
}

#[cfg(test)]
mod tests;
