use serde::Serialize;

use drape_cloth::math::Vec3;
use drape_cloth::mesh::{OrientationFault, TriMesh, border};
use drape_cloth::tool::{Surface, ToolError};

/// The tool that the next ply falls on: `tool` and, as a further body in the same mesh, a draped `ply` that is
/// `thickness` thick, everything in metres and with z up.
///
/// Vertices of a draped sheet lie on what it is pressed on, so the upper face of the body is the sheet moved by the
/// thickness along its vertex normals: wherever it is, it is at most this far from the fabric, also where that is
/// crushed. Sides and bottom go straight down to a thickness below the lowest vertex. So what the fabric spans is
/// filled, and there is no gap that the next ply could be pushed into. Where the sheet folds over itself, facets wind
/// round the body more than once, which a tool takes for solid.
///
/// # Errors
/// If the triangles of the ply do not agree on which side is up.
pub fn next_tool(
    tool: &TriMesh,
    ply: &TriMesh,
    thickness: f64,
) -> Result<TriMesh, OrientationFault> {
    let edges = border(ply)?;
    let bottom = ply.bounds().0.z - thickness;
    let (first, count) = (tool.vertices.len() as u32, ply.vertices.len() as u32);
    let normals = ply.vertex_normals();
    let moved = ply.vertices.iter().zip(&normals);
    let upper: Vec<Vec3> = moved.map(|(x, n)| x + n * thickness).collect();
    let lower = upper.iter().map(|x| Vec3::new(x.x, x.y, bottom));
    let mut both = tool.clone();
    both.vertices.extend(upper.iter().copied().chain(lower));
    let faces = ply.triangles.iter();
    let faces = faces.flat_map(|&[a, b, c]| [[a, b, c], [count + a, count + c, count + b]]);
    let sides = edges
        .iter()
        .flat_map(|&[a, b]| [[b, a, count + a], [b, count + a, count + b]]);
    let all = faces.chain(sides).map(|t| t.map(|v| first + v));
    both.triangles.extend(all);
    Ok(both)
}

/// How far points lie over a ply.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlyGap {
    /// How many lie over or beneath it; others, beside it, do not count.
    pub points: usize,
    pub mean_m: f64,
    /// Below 0 where a point lies beneath it.
    pub least_m: f64,
}

impl PlyGap {
    /// Distances of `points` [m] from the sheet of the ply `below`, along the normal of its nearest facet; none where
    /// no point lies over it.
    ///
    /// # Errors
    /// As [`next_tool`].
    pub fn new(below: &TriMesh, points: &[[f64; 3]]) -> Result<Option<Self>, ToolError> {
        let surface = Surface::new(below)?;
        let gap = |x: &[f64; 3]| {
            let nearest = surface.project(Vec3::from(*x));
            let off = Vec3::from(*x) - nearest.position;
            let height = off.dot(&nearest.normal);
            // Beside the border the nearest point is to the side.
            (height.abs() >= 0.5 * off.norm()).then_some(height)
        };
        let gaps: Vec<f64> = points.iter().filter_map(gap).collect();
        Ok((!gaps.is_empty()).then(|| Self {
            points: gaps.len(),
            mean_m: gaps.iter().sum::<f64>() / gaps.len() as f64,
            least_m: gaps.iter().copied().fold(f64::INFINITY, f64::min),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drape_cloth::tool::{GridConfig, Plate, Shape, Tool};

    const THICKNESS: f64 = 4e-4;

    /// A square sheet of 9 x 9 vertices, 160 mm wide, whose vertices a function lifts from the plane.
    fn sheet(place: impl Fn(f64, f64) -> [f64; 3]) -> TriMesh {
        let at = |k: u32| 0.02 * (f64::from(k) - 4.0);
        let points: Vec<[f64; 3]> = (0..81).map(|v| place(at(v % 9), at(v / 9))).collect();
        let cells = (0..64).map(|cell| cell / 8 * 9 + cell % 8);
        let halves = cells.flat_map(|v| [[v, v + 1, v + 10], [v, v + 10, v + 9]]);
        TriMesh::new(&points, &halves.collect::<Vec<_>>())
    }

    fn laid(ply: &TriMesh) -> (TriMesh, Tool) {
        let plate = Shape::Plate(Plate::default()).mesh().unwrap();
        let mesh = next_tool(&plate, ply, THICKNESS).unwrap();
        let tool = Tool::from_mesh(mesh.clone(), &GridConfig::default()).unwrap();
        (mesh, tool)
    }

    /// Over the ply the tool is a thickness higher, beside it as it was, and further plies add up.
    #[test]
    fn flat_plies_add_their_thickness() {
        let ply = sheet(|x, y| [x, y, 0.0]);
        let (mesh, tool) = laid(&ply);
        let phi =
            |tool: &Tool, x: f64, z: f64| tool.surface.signed_distance(Vec3::new(x, 0.003, z));
        assert!((phi(&tool, 0.01, 0.002) - (0.002 - THICKNESS)).abs() < 1e-9);
        assert!((phi(&tool, 0.15, 0.002) - 0.002).abs() < 1e-9);
        // Nothing of the ply's inner faces is left within the plate.
        assert!((phi(&tool, 0.01, -0.001) + 0.001 + THICKNESS).abs() < 1e-9);
        assert!(!tool.surface.is_open());

        let higher = sheet(|x, y| [x, y, THICKNESS]);
        let mesh = next_tool(&mesh, &higher, THICKNESS).unwrap();
        let tool = Tool::from_mesh(mesh, &GridConfig::default()).unwrap();
        assert!((phi(&tool, 0.01, 0.002) - (0.002 - 2.0 * THICKNESS)).abs() < 1e-9);
    }

    /// A ridge that the ply spans is solid below, and a fold that lies over on its side is a tool too.
    #[test]
    fn what_is_spanned_is_filled_and_folds_are_solid() {
        let (_, tool) = laid(&sheet(|x, y| [x, y, 0.03 * (1.0 - x.abs() / 0.08)]));
        for z in [0.001, 0.01, 0.02] {
            assert!(tool.surface.signed_distance(Vec3::new(0.001, 0.003, z)) < 0.0);
        }
        // Along x the sheet goes forth, back over itself, and forth again.
        let folded = |x: f64| match x {
            x if x < -0.03 => [x, 0.0],
            x if x < 0.03 => [-x - 0.05, 0.002 + x / 30.0],
            x => [x - 0.08, 0.004],
        };
        let ply = sheet(|x, y| [folded(x)[0], y, folded(x)[1]]);
        let (_, tool) = laid(&ply);
        for vertex in &ply.vertices {
            let phi = tool.surface.signed_distance(*vertex);
            assert!(phi < 1.001 * THICKNESS, "{phi} at {vertex:?}");
        }
        // The pocket that is open to the side stays free; below the end that hangs over is none.
        let phi = |x: f64, z: f64| tool.surface.signed_distance(Vec3::new(x, 0.003, z));
        assert!(phi(-0.05, 0.001) > 0.0 && phi(-0.05, 0.003) < 0.0);
        assert!(phi(-0.02, 0.002) < 0.0);
    }

    #[test]
    fn gaps_have_their_sign() {
        let ply = sheet(|x, y| [x, y, 0.1 * x]);
        let over = |h: f64| [0.01 - h * 0.1, 0.003, 0.001 + h];
        let beside = [0.2, 0.0, -0.01];
        let gap = PlyGap::new(&ply, &[over(0.002), beside, over(-0.001)]);
        let gap = gap.unwrap().unwrap();
        let length = 1.01f64.sqrt();
        assert_eq!(gap.points, 2);
        assert!((gap.least_m + 0.001 * length).abs() < 1e-12);
        assert!((gap.mean_m - 0.0005 * length).abs() < 1e-12);
        assert_eq!(PlyGap::new(&ply, &[beside]).unwrap(), None);
    }
}
