//! Projections of the constraints, for all lanes at once. Everything here is inlined into
//! the substep, so that it is compiled for the instruction set in use.

use super::model::{BendHinge, BendTriple, EdgeClass, Limit};
use super::trellis::Trellis;
use crate::math::{Lanes, Vec3x};

/// Below this squared length [m^2] an edge has no direction, and nothing pulls along it.
pub(super) const SHORTEST_SQUARE: f64 = 1e-20;

/// Projects the edges of one colour, one after the other.
///
/// C = |x1 - x0| - l [m]. Macklin et al. 2016 (XPBD), eqs. 17-18, with lambda = 0 at the
/// start of the substep.
#[inline(always)]
pub(super) fn project_edges<V: Lanes>(class: &EdgeClass, x: &mut [Vec3x<V>], w: &[V]) {
    for ((v, rest), law) in class
        .vertices
        .iter()
        .zip(&class.rest_length)
        .zip(&class.law)
    {
        let [a, b] = v.map(|v| v as usize);
        let d = x[b] - x[a];
        let length = d.dot(d).max(V::of(SHORTEST_SQUARE)).sqrt();
        let c = length - V::of(*rest);
        let compliance = V::select(c.lt(V::zero()), V::of(law.compression), V::of(law.tension));
        let sum = w[a] + w[b] + compliance;
        let pull = d.scale(c / (sum * length).max(V::of(1e-28)));
        x[a] = x[a] + pull.scale(w[a]);
        x[b] = x[b] - pull.scale(w[b]);
    }
}

/// As [`project_edges`], with the compliance of a trellis.
#[inline(always)]
pub(super) fn project_diagonals<V: Lanes>(
    class: &EdgeClass,
    trellis: &Trellis,
    x: &mut [Vec3x<V>],
    w: &[V],
) {
    for ((v, rest), law) in class
        .vertices
        .iter()
        .zip(&class.rest_length)
        .zip(&class.law)
    {
        let [a, b] = v.map(|v| v as usize);
        let d = x[b] - x[a];
        let square = d.dot(d).max(V::of(SHORTEST_SQUARE));
        let length = square.sqrt();
        let c = length - V::of(*rest);
        let compliance = V::select(c.lt(V::zero()), V::of(law.compression), V::of(law.tension));
        let sum = w[a] + w[b] + compliance * trellis.share(square, V::of(1.0 / rest));
        let pull = d.scale(c / (sum * length).max(V::of(1e-28)));
        x[a] = x[a] + pull.scale(w[a]);
        x[b] = x[b] - pull.scale(w[b]);
    }
}

/// As [`project_edges`], for yarns that have another compliance beyond a tension: where the
/// projection by the law before it would end with more.
#[inline(always)]
pub(super) fn project_limited_edges<V: Lanes>(
    class: &EdgeClass,
    limits: &[Limit],
    x: &mut [Vec3x<V>],
    w: &[V],
) {
    let smallest = V::of(1e-28);
    for (((v, rest), law), limit) in class
        .vertices
        .iter()
        .zip(&class.rest_length)
        .zip(&class.law)
        .zip(limits)
    {
        let [a, b] = v.map(|v| v as usize);
        let d = x[b] - x[a];
        let length = d.dot(d).max(V::of(SHORTEST_SQUARE)).sqrt();
        let c = length - V::of(*rest);
        let gives = w[a] + w[b];
        let compliance = V::select(c.lt(V::zero()), V::of(law.compression), V::of(law.tension));
        let before = gives + compliance;
        let beyond = (V::of(limit.force) * before).lt(c);
        let c = V::select(beyond, c - V::of(limit.offset), c);
        let sum = V::select(beyond, gives + V::of(limit.compliance), before);
        let pull = d.scale(c / (sum * length).max(smallest));
        x[a] = x[a] + pull.scale(w[a]);
        x[b] = x[b] - pull.scale(w[b]);
    }
}

/// Projects three-node bending, one colour.
///
/// C = x0 - 2 x1 + x2 [m], a vector; each component is a constraint of its own with the same
/// denominator, so there is one division and no square root.
#[inline(always)]
pub(super) fn project_triples<V: Lanes>(triples: &[BendTriple], x: &mut [Vec3x<V>], w: &[V]) {
    for triple in triples {
        let [a, b, c] = triple.vertices.map(|v| v as usize);
        let [wa, wb, wc] = [w[a], w[b], w[c]];
        let alpha = V::of(triple.compliance);
        let sum = wa + wc + V::of(4.0) * wb + alpha;
        let difference = x[a] + x[c] - x[b].scale(V::of(2.0));
        let pull = difference.scale(V::of(1.0) / sum);
        x[a] = x[a] - pull.scale(wa);
        x[b] = x[b] + pull.scale(wb + wb);
        x[c] = x[c] - pull.scale(wc);
    }
}

/// Arc tangent of t >= 0 [rad], error below 2e-6 (least-squares polynomial in t^2 over
/// 0..1, reflected beyond).
#[inline(always)]
fn arc_tangent<V: Lanes>(t: V) -> V {
    let one = V::of(1.0);
    let large = one.lt(t);
    let u = V::select(large, one / t.max(V::of(1e-20)), t);
    let s = u * u;
    let mut sum = V::zero();
    for c in [
        -0.011_721_2,
        0.052_653_32,
        -0.116_432_87,
        0.193_543_46,
        -0.332_623_47,
        0.999_977_26,
    ] {
        sum = sum * s + V::of(c);
    }
    let angle = u * sum;
    V::select(large, V::of(std::f64::consts::FRAC_PI_2) - angle, angle)
}

/// Projects dihedral bending, one colour.
///
/// C = angle between the normals of the two triangles [rad], 0 at rest (paper, Figure 2b).
/// The angle comes from its half's tangent, which stays exact near the flat state where
/// arccos does not. Gradients as in Bridson et al. 2003 (discrete hinge).
#[inline(always)]
pub(super) fn project_hinges<V: Lanes>(hinges: &[BendHinge], x: &mut [Vec3x<V>], w: &[V]) {
    let tiny = V::of(1e-20);
    for hinge in hinges {
        let i = hinge.vertices.map(|v| v as usize);
        let [p0, p1, p2, p3] = i.map(|i| x[i]);
        let e = p1 - p0;
        // Normals of twice the area: of (p0, p1, p2), and of (p1, p0, p3).
        let n1 = e.cross(p2 - p0);
        let n2 = (p3 - p0).cross(e);
        let s1 = n1.dot(n1).max(tiny);
        let s2 = n2.dot(n2).max(tiny);
        let es = e.dot(e).max(tiny);
        let length = es.sqrt();
        let cosine = n1.dot(n2);
        let sine = n1.cross(n2).dot(e) / length;
        let norm = (s1 * s2).sqrt();
        // tan(angle / 2) = |sine| / (norm + cosine)
        let absolute = sine.max(-sine);
        let half = arc_tangent(absolute / (norm + cosine).max(tiny));
        let angle = V::select(sine.lt(V::zero()), -(half + half), half + half);

        let g2 = n1.scale(-(length / s1));
        let g3 = n2.scale(-(length / s2));
        let t2 = (p2 - p0).dot(e) / es;
        let t3 = (p3 - p0).dot(e) / es;
        let one = V::of(1.0);
        let g0 = g2.scale(t2 - one) + g3.scale(t3 - one);
        let g1 = (g2.scale(t2) + g3.scale(t3)).scale(V::of(-1.0));
        let g = [g0, g1, g2, g3];

        let mut sum = V::of(hinge.compliance);
        for k in 0..4 {
            sum = sum + w[i[k]] * g[k].dot(g[k]);
        }
        let lambda = -(angle / sum);
        for k in 0..4 {
            x[i[k]] = x[i[k]] + g[k].scale(lambda * w[i[k]]);
        }
    }
}

#[cfg(test)]
mod tests;
