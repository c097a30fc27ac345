//! Holes of a mesh: the borders round them, and facets that close them.

use std::collections::{HashMap, HashSet};

use drape_cloth::math::Vec3;

use super::twins::{doubled_area, undirected};

/// Most corners of a hole whose facets are all chosen at once, in the cube of their number; longer ones are cut first.
const MOST: usize = 500;
/// Facets flatter than this (height over longest edge) close nothing: single precision has no normal for them.
const FLAT: f64 = 1e-4;
/// Among facets of equal area, how much the squares of edges weigh: too little for facets that overlap.
const SHORT: f64 = 1e-3;

/// The closed ways along directed edges, each through a vertex once. Where several go on, the first of `edges` does:
/// the numbers of the vertices decide nothing.
pub fn loops(edges: Vec<[u32; 2]>) -> Vec<Vec<u32>> {
    let mut leaving: HashMap<u32, Vec<u32>> = HashMap::new();
    for &[from, to] in edges.iter().rev() {
        leaving.entry(from).or_default().push(to);
    }
    let mut loops = Vec::new();
    for [first, _] in edges {
        let (mut path, mut places, mut at) = (Vec::new(), HashMap::new(), first);
        loop {
            if let Some(&start) = places.get(&at) {
                let closed = path.split_off(start);
                closed.iter().for_each(|v| _ = places.remove(v));
                loops.push(closed);
            }
            let Some(next) = leaving.get_mut(&at).and_then(Vec::pop) else {
                break;
            };
            places.insert(at, path.len());
            path.push(at);
            at = next;
        }
    }
    loops
}

/// Area that a border goes round, seen from where that is largest [m²].
pub fn within(x: &[Vec3], border: &[u32]) -> f64 {
    let origin = x[border[0] as usize];
    let ends = border.iter().zip(border.iter().cycle().skip(1));
    let area = ends.map(|(&a, &b)| (x[a as usize] - origin).cross(&(x[b as usize] - origin)));
    0.5 * area.sum::<Vec3>().norm()
}

/// Facets that close a hole, of least area, against the direction of its border; no edge of theirs is among `edges`
/// yet, where it is then. None if there are none, as for a crack without width.
pub fn fill(x: &[Vec3], border: &[u32], edges: &mut HashSet<[u32; 2]>) -> Option<Vec<[u32; 3]>> {
    let mut facets = Vec::new();
    let mut pieces = vec![border.to_vec()];
    while let Some(piece) = pieces.pop() {
        match piece.len() > MOST {
            true => pieces.extend(cut(x, &piece, edges)?),
            false => facets.extend(least_area(x, &piece, edges)?),
        }
    }
    for &[a, b, c] in &facets {
        edges.extend([[a, b], [b, c], [c, a]].map(undirected));
    }
    Some(facets)
}

/// Cuts a border in two by its shortest chord between opposite sides, from corners that look into the hole, if there
/// are any, so that the chord lies in it.
fn cut(x: &[Vec3], border: &[u32], edges: &HashSet<[u32; 2]>) -> Option<[Vec<u32>; 2]> {
    let count = border.len();
    let at = |i: usize| x[border[i % count] as usize];
    let corner = |i: usize| doubled_area([at(i), at(i + 1), at(i + 2)]);
    let normal = (1..count - 1)
        .map(|i| doubled_area([at(0), at(i), at(i + 1)]))
        .sum();
    let looks_out = |i: usize| usize::from(corner(i + count - 1).dot(&normal) > 0.0);
    let mut best = ((3, f64::INFINITY), 0, 0);
    for i in 0..count {
        for j in i + count / 4..count.min(i + count - count / 4) {
            let cost = (looks_out(i) + looks_out(j), (at(i) - at(j)).norm_squared());
            if cost < best.0 && !edges.contains(&undirected([border[i], border[j]])) {
                best = (cost, i, j);
            }
        }
    }
    let ((kind, _), i, j) = best;
    let rest = border[j..].iter().chain(&border[..=i]).copied();
    (kind < 3).then(|| [border[i..=j].to_vec(), rest.collect()])
}

/// The facets of least area over a closed border (Barequet and Sharir, Computer Aided Geometric Design 1995, 12,
/// 207).
fn least_area(x: &[Vec3], border: &[u32], edges: &HashSet<[u32; 2]>) -> Option<Vec<[u32; 3]>> {
    let count = border.len();
    let at = |i: usize| x[border[i] as usize];
    // Of the polygon from corner i to corner j: its least cost and the third corner of the facet at its chord.
    let mut least = vec![(0.0, 0); count * count];
    for length in 2..count {
        for i in 0..count - length {
            let j = i + length;
            let (a, b) = (border[i], border[j]);
            let is_border = (i, j) == (0, count - 1);
            let mut best = (f64::INFINITY, 0);
            if is_border || !edges.contains(&undirected([a, b])) {
                let chord = (at(j) - at(i)).norm_squared();
                for k in i + 1..j {
                    let longest = (at(k) - at(i))
                        .norm_squared()
                        .max((at(k) - at(j)).norm_squared());
                    let area = doubled_area([at(i), at(k), at(j)]).norm();
                    let cost =
                        least[i * count + k].0 + least[k * count + j].0 + area + SHORT * chord;
                    if cost < best.0 && area > FLAT * longest.max(chord) {
                        best = (cost, k);
                    }
                }
            }
            least[i * count + j] = best;
        }
    }
    let mut facets = Vec::with_capacity(count - 2);
    let mut open = vec![(0, count - 1)];
    while let Some((i, j)) = open.pop() {
        if j > i + 1 {
            let (cost, k) = least[i * count + j];
            if !f64::is_finite(cost) {
                return None;
            }
            facets.push([border[j], border[k], border[i]]);
            open.extend([(i, k), (k, j)]);
        }
    }
    Some(facets)
}
