//! Direct solves along lines of vertices: yarns in tension and bending, rows of diagonals in
//! shear. Everything here is inlined into the substep, so that it is compiled for the
//! instruction set in use.
//!
//! A projection that goes constraint by constraint sees, of all the inertia and stiffness
//! around it, only its own vertices. Long waves then meet a fabric that is softer the longer
//! the substep, and a wrinkle sinks by itself. Along a line the system is banded, and solving
//! it as a whole costs hardly more. What is left is the splitting between lines that cross.

mod bend;

use std::collections::BTreeMap;
use std::ops::Range;

use super::model::{EdgeLaw, Limit, bending_stiffness, yarn_law};
use super::physics::{Bending, PhysicsConfig};
use super::trellis::Trellis;
use crate::fabric::{Family, Lamina};
use crate::math::{Lanes, Vec3x};

pub(super) use bend::bend;

/// A chain of vertices which is solved as a whole.
#[derive(Clone, Debug)]
pub(super) struct Line {
    /// At least one.
    pub vertices: Vec<u32>,
    /// Its edges among those of all yarns; empty for a row of diagonals, whose forces nobody
    /// keeps.
    pub edges: Range<usize>,
    pub rest_length: f64,
    /// That of a row of diagonals holds near rest, see [`Trellis`].
    pub law: EdgeLaw,
    pub limit: Option<Limit>,
    /// Bending stiffness D b / l^3 [N/m]: energy = stiffness |x0 - 2 x1 + x2|^2 / 2.
    pub bending: f64,
}

/// The lines of a lamina. Of the warps and of the wefts each holds every vertex once: where
/// no yarn runs, a line of one vertex stands in.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    pub warps: Vec<Line>,
    pub wefts: Vec<Line>,
    pub diagonals: Vec<Line>,
    /// Law of the diagonals; none without shear.
    pub trellis: Option<Trellis>,
    /// Edges of all yarns.
    pub edge_count: usize,
    /// Vertices of the longest line.
    pub longest: usize,
    /// How wefts cross each warp.
    pub crossings: Vec<Crossings>,
}

/// The edges of wefts at the vertices of a warp.
#[derive(Clone, Debug)]
pub(super) struct Crossings {
    /// Of each vertex along the warp those before and after it.
    pub edges: Vec<[Option<Crossing>; 2]>,
    /// The last warp that they lead to.
    pub last_warp: usize,
}

/// An edge of a weft at a vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    /// Among those of all yarns.
    pub edge: u32,
    pub leads: Leads,
}

/// Where an edge of a weft leads.
#[derive(Clone, Copy, Debug)]
pub(super) enum Leads {
    /// To this vertex of a later warp.
    On {
        to: u32,
        /// See [`Chain::least_kept`].
        least_kept: f64,
    },
    /// To a warp before.
    Back,
}

fn crossings(warps: &[Line], wefts: &[Line], vertex_count: usize) -> Vec<Crossings> {
    let mut place = vec![[0; 2]; vertex_count];
    for (index, warp) in warps.iter().enumerate() {
        for (i, &v) in warp.vertices.iter().enumerate() {
            place[v as usize] = [index, i];
        }
    }
    let none = |warp: (usize, &Line)| Crossings {
        edges: vec![[None; 2]; warp.1.vertices.len()],
        last_warp: warp.0,
    };
    let mut all: Vec<Crossings> = warps.iter().enumerate().map(none).collect();
    for weft in wefts {
        for (ends, edge) in weft.vertices.windows(2).zip(weft.edges.clone()) {
            for (end, other, side) in [(ends[0], ends[1], 1), (ends[1], ends[0], 0)] {
                let [[warp, i], [to_warp, _]] = [place[end as usize], place[other as usize]];
                let leads = if warp < to_warp {
                    Leads::On {
                        to: other,
                        least_kept: weft.least_kept(),
                    }
                } else {
                    Leads::Back
                };
                let edge = edge as u32;
                all[warp].edges[i][side] = Some(Crossing { edge, leads });
                all[warp].last_warp = all[warp].last_warp.max(to_warp);
            }
        }
    }
    all
}

impl Lines {
    pub fn new(lamina: &Lamina, physics: &PhysicsConfig, trellis: Option<Trellis>) -> Self {
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
            let line = Line {
                vertices: yarn.vertices.clone(),
                edges: first..edge_count,
                rest_length: yarn.rest_length,
                law,
                limit: Limit::of_yarn(law, lamina, physics, yarn),
                bending: stiffness * yarn.width / yarn.rest_length.powi(3),
            };
            yarns.push((yarn.family, line));
        }
        let family = |wanted| {
            let of = yarns.iter().filter(|(family, _)| *family == wanted);
            with_lone_vertices(of.map(|(_, line)| line.clone()).collect(), lamina)
        };
        let (warps, wefts) = (family(Family::Warp), family(Family::Weft));
        let diagonals = (trellis.as_ref()).map_or(Vec::new(), |t| diagonals(lamina, t.at_rest));
        let all = warps.iter().chain(&wefts).chain(&diagonals);
        Self {
            longest: all.map(|line| line.vertices.len()).max().unwrap_or(0),
            crossings: crossings(&warps, &wefts, lamina.vertex_count()),
            warps,
            wefts,
            diagonals,
            trellis,
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

/// A line as the solves see it, for all lanes: the same line in every lane, or another in each.
pub(super) trait Chain<V: Lanes> {
    /// Where the vertices of the line are; at least one.
    fn vertices(&self) -> &[u32];
    /// Where the forces of its edges are.
    fn edges(&self) -> Range<usize>;
    /// Rest length of an edge [m], and its inverse.
    fn rest(&self) -> [V; 2];
    /// Compliance of an edge in tension and in compression [m/N].
    fn compliance(&self) -> [V; 2];
    /// Greatest compression, as a force density <= 0 [N/m], that lasts into the next substep.
    fn least_kept(&self) -> V;
    /// Tension at which its limit or knee begins, compliance and offset beyond it.
    fn limit(&self) -> Option<[V; 3]>;
    /// Bending stiffness [N/m]; none where no lane has any.
    fn bending(&self) -> Option<V>;
    /// `x` in the lanes whose line has edge `j`, else 0.
    fn of_edge(&self, j: usize, x: V) -> V;
    /// 1 in the lanes whose line has edge `j`, which is one of the line's longest, else 0.
    fn has_edge(&self, j: usize) -> V;
}

impl<V: Lanes> Chain<V> for Line {
    #[inline(always)]
    fn vertices(&self) -> &[u32] {
        &self.vertices
    }
    #[inline(always)]
    fn edges(&self) -> Range<usize> {
        self.edges.clone()
    }
    #[inline(always)]
    fn rest(&self) -> [V; 2] {
        [V::of(self.rest_length), V::of(1.0 / self.rest_length)]
    }
    #[inline(always)]
    fn compliance(&self) -> [V; 2] {
        [V::of(self.law.tension), V::of(self.law.compression)]
    }
    #[inline(always)]
    fn least_kept(&self) -> V {
        V::of(-4.0 * KEPT_COMPRESSION * self.bending)
    }
    #[inline(always)]
    fn limit(&self) -> Option<[V; 3]> {
        let of = |limit: Limit| [limit.force, limit.compliance, limit.offset].map(V::of);
        self.limit.map(of)
    }
    #[inline(always)]
    fn bending(&self) -> Option<V> {
        (self.bending != 0.0).then(|| V::of(self.bending))
    }
    #[inline(always)]
    fn of_edge(&self, _: usize, x: V) -> V {
        x
    }
    #[inline(always)]
    fn has_edge(&self, _: usize) -> V {
        V::of(1.0)
    }
}

/// Scratch space of a line, one entry a vertex.
pub(super) struct Scratch<V> {
    edge: Vec<Vec3x<V>>,
    upper: Vec<V>,
    second: Vec<V>,
}

impl<V: Lanes> Scratch<V> {
    pub fn new(longest: usize) -> Self {
        Self {
            edge: vec![Vec3x::zero(); longest],
            upper: vec![V::zero(); longest],
            second: vec![V::zero(); longest],
        }
    }
}

/// What the yarns of a vertex do to it, for the next substep.
pub(super) struct Grip<'a, V> {
    /// Net force of its yarns [N].
    pub pull: &'a mut [Vec3x<V>],
    /// Sum over its yarn edges of |force density| [N/m].
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
/// What is kept of an edge is its force density, force / length [N/m] (Schek 1974): its pull is then
/// the edge times it, and no length is asked for between solves.
///
/// Each edge takes the compliance of the sign of its force. That of the predicted strain would
/// not do: at rest it is the sign of gravity's last push, so edges would change branch in every
/// substep and never come to rest. Pinned vertices (mobility 0) decouple their neighbours by
/// the formula itself. Beyond the limit or knee of a yarn that has one there is a third branch,
/// likewise by its force.
#[inline(always)]
pub(super) fn stretch<V: Lanes>(
    line: &impl Chain<V>,
    x: &mut [Vec3x<V>],
    mobility: &[V],
    density: &mut [V],
    scratch: &mut Scratch<V>,
) {
    let rows = scratch.rows(line.vertices().len());
    match line.limit() {
        None => eliminate(line, x, mobility, Law::Kept(density, None), rows),
        limit => eliminate(line, x, mobility, Law::Kept(density, limit), rows),
    }
    let rows = scratch.rows(line.vertices().len());
    substitute(line, x, mobility, Some(density), rows);
}

/// Back substitution from the far end; a vertex moves once both its edges are known.
#[inline(always)]
fn substitute<V: Lanes>(
    line: &impl Chain<V>,
    x: &mut [Vec3x<V>],
    mobility: &[V],
    mut density: Option<&mut [V]>,
    rows: Rows<V>,
) {
    let mut after = Vec3x::zero();
    let mut change_after = V::zero();
    for j in (0..line.vertices().len() - 1).rev() {
        let change = rows.right[j] + rows.upper[j] * change_after;
        if let Some(density) = &mut density {
            density[j] = kept(line, density[j]) + change;
        }
        let moved = rows.edge[j].scale(change);
        let v = line.vertices()[j + 1] as usize;
        x[v] = x[v] + (after - moved).scale(mobility[v]);
        (after, change_after) = (moved, change);
    }
    let v = line.vertices()[0] as usize;
    x[v] = x[v] + after.scale(mobility[v]);
}

/// Compression that lasts into the next substep, in units of that at which a yarn's bending gives
/// way (4 k l: a zigzag of amplitude y costs 8 k y^2 of bending a vertex and shortens an edge by
/// 2 y^2 / l). Surplus between draped vertices holds much more than that, and without it the
/// tension beside it is wrong: after random episodes the worst edge is strained by 11 % at 1, 3.3 %
/// at 10, 2.6 % at 25. A yarn without bending must keep none: let go, it would throw itself to and fro.
const KEPT_COMPRESSION: f64 = 25.0;

/// The part of a yarn's force density that lasts into the next substep.
#[inline(always)]
fn kept<V: Lanes>(line: &impl Chain<V>, density: V) -> V {
    density.max(line.least_kept())
}

/// Pull of an edge's kept force on its start [N], and its stress, for both ends [N/m]; `edge` leads
/// from start to end [m].
#[inline(always)]
pub(super) fn recall_edge<V: Lanes>(edge: Vec3x<V>, density: V, least_kept: V) -> (Vec3x<V>, V) {
    let pull = edge.scale(density.max(least_kept));
    (pull, density.max(-density))
}

/// Finds the pull of a yarn's kept forces where it lies, and the stress of all: from vertex to
/// vertex what the edges before and after it do.
#[inline(always)]
pub(super) fn recall<V: Lanes>(
    line: &impl Chain<V>,
    x: &[Vec3x<V>],
    density: &[V],
    grip: &mut Grip<V>,
) {
    let mut before = (Vec3x::zero(), V::zero());
    for (i, &v) in line.vertices().iter().enumerate() {
        let v = v as usize;
        let after = recall_after(line, i, x, density);
        grip.pull[v] = after.0 - before.0;
        grip.stress[v] = before.1 + after.1;
        before = after;
    }
}

/// Pull and stress of the edge after vertex `i` of a yarn, 0 at its end.
#[inline(always)]
pub(super) fn recall_after<V: Lanes>(
    line: &impl Chain<V>,
    i: usize,
    x: &[Vec3x<V>],
    density: &[V],
) -> (Vec3x<V>, V) {
    match line.vertices().get(i + 1) {
        Some(&next) => {
            let edge = x[next as usize] - x[line.vertices()[i] as usize];
            recall_edge(edge, density[i], line.least_kept())
        }
        None => (Vec3x::zero(), V::zero()),
    }
}

/// Solves a row of diagonals together, each from force 0 and with the compliance of the sign
/// and size of its C. As for a yarn, but soft enough that its forces need not be kept.
#[inline(always)]
pub(super) fn shear<V: Lanes>(
    line: &impl Chain<V>,
    trellis: &Trellis,
    x: &mut [Vec3x<V>],
    mobility: &[V],
    scratch: &mut Scratch<V>,
) {
    let rows = scratch.rows(line.vertices().len());
    eliminate(line, x, mobility, Law::Shear(trellis), rows);
    let rows = scratch.rows(line.vertices().len());
    substitute(line, x, mobility, None, rows);
}

/// Eliminated rows of a system, one a vertex or edge.
struct Rows<'a, V> {
    /// From end to end.
    edge: &'a mut [Vec3x<V>],
    upper: &'a mut [V],
    right: &'a mut [V],
}

impl<V: Lanes> Scratch<V> {
    #[inline(always)]
    fn rows(&mut self, vertices: usize) -> Rows<'_, V> {
        Rows {
            edge: &mut self.edge[..vertices],
            upper: &mut self.upper[..vertices],
            right: &mut self.second[..vertices],
        }
    }
}

/// What an edge's length answers to.
#[derive(Clone, Copy)]
enum Law<'a, V> {
    /// Force densities from the last substep, and the limit.
    Kept(&'a [V], Option<[V; 3]>),
    /// None from the last substep, and that of a diagonal.
    Shear(&'a Trellis),
}

/// Compliance of edge `j` [m/N], and what its force leaves of its C [m]. The law is a constant
/// where this is inlined, so that branches that it has not cost nothing.
#[inline(always)]
fn compliance<V: Lanes>(
    line: &impl Chain<V>,
    law: Law<V>,
    j: usize,
    square: V,
    length: V,
) -> [V; 2] {
    let [tension, compression] = line.compliance();
    let [rest, inverse_rest] = line.rest();
    let c = length - rest;
    match law {
        Law::Kept(density, limit) => {
            let compressed = density[j].lt(V::zero());
            let compliance = V::select(compressed, compression, tension);
            let force = kept(line, density[j]) * length;
            match limit {
                None => [compliance, c - compliance * force],
                Some([most, limited, offset]) => {
                    let beyond = most.lt(force);
                    let compliance = V::select(beyond, limited, compliance);
                    let offset = V::select(beyond, offset, V::zero());
                    [compliance, c - offset - compliance * force]
                }
            }
        }
        Law::Shear(trellis) => {
            let at_rest = V::select(c.lt(V::zero()), compression, tension);
            [at_rest * trellis.share(square, inverse_rest), c]
        }
    }
}

/// Forward elimination of the tridiagonal system of a line's edges. Rows and unknowns are scaled
/// by the lengths of their edges, in place of their directions: that saves a division.
#[inline(always)]
fn eliminate<V: Lanes>(
    line: &impl Chain<V>,
    x: &[Vec3x<V>],
    mobility: &[V],
    law: Law<V>,
    rows: Rows<V>,
) {
    // A collapsed edge, or two pinned ends and no compliance, leave a zero diagonal; any finite
    // value does then.
    let smallest = V::of(1e-28);

    let v0 = line.vertices()[0] as usize;
    let (mut x0, mut w0) = (x[v0], mobility[v0]);
    let mut previous = Vec3x::zero();
    let mut previous_inverse = V::zero();
    let mut previous_right = V::zero();
    for j in 0..line.vertices().len() - 1 {
        let v1 = line.vertices()[j + 1] as usize;
        let (x1, w1) = (x[v1], mobility[v1]);
        let Vec3x([dx, dy, dz]) = x1 - x0;
        let d = Vec3x([
            line.of_edge(j, dx),
            line.of_edge(j, dy),
            line.of_edge(j, dz),
        ]);
        let square = d.dot(d);
        let length = square.sqrt();
        let [compliance, residual] = compliance(line, law, j, square, length);
        // Eliminates the coupling with the edge before, through their common vertex.
        let coupling = w0 * previous.dot(d);
        let upper = coupling * previous_inverse;
        let diagonal = ((w0 + w1 + compliance) * square - coupling * upper).max(smallest);
        let inverse = V::of(1.0) / diagonal;
        let right = (residual * length + coupling * previous_right) * inverse;
        if j > 0 {
            rows.upper[j - 1] = upper;
        }
        rows.edge[j] = d;
        rows.right[j] = right;
        (x0, w0, previous, previous_inverse, previous_right) = (x1, w1, d, inverse, right);
    }
    // Nothing comes after the last edge, and what a longer line left there may be no number.
    rows.upper[line.vertices().len().saturating_sub(2)] = V::zero();
}

#[cfg(test)]
mod tests;
