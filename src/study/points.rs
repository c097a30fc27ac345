//! The same material points of two sheets, and how far they are apart.

use std::collections::HashMap;

use crate::scene::SceneConfig;
use crate::tool::Tool;

/// Vertices of two flat blanks that lie within a micrometre, ascending in the first.
pub fn same_points(a: &[[f64; 2]], b: &[[f64; 2]]) -> Vec<[usize; 2]> {
    const SAME: f64 = 1e-6;
    let key = |x: &[f64; 2]| x.map(|x| (x / SAME).floor() as i64);
    let known: HashMap<[i64; 2], usize> = b.iter().enumerate().map(|(j, x)| (key(x), j)).collect();
    let find = |x: &[f64; 2]| {
        let [u, v] = key(x);
        let around = (-1..=1).flat_map(|i| (-1..=1).map(move |j| [u + i, v + j]));
        around.filter_map(|key| known.get(&key)).copied().next()
    };
    let pairs = a.iter().enumerate();
    pairs.filter_map(|(i, x)| Some([i, find(x)?])).collect()
}

/// Mean and largest distance between the same material points [mm].
pub fn deviation(a: &[[f64; 3]], b: &[[f64; 3]], pairs: &[[usize; 2]]) -> [f64; 2] {
    let apart = |&[i, j]: &[usize; 2]| {
        let square: f64 = a[i].iter().zip(b[j]).map(|(x, y)| (x - y).powi(2)).sum();
        1e3 * square.sqrt()
    };
    let all: Vec<f64> = pairs.iter().map(apart).collect();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    [mean, all.iter().copied().fold(0.0, f64::max)]
}

/// Summed distance to the tool of one `side` of `pairs` [m].
pub fn summed(tool: &Tool, x: &[[f64; 3]], pairs: &[[usize; 2]], side: usize) -> f64 {
    let distance = |pair: &[usize; 2]| tool.distance(x[pair[side]]).0.max(0.0);
    pairs.iter().map(distance).sum()
}

/// Every second vertex of a rectangle along its yarns, if the last is one of them.
pub fn coarser(scene: &SceneConfig) -> Option<[usize; 2]> {
    let here = scene.blank.vertices;
    let halves = here.iter().all(|n| n % 2 == 1 && *n >= 5);
    (is_plain(scene) && halves).then(|| here.map(|n| (n - 1) / 2 + 1))
}

/// A rectangle along its yarns, by vertices along its sides.
pub fn is_plain(scene: &SceneConfig) -> bool {
    let blank = &scene.blank;
    blank.outline.is_none() && blank.cell_mm.is_none() && blank.yarn_angle_deg == 0.0
}
