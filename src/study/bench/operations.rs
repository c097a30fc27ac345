//! What a substep has to do at least, counted from the method.
//!
//! This is a count of the documented algorithm (`docs/PHYSICS.md`, "A substep") for the terms of
//! the standard sheet, not of the instructions of a kernel: a kernel that computes something
//! twice, or in another order, is held to the same numbers. Free of charge are loads and stores,
//! changes of sign, and all that does not change within a control step: constants, alpha / h^2,
//! 1 / h. Looking up the tool's distance is left out too: it is done once in 20 substeps, lane
//! by lane from a table; the feature `contact_interval` shows what it costs.

use std::ops::{Add, Mul};

use serde::Serialize;

use super::limits::Limits;
use crate::fabric::{Lamina, Yarn};
use crate::sim::Solver;

/// Operations on one number each: on one lane of one environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Operations {
    /// Additions, subtractions, multiplications, minima, maxima, comparisons and selections.
    pub simple: usize,
    pub divisions: usize,
    pub roots: usize,
}

/// x1 - x0: 3; its square 5, not below the shortest 1, root, 1 / root, direction 3, length 1.
const DIRECTION: Operations = Operations::new(13, 1, 1);

/// An edge of a yarn in the direct solve, one term a step of `sim`'s elimination:
/// C 1, branch 1, coupling 6, factor 1, diagonal 5, its inverse, right side 3; then backwards
/// multiplier 2, next branch 1, pull 3, and its difference to the one before, moved by w, 9.
const CHAINED_EDGE: Operations = DIRECTION.plus(Operations::new(32, 1, 0));

/// An edge by itself: C 1, branch by its sign 2, denominator 2, multiplier 1 division, pull 3,
/// both ends moved by w 12.
const SINGLE_EDGE: Operations = DIRECTION.plus(Operations::new(20, 1, 0));

/// Three neighbours on a yarn: x0 - 2 x1 + x2 9, denominator 4, its inverse, pull 3, three ends
/// moved by w 18, twice w in the middle 1.
const TRIPLE: Operations = Operations::new(35, 1, 0);

/// Predict a vertex: free or not 1, gravity 2, x + h v 6.
const PREDICT: Operations = Operations::new(9, 0, 0);

/// Push out of the tool: distance to the plane 6, depth 1 if free 2, moved along the normal 6.
const CONTACT: Operations = Operations::new(15, 0, 0);

/// Friction: way 3, its tangential part 11, length 5 and root, whether it holds 2, share 2 and a
/// division, at most 1 2, only in contact 2, taken back 6.
const FRICTION: Operations = Operations::new(33, 1, 1);

/// New velocity: 6, its square 5, not below that of the cap 1, root, cap / root, scaled 3, free
/// or not 4.
const VELOCITY: Operations = Operations::new(19, 1, 1);

/// What a substep of the standard sheet has to compute with the default physics and `solver`,
/// for one environment.
pub fn operations(lamina: &Lamina, solver: Solver) -> Operations {
    let count = Constraints::of(lamina);
    let yarn_edge = match solver {
        Solver::Yarn => CHAINED_EDGE,
        Solver::GaussSeidel => SINGLE_EDGE,
    };
    let vertex = PREDICT + CONTACT + FRICTION + VELOCITY;
    yarn_edge * count.yarn_edges
        + SINGLE_EDGE * count.diagonals
        + TRIPLE * count.triples
        + vertex * count.vertices
}

/// Numbers of a vertex that a substep reads: position 3, velocity 3, inverse mass 1, tangent
/// plane 4; that it leaves behind: position 3, velocity 3; and the position at its start, which
/// it writes and reads again after everything else has moved: 6.
const NUMBERS_MOVED: usize = 23;

/// Numbers of a vertex that an environment holds: position, velocity, position at the start of
/// the substep, inverse mass, tangent plane.
const NUMBERS_HELD: usize = 14;

/// Bytes that a substep of one environment has to move if everything that is touched again
/// within the substep could be kept at hand: the state once through. Constants of constraints
/// are shared by all lanes, and the branches of yarn edges are a bit a lane: both left out.
pub fn bytes_moved(lamina: &Lamina, number_size: usize) -> usize {
    lamina.vertex_count() * NUMBERS_MOVED * number_size
}

/// Numbers in the state of one environment.
pub fn numbers_held(lamina: &Lamina) -> usize {
    lamina.vertex_count() * NUMBERS_HELD
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
