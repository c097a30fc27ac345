//! Material points: the same ones of two sheets, how far they are apart, and from the tool.

use drape_cloth::scene::SceneConfig;
use drape_cloth::tool::Tool;

/// Vertices of two flat blanks that lie within a micrometre, ascending in the first.
pub fn same_points(a: &[[f64; 2]], b: &[[f64; 2]]) -> Vec<[usize; 2]> {
    let same = |x: &[f64; 2], y: &[f64; 2]| (0..2).all(|k| (x[k] - y[k]).abs() < 1e-6);
    let find = |x: &[f64; 2]| b.iter().position(|y| same(x, y));
    let pairs = a.iter().enumerate();
    pairs.filter_map(|(i, x)| Some([i, find(x)?])).collect()
}

/// Mean and greatest distance between the same material points [mm]; NaN and 0 without any.
pub fn apart_mm(a: &[[f64; 3]], b: &[[f64; 3]], pairs: &[[usize; 2]]) -> [f64; 2] {
    let apart = |&[i, j]: &[usize; 2]| {
        let square: f64 = a[i].iter().zip(b[j]).map(|(x, y)| (x - y).powi(2)).sum();
        1e3 * square.sqrt()
    };
    let all: Vec<f64> = pairs.iter().map(apart).collect();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    [mean, all.iter().copied().fold(0.0, f64::max)]
}

/// Summed distances to the tool of the same material points, of either sheet [m].
pub fn summed_m(tool: &Tool, x: [&[[f64; 3]]; 2], pairs: &[[usize; 2]]) -> [f64; 2] {
    let vertices = |side: usize| pairs.iter().map(move |pair| pair[side]);
    [0, 1].map(|side| tool.summed_distance(vertices(side), x[side]))
}

/// The vertex nearest to a place on the flat blank [m].
pub fn nearest(rest: &[[f64; 2]], at: [f64; 2]) -> u32 {
    let square = |v: usize| (rest[v][0] - at[0]).powi(2) + (rest[v][1] - at[1]).powi(2);
    let nearest = (0..rest.len()).min_by(|&a, &b| square(a).total_cmp(&square(b)));
    nearest.expect("a blank has vertices") as u32
}

/// Every second vertex of a rectangle along its yarns, if the last is one of them.
pub fn coarser(scene: &SceneConfig) -> Option<[usize; 2]> {
    let here = scene.blank.vertices;
    let halves = here.iter().all(|n| n % 2 == 1 && *n >= 5);
    (scene.blank.is_plain() && halves).then(|| here.map(|n| (n - 1) / 2 + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_two_meshes_are_found_and_measured() {
        let fine: Vec<[f64; 2]> = (0..5).map(|i| [0.1 * f64::from(i), 0.0]).collect();
        let coarse = [[0.2 + 4e-7, -4e-7], [0.3 + 3e-6, 0.0], [0.0, 0.0]];
        let pairs = same_points(&coarse, &fine);
        assert_eq!(pairs, [[0, 2], [2, 0]]);
        let a = [[0.0, 0.0, 3e-3], [9.0; 3], [0.0; 3]];
        let b = [[0.0, 1e-3, 0.0], [9.0; 3], [4e-3, 0.0, 3e-3]];
        let [mean, greatest] = apart_mm(&a, &b, &pairs);
        assert!((mean - 2.5).abs() < 1e-12 && (greatest - 4.0).abs() < 1e-12);
        assert_eq!(nearest(&fine, [0.26, 1.0]), 3);
    }

    #[test]
    fn only_plain_blanks_with_even_cells_have_a_coarser_mesh() {
        let mut scene = SceneConfig::rib();
        scene.blank.vertices = [65, 17];
        assert_eq!(coarser(&scene), Some([33, 9]));
        scene.blank.vertices = [65, 16];
        assert_eq!(coarser(&scene), None);
        scene.blank.vertices = [65, 17];
        scene.blank.yarn_angle_deg = 45.0;
        assert_eq!(coarser(&scene), None);
    }
}
