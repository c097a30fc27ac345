use fixedbitset::FixedBitSet;

use super::solid::Tool;
use super::surface::step;
use crate::math::Vec3;

/// Share of the length of a straight piece of cloth that an edge of the tool may reach through it before
/// it is a feature: 23 degrees between two planes, or a radius of 1.25 lengths.
pub const SMOOTH: f64 = 0.1;

/// Where a tool is finer than the cells of a blank: at convex edges and round small radii, which lie between
/// vertices and reach through the cloth. On nothing else do cells lie deeper than [`SMOOTH`] of their length.
#[derive(Debug)]
pub(crate) struct Features {
    /// Thinnest wall that ends at one of them [m]; infinite where none does.
    pub thinnest: f64,
    /// Corner [m], side [m] and numbers of the boxes in which space is cut up here.
    low: Vec3,
    side: f64,
    dims: [usize; 3],
    /// Those that come within reach of a feature.
    near: FixedBitSet,
}

/// An edge, from end to end, with what is beside it.
struct Edge {
    ends: [Vec3; 2],
    /// Outward normals of its facets, and a place on each [m].
    sides: Vec<(Vec3, Vec3)>,
}

impl Tool {
    /// Features under a blank of cells whose longest side is `length` [m], `between` these corners in x
    /// and y [m], with what lies within `reach` [m] of them; none where the tool is smooth at this scale.
    pub(crate) fn features(
        &self,
        length: f64,
        between: [[f64; 2]; 2],
        reach: f64,
    ) -> Option<Features> {
        let edges = self.sharp_edges(length, between);
        let ends = || edges.iter().flat_map(|edge| edge.ends);
        let first = ends().next()?;
        let (mut low, mut high) = ends().fold((first, first), |(l, h), x| (l.inf(&x), h.sup(&x)));
        for k in 0..2 {
            low[k] = low[k].max(between[0][k]);
            high[k] = high[k].min(between[1][k]);
        }
        let side = 0.5 * reach;
        let margin = Vec3::repeat(reach + side);
        let (low, high) = (low - margin, high + margin);
        let dims = [0, 1, 2].map(|k| ((high[k] - low[k]) / side).ceil().max(1.0) as usize);
        let thickness = |&(normal, at): &(Vec3, Vec3)| self.surface.thickness(at, normal);
        let walls = edges
            .iter()
            .flat_map(|edge| &edge.sides)
            .filter_map(thickness);
        let mut features = Features {
            thinnest: walls.fold(f64::INFINITY, f64::min),
            low,
            side,
            dims,
            near: FixedBitSet::with_capacity(dims.iter().product()),
        };
        for Edge { ends: [a, b], .. } in &edges {
            let count = ((b - a).norm() / side).ceil().max(1.0) as usize;
            for k in 0..=count {
                features.mark(a + (b - a) * (k as f64 / count as f64), reach);
            }
        }
        Some(features)
    }

    /// The convex edges under a blank through which cells of this `length` [m] would let the tool.
    fn sharp_edges(&self, length: f64, between: [[f64; 2]; 2]) -> Vec<Edge> {
        let mesh = &self.mesh;
        let mut beside: Vec<([u32; 2], usize)> = Vec::new();
        for (t, &[a, b, c]) in mesh.triangles.iter().enumerate() {
            let sides = [[a, b], [b, c], [c, a]];
            beside.extend(sides.map(|[v, w]| ([v.min(w), v.max(w)], t)));
        }
        beside.sort_unstable();
        let step = step(mesh);
        let is_open = self.surface.is_open();
        let edge = |beside: &[([u32; 2], usize)]| {
            let [v, w] = beside[0].0;
            let ends = [v, w].map(|v| mesh.vertices[v as usize]);
            let [a, b] = ends;
            let is_apart =
                |k: usize| a[k].max(b[k]) < between[0][k] || a[k].min(b[k]) > between[1][k];
            let along = (b - a).try_normalize(step)?;
            if is_apart(0) || is_apart(1) {
                return None;
            }
            let middle = (a + b) * 0.5;
            let side = |&(_, t): &([u32; 2], usize)| {
                let [p, q, r] = mesh.corners(t);
                let normal = (q - p).cross(&(r - p)).try_normalize(0.0)?;
                let opposite = mesh.triangles[t].iter().find(|&&u| u != v && u != w)?;
                let inwards = mesh.vertices[*opposite as usize] - middle;
                Some((
                    normal,
                    inwards - along * along.dot(&inwards),
                    middle + inwards * 0.1,
                ))
            };
            let found: Vec<(Vec3, Vec3, Vec3)> = beside.iter().filter_map(side).collect();
            let (turn, width) = match &found[..] {
                [(n, p, _), (m, q, _)] if n.dot(q) < 0.0 => (n.angle(m), p.norm().max(q.norm())),
                // Below its border an open mesh goes on straight down.
                [(n, p, _)] if is_open => (n.z.clamp(-1.0, 1.0).asin(), p.norm()),
                _ => return None,
            };
            // How deep a straight piece of the length lies at one edge, or at several that follow each other.
            let through = 0.5
                * (0.5 * turn)
                    .sin()
                    .max(0.25 * turn * length / width.max(step));
            let normal = found.iter().map(|side| side.0).sum::<Vec3>();
            let is_bare = || !self.surface.is_inside(middle + normal * step);
            let sides = found.iter().map(|&(normal, _, at)| (normal, at)).collect();
            (through > SMOOTH && is_bare()).then_some(Edge { ends, sides })
        };
        beside
            .chunk_by(|a, b| a.0 == b.0)
            .filter_map(edge)
            .collect()
    }
}

impl Features {
    /// Marks the boxes that come within `reach` [m] of `x` [m].
    fn mark(&mut self, x: Vec3, reach: f64) {
        let [u, v, w] = [0, 1, 2].map(|k| {
            let box_of = |x: f64| ((x - self.low[k]) / self.side).max(0.0) as usize;
            box_of(x[k] - reach)..=box_of(x[k] + reach).min(self.dims[k] - 1)
        });
        for (i, j, k) in u
            .flat_map(|i| v.clone().map(move |j| (i, j)))
            .flat_map(|(i, j)| w.clone().map(move |k| (i, j, k)))
        {
            self.near.insert(i + self.dims[0] * (j + self.dims[1] * k));
        }
    }

    /// Whether a feature may be within reach of `x` [m].
    pub(crate) fn may_reach(&self, x: Vec3) -> bool {
        let mut number = 0;
        for k in [2, 1, 0] {
            let at = (x[k] - self.low[k]) / self.side;
            if !(at >= 0.0 && at < self.dims[k] as f64) {
                return false;
            }
            number = number * self.dims[k] + at as usize;
        }
        self.near.contains(number)
    }
}
