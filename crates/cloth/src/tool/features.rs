use std::collections::HashSet;

use rayon::prelude::*;

use super::solid::Tool;
use super::surface::step;
use crate::math::Vec3;

/// Share of the length of a straight piece of cloth that an edge of the tool may reach through it before
/// it is a feature: 35 degrees between two planes, or a radius of 0.8 lengths.
pub const SMOOTH: f64 = 0.15;

/// Where a tool is finer than the cells of a blank: at convex edges and round small radii, which lie between
/// vertices and reach through the cloth. On nothing else do cells lie deeper than [`SMOOTH`] of their length.
#[derive(Debug)]
pub(crate) struct Features {
    /// Thinnest wall that ends at one of them [m]; infinite where none does.
    pub thinnest: f64,
    /// Steepest slope of a tip [-]; 0 where there are none.
    pub steepest: f64,
    /// What lies near, by how near that is.
    pub zones: [Zone; 2],
}

/// What lies within reach of a feature.
#[derive(Debug)]
pub(crate) struct Zone {
    /// [m]
    reach: f64,
    /// Numbers of the cubes of half that side that lie near, and of the columns that have one.
    cubes: HashSet<[i32; 3]>,
    columns: HashSet<[i32; 2]>,
}

/// An edge, from end to end, or a tip, whose ends are one.
struct Edge {
    ends: [Vec3; 2],
    /// Outward normals of its facets, and places on each along the edge [m].
    sides: Vec<(Vec3, Vec3)>,
}

/// A facet beside an edge.
struct Side {
    normal: Vec3,
    /// Its third corner [m], and the way there straight from the edge [m].
    opposite: Vec3,
    inwards: Vec3,
}

impl Tool {
    /// Features under a blank of cells whose longest side is `length` [m], `between` these corners in x
    /// and y [m], with what lies within each `reach` [m] of them; none where the tool is smooth at this scale.
    pub(crate) fn features(
        &self,
        length: f64,
        between: [[f64; 2]; 2],
        reach: [f64; 2],
    ) -> Option<Features> {
        let mut edges = self.sharp_edges(length, between);
        let tips = self.tips(between);
        let steepest = tips.iter().map(|&(_, slope)| slope).fold(0.0, f64::max);
        edges.extend(tips.into_iter().map(|(tip, _)| tip));
        if edges.is_empty() {
            return None;
        }
        let thickness = |&(normal, at): &(Vec3, Vec3)| self.surface.thickness(at, normal);
        let walls: Vec<f64> = (edges.par_iter())
            .flat_map_iter(|edge| edge.sides.iter().filter_map(thickness))
            .collect();
        Some(Features {
            thinnest: walls.into_iter().fold(f64::INFINITY, f64::min),
            steepest,
            zones: reach.map(|reach| Zone::new(&edges, between, reach)),
        })
    }

    /// The convex edges under a blank through which cells of this `length` [m] would let the tool.
    fn sharp_edges(&self, length: f64, between: [[f64; 2]; 2]) -> Vec<Edge> {
        let mesh = &self.mesh;
        let mut beside: Vec<([u32; 2], usize)> = Vec::new();
        for (t, &[a, b, c]) in mesh.triangles.iter().enumerate() {
            let sides = [[a, b], [b, c], [c, a]];
            beside.extend(sides.map(|[v, w]| ([v.min(w), v.max(w)], t)));
        }
        beside.par_sort_unstable();
        let step = step(mesh);
        let edge = |beside: &[([u32; 2], usize)]| {
            let ends = beside[0].0.map(|v| mesh.vertices[v as usize]);
            let [a, b] = ends;
            let along = (b - a).try_normalize(step)?;
            if is_apart(ends, between) {
                return None;
            }
            let middle = (a + b) * 0.5;
            let side = |corners: [Vec3; 3], opposite: Vec3| {
                let [p, q, r] = corners;
                let inwards = opposite - middle;
                Some(Side {
                    normal: (q - p).cross(&(r - p)).try_normalize(0.0)?,
                    opposite,
                    inwards: inwards - along * along.dot(&inwards),
                })
            };
            let of_mesh = |&([v, w], t): &([u32; 2], usize)| {
                let other = mesh.triangles[t].iter().find(|&&u| u != v && u != w)?;
                side(mesh.corners(t), mesh.vertices[*other as usize])
            };
            let mut found: Vec<Side> = beside.iter().filter_map(of_mesh).collect();
            if let [one] = &found[..] {
                // Across a crack.
                let near = self.surface.near(middle, 10.0 * step).into_iter();
                let near = near.filter(|(number, ..)| number.is_some());
                let sides = near.filter_map(|(.., [p, q, r])| side([p, q, r], (p + q + r) / 3.0));
                let is_other = |s: &Side| {
                    one.normal.dot(&s.normal) < 0.999 || one.inwards.dot(&s.inwards) < 0.0
                };
                found.extend({ sides }.find(is_other));
            }
            // How far the surface turns, and how far it then goes on.
            let (turn, width, wall) = match &found[..] {
                [one, other] if one.normal.dot(&other.inwards) < 0.0 => {
                    let width = one.inwards.norm().max(other.inwards.norm());
                    (one.normal.angle(&other.normal), width, None)
                }
                // Below its border an open mesh goes on straight down.
                [one] if self.surface.is_open() => {
                    let outwards = -Vec3::new(one.inwards.x, one.inwards.y, 0.0);
                    let wall = outwards.try_normalize(step)?;
                    (one.normal.angle(&wall), one.inwards.norm(), Some(wall))
                }
                _ => return None,
            };
            // How deep a straight piece of the length lies at one edge, or at several that follow each other.
            let normal =
                found.iter().map(|side| side.normal).sum::<Vec3>() + wall.unwrap_or_default();
            let normal = normal.try_normalize(0.0)?;
            let is_sharp = 0.5 * (0.5 * turn).sin() > SMOOTH;
            let is_round = || {
                // Not the roughness of a scan: there such a piece ends in the tool.
                let [down, across] = [
                    normal * (SMOOTH * length),
                    along.cross(&normal) * (0.5 * length),
                ];
                let is_free = |x: Vec3| !self.surface.is_inside(x);
                0.125 * turn * length / width.max(step) > SMOOTH
                    && (is_free(middle - down + across) || is_free(middle - down - across))
            };
            if !is_sharp && !is_round() {
                return None;
            }
            let count = ((b - a).norm() / length).ceil().max(1.0) as usize;
            let places = (0..count).map(|k| a + (b - a) * ((k as f64 + 0.5) / count as f64));
            let is_bare = |x: &Vec3| !self.surface.is_inside(x + normal * step);
            let mut sides = Vec::new();
            for x in places.filter(is_bare) {
                sides.extend(found.iter().map(|s| (s.normal, x + (s.opposite - x) * 0.1)));
                sides.extend(wall.map(|wall| (wall, x - Vec3::z() * (0.1 * length))));
            }
            (!sides.is_empty()).then_some(Edge { ends, sides })
        };
        let edges: Vec<_> = beside.chunk_by(|a, b| a.0 == b.0).collect();
        edges.into_par_iter().filter_map(edge).collect()
    }

    /// The tips under a blank, where no edge need be sharp, and how steep they are [-].
    fn tips(&self, between: [[f64; 2]; 2]) -> Vec<(Edge, f64)> {
        let mesh = &self.mesh;
        let normals = mesh.vertex_normals();
        let step = step(mesh);
        // Of each vertex: whether nothing beside it rises over it, and its facets.
        let mut found = vec![(true, Vec::new()); mesh.vertices.len()];
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            let corners = mesh.corners(t);
            let [a, b, c] = corners;
            let Some(n) = (b - a).cross(&(c - a)).try_normalize(0.0) else {
                continue;
            };
            for (&v, at) in triangle.iter().zip(corners) {
                let m = normals[v as usize];
                let (is_tip, sides) = &mut found[v as usize];
                let is_steep = 0.5 * n.cross(&m).norm() > SMOOTH;
                *is_tip &= is_steep && corners.iter().all(|x| m.dot(&(x - at)) <= step);
                sides.push((n, at + ((a + b + c) / 3.0 - at) * 0.1));
            }
        }
        let tip = |(v, (is_tip, sides)): (usize, (bool, Vec<(Vec3, Vec3)>))| {
            let (x, m) = (mesh.vertices[v], normals[v]);
            let slopes = sides
                .iter()
                .map(|(n, _)| n.cross(&m).norm() / n.dot(&m).max(0.01));
            let slope = slopes.fold(0.0, f64::max);
            let is_left = is_tip && slope > 0.0 && !is_apart([x; 2], between);
            let is_bare = is_left && !self.surface.is_inside(x + m * step);
            let ends = [x; 2];
            is_bare.then_some((Edge { ends, sides }, slope))
        };
        found.into_iter().enumerate().filter_map(tip).collect()
    }
}

/// Whether the box about two points lies beside a rectangle in x and y.
fn is_apart([a, b]: [Vec3; 2], between: [[f64; 2]; 2]) -> bool {
    let is_apart = |k: usize| a[k].max(b[k]) < between[0][k] || a[k].min(b[k]) > between[1][k];
    is_apart(0) || is_apart(1)
}

impl Zone {
    fn new(edges: &[Edge], between: [[f64; 2]; 2], reach: f64) -> Self {
        let (cubes, columns) = (HashSet::new(), HashSet::new());
        let mut zone = Self {
            reach,
            cubes,
            columns,
        };
        let is_under = |x: &Vec3| {
            (0..2).all(|k| (between[0][k] - reach..=between[1][k] + reach).contains(&x[k]))
        };
        for Edge { ends: [a, b], .. } in edges {
            let count = (2.0 * (b - a).norm() / reach).ceil().max(1.0) as usize;
            let places = (0..=count).map(|k| a + (b - a) * (k as f64 / count as f64));
            places.filter(is_under).for_each(|x| zone.mark(x));
        }
        zone
    }

    fn mark(&mut self, x: Vec3) {
        let reach = Vec3::repeat(self.reach);
        let (from, to) = (self.cube(x - reach), self.cube(x + reach));
        for i in from[0]..=to[0] {
            for j in from[1]..=to[1] {
                self.columns.insert([i, j]);
                self.cubes.extend((from[2]..=to[2]).map(|k| [i, j, k]));
            }
        }
    }

    /// Whether a feature may be within reach of `x` [m].
    pub(crate) fn has(&self, x: Vec3) -> bool {
        self.cubes.contains(&self.cube(x))
    }

    /// Whether a feature may be within reach of a place over or under `x` [m].
    pub(crate) fn has_column(&self, x: Vec3) -> bool {
        let [i, j, _] = self.cube(x);
        self.columns.contains(&[i, j])
    }

    fn cube(&self, x: Vec3) -> [i32; 3] {
        [0, 1, 2].map(|k| (2.0 * x[k] / self.reach).floor() as i32)
    }
}
