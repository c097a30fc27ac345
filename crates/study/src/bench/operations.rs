//! What a substep has to do at least, counted from the method.
//!
//! This is a count of the documented algorithm (`docs/PHYSICS.md`, "A substep") for the terms of
//! the standard sheet, not of the instructions of a kernel: a kernel that computes something
//! twice, or in another order, is held to the same numbers. Free of charge are loads and stores,
//! changes of sign, and all that does not change within a control step: constants, alpha / h^2,
//! 1 / h. Looking up the tool's distance is left out too: it is done once in 5 substeps, from
//! a table; the feature `contact_interval` shows what it costs.

use std::ops::{Add, Mul};

use serde::Serialize;

use super::limits::Limits;
use drape_cloth::fabric::{Lamina, Yarn};
use drape_cloth::sim::Solver;

/// Operations on one number each: on one lane of one environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Operations {
    /// Additions, subtractions, multiplications, minima, maxima, comparisons and selections.
    pub simple: usize,
    pub divisions: usize,
    pub roots: usize,
}

/// x1 - x0: 3; its square 5, root.
const LENGTH: Operations = Operations::new(8, 0, 1);

/// An edge in a tridiagonal solve: C 1, branch by a sign 2, coupling 6, factor 1, diagonal 6, its
/// inverse, right side 4; then backwards multiplier 2, pull 3, and its difference to the one
/// before, moved by w, 9.
const LINE_EDGE: Operations = LENGTH.plus(Operations::new(34, 1, 0));

/// What a diagonal has on top: the sine of the shear 2, within bounds 2, a polynomial of degree 5
/// 10, times the compliance 1.
const TRELLIS: Operations = Operations::new(15, 0, 0);

/// What the edge of a yarn has on top, whose force density is kept: what is kept 1, the force 1, what
/// it explains 2, the new value 1; in the next substep the edge anew 3, its pull 3 and the sum of
/// pulls 6, the stress 1 and its sum 2.
const KEPT_FORCE: Operations = Operations::new(20, 0, 0);

/// A vertex in the pentadiagonal solve of bending: second difference 9, stiffness 1, K x 9, lower
/// diagonals 3, diagonal 2, pivot 4 and its inverse, upper diagonals 4, right side 18; then
/// backwards 15.
const BENT_VERTEX: Operations = Operations::new(65, 1, 0);

/// A vertex's pull in the prediction of the solve along lines: h^2 w 1, whether it is held back 3,
/// the pull 3, added 3.
const PULLED: Operations = Operations::new(10, 0, 0);

/// An edge by itself: not below the shortest length 1, C 1, branch by its sign 2, denominator 3,
/// multiplier 1 division, pull 3, both ends moved by w 12.
const SINGLE_EDGE: Operations = LENGTH.plus(Operations::new(22, 1, 0));

/// Three neighbours on a yarn: x0 - 2 x1 + x2 9, denominator 4, its inverse, pull 3, three ends
/// moved by w 18, twice w in the middle 1.
const TRIPLE: Operations = Operations::new(35, 1, 0);

/// Predict a vertex: free or not 1, gravity 2, x + h v 6.
const PREDICT: Operations = Operations::new(9, 0, 0);

/// Push out of the tool: distance to the plane 6, depth 1 if free 2, moved along the normal 6.
const CONTACT: Operations = Operations::new(15, 0, 0);

/// Friction of what sticks (sliding is rare, and its division is skipped where nothing does): way
/// 3, its tangential part 11, square 5, whether it holds 3, only in contact 2, taken back 6, way 3.
const FRICTION: Operations = Operations::new(33, 0, 0);

/// New velocity: 3, whether it is above the cap 6 (then it is rare, and skipped), free or not 4.
const VELOCITY: Operations = Operations::new(13, 0, 0);

/// What a substep of the standard sheet has to compute with the default physics and `solver`,
/// for one environment.
pub fn operations(lamina: &Lamina, solver: Solver) -> Operations {
    let count = Constraints::of(lamina);
    let vertex = (PREDICT + CONTACT + FRICTION + VELOCITY) * count.vertices;
    match solver {
        Solver::Yarn => {
            vertex
                + (LINE_EDGE + KEPT_FORCE) * count.yarn_edges
                + (LINE_EDGE + TRELLIS) * count.diagonals
                + BENT_VERTEX * (2 * count.vertices)
                + PULLED * count.vertices
        }
        Solver::GaussSeidel => {
            vertex
                + SINGLE_EDGE * (count.yarn_edges + count.diagonals)
                + TRELLIS * count.diagonals
                + TRIPLE * count.triples
        }
    }
}

/// Numbers of a vertex that a substep reads: position 3, velocity 3, inverse mass and mobility 2,
/// tangent plane 4; that it leaves behind: position 3, velocity 3; and the position at its start,
/// which it writes and reads again after everything else has moved: 6.
const NUMBERS_MOVED: usize = 24;

/// What the solve along lines moves on top: force densities of two yarn edges and the pull of one,
/// read and left behind, and the mobility, left behind; but new velocities are at hand where the
/// next substep is predicted.
const FORCE_NUMBERS_MOVED: usize = 11 - 3;

/// Numbers of a vertex that an environment holds: position, velocity, position at the start of
/// the substep, inverse mass, mobility, tangent plane; with force densities of two yarn edges and
/// the pull of one under the solve along lines.
const NUMBERS_HELD: usize = 15;
const FORCE_NUMBERS_HELD: usize = 5;

/// Bytes that a substep of one environment has to move if everything that is touched again
/// within the substep could be kept at hand: the state once through. Constants of constraints
/// are shared by all lanes, and left out.
pub fn bytes_moved(lamina: &Lamina, solver: Solver, number_size: usize) -> usize {
    let numbers = match solver {
        Solver::Yarn => NUMBERS_MOVED + FORCE_NUMBERS_MOVED,
        Solver::GaussSeidel => NUMBERS_MOVED,
    };
    lamina.vertex_count() * numbers * number_size
}

/// Numbers in the state of one environment under the solve along lines.
pub fn numbers_held(lamina: &Lamina) -> usize {
    lamina.vertex_count() * (NUMBERS_HELD + FORCE_NUMBERS_HELD)
}

/// How many constraints of each kind a lamina has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Constraints {
    pub vertices: usize,
    pub yarn_edges: usize,
    pub diagonals: usize,
    /// Three neighbours on a yarn.
    pub triples: usize,
}

impl Constraints {
    /// Counts those of `lamina`.
    pub fn of(lamina: &Lamina) -> Self {
        let along_yarns = |span: usize| {
            let count = |yarn: &Yarn| yarn.vertices.windows(span).len();
            lamina.yarns.iter().map(count).sum()
        };
        Self {
            vertices: lamina.vertex_count(),
            yarn_edges: along_yarns(2),
            diagonals: lamina.diagonals.len(),
            triples: along_yarns(3),
        }
    }
}

impl Operations {
    const fn new(simple: usize, divisions: usize, roots: usize) -> Self {
        Self {
            simple,
            divisions,
            roots,
        }
    }

    const fn plus(self, other: Self) -> Self {
        Self {
            simple: self.simple + other.simple,
            divisions: self.divisions + other.divisions,
            roots: self.roots + other.roots,
        }
    }

    /// Least time for these [s]. Divisions and roots share a unit of the processor, beside which
    /// everything else goes on, so the longer of the two counts.
    pub fn seconds(&self, limits: &Limits) -> f64 {
        let simple = self.simple as f64 / limits.operations_per_second;
        let slow = self.divisions as f64 / limits.divisions_per_second
            + self.roots as f64 / limits.roots_per_second;
        simple.max(slow)
    }
}

impl Add for Operations {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.plus(other)
    }
}

impl Mul<usize> for Operations {
    type Output = Self;
    fn mul(self, count: usize) -> Self {
        Self::new(
            self.simple * count,
            self.divisions * count,
            self.roots * count,
        )
    }
}
