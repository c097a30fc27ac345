use parry3d_f64::query::PointQuery;
use parry3d_f64::shape;
use rayon::prelude::*;

use super::surface::Surface;
use super::union::clip;
use crate::math::{Vec3, to_parry};
use crate::mesh::TriMesh;

/// What the greatest depth may be too small by [m].
const TOLERANCE: f64 = 1e-7;

/// Most facets that bound the depth of a piece before it is quartered.
const MOST_FACETS: usize = 12;

/// The place of a sheet that is deepest inside a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deepest {
    /// [m], 0 where nothing is inside.
    pub depth: f64,
    /// [m]
    pub at: Vec3,
}

/// A part of a triangle of the sheet.
type Piece = [Vec3; 3];

impl Surface {
    /// How deep a sheet lies inside the solid, anywhere on its triangles, by the exact distance: to
    /// 0.1 um. What is no number is left out.
    ///
    /// Branch and bound. On a piece of a triangle the depth is at most the smallest of some functions
    /// that are linear there; the greatest value of that is a linear programme. Where the
    /// solid is convex that comes to the depth itself (Kelley 1960); elsewhere pieces are quartered until it is
    /// near enough.
    pub fn deepest(&self, sheet: &TriMesh) -> Deepest {
        let none = Deepest {
            depth: 0.0,
            at: Vec3::zeros(),
        };
        let deeper = |a: Deepest, b: Deepest| if b.depth > a.depth { b } else { a };
        let depth = |&at: &Vec3| Deepest {
            depth: -self.signed_distance(at),
            at,
        };
        // Collected in order, as a reduction in parallel would choose among equals by chance.
        let all = 0..sheet.triangles.len();
        let mut pieces: Vec<Piece> = all.map(|t| sheet.corners(t)).collect();
        let places = [sheet.vertices.clone(), pieces.iter().map(middle).collect()].concat();
        let found: Vec<Deepest> = places.par_iter().map(depth).collect();
        let mut deepest = found.into_iter().fold(none, deeper);
        while !pieces.is_empty() {
            let least = deepest.depth + TOLERANCE;
            let found = pieces
                .par_iter()
                .filter_map(|piece| self.look(piece, least).map(|found| (found, piece)));
            let found: Vec<_> = found.collect();
            let seen = found.iter().map(|((deepest, _), _)| *deepest);
            deepest = seen.fold(deepest, deeper);
            let least = deepest.depth + TOLERANCE;
            let open = found.iter().filter(|((_, bound), _)| *bound > least);
            pieces = open.flat_map(|(_, piece)| quarters(piece)).collect();
        }
        deepest
    }

    /// A deep place of a piece and a bound on its depth [m]; none if that is at most `least` [m].
    fn look(&self, piece: &Piece, least: f64) -> Option<(Deepest, f64)> {
        let centre = middle(piece);
        let radius = piece
            .iter()
            .map(|x| (x - centre).norm())
            .fold(0.0, f64::max);
        let depth = -self.signed_distance(centre);
        // Distances change by no more than one moves.
        let most = depth + radius;
        if most <= least || most.is_nan() {
            return None;
        }
        let near = self.near(centre, depth.abs() + 2.0 * radius);
        // What no facet passes through is outside as a whole.
        if depth < 0.0 && near.iter().all(|(.., facet)| are_apart(piece, facet)) {
            return None;
        }
        let mut deepest = Deepest { depth, at: centre };
        let (mut bound, mut next) = (most, centre);
        let (mut known, mut functions) = (Vec::new(), Vec::new());
        // Cutting planes: what bounds the depth where it would be greatest by those that are known.
        while known.len() < MOST_FACETS {
            let k = nearest(&near, next)?;
            if known.contains(&k) {
                break;
            }
            known.push(k);
            functions.extend(bounds(piece, &near, k));
            let (highest, weights) = highest(&functions);
            bound = bound.min(highest);
            if bound <= least {
                return None;
            }
            next = piece[0] * weights.x + piece[1] * weights.y + piece[2] * weights.z;
            let there = -self.signed_distance(next);
            if there > deepest.depth {
                (deepest.depth, deepest.at) = (there, next);
            }
            if bound <= deepest.depth + TOLERANCE {
                break;
            }
        }
        Some((deepest, bound))
    }
}

/// A facet or wall, as [`Surface::near`] tells it.
type Facet = (Option<u32>, f64, [Vec3; 3]);

/// The number among `near` of what is nearest to `x`.
fn nearest(near: &[Facet], x: Vec3) -> Option<usize> {
    let off = |(.., facet): &Facet| distance(facet, x);
    let all = near.iter().map(off).enumerate();
    all.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
}

fn distance(facet: &[Vec3; 3], x: Vec3) -> f64 {
    let [a, b, c] = facet.each_ref().map(to_parry);
    shape::Triangle::new(a, b, c).distance_to_local_point(to_parry(&x), true)
}

/// What the depth in a piece is at most because of one facet, by values at its corners [m] with what is linear
/// between them: the distance to it, which is convex; and how far it is up to its plane, if no other one
/// `near` rises over that.
fn bounds(piece: &Piece, near: &[Facet], k: usize) -> impl Iterator<Item = [f64; 3]> {
    let (number, _, [a, b, c]) = &near[k];
    let n = (b - a).cross(&(c - a)).try_normalize(0.0);
    let is_over = |n: &Vec3, x: &Vec3| n.dot(&(x - a)) > 0.01 * TOLERANCE;
    let rises = |n: &Vec3| {
        near.iter()
            .flat_map(|(.., other)| other)
            .any(|x| is_over(n, x))
    };
    // Walls below an open mesh have no side of their own.
    let plane = n.filter(|n| number.is_some() && !rises(n));
    let up = plane.map(|n| piece.map(|x| n.dot(&(a - x))));
    [piece.map(|x| distance(&[*a, *b, *c], x))]
        .into_iter()
        .chain(up)
}

/// Whether the plane of one of two triangles has the other on one side.
fn are_apart(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
    let has_on_one_side = |[p, q, r]: &[Vec3; 3], other: &[Vec3; 3]| {
        let n = (q - p).cross(&(r - p));
        let heights = other.map(|x| n.dot(&(x - p)));
        heights.iter().all(|h| *h > 0.0) || heights.iter().all(|h| *h < 0.0)
    };
    has_on_one_side(a, b) || has_on_one_side(b, a)
}

/// The greatest value on a triangle of the smallest of some functions, linear between the values at its
/// corners, and its barycentric coordinates.
fn highest(functions: &[[f64; 3]]) -> (f64, Vec3) {
    let functions: Vec<Vec3> = functions.iter().map(|&values| values.into()).collect();
    let mut highest = (f64::NEG_INFINITY, Vec3::repeat(1.0 / 3.0));
    for (k, f) in functions.iter().enumerate() {
        // Where this one is the smallest.
        let mut polygon = vec![Vec3::x(), Vec3::y(), Vec3::z()];
        let known = functions[..k].contains(f);
        for g in functions.iter().filter(|g| !known && *g != f) {
            polygon = clip(&polygon, |x| (g - f).dot(x));
        }
        for x in polygon.iter().filter(|_| !known) {
            if f.dot(x) > highest.0 {
                highest = (f.dot(x), *x);
            }
        }
    }
    highest
}

fn middle([a, b, c]: &Piece) -> Vec3 {
    (a + b + c) / 3.0
}

fn quarters(&[a, b, c]: &Piece) -> [Piece; 4] {
    let [p, q, r] = [(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5];
    [[a, p, r], [p, b, q], [r, q, c], [p, q, r]]
}

#[cfg(test)]
mod tests {
    use super::super::solidity::bounded;
    use super::super::tests::{blocks, roof};
    use super::*;

    /// A flat sheet at height `z`, turned about the vertical by 0.1, of cells 5.8 mm wide [m].
    fn sheet(z: f64) -> TriMesh {
        let (count, cell) = (25, 5.8e-3);
        let mut sheet = TriMesh::default();
        for k in 0..count * count {
            let [u, v] = [k % count, k / count].map(|i| (i as f64 - 11.9) * cell);
            let (sin, cos) = 0.1f64.sin_cos();
            let at = Vec3::new(cos * u - sin * v, sin * u + cos * v, z);
            sheet.vertices.push(at);
            if k % count + 1 < count && k / count + 1 < count {
                let [a, b, c] = [k, k + 1, k + count].map(|k| k as u32);
                sheet.triangles.extend([[a, b, c + 1], [a, c + 1, c]]);
            }
        }
        sheet
    }

    /// Between the vertices, where each is outside: below the ridges of roofs, between the walls of a fin,
    /// at the foot of one that is sunk into its plate, in pins; and nowhere above them.
    #[test]
    fn greatest_depth_of_a_surface_is_exact() {
        let plate = [[-0.2, -0.2, -0.02], [0.2, 0.2, 0.0]];
        let fin = [[0.0004, -0.15, -0.001], [0.0054, 0.15, 0.06]];
        let pin = |x: f64| [[x, 0.001, -0.001], [x + 0.003, 0.004, 0.04]];
        let mut cases = vec![
            (blocks(&[plate, fin]), 0.03, 2.5e-3),
            (blocks(&[plate, fin]), 0.0, 2.5e-3),
            (blocks(&[plate, fin]), -0.0005, (2.5e-3f64).hypot(0.5e-3)),
            (blocks(&[plate, fin]), 0.0599, 0.1e-3),
            (blocks(&[plate, fin]), 0.0601, 0.0),
            (blocks(&[plate, pin(0.01), pin(-0.03)]), 0.01, 1.5e-3),
            (blocks(&[plate]), 0.001, 0.0),
            (blocks(&[plate]), -0.003, 3e-3),
        ];
        for slope in [20.0f64, 60.0, 90.0 - 20.0] {
            let cos = slope.to_radians().cos();
            cases.push((roof(slope), 0.06 - 1e-3 / cos, 1e-3));
        }
        for (k, (mesh, z, exact)) in cases.into_iter().enumerate() {
            let found = bounded(&mesh).unwrap().deepest(&sheet(z));
            let off = (found.depth - exact).abs();
            assert!(off < 1.1 * TOLERANCE, "{k}: {found:?}, exact {exact}");
        }
    }

    /// Over a hollow, near its facets everywhere, pieces are told to be outside as a whole, at once.
    #[test]
    fn sheets_that_bridge_hollows_take_no_time() {
        let at = |k: i32| f64::from(k) * 1e-3;
        let hollow = |x: f64, y: f64| Vec3::new(x, y, (x * x + y * y) / 0.4);
        let mut mesh = TriMesh::default();
        for (i, j) in (-60..=60).flat_map(|i| (-60..=60).map(move |j| (i, j))) {
            mesh.vertices.push(hollow(at(j), at(i)));
            if i < 60 && j < 60 {
                let a = (mesh.vertices.len() - 1) as u32;
                mesh.triangles
                    .extend([[a, a + 1, a + 122], [a, a + 122, a + 121]]);
            }
        }
        let mut above = sheet(0.0);
        for x in &mut above.vertices {
            *x = hollow(0.7 * x.x, 0.7 * x.y) + Vec3::z() * 1.5e-5;
        }
        let surface = bounded(&mesh).unwrap();
        let found = surface.deepest(&above);
        assert!(found.depth < 1e-5, "{found:?}");
    }
}
