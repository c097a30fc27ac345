//! Finds the pairs of a lane that may touch, and on which sides they are.
//!
//! A remembered side is a number: kind, first part, second part (each 31 bits; vertex and
//! triangle, or two edges, the smaller first), and lowest whether the height was positive.

use std::collections::BTreeMap;

use parry3d_f64::bounding_volume::{Aabb, BoundingVolume};

use super::geometry::{Gap, Kind, Pair};
use super::tree::{Fit, Tree, visible_from};
use crate::math::{Vec3, to_parry};

/// Pairs of a lane at most, for each vertex. A fold of three layers has 20; where more are
/// near, as in a random tangle, the rest is left out.
const PAIR_LIMIT: usize = 60;
/// Pairs of triangles that are met, for each triangle.
const MEETING_LIMIT: usize = 100;

/// Layers that are pressed through each other by more than this, in thicknesses, have lost their
/// order for good.
const FORGET: f64 = 20.0;

/// The surface as it hangs together.
#[derive(Clone, Debug)]
pub struct Topology {
    triangles: Vec<[u32; 3]>,
    edges: Vec<[u32; 2]>,
    /// Triangles on both sides of an edge; twice the same on the border.
    beside: Vec<[u32; 2]>,
    /// The parts that each triangle answers for, so that each is met once.
    owned: Vec<Owned>,
    tree: Tree,
    vertex_count: usize,
}

#[derive(Clone, Debug, Default)]
struct Owned {
    vertices: Vec<u32>,
    edges: Vec<u32>,
}

impl Topology {
    pub fn new(rest: &[[f64; 2]], triangles: &[[u32; 3]]) -> Self {
        let mut owned = vec![Owned::default(); triangles.len()];
        let mut is_owned = vec![false; rest.len()];
        let mut index = BTreeMap::new();
        let (mut edges, mut beside) = (Vec::new(), Vec::new());
        for (t, corners) in triangles.iter().enumerate() {
            for k in 0..3 {
                let [a, b] = [corners[k], corners[(k + 1) % 3]];
                if !std::mem::replace(&mut is_owned[a as usize], true) {
                    owned[t].vertices.push(a);
                }
                let edge = *index.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    owned[t].edges.push(edges.len() as u32);
                    edges.push([a, b]);
                    beside.push([t as u32; 2]);
                    edges.len() - 1
                });
                beside[edge][1] = t as u32;
            }
        }
        Self {
            triangles: triangles.to_vec(),
            edges,
            beside,
            owned,
            tree: Tree::new(rest, triangles),
            vertex_count: rest.len(),
        }
    }

    /// Whether a remembered side is one of parts that there are.
    pub fn has(&self, entry: u64) -> bool {
        let (kind, parts, _) = parts(entry);
        let counts = match kind {
            Kind::VertexFace => [self.vertex_count, self.triangles.len()],
            Kind::EdgeEdge => [self.edges.len(); 2],
        };
        (0..2).all(|k| (parts[k] as usize) < counts[k])
    }
}

/// The number of a pair, without its side.
fn key(kind: Kind, first: u32, second: u32) -> u64 {
    let kind = u64::from(kind == Kind::EdgeEdge);
    kind << 63 | u64::from(first) << 32 | u64::from(second) << 1
}

/// Kind, parts and side of a remembered number.
fn parts(entry: u64) -> (Kind, [u32; 2], f64) {
    let kind = [Kind::VertexFace, Kind::EdgeEdge][(entry >> 63) as usize];
    let parts = [(entry >> 32) as u32 & !(1 << 31), (entry as u32) >> 1];
    (kind, parts, if entry & 1 == 1 { 1.0 } else { -1.0 })
}

/// What a search needs besides its result. Kept, so that it allocates once.
#[derive(Default)]
pub struct Scratch {
    /// Positions before the substep, which tell the sides [m].
    pub from: Vec<Vec3>,
    /// Positions now [m].
    pub to: Vec<Vec3>,
    /// Around the displacement of each vertex.
    bounds: Vec<Aabb>,
    fit: Fit,
    sides: Vec<u64>,
}

impl Scratch {
    /// Replaces `pairs` by all that may touch while no vertex moves by more than `slack` [m]
    /// along an axis from where it is now, and `sides` by the sides of those that face each
    /// other.
    pub fn search(
        &mut self,
        surface: &Topology,
        thickness: f64,
        slack: f64,
        pairs: &mut Vec<Pair>,
        sides: &mut Vec<u64>,
    ) {
        let (from, to, new) = (&self.from, &self.to, &mut self.sides);
        let (reach, fit) = (&mut self.bounds, &mut self.fit);
        let margin = slack + 0.5 * thickness;
        reach.clear();
        let ends = from.iter().zip(to);
        reach.extend(ends.map(|(from, to)| {
            let moved = Aabb::new(to_parry(&from.inf(to)), to_parry(&from.sup(to)));
            moved.loosened(margin)
        }));
        fit.bounds.clear();
        fit.visible.clear();
        for corners in &surface.triangles {
            let [a, b, c] = corners.map(|v| from[v as usize]);
            let normal = (b - a).cross(&(c - a));
            // What has no area or has diverged touches nothing; else all would meet all there.
            if normal.dot(&normal) > 0.0 {
                let [a, b, c] = corners.map(|v| reach[v as usize]);
                fit.bounds.push(a.merged(&b).merged(&c));
                fit.visible.push(visible_from(normal));
            } else {
                fit.bounds.push(Aabb::new_invalid());
                fit.visible.push(!0);
            }
        }
        surface.tree.refit(fit);

        pairs.clear();
        new.clear();
        let mut collector = Collector {
            surface,
            from,
            to,
            bounds: reach,
            faces: &fit.bounds,
            thickness,
            reach: thickness + 2.0 * slack,
            old: sides,
            new,
            pairs,
        };
        let visible = &fit.visible;
        let limit = MEETING_LIMIT * surface.triangles.len();
        surface.tree.pairs(fit, limit, &mut |s, t| {
            let shared = surface.triangles[s]
                .iter()
                .any(|v| surface.triangles[t].contains(v));
            if !(shared && visible[s] & visible[t] != 0) {
                collector.meet(s, t);
            }
        });
        collector.keep_pressed_through();
        new.sort_unstable();
        std::mem::swap(new, sides);
    }
}

/// Gathers pairs from triangles that are near each other.
struct Collector<'a> {
    surface: &'a Topology,
    from: &'a [Vec3],
    to: &'a [Vec3],
    bounds: &'a [Aabb],
    faces: &'a [Aabb],
    thickness: f64,
    /// Parts further apart than this [m] cannot touch before the next refresh.
    reach: f64,
    old: &'a [u64],
    new: &'a mut Vec<u64>,
    pairs: &'a mut Vec<Pair>,
}

impl Collector<'_> {
    /// Adds the remembered pairs that face each other on the wrong side, further apart than
    /// what the tree has found: pushed through by a fast press, and not yet back.
    fn keep_pressed_through(&mut self) {
        self.new.sort_unstable();
        let found = self.new.len();
        for &entry in self.old {
            if self.new[..found]
                .binary_search_by_key(&(entry & !1), |k| k & !1)
                .is_ok()
            {
                continue;
            }
            let (kind, [first, second], side) = parts(entry);
            let vertices = match kind {
                Kind::VertexFace => {
                    let [a, b, c] = self.surface.triangles[second as usize];
                    [first, a, b, c]
                }
                Kind::EdgeEdge => {
                    let [[a, b], [c, d]] = [first, second].map(|e| self.surface.edges[e as usize]);
                    [a, b, c, d]
                }
            };
            let Some(gap) = Gap::new(kind, vertices.map(|v| self.from[v as usize])) else {
                continue;
            };
            let through = -side * gap.height;
            if gap.aside <= 0.0 && through > 0.0 && through < FORGET * self.thickness {
                self.new.push(entry);
                self.pairs.push(Pair {
                    kind,
                    vertices,
                    side,
                });
            }
        }
    }

    /// Adds the pairs of the parts that two triangles answer for.
    fn meet(&mut self, s: usize, t: usize) {
        let surface = self.surface;
        for [s, t] in [[s, t], [t, s]] {
            for &p in &surface.owned[s].vertices {
                let [a, b, c] = surface.triangles[t];
                let near = self.bounds[p as usize].intersects(&self.faces[t]);
                if p != a && p != b && p != c && near {
                    self.add(Kind::VertexFace, [p, t as u32], [p, a, b, c]);
                }
            }
        }
        let around = |e: u32| {
            let [a, b] = surface.edges[e as usize].map(|v| self.bounds[v as usize]);
            a.merged(&b)
        };
        for &e in &surface.owned[s].edges {
            let bounds = around(e);
            for &f in &surface.owned[t].edges {
                if !bounds.intersects(&around(f)) {
                    continue;
                }
                let (e, f) = (e.min(f), e.max(f));
                let ([a, b], [c, d]) = (surface.edges[e as usize], surface.edges[f as usize]);
                if a != c && a != d && b != c && b != d {
                    self.add(Kind::EdgeEdge, [e, f], [a, b, c, d]);
                }
            }
        }
    }

    fn add(&mut self, kind: Kind, parts: [u32; 2], vertices: [u32; 4]) {
        if self.pairs.len() >= PAIR_LIMIT * self.surface.vertex_count {
            return;
        }
        let gap = |x: &[Vec3]| Gap::new(kind, vertices.map(|v| x[v as usize]));
        let Some(before) = gap(self.from) else { return };
        let now = gap(self.to).unwrap_or(before);
        let apart = before.height.abs().min(now.height.abs());
        let crossed = before.height * now.height < 0.0;
        let aside = before.aside.min(now.aside);
        if (apart > self.reach && !crossed) || aside > self.reach {
            return;
        }
        let key = key(kind, parts[0], parts[1]);
        let facing = before.aside <= 0.0;
        let remembered = if facing { self.remembered(key) } else { None };
        let inherited = || match kind {
            // Too near to tell: it may have been pressed through just now.
            _ if before.height.abs() >= 0.5 * self.thickness => None,
            Kind::VertexFace => self.side_beside(parts),
            Kind::EdgeEdge => self.side_of_ends(parts, before.normal),
        };
        let side = remembered.or_else(inherited);
        let side = side.unwrap_or(before.height.signum());
        if facing {
            self.new.push(key | u64::from(side > 0.0));
        }
        self.pairs.push(Pair {
            kind,
            vertices,
            side,
        });
    }

    fn remembered(&self, key: u64) -> Option<f64> {
        let found = self.old.partition_point(|&k| k < key);
        let entry = *self.old.get(found)?;
        (entry & !1 == key).then_some(parts(entry).2)
    }

    /// The side of a vertex, as remembered against a triangle next to this one: what slides
    /// along a layer stays on its side.
    fn side_beside(&self, [vertex, triangle]: [u32; 2]) -> Option<f64> {
        let corners = self.surface.triangles[triangle as usize];
        let first = key(Kind::VertexFace, vertex, 0);
        let start = self.old.partition_point(|&k| k < first);
        let mut found = None;
        for &entry in &self.old[start..] {
            if entry >> 32 != first >> 32 {
                break;
            }
            let (_, [_, other], side) = parts(entry);
            let other = other as usize;
            let shared = corners
                .iter()
                .filter(|v| self.surface.triangles[other].contains(v))
                .count();
            if shared == 2 {
                return Some(side);
            }
            if shared == 1 && found.is_none() {
                found = Some(side);
            }
        }
        found
    }

    /// The side of two edges, as remembered of their ends against the triangles beside the
    /// other edge.
    fn side_of_ends(&self, [e, f]: [u32; 2], normal: Vec3) -> Option<f64> {
        let surface = self.surface;
        for (edge, other, turned) in [(e, f, 1.0), (f, e, -1.0)] {
            for &vertex in &surface.edges[edge as usize] {
                for &t in &surface.beside[other as usize] {
                    let Some(side) = self.remembered(key(Kind::VertexFace, vertex, t)) else {
                        continue;
                    };
                    let [a, b, c] = surface.triangles[t as usize].map(|v| self.from[v as usize]);
                    let n = (b - a).cross(&(c - a));
                    let cosine = n.dot(&normal) / n.dot(&n).sqrt().max(1e-30);
                    if cosine.abs() > 0.5 {
                        return Some(turned * side * cosine.signum());
                    }
                }
            }
        }
        None
    }
}
