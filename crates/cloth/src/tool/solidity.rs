//! Whether a mesh bounds a solid.

use rayon::prelude::*;

use super::error::ToolError;
use super::surface::{CLOSURE_DEFECT, Surface, step, winding};
use super::union::has_crossing_bodies;
use crate::math::Vec3;
use crate::mesh::{TriMesh, border};

/// The surface of a mesh that bounds a solid.
///
/// # Errors
/// As for [`Surface::new`]; and meshes with facets that have no solid behind them, or open with an
/// undercut below their border.
pub(super) fn bounded(mesh: &TriMesh) -> Result<Surface, ToolError> {
    let mut surface = Surface::new(mesh)?;
    let is_overlapping = check_facets(&surface, mesh)? || has_crossing_bodies(mesh);
    if surface.is_open() {
        let gaps = surface.gaps(mesh, border(mesh)?);
        check_walls(&surface, mesh, &gaps)?;
    }
    if is_overlapping {
        surface.unite(mesh);
    }
    Ok(surface)
}

/// Whether the middle of a facet lies inside another body.
///
/// # Errors
/// If too many facets do not have the solid behind them and free space before them.
fn check_facets(surface: &Surface, mesh: &TriMesh) -> Result<bool, ToolError> {
    let step = step(mesh);
    let sides = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        let n = (b - a).cross(&(c - a));
        // No place on the lines along which meshes are regular and cracked.
        let middle = a * 0.41 + b * 0.32 + c * 0.27;
        let step = n.try_normalize(0.0).unwrap_or_default() * step;
        let sides = [middle + step, middle - step].map(|x| surface.is_inside(x));
        (sides, 0.5 * n.norm())
    };
    let sides: Vec<([bool; 2], f64)> = (0..mesh.triangles.len())
        .into_par_iter()
        .map(sides)
        .collect();
    // A facet within a body has the solid on both sides.
    let is_wrong = |&(side, _): &([bool; 2], f64)| !side[1];
    let wrong = || sides.iter().copied().filter(is_wrong);
    let area: f64 = wrong().map(|side| side.1).sum();
    if area > CLOSURE_DEFECT * mesh.area() {
        let largest = (0..sides.len())
            .filter(|&t| is_wrong(&sides[t]))
            .max_by(|&a, &b| sides[a].1.total_cmp(&sides[b].1))
            .expect("there is an area");
        let [a, b, c] = mesh.corners(largest);
        return Err(ToolError::NoSolid {
            count: wrong().count(),
            facets: sides.len(),
            facet: largest + 1,
            place_mm: ((a + b + c) / 3.0 * 1e3).into(),
        });
    }
    Ok(sides.iter().any(|(side, _)| side[0]))
}

/// Refuses walls with free space on both sides: below them the mesh comes back.
fn check_walls(surface: &Surface, mesh: &TriMesh, gaps: &[[u32; 2]]) -> Result<(), ToolError> {
    let step = step(mesh);
    let hangs = |&&[from, to]: &&[u32; 2]| {
        let [a, b] = [from, to].map(|v| mesh.vertices[v as usize]);
        let across = Vec3::new(b.y - a.y, a.x - b.x, 0.0);
        let Some(across) = across.try_normalize(step) else {
            return false;
        };
        let middle = 0.5 * (a + b);
        let sides = [1.0, -1.0].map(|side| middle + across * (10.0 * step * side));
        let crossings = sides.map(|x| surface.crossings(x.x, x.y));
        let below = crossings.iter().flatten().map(|c| c.0 - step);
        let below = below.filter(|&z| z < middle.z - 10.0 * step);
        let is_free = |z: f64| crossings.iter().all(|c| winding(c, z) <= 0);
        std::iter::once(middle.z - 10.0 * step)
            .chain(below)
            .any(is_free)
    };
    let hanging: Vec<&[u32; 2]> = gaps.par_iter().filter(hangs).collect();
    let length =
        |[a, b]: &[u32; 2]| (mesh.vertices[*b as usize] - mesh.vertices[*a as usize]).norm();
    let sum = |edges: &mut dyn Iterator<Item = &[u32; 2]>| edges.map(length).sum::<f64>();
    let all = sum(&mut gaps.iter());
    if sum(&mut hanging.iter().copied()) <= 10.0 * CLOSURE_DEFECT * all {
        return Ok(());
    }
    let [from, to] = hanging[0];
    let middle = 0.5 * (mesh.vertices[*from as usize] + mesh.vertices[*to as usize]);
    Err(ToolError::Hanging {
        count: hanging.len(),
        edges: gaps.len(),
        place_mm: (middle * 1e3).into(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::surface::tests::sheet;
    use super::*;

    /// A body of revolution about z through points of radius and height [m], outwards.
    fn turned(profile: &[[f64; 2]]) -> TriMesh {
        let segments = 24;
        let mut mesh = TriMesh::default();
        for s in 0..segments {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(s) / f64::from(segments)).sin_cos();
            let at = |&[r, z]: &[f64; 2]| Vec3::new(r * cos, r * sin, z);
            mesh.vertices.extend(profile.iter().map(at));
        }
        let count = profile.len() as u32;
        for s in 0..segments {
            for k in 0..count - 1 {
                let [a, b] = [s * count + k, (s + 1) % segments * count + k];
                mesh.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
            }
        }
        mesh
    }

    #[test]
    fn open_meshes_are_solids_or_refused() {
        // A mushroom without a bottom: the block is below its stem.
        let hat = [
            [0.05, 0.0],
            [0.05, 0.03],
            [0.11, 0.045],
            [0.11, 0.055],
            [0.001, 0.1],
        ];
        let surface = bounded(&turned(&hat)).unwrap();
        let phi = |x, z| surface.signed_distance(Vec3::new(x, 0.0, z));
        assert!(phi(0.08, 0.01) > 0.0 && phi(0.08, 0.046) < 0.0);
        assert!(phi(0.02, -0.3) < 0.0 && phi(0.06, -0.3) > 0.0);
        // A pot without a lid shows its back, either way round; so does a tube.
        let pot = [[0.001, 0.0], [0.09, 0.02], [0.11, 0.05], [0.05, 0.11]];
        for profile in [&pot[..], &[[0.05, 0.0], [0.05, 0.1]]] {
            let mut mesh = turned(profile);
            for _ in 0..2 {
                let error = bounded(&mesh).unwrap_err();
                assert!(matches!(error, ToolError::NoSolid { .. }), "{error}");
                mesh.flip();
            }
        }
        // An umbrella whose rim turns in over a plate.
        let mut mesh = turned(&[[0.08, 0.02], [0.1, 0.03], [0.001, 0.08]]);
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(sheet().vertices);
        mesh.triangles
            .extend(sheet().triangles.iter().map(|t| t.map(|i| i + first)));
        assert!(bounded(&mesh).is_ok());
    }

    #[test]
    fn walls_in_free_space_are_refused() {
        // The ends of a tube that lies: below it their borders have nothing on either side.
        let mut tube = turned(&[[0.05, 0.0], [0.05, 0.1]]);
        for v in &mut tube.vertices {
            *v = Vec3::new(v.z, v.y, -v.x);
        }
        let error = bounded(&tube).unwrap_err();
        assert!(matches!(error, ToolError::Hanging { .. }), "{error}");
        // A shelf whose upper face ends above the board below it, which comes back.
        let profile = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [2.0, 0.0]];
        let mut mesh = TriMesh::default();
        for [x, z] in profile {
            mesh.vertices
                .extend([Vec3::new(x, -1.0, z), Vec3::new(x, 1.0, z)]);
        }
        for k in [0, 2, 4] {
            mesh.triangles
                .extend([[k, k + 2, k + 3], [k, k + 3, k + 1]]);
        }
        assert!(bounded(&mesh).is_ok());
    }
}
