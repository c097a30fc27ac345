//! Direct solves along lines of vertices: yarns in tension and bending, rows of diagonals in
//! shear. Everything here is inlined into the substep, so that it is compiled for the
//! instruction set in use.
//!
//! A projection that goes constraint by constraint sees, of all the inertia and stiffness
//! around it, only its own vertices. Long waves then meet a fabric that is softer the longer
//! the substep, and a wrinkle sinks by itself. Along a line the system is banded, and solving
//! it as a whole costs hardly more. What is left is the splitting between lines that cross.

use std::collections::BTreeMap;
use std::ops::Range;

use super::constraints::direction;
use super::model::{EdgeLaw, LIMITED, bending_stiffness, yarn_law};
use super::physics::{Bending, PhysicsConfig};
use crate::fabric::{Family, Lamina};
use crate::math::{Lanes, Vec3x};

/// A chain of vertices which is solved as a whole.
#[derive(Clone, Debug)]
pub(super) struct Line {
    /// At least one.
    pub vertices: Vec<u32>,
    /// Its edges among those of all yarns; empty for a row of diagonals, whose forces nobody
    /// keeps.
    pub edges: Range<usize>,
    pub rest_length: f64,
    pub law: EdgeLaw,
    pub limit: Option<Limit>,
    /// Bending stiffness D b / l^3 [N/m]: energy = stiffness |x0 - 2 x1 + x2|^2 / 2.
    pub bending: f64,
}

/// The law of an edge beyond the strain limit: C = offset + compliance * force.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limit {
    /// Force at which it begins [N].
    pub force: f64,
    /// [m/N]
    pub compliance: f64,
    /// [m]; such that there the law is continuous.
    pub offset: f64,
}

impl Limit {
    /// Of edges whose length may grow by about `stretch` [m].
    fn new(law: EdgeLaw, stretch: f64) -> Self {
        Self {
            force: stretch / law.tension,
            compliance: LIMITED * law.tension,
            offset: stretch * (1.0 - LIMITED),
        }
    }
}

/// The lines of a lamina. Of the warps and of the wefts each holds every vertex once: where
/// no yarn runs, a line of one vertex stands in.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    pub warps: Vec<Line>,
    pub wefts: Vec<Line>,
    pub diagonals: Vec<Line>,
    /// Edges of all yarns.
    pub edge_count: usize,
    /// Vertices of the longest line.
    pub longest: usize,
}

impl Lines {
    pub fn new(lamina: &Lamina, physics: &PhysicsConfig, shear: Option<EdgeLaw>) -> Self {
        let mut edge_count = 0;
        let mut yarns: Vec<(Family, Line)> = Vec::new();
        for yarn in &lamina.yarns {
            let first = edge_count;
            edge_count += yarn.vertices.len() - 1;
            let stiffness = match physics.bending {
                Bending::Yarns => bending_stiffness(lamina, physics, yarn.family),
                Bending::Dihedral | Bending::Off => 0.0,
            };
            let law = yarn_law(lamina, physics, yarn);
            let limit = physics.strain_limit;
            let line = Line {
                vertices: yarn.vertices.clone(),
                edges: first..edge_count,
                rest_length: yarn.rest_length,
                law,
                limit: limit.map(|strain| Limit::new(law, strain * yarn.rest_length)),
                bending: stiffness * yarn.width / yarn.rest_length.powi(3),
            };
            yarns.push((yarn.family, line));
        }
        let family = |wanted| {
            let of = yarns.iter().filter(|(family, _)| *family == wanted);
            with_lone_vertices(of.map(|(_, line)| line.clone()).collect(), lamina)
        };
        let (warps, wefts) = (family(Family::Warp), family(Family::Weft));
        let diagonals = shear.map_or(Vec::new(), |law| diagonals(lamina, law));
        let all = warps.iter().chain(&wefts).chain(&diagonals);
        Self {
            longest: all.map(|line| line.vertices.len()).max().unwrap_or(0),
            warps,
            wefts,
            diagonals,
            edge_count,
        }
    }
}

fn with_lone_vertices(mut lines: Vec<Line>, lamina: &Lamina) -> Vec<Line> {
    let mut held = vec![false; lamina.vertex_count()];
    for &v in lines.iter().flat_map(|line| &line.vertices) {
        held[v as usize] = true;
    }
    for v in (0..held.len()).filter(|&v| !held[v]) {
        lines.push(Line {
            vertices: vec![v as u32],
            edges: 0..0,
            rest_length: 1.0,
            law: EdgeLaw {
                tension: 1.0,
                compression: 1.0,
            },
            limit: None,
            bending: 0.0,
        });
    }
    lines
}

/// Diagonals strung together from end to end.
fn diagonals(lamina: &Lamina, law: EdgeLaw) -> Vec<Line> {
    let mut next: BTreeMap<u32, (u32, f64)> = BTreeMap::new();
    let mut ends = Vec::new();
    for diagonal in &lamina.diagonals {
        let [from, to] = diagonal.vertices;
        next.insert(from, (to, diagonal.rest_length));
        ends.push(to);
    }
    ends.sort_unstable();
    let starts: Vec<u32> = next
        .keys()
        .filter(|v| ends.binary_search(v).is_err())
        .copied()
        .collect();
    let mut lines = Vec::new();
    for start in starts {
        let mut vertices = vec![start];
        let mut rest_length = 0.0;
        while let Some((to, length)) = next.remove(vertices.last().expect("not empty")) {
            rest_length = length;
            vertices.push(to);
        }
        lines.push(Line {
            vertices,
            edges: 0..0,
            rest_length,
            law,
            limit: None,
            bending: 0.0,
        });
    }
    lines
}

/// Scratch space of a line, one entry a vertex.
pub(super) struct Scratch<V> {
    direction: Vec<Vec3x<V>>,
    upper: Vec<V>,
    second: Vec<V>,
}

impl<V: Lanes> Scratch<V> {
    pub fn new(longest: usize) -> Self {
        Self {
            direction: vec![Vec3x::zero(); longest],
            upper: vec![V::zero(); longest],
            second: vec![V::zero(); longest],
        }
    }
}

/// What the yarns of a vertex do to it, for the next substep.
pub(super) struct Grip<'a, V> {
    /// Net force of its yarns [N].
    pub pull: &'a mut [Vec3x<V>],
    /// Sum over its yarn edges of |force| / length [N/m].
    pub stress: &'a mut [V],
}

/// Solves all length constraints of a yarn together.
///
/// C_j = |x_{j+1} - x_j| - l [m], law C = compliance * force with force > 0 in tension. The
/// tension of the last substep has moved the vertices already; with the change d of forces the
/// system (J M J^T + compliance) d = C - compliance * force of a chain is tridiagonal (Thomas
/// algorithm), M the `mobility` [m/N]. XPBD (Macklin et al. 2016, eqs. 17-18) with multipliers
/// that last: at rest nothing changes, so every yarn meets its law whatever the splitting.
///
/// Each edge takes the compliance of the sign of its force. That of the predicted strain would
/// not do: at rest it is the sign of gravity's last push, so edges would change branch in every
/// substep and never come to rest. Pinned vertices (mobility 0) decouple their neighbours by
/// the formula itself. Beyond the strain limit of a yarn that has one there is a third branch,
/// likewise by its force.
#[inline(always)]
pub(super) fn stretch<V: Lanes>(
    line: &Line,
    x: &mut [Vec3x<V>],
    mobility: &[V],
    force: &mut [V],
    scratch: &mut Scratch<V>,
) {
    let edges = line.vertices.len() - 1;
    let (n, upper, change) = scratch.parts(line.vertices.len());
    match line.limit {
        None => eliminate(line, x, mobility, Some((force, None)), (n, upper, change)),
        limit => eliminate(line, x, mobility, Some((force, limit)), (n, upper, change)),
    }

    // Back substitution from the far end; a vertex moves once both its edges are known.
    let mut after = Vec3x::zero();
    let mut change_after = V::zero();
    for j in (0..edges).rev() {
        let d = change[j] - upper[j] * change_after;
        force[j] = kept(line, force[j]) + d;
        let moved = n[j].scale(d);
        let v = line.vertices[j + 1] as usize;
        x[v] = x[v] + (after - moved).scale(mobility[v]);
        (after, change_after) = (moved, d);
    }
    let v = line.vertices[0] as usize;
    x[v] = x[v] + after.scale(mobility[v]);
}

/// Compression that lasts into the next substep, in units of that at which a yarn's bending gives
/// way (4 k l: a zigzag of amplitude y costs 8 k y^2 of bending a vertex and shortens an edge by
/// 2 y^2 / l). Surplus between draped vertices holds much more than that, and without it the
/// tension beside it is wrong: after random episodes the worst edge is strained by 11 % at 1, 3.3 %
/// at 10, 2.6 % at 25. A yarn without bending must keep none: let go, it would throw itself to and fro.
const KEPT_COMPRESSION: f64 = 25.0;

/// The part of a yarn's force that lasts into the next substep.
#[inline(always)]
fn kept<V: Lanes>(line: &Line, force: V) -> V {
    force.max(V::of(
        -4.0 * KEPT_COMPRESSION * line.bending * line.rest_length,
    ))
}

/// Adds the pull of a yarn's kept forces where it lies, and the stress of all.
#[inline(always)]
pub(super) fn recall<V: Lanes>(line: &Line, x: &[Vec3x<V>], force: &[V], grip: &mut Grip<V>) {
    let inverse_rest = V::of(1.0 / line.rest_length);
    for (j, &force) in force.iter().enumerate() {
        let [a, b] = [line.vertices[j] as usize, line.vertices[j + 1] as usize];
        let pull = direction(x[b] - x[a]).0.scale(kept(line, force));
        let stress = force.max(-force) * inverse_rest;
        grip.pull[a] = grip.pull[a] + pull;
        grip.pull[b] = grip.pull[b] - pull;
        grip.stress[a] = grip.stress[a] + stress;
        grip.stress[b] = grip.stress[b] + stress;
    }
}

/// Solves a row of diagonals together, each from force 0 and with the compliance of the sign
/// of its C. As for a yarn, but soft enough that its forces need not be kept.
#[inline(always)]
pub(super) fn shear<V: Lanes>(
    line: &Line,
    x: &mut [Vec3x<V>],
    mobility: &[V],
    scratch: &mut Scratch<V>,
) {
    let edges = line.vertices.len() - 1;
    let (n, upper, change) = scratch.parts(line.vertices.len());
    eliminate(line, x, mobility, None, (n, upper, change));
    let mut after = Vec3x::zero();
    let mut change_after = V::zero();
    for j in (0..edges).rev() {
        let d = change[j] - upper[j] * change_after;
        let moved = n[j].scale(d);
        let v = line.vertices[j + 1] as usize;
        x[v] = x[v] + (after - moved).scale(mobility[v]);
        (after, change_after) = (moved, d);
    }
    let v = line.vertices[0] as usize;
    x[v] = x[v] + after.scale(mobility[v]);
}

impl<V: Lanes> Scratch<V> {
    #[inline(always)]
    fn parts(&mut self, vertices: usize) -> (&mut [Vec3x<V>], &mut [V], &mut [V]) {
        (
            &mut self.direction[..vertices],
            &mut self.upper[..vertices],
            &mut self.second[..vertices],
        )
    }
}

/// Forward elimination of the tridiagonal system of a line's edges into directions, upper
/// diagonal and right side. The limit is a constant where this is inlined without it, so that
/// it costs nothing there.
#[inline(always)]
fn eliminate<V: Lanes>(
    line: &Line,
    x: &[Vec3x<V>],
    mobility: &[V],
    force: Option<(&[V], Option<Limit>)>,
    (n, upper, right): (&mut [Vec3x<V>], &mut [V], &mut [V]),
) {
    let rest = V::of(line.rest_length);
    let tension = V::of(line.law.tension);
    let compression = V::of(line.law.compression);
    // Two pinned ends and no compliance leave a zero diagonal; any finite value does then.
    let smallest = V::of(1e-28);

    let v0 = line.vertices[0] as usize;
    let (mut x0, mut w0) = (x[v0], mobility[v0]);
    let mut previous = Vec3x::zero();
    let mut previous_inverse = V::zero();
    let mut previous_right = V::zero();
    for j in 0..line.vertices.len() - 1 {
        let v1 = line.vertices[j + 1] as usize;
        let (x1, w1) = (x[v1], mobility[v1]);
        let (nj, length) = direction(x1 - x0);
        let c = length - rest;
        let (compliance, residual) = match force {
            Some((force, limit)) => {
                let compressed = force[j].lt(V::zero());
                let compliance = V::select(compressed, compression, tension);
                let force = kept(line, force[j]);
                match limit {
                    None => (compliance, c - compliance * force),
                    Some(limit) => {
                        let beyond = V::of(limit.force).lt(force);
                        let compliance = V::select(beyond, V::of(limit.compliance), compliance);
                        let offset = V::select(beyond, V::of(limit.offset), V::zero());
                        (compliance, c - offset - compliance * force)
                    }
                }
            }
            None => (V::select(c.lt(V::zero()), compression, tension), c),
        };
        // Eliminates the coupling with the edge before, through their common vertex.
        let coupling = -(w0 * previous.dot(nj));
        let factor = coupling * previous_inverse;
        let diagonal = (w0 + w1 + compliance - coupling * factor).max(smallest);
        let inverse = V::of(1.0) / diagonal;
        let solved = (residual - coupling * previous_right) * inverse;
        if j > 0 {
            upper[j - 1] = factor;
        }
        n[j] = nj;
        right[j] = solved;
        (x0, w0, previous, previous_inverse, previous_right) = (x1, w1, nj, inverse, solved);
    }
    // Nothing comes after the last edge, and what a longer line left there may be no number.
    upper[line.vertices.len().saturating_sub(2)] = V::zero();
}

/// Solves the bending of a yarn as a whole: (1 + M K) d = -M K x, with M the mobility and
/// K = B^T k B of the second differences B, a pentadiagonal system that is the same for x, y
/// and z (Gaussian elimination; M^1/2 (1/M + K) M^1/2 is positive definite, so no pivot is 0).
#[inline(always)]
pub(super) fn bend<V: Lanes>(
    line: &Line,
    x: &mut [Vec3x<V>],
    mobility: &[V],
    scratch: &mut Scratch<V>,
) {
    let count = line.vertices.len();
    if line.bending == 0.0 || count < 3 {
        return;
    }
    let mut rows = BendRows::new(line, x);
    let triples =
        |i: usize| [i, i + 1, i + 2].map(|next| f64::from(u8::from((2..count).contains(&next))));
    let inner = 2..count.saturating_sub(2).max(2);
    for i in 0..2 {
        rows.eliminate(i, triples(i), x, mobility, scratch);
    }
    for i in inner.clone() {
        rows.eliminate(i, [1.0; 3], x, mobility, scratch);
    }
    for i in inner.end..count {
        rows.eliminate(i, triples(i), x, mobility, scratch);
    }
    let (z, first, second) = scratch.parts(count);
    let (mut d1, mut d2) = (Vec3x::zero(), Vec3x::zero());
    for i in (0..count).rev() {
        let d = z[i] - d1.scale(first[i]) - d2.scale(second[i]);
        let v = line.vertices[i] as usize;
        x[v] = x[v] + d;
        (d1, d2) = (d, d1);
    }
}

/// Elimination of the rows of the pentadiagonal system, one after the other.
struct BendRows<'a, V> {
    line: &'a Line,
    /// Positions of the vertex and of the next.
    x: [Vec3x<V>; 2],
    /// Second differences around the vertex before and the vertex.
    difference: [Vec3x<V>; 2],
    /// Of the last two rows: upper diagonals and right side.
    first: [V; 2],
    second: [V; 2],
    right: [Vec3x<V>; 2],
}

impl<'a, V: Lanes> BendRows<'a, V> {
    #[inline(always)]
    fn new(line: &'a Line, x: &[Vec3x<V>]) -> Self {
        Self {
            line,
            x: [x[line.vertices[0] as usize], x[line.vertices[1] as usize]],
            difference: [Vec3x::zero(); 2],
            first: [V::zero(); 2],
            second: [V::zero(); 2],
            right: [Vec3x::zero(); 2],
        }
    }

    /// Row of vertex i, which is on l triples as their last vertex, on m as their middle and
    /// on r as their first (0 or 1).
    #[inline(always)]
    fn eliminate(
        &mut self,
        i: usize,
        [l, m, r]: [f64; 3],
        x: &[Vec3x<V>],
        mobility: &[V],
        scratch: &mut Scratch<V>,
    ) {
        let [before, around] = self.difference;
        let after = if r > 0.0 {
            let [x0, x1] = self.x;
            let x2 = x[self.line.vertices[i + 2] as usize];
            self.x = [x1, x2];
            x0 + x2 - x1.scale(V::of(2.0))
        } else {
            Vec3x::zero()
        };
        self.difference = [around, after];
        let wk = mobility[self.line.vertices[i] as usize] * V::of(self.line.bending);
        let kx = before + after - around.scale(V::of(2.0));
        let lower2 = wk * V::of(l);
        let lower1 = wk * V::of(-2.0 * (l + m)) - lower2 * self.first[0];
        let diagonal = V::of(1.0) + wk * V::of(l + 4.0 * m + r);
        let pivot = diagonal - lower2 * self.second[0] - lower1 * self.first[1];
        let inverse = V::of(1.0) / pivot;
        let first = (wk * V::of(-2.0 * (m + r)) - lower1 * self.second[1]) * inverse;
        let second = wk * V::of(r) * inverse;
        let right = kx.scale(wk) + self.right[0].scale(lower2) + self.right[1].scale(lower1);
        let right = right.scale(-inverse);
        scratch.upper[i] = first;
        scratch.second[i] = second;
        scratch.direction[i] = right;
        self.first = [self.first[1], first];
        self.second = [self.second[1], second];
        self.right = [self.right[1], right];
    }
}

#[cfg(test)]
mod tests;
