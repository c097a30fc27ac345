//! Whether a mesh bounds a solid.

use std::collections::HashSet;

use rayon::prelude::*;

use super::error::ToolError;
use super::surface::{CLOSURE_DEFECT, Surface, step, winding};
use super::union::has_crossing_bodies;
use crate::math::Vec3;
use crate::mesh::{TriMesh, border};

/// Facets count as vertical where their unit normal rises less than this: 0.06 degrees, what welding
/// may turn the facets of a mesh by.
const VERTICAL: f64 = 1e-3;

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
        let unit = n.try_normalize(0.0).unwrap_or_default();
        let is_inside = |offset: Vec3| surface.is_inside(middle + offset * step);
        // Near the rim of a steep mould the solid is thinner than a step across, but deep.
        let is_deep = || unit.z.abs() > VERTICAL && is_inside(-Vec3::z() * unit.z.signum());
        let sides = [is_inside(unit), is_inside(-unit) || is_deep()];
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
    let all: HashSet<&[u32; 2]> = gaps.iter().collect();
    let is_upward = |[a, b, c]: &&[u32; 3]| {
        let [a, b, c] = [a, b, c].map(|&v| mesh.vertices[v as usize]);
        (b - a).cross(&(c - a)).z > 0.0
    };
    let edges = mesh.triangles.iter().filter(is_upward);
    let edges = edges.flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let upward: HashSet<[u32; 2]> = edges.filter(|edge| all.contains(edge)).collect();
    let hangs = |&edge: &&[u32; 2]| {
        let [from, to] = *edge;
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
        // Right below a facet that faces up is the solid, however steeply it goes down from here.
        let first = (!upward.contains(edge)).then_some(middle.z - 10.0 * step);
        first.into_iter().chain(below).any(is_free)
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
    use super::super::{GridConfig, Tool};
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

    /// Strips along y over a profile of x and height [m], facing up where x ascends.
    fn extruded(profile: &[[f64; 2]]) -> TriMesh {
        let ends = |&[x, z]: &[f64; 2]| [[x, -0.2, z], [x, 0.2, z]];
        let points: Vec<[f64; 3]> = profile.iter().flat_map(ends).collect();
        let strips = (0..profile.len() as u32 - 1).map(|k| 2 * k);
        let strips = strips.flat_map(|k| [[k, k + 2, k + 3], [k, k + 3, k + 1]]);
        TriMesh::new(&points, &strips.collect::<Vec<_>>())
    }

    /// A trough whose sides rise by an angle, deep enough for a degree short of vertical, in `steps`.
    fn trough(angle: f64, steps: i32) -> TriMesh {
        let rise = angle.to_radians().tan();
        let at = |k: i32| 0.1 * f64::from(k) / f64::from(steps);
        let profile = (-steps..=steps).map(|k| [at(k), at(k).abs() * rise]);
        extruded(&profile.collect::<Vec<_>>())
    }

    /// Female moulds are as deep as they are, however steep at the rim: only what lies over other
    /// parts is an undercut.
    #[test]
    fn moulds_are_free_of_undercuts_up_to_the_vertical() {
        let at = |x, z| Vec3::new(x, 0.013, z);
        for angle in [30.0, 44.0, 46.0, 60.0, 75.0, 85.0, 89.0, 89.9] {
            for steps in [1, 7, 40] {
                let surface = bounded(&trough(angle, steps)).unwrap_or_else(|error| {
                    panic!("{angle} degrees, {steps}: {error}");
                });
                assert!(surface.overlapping.is_none());
                // In the middle the sides are equally near.
                let [height, cos] = [0.07, angle.to_radians().cos()];
                let phi = surface.signed_distance(at(0.0, height));
                assert!((phi - height * cos).abs() < 1e-12, "{angle}: {phi}");
                assert!(surface.signed_distance(at(0.0, -0.01)) < 0.0);
            }
            // A bowl, up to that slope at the rim.
            let ring = |k: i32| (angle.to_radians() * f64::from(k) / 60.0).sin_cos();
            let profile = (1..=60).map(ring).map(|(s, c)| [0.1 * s, 0.1 - 0.1 * c]);
            let mut bowl = turned(&profile.collect::<Vec<_>>());
            bowl.flip();
            let surface = bounded(&bowl).unwrap();
            // Between the corners, which are on the sphere, and the middles of its chords.
            let phi = surface.signed_distance(Vec3::new(0.0, 0.0, 0.1));
            assert!(phi > 0.0990 && phi <= 0.1, "{angle}: {phi}");
        }
        // A blade's lower half: steep at the nose, flat to the edge, and a flange on either side.
        let blade = [
            [-0.08, 0.0],
            [-0.05, 0.0],
            [-0.048, -0.02],
            [-0.03, -0.03],
            [0.05, 0.0],
        ];
        assert!(bounded(&extruded(&blade)).is_ok());
        assert!(bounded(&extruded(&blade[1..])).is_ok());
    }

    /// What leans over is refused, and is told of the way in which it is meant.
    #[test]
    fn undercuts_are_refused_with_the_side_that_is_up() {
        let grid = GridConfig {
            spacing_mm: Some(100.0),
            ..GridConfig::default()
        };
        let error = |mesh: TriMesh| Tool::from_mesh(mesh, &grid).unwrap_err().to_string();
        // The left wall leans into the trough by a few degrees, or the lid of a shelf ends in the air.
        let leaning = extruded(&[[0.0, 0.1], [-0.005, 0.0], [0.1, 0.0], [0.105, 0.1]]);
        let shelf = extruded(&[[0.1, 0.05], [0.0, 0.05], [0.0, 0.1], [0.2, 0.1]]);
        for (mut mesh, fault) in [
            (leaning, "2 of its 6 facets have none behind them"),
            (shelf, "has an undercut: "),
        ] {
            for before in ["", "the tool faces downwards, and the other way round "] {
                let found = error(mesh.clone());
                assert!(
                    found.starts_with(before) && found.contains(fault),
                    "{found}"
                );
                mesh.flip();
            }
        }
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
        assert!(bounded(&extruded(&profile)).is_ok());
    }
}
