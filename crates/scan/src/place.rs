//! Where the scanner stood: the motion from its frame into that of the cloth.

use drape_cloth::fabric::Lamina;
use drape_cloth::file::ValueError;
use drape_cloth::math::Vec3;
use drape_cloth::mesh::compare::Sheet;
use drape_cloth::scene::{Mark, ScanFrame, Scene};
use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion};

use super::rigid::{Rigid, icp, kabsch};

/// Points that the search without marks works with.
const SEARCHED: usize = 400;
/// Directions in which it starts, about the normal of the blank.
const TURNS: usize = 8;
/// Share of the points that it counts: the rest may be stray, or of wrinkles that lie elsewhere.
const COUNTED: f64 = 0.85;
/// Another way to lie is as good if it fits by less than this factor worse,
const ALIKE: f64 = 1.15;
/// and is another if it is turned by more than this [rad].
const OTHERWISE: f64 = 0.35;
/// Marks on the tool that were seen and measured agree to this share of their distance.
const AGREED: f64 = 0.02;
/// A vertex this near to the tool lies on it [m].
const LIES: f64 = 1e-3;
/// Share of the blank that has to lie on the tool for the scan to be put there.
const ENOUGH: f64 = 0.1;
/// Of that share the scan is counted on: it may show less.
const SURE: f64 = 0.7;

/// A place on a blank: a triangle, and the shares of its corners.
pub(super) type Spot = ([u32; 3], [f64; 3]);

/// The motion of scanned points [m] into the frame in which the scene's cloth is computed, and how many others
/// would do as well. `scale` is the unit of the marks [m].
pub(super) fn placed(scene: &Scene, points: &[Vec3], scale: f64) -> Result<(Rigid, usize), String> {
    let (placement, origin) = (&scene.config.placement, scene.tool.origin);
    if placement.scan_frame == ScanFrame::Scene {
        return Ok((Rigid::translation(-origin.x, -origin.y, -origin.z), 0));
    }
    let on_tool = |mark: &Mark| {
        Some((
            seen(mark, scale),
            Vec3::from(mark.scene_mm?) * 1e-3 - origin,
        ))
    };
    let fixed: Vec<(Vec3, Vec3)> = placement.scan_marks.iter().filter_map(on_tool).collect();
    if fixed.len() >= 3 {
        let (rigid, rms) = by_marks(&fixed)?;
        let apart = fixed.iter().map(|(x, _)| (x - fixed[0].0).norm());
        let most = AGREED * apart.fold(0.0, f64::max);
        if rms > most {
            return Err(format!(
                "`placement.scan_marks`: those with `scene_mm` are {:.1} mm off each other, root mean square, expected at \
                 most {:.1} mm: is a number wrong?",
                1e3 * rms,
                1e3 * most
            ));
        }
        return Ok((rigid, 0));
    }
    let mut marks = fixed;
    for (spot, x) in spots(scene, scale).map_err(|error| error.to_string())? {
        marks.push((x, at(&scene.initial.position, &spot)));
    }
    let (start, others) = match marks.len() {
        0 => search(scene, points)?,
        _ => (by_marks(&marks)?.0, 0),
    };
    Ok((on_to_tool(scene, points, start), others))
}

fn seen(mark: &Mark, scale: f64) -> Vec3 {
    Vec3::from(mark.seen) * scale
}

fn by_marks(pairs: &[(Vec3, Vec3)]) -> Result<(Rigid, f64), String> {
    let (from, to): (Vec<_>, Vec<_>) = pairs.iter().copied().unzip();
    kabsch(&from, &to).map_err(|error| format!("`placement.scan_marks`: {error}"))
}

/// Marks on the blank: where they are on it, and where the scanner saw them [m].
pub(super) fn spots(scene: &Scene, scale: f64) -> Result<Vec<(Spot, Vec3)>, ValueError> {
    let mut spots = Vec::new();
    for (index, mark) in scene.config.placement.scan_marks.iter().enumerate() {
        let Some(at_mm) = mark.at_mm else { continue };
        let spot = spot(&scene.lamina, at_mm.map(|x| 1e-3 * x)).ok_or_else(|| {
            let key = format!("placement.scan_marks[{index}].at_mm");
            ValueError::new(
                &key,
                format!("{at_mm:?}"),
                "a place on the blank, in its own frame",
            )
        })?;
        spots.push((spot, seen(mark, scale)));
    }
    Ok(spots)
}

/// Where a place on the flat blank is [m]; none beside it.
fn spot(lamina: &Lamina, x: [f64; 2]) -> Option<Spot> {
    let shares = |&triangle: &[u32; 3]| {
        let corners = triangle.map(|v| lamina.rest[v as usize]);
        let area = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        let [a, b, c] = corners;
        let shares = [area(x, b, c), area(a, x, c), area(a, b, x)].map(|s| s / area(a, b, c));
        (triangle, shares)
    };
    let least = |(_, shares): &Spot| shares.iter().fold(f64::INFINITY, |a, &b| a.min(b));
    let all = lamina.triangles.iter().map(shares);
    let best = all.max_by(|a, b| least(a).total_cmp(&least(b)))?;
    // An outline that is cut along its vertices is a little smaller than it says.
    (least(&best) >= -0.5).then_some(best)
}

/// Where a spot is when the blank lies at `position` [m].
pub(super) fn at(position: &[[f64; 3]], (triangle, shares): &Spot) -> Vec3 {
    let corners = triangle.iter().zip(shares);
    corners
        .map(|(&v, &share)| Vec3::from(position[v as usize]) * share)
        .sum()
}

/// Puts points on the tool that have to lie there, if enough of the blank does.
fn on_to_tool(scene: &Scene, points: &[Vec3], start: Rigid) -> Rigid {
    let lies = |x: &&[f64; 3]| scene.tool.distance(**x).0.abs() < LIES;
    let position = &scene.initial.position;
    let share = position.iter().filter(lies).count() as f64 / position.len() as f64;
    if share < ENOUGH {
        return start;
    }
    let tool = |x: Vec3| {
        let (phi, normal) = scene.tool.distance(x.into());
        (phi, normal.into())
    };
    icp(points, start, SURE * share, tool).0
}

/// Looks for the motion that brings the points nearest to the blank as it has fallen, from directions all
/// round. Gives how many others are as good, too: a square blank on a round tool lies in four ways.
fn search(scene: &Scene, points: &[Vec3]) -> Result<(Rigid, usize), String> {
    let mesh = scene.lamina.mesh(&scene.initial.position);
    let sheet = Sheet::new(&mesh).map_err(|error| error.to_string())?;
    let surface = |x: Vec3| {
        let foot = sheet.foot(x);
        let offset = x - foot.position;
        (foot.distance, offset.try_normalize(0.0).unwrap_or_default())
    };
    let stride = points.len().div_ceil(SEARCHED);
    let few: Vec<Vec3> = points.iter().step_by(stride).copied().collect();
    let (from, own) = axes(points);
    let (to, axes) = axes(&mesh.vertices);
    let mut found = Vec::new();
    for flip in [0.0, std::f64::consts::PI] {
        for turn in 0..TURNS {
            let turn = std::f64::consts::TAU * turn as f64 / TURNS as f64;
            // The third axis is the one across the sheet.
            let turned = Rotation3::from_axis_angle(&Vec3::z_axis(), turn)
                * Rotation3::from_axis_angle(&Vec3::x_axis(), flip);
            let rotation = axes * turned.matrix() * own.transpose();
            let rotation = Rotation3::from_matrix_unchecked(rotation);
            let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
            let start = Rigid::from_parts((to - rotation * from).into(), rotation);
            found.push(icp(&few, start, COUNTED, surface));
        }
    }
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (best, rms) = found[0];
    let mut kinds = vec![best];
    for (other, other_rms) in &found[1..] {
        let is_known = |known: &Rigid| known.rotation.angle_to(&other.rotation) < OTHERWISE;
        if *other_rms <= ALIKE * rms && !kinds.iter().any(is_known) {
            kinds.push(*other);
        }
    }
    Ok((best, kinds.len() - 1))
}

/// Middle of points, and their principal axes as columns, right-handed, the widest first.
fn axes(points: &[Vec3]) -> (Vec3, Matrix3<f64>) {
    let middle = points.iter().sum::<Vec3>() / points.len() as f64;
    let moment: Matrix3<f64> = points
        .iter()
        .map(|x| (x - middle) * (x - middle).transpose())
        .sum();
    let eigen = moment.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let [first, second] = [0, 1].map(|k| eigen.eigenvectors.column(order[k]).into_owned());
    (
        middle,
        Matrix3::from_columns(&[first, second, first.cross(&second)]),
    )
}

/// Points after a motion.
pub(super) fn moved(points: &[Vec3], rigid: &Rigid) -> Vec<Vec3> {
    points
        .iter()
        .map(|&x| (rigid * Point3::from(x)).coords)
        .collect()
}
