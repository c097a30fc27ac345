//! From an outline to the cells of a blank.
//!
//! The grid lies along the yarns, centred on the outline's extent. Nodes inside the outline,
//! or outside by less than [`OVERHANG`], become vertices; those on the border of the mesh
//! then move on to the nearest point of the outline, and the nearest of them into its
//! corners. Lengths are in cells throughout, so that quality does not depend on their size.

use std::collections::{BTreeMap, HashSet};

use super::blank::{CutFault, MAX_VERTICES};
use super::grid::Grid;
use super::outline::{Outline, Point, crossing, sides};
use crate::mesh::{TriMesh, border, patches};

/// A node outside the outline by less than this becomes a vertex: no row of cells at the border of a
/// rectangle is then left out and those beside it widened, which strain more than squeezed ones.
const OVERHANG: f64 = 0.5;
/// A node moves at most this far on to the outline, and into a corner of it.
const REACH: f64 = 0.9;
/// The outline turns by at least this much at a corner: cosine of 30 degrees.
const CORNER: f64 = 0.866;
/// Least quality of a triangle, 4 sqrt 3 area / (sum of squared sides): 0.87 for half a square. No
/// angle is then below 13 degrees. Where it would be missed, vertices stay short of the outline.
pub(super) const MIN_QUALITY: f64 = 0.4;
/// A vertex that moves less than this stays where it is.
const STILL: f64 = 1e-6;
/// Parts of the mesh of up to this many triangles are tips thinner than a cell, and dropped.
const TIP: usize = 4;

/// The cell between four nodes.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Cell {
    /// A rectangle between yarns.
    Whole,
    /// Half of one: yarns run along two of its sides, the third is the border.
    Half([u32; 3]),
    /// Triangles of vertices that do not stand on a regular grid: none where the blank has
    /// been cut away. Counter-clockwise.
    Cut(Vec<[u32; 3]>),
}

/// A blank before it is woven.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cells {
    pub grid: Grid,
    /// Place of each vertex on the flat blank [m].
    pub rest: Vec<Point>,
    /// Row by row.
    pub cells: Vec<Cell>,
}

impl Cells {
    /// A rectangle of `size` [m] around the origin, its sides along the grid.
    pub fn rectangle(size: [f64; 2], [columns, rows]: [usize; 2], cell: [f64; 2]) -> Self {
        let place = |v: usize| {
            let [s, t] = [v % columns, v / columns].map(|k| k as f64);
            [s * cell[0] - 0.5 * size[0], t * cell[1] - 0.5 * size[1]]
        };
        let nodes = 0..(rows * columns) as u32;
        Self {
            grid: Grid::new([columns, rows], cell, nodes.collect()),
            rest: (0..rows * columns).map(place).collect(),
            cells: vec![Cell::Whole; (rows - 1) * (columns - 1)],
        }
    }

    /// Cuts along `outline` with rows of cells of sides `cell` [m] at `angle` [rad] to x.
    pub fn new(outline: &Outline, cell: [f64; 2], angle: f64) -> Result<Self, CutFault> {
        let (sin, cos) = angle.sin_cos();
        let turned =
            outline.mapped(|[x, y]| [(cos * x + sin * y) / cell[0], (cos * y - sin * x) / cell[1]]);
        let fold = |k: usize, f: fn(f64, f64) -> f64| {
            let along = turned.iter().flatten().map(|p| p[k]);
            along.reduce(f).expect("has points")
        };
        let low = [0, 1].map(|k| fold(k, f64::min));
        let extent = [0, 1].map(|k| fold(k, f64::max) - low[k]);
        // A hair less, so that rounding does not add a column beside the outline.
        let [columns, rows] = extent.map(|e| ((e - STILL).ceil() as usize + 1).max(2));
        if columns.max(rows) > MAX_VERTICES {
            return Err(CutFault::Fine(columns.max(rows)));
        }
        let counts = [columns, rows];
        let origin = [0, 1].map(|k| low[k] + 0.5 * extent[k] - 0.5 * (counts[k] - 1) as f64);
        let shift = |p: &Point| [p[0] - origin[0], p[1] - origin[1]];
        let shifted = |one: &Vec<Point>| one.iter().map(shift).collect();
        let loops: Vec<Vec<Point>> = turned.iter().map(shifted).collect();

        let snapped = Cutter::new(loops, columns, rows).cut()?;
        let place = |[s, t]: Point| {
            let [s, t] = [(s + origin[0]) * cell[0], (t + origin[1]) * cell[1]];
            [cos * s - sin * t, sin * s + cos * t]
        };
        let mut nodes: Vec<u32> = snapped.triangles.concat().concat();
        nodes.sort_unstable();
        nodes.dedup();
        let grid = Grid::new(counts, cell, nodes.clone());
        let vertex = |node: u32| {
            let node = node as usize;
            grid.vertex_at(node / columns, node % columns)
                .expect("it is one of the nodes")
        };
        let cells = snapped.triangles.iter().map(|triangles| {
            let mut nodes = triangles.iter().flatten();
            let moved = nodes.any(|&n| snapped.moved[n as usize]);
            match triangles[..] {
                [_, _] if !moved => Cell::Whole,
                [half] if !moved => Cell::Half(half.map(vertex)),
                _ => Cell::Cut(triangles.iter().map(|t| t.map(vertex)).collect()),
            }
        });
        let cells = cells.collect();
        let rest = nodes.iter().map(|&n| place(snapped.position[n as usize]));
        Ok(Self {
            rest: rest.collect(),
            grid,
            cells,
        })
    }
}

/// Nodes, the outline, and what is known of their places, in cells.
struct Cutter {
    loops: Vec<Vec<Point>>,
    columns: usize,
    rows: usize,
    /// Nearest point of the outline within one cell of each node.
    nearest: Vec<Option<Point>>,
    kept: Vec<bool>,
}

/// A mesh whose border lies on the outline. Everything is by node.
struct Snapped {
    position: Vec<Point>,
    moved: Vec<bool>,
    /// Triangles of each cell.
    triangles: Vec<Vec<[u32; 3]>>,
}

impl Cutter {
    fn new(loops: Vec<Vec<Point>>, columns: usize, rows: usize) -> Self {
        let mut cutter = Self {
            loops,
            columns,
            rows,
            nearest: vec![None; columns * rows],
            kept: vec![false; columns * rows],
        };
        cutter.find_inside();
        cutter.find_nearest();
        for node in 0..columns * rows {
            if let Some(near) = cutter.nearest[node] {
                cutter.kept[node] |= distance(near, cutter.place(node)) < OVERHANG;
            }
        }
        cutter
    }

    fn place(&self, node: usize) -> Point {
        [(node % self.columns) as f64, (node / self.columns) as f64]
    }

    /// Keeps the nodes between an odd and an even crossing of their row with the outline.
    fn find_inside(&mut self) {
        for row in 0..self.rows {
            let y = row as f64;
            let edges = self.loops.iter().flat_map(|one| sides(one));
            let crossings = edges.filter_map(|edge| crossing(edge, y));
            let mut crossings: Vec<f64> = crossings.collect();
            crossings.sort_by(f64::total_cmp);
            for pair in crossings.chunks_exact(2) {
                let first = pair[0].ceil().max(0.0) as usize;
                let columns = (first..self.columns).take_while(|&c| c as f64 <= pair[1]);
                columns.for_each(|column| self.kept[row * self.columns + column] = true);
            }
        }
    }

    fn find_nearest(&mut self) {
        let counts = [self.columns, self.rows];
        for [a, b] in self.loops.iter().flat_map(|one| sides(one)) {
            let range = |k: usize| {
                let first = (a[k].min(b[k]) - 1.0).ceil().max(0.0) as usize;
                let last = (a[k].max(b[k]) + 1.0).floor().max(0.0) as usize;
                first..=last.min(counts[k] - 1)
            };
            for row in range(1) {
                for column in range(0) {
                    let node = row * self.columns + column;
                    let place = [column as f64, row as f64];
                    let point = nearest_on(a, b, place);
                    let is_nearer = |best| distance(point, place) < distance(best, place);
                    if self.nearest[node].is_none_or(is_nearer) {
                        self.nearest[node] = Some(point);
                    }
                }
            }
        }
    }

    /// Nodes at the corners of a cell, counter-clockwise from the lowest row and column; none
    /// where they are not kept.
    fn corners(&self, cell: usize) -> [Option<u32>; 4] {
        let (row, column) = (cell / (self.columns - 1), cell % (self.columns - 1));
        let first = row * self.columns + column;
        [0, 1, self.columns + 1, self.columns]
            .map(|step| first + step)
            .map(|node| self.kept[node].then_some(node as u32))
    }

    fn cut(mut self) -> Result<Snapped, CutFault> {
        let cell_count = (self.columns - 1) * (self.rows - 1);
        let mut triangles: Vec<Vec<[u32; 3]>> = (0..cell_count)
            .map(|cell| fill(self.corners(cell), |_| 1.0))
            .collect();
        keep_parts(&mut triangles)?;
        let mut used = vec![false; self.kept.len()];
        for &node in triangles.iter().flatten().flatten() {
            used[node as usize] = true;
        }
        self.kept = used;

        let mesh = TriMesh {
            triangles: triangles.concat(),
            ..TriMesh::default()
        };
        let border = border(&mesh).expect("all cells are counter-clockwise");
        let (found, expected) = (loop_count(&border)?, self.loops.len());
        if found != expected {
            return Err(CutFault::Loops { found, expected });
        }
        let mut nodes: Vec<usize> = border.iter().map(|&[a, _]| a as usize).collect();
        nodes.sort_unstable();
        Ok(self.snap(triangles, &self.targets(&nodes)))
    }

    /// Where the nodes of the border go.
    fn targets(&self, border: &[usize]) -> BTreeMap<usize, Point> {
        let near = border.iter().filter_map(|&node| {
            let near = self.nearest[node]?;
            (distance(near, self.place(node)) < REACH).then_some((node, near))
        });
        let mut targets: BTreeMap<usize, Point> = near.collect();
        let mut taken: BTreeMap<usize, Point> = BTreeMap::new();
        for corner in self.loops.iter().flat_map(|one| corners(one)) {
            let away = |&node: &usize| (distance(corner, self.place(node)), node);
            let nearest = border.iter().map(away).min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((away, node)) = nearest.filter(|(away, _)| *away < REACH) else {
                continue;
            };
            let nearer = |other: &Point| distance(*other, self.place(node)) <= away;
            if !taken.get(&node).is_some_and(nearer) {
                taken.insert(node, corner);
            }
        }
        targets.append(&mut taken);
        targets.retain(|&node, target| distance(*target, self.place(node)) > STILL);
        targets
    }

    /// Moves nodes to their targets, or part of the distance where triangles would become worse
    /// than [`MIN_QUALITY`]. Without any motion all triangles are halves of cells, so this ends.
    fn snap(&self, mut triangles: Vec<Vec<[u32; 3]>>, targets: &BTreeMap<usize, Point>) -> Snapped {
        let mut share: BTreeMap<usize, f64> = targets.keys().map(|&node| (node, 1.0)).collect();
        let mut position: Vec<Point> = (0..self.kept.len()).map(|n| self.place(n)).collect();
        loop {
            for (&node, share) in &share {
                let (from, to) = (self.place(node), targets[&node]);
                position[node] = [0, 1].map(|k| from[k] + share * (to[k] - from[k]));
            }
            let at = |t: &[u32; 3]| quality(t.map(|node| position[node as usize]));
            let mut bad = Vec::new();
            for (cell, triangles) in triangles.iter_mut().enumerate() {
                let corners = self.corners(cell);
                // Cells whose third triangle was a tip keep what they have.
                if triangles.len() == 2 {
                    *triangles = fill(corners, at);
                }
                bad.extend(triangles.iter().filter(|t| at(t) < MIN_QUALITY).flatten());
            }
            bad.sort_unstable();
            bad.dedup();
            bad.retain(|&node: &u32| share.get(&(node as usize)).is_some_and(|&s| s > 0.0));
            if bad.is_empty() {
                break;
            }
            for node in bad {
                let share = share.get_mut(&(node as usize)).expect("it has one");
                *share = if *share < 0.1 { 0.0 } else { 0.7 * *share };
            }
        }
        let mut moved = vec![false; position.len()];
        for (node, share) in share {
            moved[node] = share > 0.0;
        }
        Snapped {
            position,
            moved,
            triangles,
        }
    }
}

/// Fills a cell: one triangle of three corners, two of four, by the diagonal whose worse triangle
/// is better (the rising one where both are alike).
fn fill(corners: [Option<u32>; 4], quality: impl Fn(&[u32; 3]) -> f64) -> Vec<[u32; 3]> {
    match corners {
        [Some(a), Some(b), Some(d), Some(c)] => {
            let rising = [[a, b, d], [a, d, c]];
            let falling = [[a, b, c], [b, d, c]];
            let [up, down] =
                [&rising, &falling].map(|pair| quality(&pair[0]).min(quality(&pair[1])));
            // A hair better is rounding.
            if down > up + 1e-9 { falling } else { rising }.into()
        }
        _ => {
            let left: Vec<u32> = corners.into_iter().flatten().collect();
            <[u32; 3]>::try_from(left).into_iter().collect()
        }
    }
}

/// Drops tips that hang on to nothing and refuses a mesh of several parts.
fn keep_parts(triangles: &mut [Vec<[u32; 3]>]) -> Result<(), CutFault> {
    let all: Vec<[u32; 3]> = triangles.concat();
    let mut beside: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    let mut neighbors = vec![Vec::new(); all.len()];
    for (index, t) in all.iter().enumerate() {
        for [a, b] in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
            match beside.remove(&[b, a]) {
                Some(other) => {
                    neighbors[index].push(other);
                    neighbors[other].push(index);
                }
                None => {
                    beside.insert([a, b], index);
                }
            }
        }
    }
    let mut open = vec![true; all.len()];
    let parts = patches(&mut open, |index| neighbors[index].iter().copied());
    let largest = (0..parts.len()).max_by_key(|&p| (parts[p].len(), usize::MAX - p));
    let largest = largest.ok_or(CutFault::Empty)?;
    let is_part = |p: &usize| *p == largest || parts[*p].len() > TIP;
    let count = (0..parts.len()).filter(is_part).count();
    if count > 1 {
        return Err(CutFault::Parts(count));
    }
    let kept: HashSet<usize> = parts[largest].iter().copied().collect();
    let mut index = 0..;
    for triangles in triangles {
        triangles.retain(|_| index.next().is_some_and(|index| kept.contains(&index)));
    }
    Ok(())
}

/// Number of closed loops of a border.
fn loop_count(border: &[[u32; 2]]) -> Result<usize, CutFault> {
    let mut next: BTreeMap<u32, u32> = BTreeMap::new();
    for &[a, b] in border {
        if next.insert(a, b).is_some() {
            return Err(CutFault::Pinched);
        }
    }
    let mut count = 0;
    while let Some((first, mut at)) = next.pop_first() {
        count += 1;
        while at != first {
            at = next.remove(&at).expect("borders are closed");
        }
    }
    Ok(count)
}

/// Points of a loop at which it turns sharply.
fn corners(points: &[Point]) -> Vec<Point> {
    let count = points.len();
    let is_sharp = |i: &usize| {
        let [a, b, c] = [i + count - 1, *i, i + 1].map(|j| points[j % count]);
        let [u, v] = [[b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]];
        let lengths = u[0].hypot(u[1]) * v[0].hypot(v[1]);
        u[0] * v[0] + u[1] * v[1] < CORNER * lengths
    };
    (0..count).filter(is_sharp).map(|i| points[i]).collect()
}

fn distance(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn nearest_on(a: Point, b: Point, p: Point) -> Point {
    let [u, v] = [[b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]];
    let along = (u[0] * v[0] + u[1] * v[1]) / (u[0] * u[0] + u[1] * u[1]);
    let along = along.clamp(0.0, 1.0);
    [a[0] + along * u[0], a[1] + along * u[1]]
}

/// See [`MIN_QUALITY`]; negative for triangles that are turned over.
fn quality([a, b, c]: [Point; 3]) -> f64 {
    let area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
    let squares = distance(a, b).powi(2) + distance(b, c).powi(2) + distance(c, a).powi(2);
    4.0 * 3f64.sqrt() * area / squares
}

#[cfg(test)]
mod tests;
