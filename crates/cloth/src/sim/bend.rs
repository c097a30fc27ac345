//! Bending of the yarns: solved along each yarn, or triple by triple.

use super::edges::in_colors;
use super::line::{Along, Chain, Scratch};
use super::physics::{Bending, BendingStiffness, PhysicsConfig};
use super::scales::Scales;
use crate::fabric::{Family, Lamina};
use crate::math::{Lanes, Vec3x};

/// Three neighbours on a yarn. C = x0 - 2 x1 + x2 [m], energy = |C|^2 / (2 compliance).
#[derive(Clone, Copy, Debug)]
pub(super) struct BendTriple {
    pub vertices: [u32; 3],
    /// [m/N]
    pub compliance: f64,
    pub family: Family,
}

/// Bending stiffness per width of a family [N m].
pub(super) fn bending_stiffness(lamina: &Lamina, physics: &PhysicsConfig, family: Family) -> f64 {
    match physics.bending_stiffness {
        BendingStiffness::Material => lamina.material.bending_stiffness(family),
        BendingStiffness::NewtonMetre(d) => d,
    }
}

/// Bending stiffness D b / l^3 of a yarn of width b and edges of length l that is bent along its
/// line [N/m]; 0 where it is not.
pub(super) fn along_yarn(
    lamina: &Lamina,
    physics: &PhysicsConfig,
    family: Family,
    [width, length]: [f64; 2],
) -> f64 {
    let stiffness = match physics.bending {
        Bending::Yarns => bending_stiffness(lamina, physics, family),
        Bending::Dihedral | Bending::Off => 0.0,
    };
    stiffness * width / length.powi(3)
}

/// Curvature is C / l^2, a vertex stands for the length l: energy = D b |C|^2 / 2 l^3.
pub(super) fn triples(lamina: &Lamina, physics: &PhysicsConfig) -> Vec<Vec<BendTriple>> {
    if physics.bending != Bending::Yarns {
        return Vec::new();
    }
    let mut triples = Vec::new();
    for yarn in &lamina.yarns {
        let stiffness = bending_stiffness(lamina, physics, yarn.family) * yarn.width;
        let compliance = yarn.rest_length.powi(3) / stiffness;
        if compliance.is_finite() {
            let vertices = yarn.vertices.windows(3).map(|v| [v[0], v[1], v[2]]);
            triples.extend(vertices.map(|vertices| BendTriple {
                vertices,
                compliance,
                family: yarn.family,
            }));
        }
    }
    in_colors(lamina, &triples, |triple| triple.vertices)
}

/// Projects three-node bending, one colour.
///
/// C = x0 - 2 x1 + x2 [m], a vector; each component is a constraint of its own with the same
/// denominator, so there is one division and no square root.
#[inline(always)]
pub(super) fn project_triples<V: Lanes>(
    triples: &[BendTriple],
    x: &mut [Vec3x<V>],
    w: &[V],
    scales: Option<&Scales<V>>,
) {
    for triple in triples {
        let [a, b, c] = triple.vertices.map(|v| v as usize);
        let [wa, wb, wc] = [w[a], w[b], w[c]];
        let mut alpha = V::of(triple.compliance);
        if let Some(scales) = scales {
            alpha = alpha / scales.bending[triple.family as usize];
        }
        let sum = wa + wc + V::of(4.0) * wb + alpha;
        let difference = x[a] + x[c] - x[b].scale(V::of(2.0));
        let pull = difference.scale(V::of(1.0) / sum);
        x[a] = x[a] - pull.scale(wa);
        x[b] = x[b] + pull.scale(wb + wb);
        x[c] = x[c] - pull.scale(wc);
    }
}

/// Solves the bending of a yarn as a whole: (1 + M K) d = -M K x, with M the mobility and
/// K = B^T k B of the second differences B, a pentadiagonal system that is the same for x, y
/// and z (Gaussian elimination; M^1/2 (1/M + K) M^1/2 is positive definite, so no pivot is 0).
#[inline(always)]
pub(super) fn bend<V: Lanes, C: Chain<V>>(yarn: Along<V, C>) {
    let Along {
        line,
        law,
        x,
        mobility,
        scratch,
        ..
    } = yarn;
    let count = line.vertices().len();
    let Some(stiffness) = law.bending.filter(|_| count >= 3) else {
        return;
    };
    let mut rows = BendRows::new(line, stiffness, x);
    let inner = 2..count.saturating_sub(2).max(2);
    for i in 0..2 {
        rows.eliminate(i, i + 2 < count, ends(line, i), x, mobility, scratch);
    }
    for i in inner.clone() {
        let triples = [line.has_edge(i - 1), line.has_edge(i), line.has_edge(i + 1)];
        rows.eliminate(i, true, triples, x, mobility, scratch);
    }
    for i in inner.end..count {
        rows.eliminate(i, i + 2 < count, ends(line, i), x, mobility, scratch);
    }
    let Scratch {
        edge: z,
        upper: first,
        second,
    } = scratch;
    let (mut d1, mut d2) = (Vec3x::zero(), Vec3x::zero());
    for i in (0..count).rev() {
        let d = z[i] - d1.scale(first[i]) - d2.scale(second[i]);
        let v = line.vertices()[i] as usize;
        x[v] = x[v] + d;
        (d1, d2) = (d, d1);
    }
}

/// 1 in the lanes where vertex i is the last of a triple, where the middle, where the first. A
/// triple is there if its second edge is.
#[inline(always)]
fn ends<V: Lanes>(line: &impl Chain<V>, i: usize) -> [V; 3] {
    let mut found = [V::zero(); 3];
    for (k, found) in found.iter_mut().enumerate() {
        if (2..line.vertices().len()).contains(&(i + k)) {
            *found = line.has_edge(i + k - 1);
        }
    }
    found
}

/// Elimination of the rows of the pentadiagonal system, one after the other.
struct BendRows<'a, V, C> {
    line: &'a C,
    stiffness: V,
    /// Positions of the vertex and of the next.
    x: [Vec3x<V>; 2],
    /// Second differences around the vertex before and the vertex.
    difference: [Vec3x<V>; 2],
    /// Of the last two rows: upper diagonals and right side.
    first: [V; 2],
    second: [V; 2],
    right: [Vec3x<V>; 2],
}

impl<'a, V: Lanes, C: Chain<V>> BendRows<'a, V, C> {
    #[inline(always)]
    fn new(line: &'a C, stiffness: V, x: &[Vec3x<V>]) -> Self {
        Self {
            line,
            stiffness,
            x: [0, 1].map(|k: usize| x[line.vertices()[k] as usize]),
            difference: [Vec3x::zero(); 2],
            first: [V::zero(); 2],
            second: [V::zero(); 2],
            right: [Vec3x::zero(); 2],
        }
    }

    /// Row of vertex i, which is on l triples as their last vertex, on m as their middle and
    /// on r as their first (0 or 1); r is 0 in all lanes unless there is an `onward` vertex i + 2.
    #[inline(always)]
    fn eliminate(
        &mut self,
        i: usize,
        onward: bool,
        [l, m, r]: [V; 3],
        x: &[Vec3x<V>],
        mobility: &[V],
        scratch: &mut Scratch<V>,
    ) {
        let [before, around] = self.difference;
        let after = if onward {
            let [x0, x1] = self.x;
            let x2 = x[self.line.vertices()[i + 2] as usize];
            self.x = [x1, x2];
            self.line.of_edge(i + 1, x0 + x2 - x1.scale(V::of(2.0)))
        } else {
            Vec3x::zero()
        };
        self.difference = [around, after];
        let wk = mobility[self.line.vertices()[i] as usize] * self.stiffness;
        let kx = before + after - around.scale(V::of(2.0));
        let lower2 = wk * l;
        let lower1 = wk * (V::of(-2.0) * (l + m)) - lower2 * self.first[0];
        let diagonal = V::of(1.0) + wk * (l + V::of(4.0) * m + r);
        let pivot = diagonal - lower2 * self.second[0] - lower1 * self.first[1];
        let inverse = V::of(1.0) / pivot;
        let first = (wk * (V::of(-2.0) * (m + r)) - lower1 * self.second[1]) * inverse;
        let second = wk * r * inverse;
        let right = kx.scale(wk) + self.right[0].scale(lower2) + self.right[1].scale(lower1);
        let right = right.scale(-inverse);
        scratch.upper[i] = first;
        scratch.second[i] = second;
        scratch.edge[i] = right;
        self.first = [self.first[1], first];
        self.second = [self.second[1], second];
        self.right = [self.right[1], right];
    }
}

#[cfg(test)]
mod tests;
