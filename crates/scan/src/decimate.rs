//! Fewer facets where fewer do.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use drape_cloth::math::Vec3;
use rayon::prelude::*;

use super::twins::{MANY, doubled_area, edge, twins};

/// New facets are not flatter than this (height over longest edge), or than the flattest that they replace.
const FLAT: f64 = 0.02;
/// Cosine of the angle up to which a facet may turn.
const TURN: f64 = 0.5;
/// Weight of an edge's length in the order: where all is flat, short edges go first and facets stay compact.
const LENGTH: f64 = 1e-3;

/// A facet that is gone.
const GONE: [u32; 3] = [u32::MAX; 3];

/// Drops vertices of a mesh with consistent facets by collapsing an edge from the vertex to a neighbour, the cheapest
/// first, until there is none left whose collapse keeps the neighbour within half the `tolerance` [m] of the planes
/// of all facets at the vertex (Ronfard and Rossignac, Computer Graphics Forum 1996, 15, 67), turns no facet far
/// and joins no parts. Half, as what is moved may be moved again. Vertices at borders stay.
///
/// The planes are those of the mesh as it is by then. The sums of quadrics that are usual (Garland and
/// Heckbert, SIGGRAPH 1997) know those of the beginning, too, but decimate their own result again.
pub fn decimate(x: &[Vec3], triangles: &mut Vec<[u32; 3]>, tolerance: f64) {
    let mut stars = vec![Vec::new(); x.len()];
    for (facet, triangle) in triangles.iter().enumerate() {
        triangle.iter().for_each(|&v| stars[v as usize].push(facet));
    }
    let mut is_border = vec![false; x.len()];
    for (half, twin) in twins(triangles).into_iter().enumerate() {
        for v in edge(triangles, half) {
            is_border[v as usize] |= twin == half || twin == MANY;
        }
    }
    let normal = |t: &[u32; 3]| doubled_area(t.map(|v| x[v as usize])).normalize();
    let mut mesh = Mesh {
        x,
        normals: triangles.iter().map(normal).collect(),
        triangles,
        stars,
        is_border,
        most: 0.5 * tolerance,
    };
    let mut stamps = vec![0_u32; x.len()];
    loop {
        // A collapse may allow others further away, which are not in the queue: until there are none.
        let all = (0..x.len() as u32).into_par_iter();
        let entry = |u: u32| Some(Reverse((mesh.best(u)?, u, stamps[u as usize])));
        let mut queue: BinaryHeap<_> = all.filter_map(entry).collect::<Vec<_>>().into();
        if queue.is_empty() {
            break;
        }
        while let Some(Reverse(((_, v), u, stamp))) = queue.pop() {
            if stamp != stamps[u as usize] {
                continue;
            }
            // Costs are as they were, but v may have come near to other neighbours of u.
            let mut changed = vec![u];
            if mesh.allows(u, v) {
                changed.extend(mesh.ring(u));
                mesh.collapse(u, v);
            }
            for w in changed {
                stamps[w as usize] += 1;
                queue.extend(
                    mesh.best(w)
                        .map(|best| Reverse((best, w, stamps[w as usize]))),
                );
            }
        }
    }
    triangles.retain(|triangle| *triangle != GONE);
}

struct Mesh<'a> {
    x: &'a [Vec3],
    triangles: &'a mut [[u32; 3]],
    /// Unit normals.
    normals: Vec<Vec3>,
    /// Facets at a vertex.
    stars: Vec<Vec<usize>>,
    is_border: Vec<bool>,
    /// Farthest that a facet is moved [m].
    most: f64,
}

impl Mesh<'_> {
    /// Facets at a vertex.
    fn star(&self, v: u32) -> impl Iterator<Item = (usize, [u32; 3])> {
        let facets = self.stars[v as usize].iter();
        facets.map(|&facet| (facet, self.triangles[facet]))
    }

    /// Neighbours of a vertex that is not at a border.
    fn ring(&self, u: u32) -> impl Iterator<Item = u32> {
        self.star(u).map(move |(_, [a, b, c])| match u {
            u if u == a => b,
            u if u == b => c,
            _ => a,
        })
    }

    fn corners(&self, triangle: [u32; 3]) -> [Vec3; 3] {
        triangle.map(|v| self.x[v as usize])
    }

    /// The neighbour to which a vertex moves best, after its cost as bits, which ascend as positive numbers do.
    fn best(&self, u: u32) -> Option<(u64, u32)> {
        if self.is_border[u as usize] {
            return None;
        }
        let cost = |v: u32| {
            let along = self.x[v as usize] - self.x[u as usize];
            let facets = self.stars[u as usize].iter();
            let off = facets.map(|&facet| self.normals[facet].dot(&along).abs());
            let off = off.fold(0.0, f64::max);
            (off < self.most).then(|| ((off + LENGTH * along.norm()).to_bits(), v))
        };
        let mut moves: Vec<(u64, u32)> = self.ring(u).filter_map(cost).collect();
        moves.sort_unstable();
        moves.into_iter().find(|&(_, v)| self.allows(u, v))
    }

    /// Whether moving `u` to `v` keeps the mesh one, and its facets from turning and from becoming too flat.
    fn allows(&self, u: u32, v: u32) -> bool {
        let is_near = |w: &u32| *w != v && self.star(v).any(|(_, corners)| corners.contains(w));
        let mut shared = self.ring(u).filter(is_near);
        let (Some(a), Some(b), None) = (shared.next(), shared.next(), shared.next()) else {
            return false;
        };
        // Three neighbours with a facet over them already, as of a tetrahedron.
        let is_over = |c: [u32; 3]| c.contains(&a) && c.contains(&b) && !c.contains(&u);
        if self.star(v).any(|(_, corners)| is_over(corners)) {
            return false;
        }
        let height = |triangle: [u32; 3]| {
            let [a, b, c] = self.corners(triangle);
            let longest = (b - a).norm_squared().max((c - b).norm_squared());
            let area = doubled_area([a, b, c]);
            (area, area.norm() / longest.max((a - c).norm_squared()))
        };
        let flattest = self.star(u).map(|(_, t)| height(t).1).fold(FLAT, f64::min);
        let mut moved = self.star(u).filter(|(_, corners)| !corners.contains(&v));
        moved.all(|(facet, corners)| {
            let (area, height) = height(corners.map(|w| if w == u { v } else { w }));
            height >= flattest && area.dot(&self.normals[facet]) >= TURN * area.norm()
        })
    }

    fn collapse(&mut self, u: u32, v: u32) {
        for facet in std::mem::take(&mut self.stars[u as usize]) {
            let corners = self.triangles[facet];
            if corners.contains(&v) {
                self.triangles[facet] = GONE;
                for w in corners {
                    self.stars[w as usize].retain(|&other| other != facet);
                }
                continue;
            }
            let corners = corners.map(|w| if w == u { v } else { w });
            self.triangles[facet] = corners;
            self.normals[facet] = doubled_area(self.corners(corners)).normalize();
            self.stars[v as usize].push(facet);
        }
    }
}
