//! Surplus: how much more yarn there is over a region than the tool has room for.

use fixedbitset::FixedBitSet;

use crate::fabric::Lamina;
use crate::math::Vec3;
use crate::tool::Tool;

/// The length by which a yarn that crosses `region` is longer there than its trace on the tool
/// [m], on average over these yarns: what does not stand up as a wrinkle is pressed into the
/// fabric as waviness of its fibres.
///
/// The trace joins the points of the tool nearest to the yarn's vertices, so surplus is seen
/// whether it stands off the tool or is compressed on it. An edge counts with both ends in the
/// region, and where its trace is shorter than its length at rest; it never makes up for another.
/// 0 where no edge lies in the region.
pub fn surplus(lamina: &Lamina, tool: &Tool, positions: &[[f64; 3]], region: &FixedBitSet) -> f64 {
    let (sum, yarns) = summed_surplus(lamina, &feet(tool, positions), region);
    sum / yarns.max(1) as f64
}

/// Surplus summed over the yarns [m], and how many they are, for vertices with these [`feet`].
pub fn summed_surplus(lamina: &Lamina, feet: &[Vec3], region: &FixedBitSet) -> (f64, usize) {
    let foot = |v: u32| feet[v as usize];
    let (mut sum, mut yarns) = (0.0, 0);
    for yarn in &lamina.yarns {
        let mut inside = yarn.vertices.windows(2).filter(|pair| {
            let mut ends = pair.iter();
            ends.all(|&v| region.contains(v as usize))
        });
        let excess = |pair: &[u32]| excess(yarn.rest_length, [foot(pair[0]), foot(pair[1])]);
        if let Some(first) = inside.next() {
            yarns += 1;
            let all = std::iter::once(first).chain(inside);
            sum += all.map(excess).sum::<f64>();
        }
    }
    (sum, yarns)
}

/// The greatest share of its length that an edge of a yarn at each vertex has too much [-].
pub fn crushed(lamina: &Lamina, tool: &Tool, positions: &[[f64; 3]]) -> Vec<f64> {
    let feet = feet(tool, positions);
    let foot = |v: u32| feet[v as usize];
    let mut greatest = vec![0.0f64; positions.len()];
    for (yarn, ends) in lamina.yarn_edges() {
        let share = excess(yarn.rest_length, ends.map(foot)) / yarn.rest_length;
        for v in ends {
            greatest[v as usize] = greatest[v as usize].max(share);
        }
    }
    greatest
}

/// The points of the tool that are nearest to vertices.
pub fn feet(tool: &Tool, positions: &[[f64; 3]]) -> Vec<Vec3> {
    let nearest = positions.iter().map(|&x| (x, tool.distance(x)));
    nearest
        .map(|(x, (phi, normal))| foot(x, phi, normal))
        .collect()
}

/// The point of the tool that is nearest to `x`, from the distance `phi` [m] and the `normal` there.
pub fn foot(x: [f64; 3], phi: f64, normal: [f64; 3]) -> Vec3 {
    Vec3::from(x) - Vec3::from(normal) * phi
}

/// How much longer an edge is than its trace [m].
fn excess(rest_length: f64, [a, b]: [Vec3; 2]) -> f64 {
    let excess = rest_length - (b - a).norm();
    // Not `max`, which would take what is no number for no surplus.
    if excess < 0.0 { 0.0 } else { excess }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::{BlankConfig, Material};
    use crate::tool::{GridConfig, Plate, Pose, Shape, Source, ToolConfig};

    const SIDE: f64 = 0.3;

    fn plate() -> Tool {
        Tool::new(&ToolConfig {
            source: Source::Shape(Shape::Plate(Plate::default())),
            pose: Pose::default(),
            grid: GridConfig {
                spacing_mm: Some(10.0),
                ..GridConfig::default()
            },
        })
        .unwrap()
    }

    /// A square of `count` vertices a side, which `place` lays out from the flat blank [m].
    fn measured(count: usize, place: impl Fn([f64; 2]) -> [f64; 3], half: bool) -> f64 {
        let config = BlankConfig {
            size_mm: [1e3 * SIDE; 2],
            vertices: [count; 2],
            ..BlankConfig::default()
        };
        let lamina = Lamina::new(&config, Material::interglas_92125()).unwrap();
        let positions: Vec<_> = lamina.rest.iter().map(|&at| place(at)).collect();
        let mut region = FixedBitSet::with_capacity(positions.len());
        for (v, at) in lamina.rest.iter().enumerate() {
            region.set(v, !half || at[0] < 1e-9);
        }
        surplus(&lamina, &plate(), &positions, &region)
    }

    /// Along x, how far a yarn has come over z = a (1 - cos(2 pi x / length)) after the arc `s`.
    fn over_ripple(s: f64, a: f64, length: f64) -> [f64; 2] {
        let k = std::f64::consts::TAU / length;
        let steps = 20_000;
        let mut x = 0.0f64;
        for _ in 0..steps {
            // Midpoint rule for dx/ds = 1 / sqrt(1 + z'^2).
            let slope = |x: f64| a * k * (k * x).sin();
            let rate = |x: f64| 1.0 / (1.0 + slope(x).powi(2)).sqrt();
            let ds = s / f64::from(steps);
            x += ds * rate(x + 0.5 * ds * rate(x));
        }
        [x, a * (1.0 - (k * x).cos())]
    }

    /// Exact values: none of a flat sheet, wherever it hangs; of one crushed along its warp, that
    /// share of every second yarn; of a ripple, arc less chord. The same for any mesh.
    #[test]
    fn surplus_is_exact_and_the_same_on_every_mesh() {
        let [end, _] = over_ripple(SIDE, 0.005, 0.06);
        for count in [33, 65, 129] {
            let flat = measured(count, |[x, y]| [x, y, 0.02], false);
            assert!(flat < 1e-9, "{count}: {flat}");
            let crushed = measured(count, |[x, y]| [0.9 * x, y, 0.0], false);
            assert!(
                (crushed - 0.5 * 0.1 * SIDE).abs() < 1e-9,
                "{count}: {crushed}"
            );
            let ripple = |[x, y]: [f64; 2]| {
                let [x, z] = over_ripple(x + 0.5 * SIDE, 0.005, 0.06);
                [x - 0.5 * SIDE, y, z]
            };
            let column: Vec<_> = (0..count)
                .map(|k| ripple([(k as f64 / (count - 1) as f64 - 0.5) * SIDE, 0.0]))
                .collect();
            let place = |[x, y]: [f64; 2]| {
                let k = ((x / SIDE + 0.5) * (count - 1) as f64).round() as usize;
                [column[k][0], y, column[k][2]]
            };
            let found = measured(count, place, false);
            let exact = 0.5 * (SIDE - end);
            assert!(
                (found - exact).abs() < 1e-7,
                "{count}: {found}, exact {exact}"
            );
        }
    }

    /// A sheet crushed by a tenth along its warps on one side.
    #[test]
    fn crushed_vertices_are_found_where_they_are() {
        let config = BlankConfig {
            size_mm: [1e3 * SIDE; 2],
            vertices: [9; 2],
            ..BlankConfig::default()
        };
        let lamina = Lamina::new(&config, Material::interglas_92125()).unwrap();
        let place = |&[x, y]: &[f64; 2]| [if x < 0.0 { 0.9 * x } else { x }, y, 0.01];
        let positions: Vec<_> = lamina.rest.iter().map(place).collect();
        let found = crushed(&lamina, &plate(), &positions);
        for (share, [x, _]) in found.iter().zip(&lamina.rest) {
            let exact = if *x < 1e-9 { 0.1 } else { 0.0 };
            assert!((share - exact).abs() < 1e-9, "{share} at {x}");
        }
    }

    /// Stretched edges do not make up for crushed ones, and what is outside does not count.
    #[test]
    fn only_what_is_too_long_inside_counts() {
        let place = |[x, y]: [f64; 2]| [if x < 0.0 { 0.98 * x } else { 1.5 * x }, y, 0.0];
        let all = measured(33, place, false);
        assert!((all - 0.5 * 0.02 * 0.5 * SIDE).abs() < 1e-9, "{all}");
        // Every warp crosses the half, and one weft more than half of them.
        let half = measured(33, place, true);
        let exact = 33.0 / (33.0 + 17.0) * 0.02 * 0.5 * SIDE;
        assert!((half - exact).abs() < 1e-9, "{half}, exact {exact}");
        assert!(measured(33, |_| [f64::NAN; 3], true).is_nan());
    }
}
