use parry3d_f64::bounding_volume::{Aabb, BoundingVolume};

use crate::math::Vec3;

/// Triangles in a leaf at most: the two of a cell.
const LEAF: usize = 2;

/// Directions along which a patch may be a height field: the axes and the diagonals of a cube,
/// each both ways. The lower [`DIRECTIONS`] bits of a mask stand for one way, the next for the
/// other.
const DIRECTIONS: usize = 7;
const AXES: [[f64; 3]; DIRECTIONS] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [1.0, 1.0, -1.0],
    [1.0, -1.0, 1.0],
    [1.0, -1.0, -1.0],
];
/// Smallest cosine between a normal and a direction that sees the triangle from its upper side:
/// 80 degrees.
const MIN_COSINE: f64 = 0.17;

/// Directions from which a triangle with this `normal` (of any length) is seen from above.
pub fn visible_from(normal: Vec3) -> u16 {
    let min = MIN_COSINE * normal.norm();
    let mut mask = 0;
    for (k, axis) in AXES.iter().enumerate() {
        let along = normal.dot(&Vec3::from(*axis));
        let limit = if k < 3 { min } else { min * 3f64.sqrt() };
        mask |= u16::from(along > limit) << k;
        mask |= u16::from(along < -limit) << (k + DIRECTIONS);
    }
    mask
}

#[derive(Clone, Debug)]
struct Node {
    /// Triangles below it, a range of [`Tree::order`].
    first: u32,
    last: u32,
    /// The other child; the one follows its parent. 0 in a leaf.
    right: u32,
    /// Least x, y and greatest x, y of its vertices at rest [m].
    rest: [f64; 4],
}

/// A binary tree over the triangles of the flat blank. It halves the blank again and again and
/// never changes; only the boxes around its nodes follow the cloth.
#[derive(Clone, Debug)]
pub struct Tree {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

/// What of a tree follows the cloth, one entry a triangle and a node.
#[derive(Default)]
pub struct Fit {
    pub bounds: Vec<Aabb>,
    /// See [`visible_from`].
    pub visible: Vec<u16>,
    node_bounds: Vec<Aabb>,
    node_visible: Vec<u16>,
}

impl Tree {
    pub fn new(rest: &[[f64; 2]], triangles: &[[u32; 3]]) -> Self {
        let mut tree = Self {
            nodes: Vec::new(),
            order: (0..triangles.len() as u32).collect(),
        };
        tree.split(rest, triangles, 0..triangles.len());
        tree
    }

    fn split(
        &mut self,
        rest: &[[f64; 2]],
        triangles: &[[u32; 3]],
        range: std::ops::Range<usize>,
    ) -> u32 {
        let inf = f64::INFINITY;
        let mut area = [inf, inf, -inf, -inf];
        for &t in &self.order[range.clone()] {
            for v in triangles[t as usize] {
                let x = rest[v as usize];
                for k in 0..2 {
                    area[k] = area[k].min(x[k]);
                    area[k + 2] = area[k + 2].max(x[k]);
                }
            }
        }
        let index = self.nodes.len();
        self.nodes.push(Node {
            first: range.start as u32,
            last: range.end as u32,
            right: 0,
            rest: area,
        });
        if range.len() > LEAF {
            let k = usize::from(area[3] - area[1] > area[2] - area[0]);
            let centre = |t: &u32| -> f64 {
                let corners = triangles[*t as usize];
                corners.iter().map(|&v| rest[v as usize][k]).sum()
            };
            let by_place = |a: &u32, b: &u32| centre(a).total_cmp(&centre(b)).then(a.cmp(b));
            self.order[range.clone()].sort_unstable_by(by_place);
            let middle = range.start + range.len() / 2;
            self.split(rest, triangles, range.start..middle);
            self.nodes[index].right = self.split(rest, triangles, middle..range.end);
        }
        index as u32
    }

    /// Fits the boxes of the nodes to those of the triangles.
    pub fn refit(&self, fit: &mut Fit) {
        fit.node_bounds
            .resize(self.nodes.len(), Aabb::new_invalid());
        fit.node_visible.resize(self.nodes.len(), 0);
        // Children follow their parents.
        for (index, node) in self.nodes.iter().enumerate().rev() {
            let (bounds, visible) = if node.right == 0 {
                let below = &self.order[node.first as usize..node.last as usize];
                below.iter().fold((Aabb::new_invalid(), !0), |(b, m), &t| {
                    let t = t as usize;
                    (b.merged(&fit.bounds[t]), m & fit.visible[t])
                })
            } else {
                let [l, r] = [index + 1, node.right as usize];
                (
                    fit.node_bounds[l].merged(&fit.node_bounds[r]),
                    fit.node_visible[l] & fit.node_visible[r],
                )
            };
            fit.node_bounds[index] = bounds;
            fit.node_visible[index] = visible;
        }
    }

    /// Calls `near` for pairs of triangles whose boxes overlap, each pair once, until it has
    /// seen `limit` of them.
    ///
    /// Left out is what cannot touch: parts of a patch that is a height field along some
    /// direction (Volino and Magnenat-Thalmann 1994, without their test of the contour).
    pub fn pairs(&self, fit: &Fit, limit: usize, near: &mut impl FnMut(usize, usize)) {
        let mut left = limit;
        self.within(0, fit, &mut left, near);
    }

    fn within(
        &self,
        index: usize,
        fit: &Fit,
        left: &mut usize,
        near: &mut impl FnMut(usize, usize),
    ) {
        if fit.node_visible[index] != 0 {
            return;
        }
        let node = &self.nodes[index];
        if node.right == 0 {
            let below = &self.order[node.first as usize..node.last as usize];
            for (i, &s) in below.iter().enumerate() {
                for &t in &below[i + 1..] {
                    meet([s, t], fit, left, near);
                }
            }
            return;
        }
        self.within(index + 1, fit, left, near);
        self.within(node.right as usize, fit, left, near);
        self.between([index + 1, node.right as usize], fit, left, near);
    }

    fn between(
        &self,
        [a, b]: [usize; 2],
        fit: &Fit,
        left: &mut usize,
        near: &mut impl FnMut(usize, usize),
    ) {
        if *left == 0 || !fit.node_bounds[a].intersects(&fit.node_bounds[b]) {
            return;
        }
        let (p, q) = (&self.nodes[a], &self.nodes[b]);
        let touching = (0..2).all(|k| p.rest[k] <= q.rest[k + 2] && q.rest[k] <= p.rest[k + 2]);
        if touching && fit.node_visible[a] & fit.node_visible[b] != 0 {
            return;
        }
        let larger = |p: &Node, q: &Node| p.last - p.first >= q.last - q.first;
        if p.right != 0 && (q.right == 0 || larger(p, q)) {
            self.between([a + 1, b], fit, left, near);
            self.between([p.right as usize, b], fit, left, near);
        } else if q.right != 0 {
            self.between([a, b + 1], fit, left, near);
            self.between([a, q.right as usize], fit, left, near);
        } else {
            for &s in &self.order[p.first as usize..p.last as usize] {
                for &t in &self.order[q.first as usize..q.last as usize] {
                    meet([s, t], fit, left, near);
                }
            }
        }
    }
}

fn meet(pair: [u32; 2], fit: &Fit, left: &mut usize, near: &mut impl FnMut(usize, usize)) {
    let [s, t] = pair.map(|t| t as usize);
    if *left > 0 && fit.bounds[s].intersects(&fit.bounds[t]) {
        *left -= 1;
        near(s, t);
    }
}
