//! The mesh of a scanned tool, made one that bounds a solid and is no finer than it has to be.

use std::collections::{HashMap, HashSet};
use std::mem::replace;

use drape_cloth::math::Vec3;
use drape_cloth::mesh::{OrientationFault, TriMesh, border};
use drape_cloth::tool::Surface;
use rayon::prelude::*;
use serde::Serialize;

use super::decimate::decimate;
use super::holes::{fill, loops, within};
use super::twins::{doubled_area, edge, twins, undirected};

/// Parts with less than this share of the area of the largest are stray.
const STRAY: f64 = 0.01;
/// The widest border of a part is where its surface ends, no hole, if it goes round more than this share of the
/// part's area: a sphere is open from a hole of 52 degrees on.
const OUTER: f64 = 0.05;
/// More rounds than scans take. What is mended can show what else is to mend, as neighbours of dropped facets.
const ROUNDS: usize = 10;

/// What [`repair`] changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Changes {
    /// Facets with the corners of an earlier one, which were dropped.
    pub doubled_facets: usize,
    /// Parts that were dropped, and their facets.
    pub stray_parts: usize,
    pub stray_facets: usize,
    /// Facets that were turned over.
    pub turned_facets: usize,
    /// Holes that were closed, and the way round the longest [mm].
    pub closed_holes: usize,
    pub longest_hole_mm: f64,
    /// Cracks without width, and holes that nothing closes without touching another facet.
    pub holes_left: usize,
    /// Facets by which the mesh is coarser.
    pub decimated_facets: usize,
    /// Distance of vertices that were not stray from the repaired surface [mm].
    pub mean_mm: f64,
    pub max_mm: f64,
}

/// Repairs a mesh whose facets all have area: drops doubled facets and stray parts, turns facets to one side (out
/// of closed parts, up where they are open), closes holes but not the outer border of an open part, and
/// decimates for a `tolerance` [m], not at all for 0.
///
/// Vertices stay where they are, rounded as an STL file in millimetres has them. A repaired mesh
/// is not changed again, and the number of threads changes nothing. Parts that cross, or between which there is a
/// gap, are left as they are.
///
/// # Errors
/// If neighbouring facets cannot agree on which side is out, as on a Moebius strip.
pub fn repair(mesh: &TriMesh, tolerance: f64) -> Result<(TriMesh, Changes), OrientationFault> {
    let single = |x: f64| f64::from((x * 1e3) as f32) * 1e-3;
    let mut repaired = TriMesh {
        vertices: mesh.vertices.iter().map(|x| x.map(single)).collect(),
        triangles: mesh.triangles.clone(),
    };
    let (mut changes, mut kept) = (Changes::default(), None);
    for _ in 0..ROUNDS {
        let before = changes;
        drop_doubled(&mut repaired, &mut changes);
        let (disagrees, parts) = parts(&repaired.triangles);
        if drop_stray(&mut repaired, &parts, &mut changes) {
            continue;
        }
        kept.get_or_insert_with(|| used(&repaired));
        turn(&mut repaired, &disagrees, &parts, &mut changes);
        close(&mut repaired, &parts, &mut changes);
        let finer = repaired.triangles.len();
        decimate(&repaired.vertices, &mut repaired.triangles, tolerance);
        changes.decimated_facets += finer - repaired.triangles.len();
        if changes == before {
            break;
        }
    }
    // Vertices without facets would count for the bounds of the tool.
    let used = used(&repaired);
    let renamed = |v: u32| used.partition_point(|&other| other < v) as u32;
    let repaired = TriMesh {
        vertices: used
            .iter()
            .map(|&v| repaired.vertices[v as usize])
            .collect(),
        triangles: repaired.triangles.iter().map(|t| t.map(renamed)).collect(),
    };
    border(&repaired)?;
    let surface = Surface::new(&repaired).expect("its largest part is left, and facets agree");
    let off = |x: Vec3| 1e3 * (x - surface.project(x).position).norm();
    let kept = kept.unwrap_or_default().into_par_iter();
    let distances: Vec<f64> = kept.map(|v| off(mesh.vertices[v as usize])).collect();
    changes.mean_mm = distances.iter().sum::<f64>() / distances.len().max(1) as f64;
    changes.max_mm = distances.into_iter().fold(0.0, f64::max);
    Ok((repaired, changes))
}

/// Keeps one of the facets with the same corners, and none of the [`walls`].
fn drop_doubled(mesh: &mut TriMesh, changes: &mut Changes) {
    let count = mesh.triangles.len();
    let side = |t: [u32; 3]| (t[0] < t[1]) ^ (t[1] < t[2]) ^ (t[2] < t[0]);
    let (mut sides, mut two_sided) = (HashMap::new(), HashSet::new());
    mesh.triangles.retain(|&triangle| {
        let (corners, side) = (sorted(triangle), side(triangle));
        let other = sides.insert(corners, side);
        if other.is_some_and(|other| other != side) {
            two_sided.insert(corners);
        }
        other.is_none()
    });
    if !two_sided.is_empty() {
        let walls = walls(&mesh.triangles, &two_sided);
        mesh.triangles
            .retain(|&triangle| !walls.contains(&sorted(triangle)));
    }
    changes.doubled_facets += count - mesh.triangles.len();
}

fn sorted(mut corners: [u32; 3]) -> [u32; 3] {
    corners.sort_unstable();
    corners
}

/// Corners of walls within a body: sheets of facets that are there for both sides, at whose rims others go on without them.
fn walls(triangles: &[[u32; 3]], two_sided: &HashSet<[u32; 3]>) -> HashSet<[u32; 3]> {
    let edges = |[a, b, c]: [u32; 3]| [[a, b], [a, c], [b, c]];
    // At each edge of a sheet the facets of sheets, and how many others there are.
    let mut at: HashMap<[u32; 2], (Vec<[u32; 3]>, usize)> = HashMap::new();
    for &corners in two_sided {
        for edge in edges(corners) {
            at.entry(edge).or_default().0.push(corners);
        }
    }
    let others = triangles.iter().map(|&triangle| sorted(triangle));
    for corners in others.filter(|corners| !two_sided.contains(corners)) {
        for edge in edges(corners) {
            at.entry(edge).and_modify(|(_, others)| *others += 1);
        }
    }
    let (mut seen, mut walls) = (HashSet::new(), HashSet::new());
    for &first in two_sided {
        if !seen.insert(first) {
            continue;
        }
        let (mut sheet, mut next, mut rim) = (vec![first], 0, Vec::new());
        while let Some(&corners) = sheet.get(next) {
            next += 1;
            for (own, others) in edges(corners).map(|edge| &at[&edge]) {
                rim.extend((own.len() == 1).then_some(*others));
                sheet.extend(own.iter().filter(|&&other| seen.insert(other)));
            }
        }
        if !rim.is_empty() && rim.iter().all(|&others| others > 0 && others % 2 == 0) {
            walls.extend(sheet);
        }
    }
    walls
}

/// Which facets disagree with the first of their part on which side is out, and the facets of each part, which hangs
/// together by edges of two facets.
fn parts(triangles: &[[u32; 3]]) -> (Vec<bool>, Vec<Vec<usize>>) {
    let twins = twins(triangles);
    let mut disagrees = vec![false; triangles.len()];
    let (mut seen, mut parts) = (disagrees.clone(), Vec::new());
    for first in 0..triangles.len() {
        if replace(&mut seen[first], true) {
            continue;
        }
        let (mut part, mut next) = (vec![first], 0);
        while let Some(&facet) = part.get(next) {
            next += 1;
            for (half, &twin) in (3 * facet..).zip(&twins[3 * facet..3 * facet + 3]) {
                let other = twin / 3;
                if other < seen.len() && !replace(&mut seen[other], true) {
                    let [from, other_from] = [half, twin].map(|half| edge(triangles, half)[0]);
                    disagrees[other] = disagrees[facet] ^ (from == other_from);
                    part.push(other);
                }
            }
        }
        parts.push(part);
    }
    (disagrees, parts)
}

/// Whether there were stray parts.
fn drop_stray(mesh: &mut TriMesh, parts: &[Vec<usize>], changes: &mut Changes) -> bool {
    let area = |&facet: &usize| doubled_area(mesh.corners(facet)).norm();
    let areas: Vec<f64> = parts
        .iter()
        .map(|part| part.iter().map(area).sum())
        .collect();
    let least = STRAY * areas.iter().copied().fold(0.0, f64::max);
    let mut is_stray = vec![false; mesh.triangles.len()];
    for (part, _) in (parts.iter().zip(areas)).filter(|(_, area)| *area < least) {
        changes.stray_parts += 1;
        changes.stray_facets += part.len();
        part.iter().for_each(|&facet| is_stray[facet] = true);
    }
    let mut strays = is_stray.iter();
    mesh.triangles.retain(|_| strays.next() == Some(&false));
    is_stray.contains(&true)
}

/// Turns facets over that disagree with the first of their part, and whole parts.
fn turn(mesh: &mut TriMesh, disagrees: &[bool], parts: &[Vec<usize>], changes: &mut Changes) {
    for part in parts {
        // The volume is measured from a point of the part: from far away the terms would cancel.
        let origin = mesh.corners(part[0])[0];
        let (mut sum, mut area, mut volume) = (Vec3::zeros(), 0.0, 0.0);
        for &facet in part {
            let corners = mesh.corners(facet);
            let normal = doubled_area(corners) * if disagrees[facet] { -1.0 } else { 1.0 };
            sum += normal;
            area += normal.norm();
            volume += normal.dot(&(corners[0] - origin));
        }
        let is_closed = sum.norm() <= OUTER * area;
        // A cavity faces inwards, as all its facets say.
        let is_cavity = is_closed
            && volume < 0.0
            && part.iter().all(|&facet| !disagrees[facet])
            && parts.iter().any(|other| encloses(mesh, other, part));
        if is_cavity {
            continue;
        }
        // The sum is what the borders of the part go round.
        let outwards = if is_closed { volume } else { sum.z };
        for &facet in part {
            if disagrees[facet] ^ (outwards < 0.0) {
                mesh.triangles[facet].swap(1, 2);
                changes.turned_facets += 1;
            }
        }
    }
}

/// Whether the bounds of a part lie within those of another, on no side at them.
fn encloses(mesh: &TriMesh, outer: &[usize], inner: &[usize]) -> bool {
    let bounds = |part: &[usize]| {
        let corners = part.iter().flat_map(|&facet| mesh.corners(facet));
        corners.fold(
            [Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY)],
            |[low, high], x| [low.inf(&x), high.sup(&x)],
        )
    };
    let ([low, high], [least, most]) = (bounds(outer), bounds(inner));
    (0..3).all(|k| low[k] < least[k] && most[k] < high[k])
}

/// Closes the holes of parts.
fn close(mesh: &mut TriMesh, parts: &[Vec<usize>], changes: &mut Changes) {
    let (x, twins) = (&mesh.vertices, twins(&mesh.triangles));
    let halves = (0..twins.len()).map(|half| undirected(edge(&mesh.triangles, half)));
    let mut edges: HashSet<[u32; 2]> = halves.collect();
    changes.holes_left = 0;
    for part in parts {
        let area: f64 = part
            .iter()
            .map(|&facet| doubled_area(mesh.corners(facet)).norm())
            .sum();
        let halves = part.iter().flat_map(|facet| 3 * facet..3 * facet + 3);
        let border = halves.filter(|&half| twins[half] == half);
        let mut holes = loops(border.map(|half| edge(&mesh.triangles, half)).collect());
        holes.sort_by(|a, b| within(x, b).total_cmp(&within(x, a)));
        let is_open = holes
            .first()
            .is_some_and(|widest| within(x, widest) > 0.5 * OUTER * area);
        for hole in &holes[usize::from(is_open)..] {
            let Some(facets) = fill(x, hole, &mut edges) else {
                changes.holes_left += 1;
                continue;
            };
            mesh.triangles.extend(facets);
            let ends = hole.iter().zip(hole.iter().cycle().skip(1));
            let length = ends.map(|(&a, &b)| (x[b as usize] - x[a as usize]).norm());
            changes.longest_hole_mm = changes.longest_hole_mm.max(1e3 * length.sum::<f64>());
            changes.closed_holes += 1;
        }
    }
}

/// Vertices that facets have, in ascending order.
fn used(mesh: &TriMesh) -> Vec<u32> {
    let mut used = mesh.triangles.as_flattened().to_vec();
    used.par_sort_unstable();
    used.dedup();
    used
}
