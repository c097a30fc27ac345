//! Lines of vertices that are solved as a whole, and the tridiagonal solve along one. Everything
//! here is inlined into the substep, so that it is compiled for the instruction set in use.
//!
//! Constraint by constraint, long waves meet a fabric that is softer the longer the substep, and a
//! wrinkle sinks by itself. Along a line the system is banded, and solving it as a whole costs
//! hardly more. What is left is the splitting between lines that cross.

use std::ops::Range;

pub(super) use super::law::Direction;
use super::law::{EdgeLaw, Limit};
use crate::math::{Lanes, Vec3x};

/// A chain of vertices which is solved as a whole.
#[derive(Clone, Debug)]
pub(super) struct Line {
    /// At least one.
    pub vertices: Vec<u32>,
    /// Its edges among those of all yarns; empty for a row of diagonals, whose solve
    /// starts from none.
    pub edges: Range<usize>,
    pub rest_length: f64,
    /// That of a row of diagonals holds near rest, see [`super::shear`].
    pub law: EdgeLaw,
    pub limit: Option<Limit>,
    /// Bending stiffness D b / l^3 [N/m]: energy = stiffness |x0 - 2 x1 + x2|^2 / 2.
    pub bending: f64,
}

impl Line {
    /// Greatest compression that lasts, as a force density <= 0 [N/m].
    pub fn min_warm(&self) -> f64 {
        -MAX_WARM * self.bending
    }
}

/// Compression that the next substep starts with, as a force density over the bending k of a yarn: so
/// many times that at which it gives way (4 k: a zigzag of amplitude y costs 8 k y^2 of bending a vertex and shortens an edge by
/// 2 y^2 / l). Surplus between draped vertices holds much more than that, and without it the
/// tension beside it is wrong: after random episodes the worst edge is strained by 11 % at once that,
/// 3.3 % at 10 times, 2.6 % at 25. A yarn without bending must start with none: let go, it would throw itself to and fro.
pub(super) const MAX_WARM: f64 = 4.0 * 25.0;

/// A line as the solves see it, for all lanes: the same line in every lane, or another in each.
pub(super) trait Chain<V: Lanes> {
    /// Where the vertices of the line are; at least one.
    fn vertices(&self) -> &[u32];
    /// Where the forces of its edges are.
    fn edges(&self) -> Range<usize>;
    /// The law of the model.
    fn law(&self) -> LineLaw<V>;
    /// `x` in the lanes whose line has edge `j`, else 0.
    fn of_edge(&self, j: usize, x: Vec3x<V>) -> Vec3x<V>;
    /// 1 in the lanes whose line has edge `j`, which is one of the line's longest, else 0.
    fn has_edge(&self, j: usize) -> V;
}

/// The law of a line's edges.
#[derive(Clone, Copy)]
pub(super) struct LineLaw<V> {
    /// Rest length of an edge [m], and its inverse.
    pub rest: [V; 2],
    /// In tension and in compression [m/N].
    pub compliance: [V; 2],
    /// Greatest compression, as a force density <= 0 [N/m], that the next substep starts with.
    pub min_warm: V,
    /// Tension at which its limit or knee begins, compliance and offset beyond it.
    pub limit: Option<[V; 3]>,
    /// Bending stiffness [N/m]; none where no lane has any.
    pub bending: Option<V>,
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
    fn law(&self) -> LineLaw<V> {
        LineLaw {
            rest: [V::of(self.rest_length), V::of(1.0 / self.rest_length)],
            compliance: self.law.in_lanes(None),
            min_warm: V::of(self.min_warm()),
            limit: match self.limit {
                Some(limit) => Some([
                    V::of(limit.force),
                    V::of(limit.compliance),
                    V::of(limit.offset),
                ]),
                None => None,
            },
            bending: match self.bending {
                0.0 => None,
                stiffness => Some(V::of(stiffness)),
            },
        }
    }
    #[inline(always)]
    fn of_edge(&self, _: usize, x: Vec3x<V>) -> Vec3x<V> {
        x
    }
    #[inline(always)]
    fn has_edge(&self, _: usize) -> V {
        V::of(1.0)
    }
}

/// Eliminated rows of the system of a line, one a vertex or edge.
pub(super) struct Scratch<V> {
    /// Edges from end to end; right sides of bending.
    pub edge: Vec<Vec3x<V>>,
    pub upper: Vec<V>,
    /// Right sides; the second upper diagonal of bending.
    pub second: Vec<V>,
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

/// A line with the state of its vertices and edges: those of the vertices at their places, those
/// of the edges in their order.
pub(super) struct Along<'a, V: Lanes, C> {
    pub line: &'a C,
    pub law: LineLaw<V>,
    /// [m]
    pub x: &'a mut [Vec3x<V>],
    /// That at the start of the substep [m]; of a row of diagonals, where its law bends.
    pub previous: &'a [Vec3x<V>],
    /// [m/N]
    pub mobility: &'a [V],
    /// Force density of each edge [N/m], > 0 in tension.
    pub density: &'a mut [V],
    pub scratch: &'a mut Scratch<V>,
}

impl<V: Lanes, C> Along<'_, V, C> {
    /// That for one of several stages.
    #[inline(always)]
    pub fn again(&mut self) -> Along<'_, V, C> {
        Along {
            line: self.line,
            law: self.law,
            x: self.x,
            previous: self.previous,
            mobility: self.mobility,
            density: self.density,
            scratch: self.scratch,
        }
    }
}

/// What the edges of a line answer to.
pub(super) trait Response<V: Lanes> {
    /// Compliance of edge `j` [m/N], and its residual: what its force leaves of its C [m].
    fn at(&self, law: &LineLaw<V>, j: usize, square: V, length: V) -> [V; 2];
    /// Takes in by how much the force density of edge `j` changes [N/m], where forces last.
    #[inline(always)]
    fn add(&mut self, _law: &LineLaw<V>, _j: usize, _change: V) {}
}

/// Solves (J M J^T + compliance) d = residual for the changes d of the edges' forces, and moves
/// the vertices by -M J^T d, M the `mobility` [m/N]. The system of a chain is tridiagonal
/// (Thomas algorithm). Pinned vertices (mobility 0) decouple their neighbours by the formula
/// itself.
#[inline(always)]
pub(super) fn solve<V: Lanes, C: Chain<V>>(along: Along<V, C>, response: &mut impl Response<V>) {
    let (line, law, rows) = (along.line, &along.law, along.scratch);
    // Apart, so that the compiler knows them to lie apart.
    eliminate(line, law, response, along.x, along.mobility, rows);
    substitute(line, law, response, along.x, along.mobility, rows);
}

/// Forward elimination of the tridiagonal system of a line's edges. Rows and unknowns are scaled
/// by the lengths of their edges, in place of their directions: that saves a division.
#[inline(always)]
fn eliminate<V: Lanes>(
    line: &impl Chain<V>,
    law: &LineLaw<V>,
    response: &impl Response<V>,
    x: &[Vec3x<V>],
    mobility: &[V],
    rows: &mut Scratch<V>,
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
        let d = line.of_edge(j, x1 - x0);
        let square = d.dot(d);
        let length = square.sqrt();
        let [compliance, residual] = response.at(law, j, square, length);
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
        rows.second[j] = right;
        (x0, w0, previous, previous_inverse, previous_right) = (x1, w1, d, inverse, right);
    }
    // Nothing comes after the last edge, and what a longer line left there may be no number.
    rows.upper[line.vertices().len().saturating_sub(2)] = V::zero();
}

/// Back substitution from the far end; a vertex moves once both its edges are known.
#[inline(always)]
fn substitute<V: Lanes>(
    line: &impl Chain<V>,
    law: &LineLaw<V>,
    response: &mut impl Response<V>,
    x: &mut [Vec3x<V>],
    mobility: &[V],
    rows: &mut Scratch<V>,
) {
    let mut after = Vec3x::zero();
    let mut change_after = V::zero();
    for j in (0..line.vertices().len() - 1).rev() {
        let change = rows.second[j] + rows.upper[j] * change_after;
        response.add(law, j, change);
        let moved = rows.edge[j].scale(change);
        let v = line.vertices()[j + 1] as usize;
        x[v] = x[v] + (after - moved).scale(mobility[v]);
        (after, change_after) = (moved, change);
    }
    let v = line.vertices()[0] as usize;
    x[v] = x[v] + after.scale(mobility[v]);
}
