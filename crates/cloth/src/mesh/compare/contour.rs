use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::Polyline;
use serde::Serialize;

use crate::math::{Vec3, to_parry};
use crate::mesh::{TriMesh, border};

/// Samples of the border lie no farther apart than this share of its length: 0.5 mm on a
/// blank of 370 mm.
const STEP: f64 = 1.0 / 3000.0;

/// Distance of one surface's border from another's [m].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ContourDeviation {
    /// Mean over the length of the border.
    pub mean: f64,
    pub max: f64,
}

/// Distance of the border of `a`, sampled evenly along its length, from the border of `b`
/// (its edges, not its vertices alone). None where one of them has no border,
/// or triangles that do not agree on which side is up.
///
/// Borders of holes count as well; each sample goes to the nearest border, whichever it is.
pub fn contour_deviation(a: &TriMesh, b: &TriMesh) -> Option<ContourDeviation> {
    let [border, other] = [a, b].map(border);
    let (border, other) = (border.ok()?, other.ok()?);
    if other.is_empty() {
        return None;
    }
    let vertices = b.vertices.iter().map(to_parry).collect();
    let other = Polyline::new(vertices, Some(other));
    let distance = |x: Vec3| {
        let x = to_parry(&x);
        (other.project_local_point(x, false).point - x).length()
    };

    let ends = |edge: &[u32; 2]| edge.map(|v| a.vertices[v as usize]);
    let edges: Vec<[Vec3; 2]> = border.iter().map(ends).collect();
    let length: f64 = edges.iter().map(|[p, q]| (q - p).norm()).sum();
    if length.is_nan() || length <= 0.0 {
        return None;
    }
    let (mut sum, mut max) = (0.0, 0.0f64);
    for [p, q] in edges {
        let side = (q - p).norm();
        let count = (side / (STEP * length)).ceil().max(1.0);
        for k in 0..count as usize {
            let found = distance(p + (q - p) * ((k as f64 + 0.5) / count));
            sum += found * side / count;
            max = max.max(found);
        }
        // The greatest distance is often that of a corner.
        max = max.max(distance(p));
    }
    Some(ContourDeviation {
        mean: sum / length,
        max,
    })
}
