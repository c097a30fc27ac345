//! Projections of the constraints, for all lanes at once. Everything here is inlined into
//! the substep, so that it is compiled for the instruction set in use.

use super::model::{BendHinge, BendTriple, Chain, EdgeClass};
use crate::math::{Lanes, Vec3x};

/// Below this squared length [m^2] an edge has no direction, and nothing pulls along it.
const SHORTEST_SQUARE: f64 = 1e-20;

/// Scratch space of the direct yarn solve, one entry an edge.
pub(super) struct ChainScratch<V> {
    direction: Vec<Vec3x<V>>,
    /// Upper diagonal of the eliminated matrix.
    upper: Vec<V>,
    /// Right side, then the multiplier.
    lambda: Vec<V>,
}

impl<V: Lanes> ChainScratch<V> {
    pub fn new(edges: usize) -> Self {
        Self {
            direction: vec![Vec3x::zero(); edges],
            upper: vec![V::zero(); edges],
            lambda: vec![V::zero(); edges],
        }
    }
}

/// Direction and length of an edge; a collapsed edge has direction zero.
#[inline(always)]
fn direction<V: Lanes>(d: Vec3x<V>) -> (Vec3x<V>, V) {
    let square = d.dot(d);
    let inverse = V::of(1.0) / square.max(V::of(SHORTEST_SQUARE)).sqrt();
    (d.scale(inverse), square * inverse)
}

/// Solves all length constraints of one yarn together.
///
/// C_j = |x_{j+1} - x_j| - l [m]; the system (J W J^T + alpha_tilde) lambda = -C of a chain
/// is tridiagonal (Thomas algorithm). Each edge takes the compliance [1/kg, as alpha / h^2]
/// of the sign that its multiplier had in the last substep, `compressed`, which is updated.
/// The sign of the predicted strain would not do: at rest it is that of gravity's last push,
/// not of the force in the yarn, so edges change branch in every substep and never come to
/// rest (30 mm/s on the rib instead of 0.0002). Pinned vertices (w = 0) decouple their neighbours by the
/// formula itself.
#[inline(always)]
pub(super) fn project_chain<V: Lanes>(
    chain: &Chain,
    inverse_h_squared: V,
    x: &mut [Vec3x<V>],
    w: &[V],
    compressed: &mut [V::Mask],
    scratch: &mut ChainScratch<V>,
) {
    let rest = V::of(chain.rest_length);
    let tension = V::of(chain.law.tension) * inverse_h_squared;
    let compression = V::of(chain.law.compression) * inverse_h_squared;
    // Two pinned ends and no compliance leave a zero diagonal; any finite value does then.
    let smallest = V::of(1e-28);

    let edges = chain.vertices.len() - 1;
    let ChainScratch {
        direction: n,
        upper,
        lambda,
    } = scratch;
    let (n, upper, lambda) = (&mut n[..edges], &mut upper[..edges], &mut lambda[..edges]);

    let mut x0 = x[chain.vertices[0] as usize];
    let mut w0 = w[chain.vertices[0] as usize];
    let mut previous = Vec3x::zero();
    let mut previous_inverse = V::zero();
    let mut previous_right = V::zero();
    for j in 0..edges {
        let v1 = chain.vertices[j + 1] as usize;
        let (x1, w1) = (x[v1], w[v1]);
        let (nj, length) = direction(x1 - x0);
        let c = length - rest;
        let alpha_tilde = V::select(compressed[j], compression, tension);
        // Eliminates the coupling with the edge before, through their common vertex.
        let coupling = -(w0 * previous.dot(nj));
        let factor = coupling * previous_inverse;
        let diagonal = (w0 + w1 + alpha_tilde - coupling * factor).max(smallest);
        let inverse = V::of(1.0) / diagonal;
        let right = (-c - coupling * previous_right) * inverse;
        if j > 0 {
            upper[j - 1] = factor;
        }
        n[j] = nj;
        lambda[j] = right;
        (x0, w0, previous, previous_inverse, previous_right) = (x1, w1, nj, inverse, right);
    }

    // Back substitution from the far end; a vertex moves once both its edges are known.
    let mut after = Vec3x::zero();
    let mut lambda_after = V::zero();
    for j in (0..edges).rev() {
        if j + 1 < edges {
            lambda[j] = lambda[j] - upper[j] * lambda_after;
        }
        // lambda > 0 pushes the ends apart.
        compressed[j] = V::zero().lt(lambda[j]);
        let pull = n[j].scale(lambda[j]);
        let v1 = chain.vertices[j + 1] as usize;
        x[v1] = x[v1] + (pull - after).scale(w[v1]);
        (after, lambda_after) = (pull, lambda[j]);
    }
    let v0 = chain.vertices[0] as usize;
    x[v0] = x[v0] - after.scale(w[v0]);
}

/// Projects the edges of one colour, one after the other.
///
/// C = |x1 - x0| - l [m]. Macklin et al. 2016 (XPBD), eqs. 17-18, with lambda = 0 at the
/// start of the substep.
#[inline(always)]
pub(super) fn project_edges<V: Lanes>(
    class: &EdgeClass,
    inverse_h_squared: V,
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
        let (n, length) = direction(x[b] - x[a]);
        let c = length - V::of(*rest);
        let compliance = V::select(c.lt(V::zero()), V::of(law.compression), V::of(law.tension));
        let sum = w[a] + w[b] + compliance * inverse_h_squared;
        let pull = n.scale(c / sum.max(V::of(1e-28)));
        x[a] = x[a] + pull.scale(w[a]);
        x[b] = x[b] - pull.scale(w[b]);
    }
}

/// Projects three-node bending, one colour.
///
/// C = x0 - 2 x1 + x2 [m], a vector; each component is a constraint of its own with the same
/// denominator, so there is one division and no square root.
#[inline(always)]
pub(super) fn project_triples<V: Lanes>(
    triples: &[BendTriple],
    inverse_h_squared: V,
    x: &mut [Vec3x<V>],
    w: &[V],
) {
    for triple in triples {
        let [a, b, c] = triple.vertices.map(|v| v as usize);
        let [wa, wb, wc] = [w[a], w[b], w[c]];
        let alpha_tilde = V::of(triple.compliance) * inverse_h_squared;
        let sum = wa + wc + V::of(4.0) * wb + alpha_tilde;
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
pub(super) fn project_hinges<V: Lanes>(
    hinges: &[BendHinge],
    inverse_h_squared: V,
    x: &mut [Vec3x<V>],
    w: &[V],
) {
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

        let mut sum = V::of(hinge.compliance) * inverse_h_squared;
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
