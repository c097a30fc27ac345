//! Shear of woven cloth: stress linear in the shear angle.
//!
//! A cell between yarns of lengths a and b that hardly stretch is a trellis. Its diagonal l
//! knows its shear angle, sin gamma = (l^2 - l0^2) / (2 a b), and with the energy
//! G t a b gamma^2 / 2 pulls with dE/dl = G t gamma l / cos gamma. The compliance of a solve is that
//! of the chord, (l - l0) / (dE/dl), at the length that it starts from, as a polynomial in the sine,
//! which costs neither roots nor divisions.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{SMatrix, SVector};

use super::edges::{Edge, EdgeClass, EdgeResponse, Projected, in_colors};
use super::law::{EdgeLaw, branch};
use super::line::{Along, Chain, Direction, Line, LineLaw, Response, solve};
use super::physics::PhysicsConfig;
use crate::fabric::Lamina;
use crate::math::{Lanes, polynomial};

/// Sine of the shear angle up to which polynomials are fitted, that of 60 degrees: woven cloth
/// locks before. Beyond it they keep their last value.
pub(super) const MAX_SINE: f64 = 0.866_025_4;

/// Powers of the sine in the fit of a diagonal.
pub(super) const POWERS: usize = 5;

/// The law of the diagonals of a lamina.
#[derive(Clone, Debug)]
pub(super) struct Trellis {
    /// sin gamma over l^2 / l0^2 - 1.
    per_growth: f64,
    /// Compliance over that at rest is 1 + sum of share[k] sin^(k + 1) gamma.
    share: [f64; POWERS],
    /// Compliance of a diagonal at rest, by the sign of the shear [m/N].
    pub at_rest: EdgeLaw,
}

impl Trellis {
    /// Of cells of the size that `lamina` has, with shear moduli by the sign of the shear [Pa].
    ///
    /// The fit is that of least relative squares: within 0.2 % for square cells, 1.3 % for any.
    pub fn new(lamina: &Lamina, [positive, negative]: [f64; 2]) -> Self {
        let [a, b] = lamina.cell();
        let per_growth = (a * a + b * b) / (2.0 * a * b);
        // In units of the greatest, so that the system is well conditioned.
        let share = fit(-1.0, |part| chord(MAX_SINE * part, per_growth));
        let compliance =
            |modulus: f64| 1.0 / (2.0 * per_growth * modulus * lamina.material.thickness());
        Self {
            per_growth,
            share: std::array::from_fn(|k| share[k] / MAX_SINE.powi(k as i32 + 1)),
            at_rest: EdgeLaw {
                tension: compliance(positive),
                compression: compliance(negative),
            },
        }
    }

    /// All its numbers, those at rest aside.
    #[cfg(feature = "gpu")]
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        std::iter::once(self.per_growth).chain(self.share)
    }

    /// Compliance of a diagonal over that at rest, from the square of its length and the inverse
    /// of its length at rest [1/m].
    #[inline(always)]
    pub fn share<V: Lanes>(&self, square: V, inverse_rest: V) -> V {
        let per_growth = V::of(self.per_growth);
        let sine = square * (inverse_rest * inverse_rest * per_growth) - per_growth;
        let sine = sine.min(V::of(MAX_SINE)).max(V::of(-MAX_SINE));
        polynomial(&self.share, sine) * sine + V::of(1.0)
    }
}

/// The share[k] of which 1 + sum of share[k] part^(k + 1) is nearest to `chord` of `part`, from
/// `low` to 1, by least relative squares.
pub(super) fn fit(low: f64, chord: impl Fn(f64) -> f64) -> [f64; POWERS] {
    let [middle, half] = [0.5 * (1.0 + low), 0.5 * (1.0 - low)];
    let mut normal = SMatrix::<f64, POWERS, POWERS>::zeros();
    let mut right = SVector::<f64, POWERS>::zeros();
    let points = 200;
    for i in 0..points {
        let angle = std::f64::consts::PI * (f64::from(i) + 0.5) / f64::from(points);
        let part = middle + half * angle.cos();
        let chord = chord(part);
        let powers: SVector<f64, POWERS> = SVector::from_fn(|k, _| part.powi(k as i32 + 1) / chord);
        normal += powers * powers.transpose();
        right += powers * (1.0 - 1.0 / chord);
    }
    let share = normal.cholesky().expect("powers are independent");
    share.solve(&right).into()
}

/// (l - l0) / (dE/dl) over its limit at rest, in shear of `sine`, not 0 and less than 1.
fn chord(sine: f64, per_growth: f64) -> f64 {
    let stretch = (1.0 + sine / per_growth).sqrt();
    let cosine = (1.0 - sine * sine).sqrt();
    sine / sine.asin() * cosine * 2.0 / (stretch * (stretch + 1.0))
}

/// That for a constraint that is the sine itself: sin gamma cos gamma / gamma, within 0.1 %
/// up to 60 degrees (least relative squares).
#[inline(always)]
pub(super) fn share_of_sine<V: Lanes>(sine: V) -> V {
    let square = (sine * sine).min(V::of(MAX_SINE * MAX_SINE));
    polynomial(&[1.0, -0.680_531_98, -0.003_791_1, -0.174_311_54], square)
}

/// The law of the diagonals: near rest a spring of 2 G h for square cells, as such a diagonal
/// grows by a gamma / sqrt 2.
pub(super) fn trellis(lamina: &Lamina, physics: &PhysicsConfig) -> Option<Trellis> {
    let shear = &lamina.material.shear;
    let moduli = [shear.positive.modulus(), shear.negative.modulus()];
    physics.shear.then(|| Trellis::new(lamina, moduli))
}

/// Diagonals strung together from end to end.
pub(super) fn rows(lamina: &Lamina, law: EdgeLaw) -> Vec<Line> {
    let mut next: BTreeMap<u32, u32> = lamina.diagonals.iter().map(|&[a, b]| (a, b)).collect();
    let ends: BTreeSet<u32> = next.values().copied().collect();
    let starts: Vec<u32> = next.keys().filter(|v| !ends.contains(v)).copied().collect();
    let row = |start| {
        let mut vertices = vec![start];
        while let Some(to) = next.remove(vertices.last().expect("not empty")) {
            vertices.push(to);
        }
        Line {
            vertices,
            edges: 0..0,
            rest_length: lamina.cell_diagonal(),
            law,
            limit: None,
            bending: 0.0,
        }
    };
    starts.into_iter().map(row).collect()
}

/// Diagonals in colours.
pub(super) fn edges(lamina: &Lamina, trellis: &Trellis) -> Vec<EdgeClass> {
    let edge = |&ends| Edge {
        ends,
        rest_length: lamina.cell_diagonal(),
        law: trellis.at_rest,
        direction: Direction::Diagonal,
    };
    let edges: Vec<Edge> = lamina.diagonals.iter().map(edge).collect();
    let classes = in_colors(lamina, &edges, |edge| edge.ends);
    classes.into_iter().map(EdgeClass::from).collect()
}

impl<V: Lanes> EdgeResponse<V> for Trellis {
    #[inline(always)]
    fn at(&self, class: &EdgeClass, edge: Projected<V>) -> [V; 2] {
        let inverse_rest = V::of(1.0 / class.rest_length[edge.i]);
        let share = self.share(edge.square, inverse_rest);
        [edge.c, branch(edge.law, edge.c) * share]
    }
}

/// Solves a row of diagonals together, each from force 0 and with the compliance of the sign
/// and size of its C. As for a yarn, but soft enough that its forces need not last.
#[inline(always)]
pub(super) fn shear<V: Lanes, C: Chain<V>>(row: Along<V, C>, trellis: &Trellis) {
    solve(row, &mut Cold(trellis));
}

/// No forces from the last substep, and the law of a diagonal.
struct Cold<'a>(&'a Trellis);

impl<V: Lanes> Response<V> for Cold<'_> {
    #[inline(always)]
    fn at(&self, law: &LineLaw<V>, _: usize, square: V, length: V) -> [V; 2] {
        let [rest, inverse_rest] = law.rest;
        let c = length - rest;
        let at_rest = branch(law.compliance, c);
        [at_rest * self.0.share(square, inverse_rest), c]
    }
}

#[cfg(test)]
mod tests;
