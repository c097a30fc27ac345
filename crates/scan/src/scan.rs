use std::collections::BTreeMap;
use std::sync::Arc;

use drape_cloth::fabric::Lamina;
use drape_cloth::file::ReadError;
use drape_cloth::math::Vec3;
use drape_cloth::scene::{Placement, Scene, SceneConfig, SceneError, Unit};
use drape_cloth::sim::Snapshot;
use rstar::RTree;
use serde::Serialize;

use super::cloud::{Cloud, cube, thinned};
use super::fit::{feet, pulled};
use super::place::{moved, placed, spots};

/// Spread of the points over that of the flat blank: draped cloth is narrower, and what noise adds is little.
const SPREAD: [f64; 2] = [0.35, 1.1];
/// A part of the scan that hangs together and has fewer of its points than this share is stray.
const STRAY: f64 = 0.02;
/// Side of the cubes for each of which one point pulls, in cells.
const THIN: f64 = 0.33;
/// Most of the points that may be far from the pulled blank, and of its vertices that may be unseen.
const MOST_FAR: f64 = 0.1;
const MOST_UNSEEN: f64 = 0.4;
/// Mean distance of the other points from it that cloth of this blank does not have, in diagonals of a cell.
pub const MOST_OFF: f64 = 0.2;
/// Points of the scan that the fit is measured at.
const MEASURED: usize = 50_000;

/// How well a scan and the blank that was fitted to it agree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScanFit {
    /// Mean and 95th percentile of the distance of scanned points to the blank, as the scene starts with it [mm].
    pub mean_mm: f64,
    pub p95_mm: f64,
    /// Those of seen vertices to the nearest scanned point [mm].
    pub vertices_mean_mm: f64,
    pub vertices_p95_mm: f64,
    /// The first while the points still pulled [mm].
    pub pulled_mean_mm: f64,
    /// Mean distance by which the blank moved when it was let go [mm]: what its laws do not hold.
    pub spring_back_mm: f64,
    /// Share of the vertices that no point was near to, by the diagonal of a cell.
    pub unseen_share: f64,
    /// Share of the points that were not near to the blank. They do not count above.
    pub stray_share: f64,
    /// Points of the file that were left out, as their coordinates are no numbers.
    pub dropped_count: usize,
    /// Other ways to lie in which the scan is as near to the fallen blank; 0 where its frame or marks are known.
    pub other_places: usize,
}

/// Sets up a scene as [`Scene::watched`] does, and lets its blank start from its scan if it has one.
///
/// # Errors
/// As there; and if the scan cannot be read or cannot be of this blank, which the message says why.
pub fn set_up(
    config: &SceneConfig,
    watch: impl FnMut(&Scene, f64, &dyn Fn() -> Snapshot),
) -> Result<(Scene, Option<ScanFit>), SceneError> {
    let Some(path) = &config.placement.scan else {
        return Ok((Scene::watched(config, watch)?, None));
    };
    config.check()?;
    let lamina = Lamina::new(&config.blank, config.read_material()?)?;
    let unit = config.placement.scan_unit;
    let cloud = Cloud::read(path, unit.map_or(1e-3, Unit::metres))?;
    let refuse = |fault| ReadError::fault(path, fault);
    check_size(&cloud.points, &lamina, unit).map_err(refuse)?;
    let points = of_the_blank(&cloud.points, &lamina).map_err(refuse)?;

    let mut falling = config.clone();
    falling.placement = Placement {
        scan: None,
        scan_unit: None,
        scan_frame: Default::default(),
        scan_marks: Vec::new(),
        ..config.placement.clone()
    };
    let mut scene = Scene::watched(&falling, watch)?;
    scene.config = config.clone();
    let (state, fit) = fitted(&scene, &cloud, &points).map_err(refuse)?;
    scene.initial = Arc::new(state);
    scene.fit_error = 1e-3 * fit.mean_mm;
    Ok((scene, Some(fit)))
}

/// The state of the scene's blank that fits a scan, of which `points` are those of the blank, thinned.
fn fitted(scene: &Scene, cloud: &Cloud, points: &[Vec3]) -> Result<(Snapshot, ScanFit), String> {
    let unit = scene.config.placement.scan_unit;
    let scale = unit.map_or(1e-3, Unit::metres);
    let (rigid, other_places) = placed(scene, points, scale)?;
    let spots = spots(scene, scale).map_err(|error| error.to_string())?;
    let spots: Vec<_> = spots
        .into_iter()
        .map(|(spot, x)| (spot, moved(&[x], &rigid)[0]))
        .collect();
    let points = moved(points, &rigid);
    let fallen = { &scene.initial.position }.iter().map(|&x| x.into());
    let fallen: Vec<Vec3> = fallen.collect();
    let (beside, most) = ((middle(&points) - middle(&fallen)).norm(), spread(&fallen));
    if beside > most {
        return Err(format!(
            "its middle is {:.0} mm beside that of the fallen blank, expected at most {:.0} mm: check \
             `placement.scan_frame` and `scan_marks`",
            1e3 * beside,
            1e3 * most
        ));
    }
    let (held, state) = pulled(scene, &points, &spots)
        .ok_or("pulled on to it the blank diverged, expected a scan of this blank")?;

    let (lamina, near) = (&scene.lamina, scene.lamina.cell_diagonal());
    let all = moved(&cloud.points, &rigid);
    let stride = all.len().div_ceil(MEASURED);
    let measured: Vec<Vec3> = all.iter().step_by(stride).copied().collect();
    let off = |position: &[[f64; 3]], points: &[Vec3]| -> Vec<f64> {
        let feet = feet(lamina, position, points).into_iter();
        feet.map(|foot| foot.distance).collect()
    };
    let first = measured.iter().zip(off(&held, &measured));
    let (kept, first): (Vec<Vec3>, Vec<f64>) = first.filter(|(_, off)| *off <= near).unzip();
    let stray_share = 1.0 - kept.len() as f64 / measured.len() as f64;
    let tree: RTree<[f64; 3]> = RTree::bulk_load(all.iter().map(|&x| x.into()).collect());
    let nearest = |x: &[f64; 3]| {
        let nearest = tree.nearest_neighbor(*x).expect("there are points");
        (Vec3::from(*nearest) - Vec3::from(*x)).norm()
    };
    let is_seen = |v: &usize| nearest(&held[*v]) <= near;
    let seen: Vec<usize> = (0..held.len()).filter(is_seen).collect();
    let unseen_share = 1.0 - seen.len() as f64 / held.len() as f64;
    refuse_above(MOST_UNSEEN, unseen_share, |found, most| {
        format!(
            "no point is within {:.1} mm of {found} of the blank, expected at most {most} unseen: is the scan of \
             all of it?",
            1e3 * near
        )
    })?;

    refuse_above(MOST_FAR, stray_share, |found, most| {
        format!(
            "{found} of its points are more than {:.1} mm off the blank that was pulled on to them, expected at \
             most {most}: cut away what is not the blank, or give `placement.scan_marks`",
            1e3 * near
        )
    })?;

    let [pulled_mean_mm, _] = mean_and_p95(first);
    let most_mm = 1e3 * MOST_OFF * near;
    if pulled_mean_mm > most_mm {
        return Err(format!(
            "its points are {pulled_mean_mm:.1} mm off the blank that was pulled on to them in the mean, expected at \
             most {most_mm:.1} mm: is it one sheet, and this blank?"
        ));
    }
    let [mean_mm, p95_mm] = mean_and_p95(off(&state.position, &kept));
    let of_seen = seen.iter().map(|&v| nearest(&state.position[v]));
    let [vertices_mean_mm, vertices_p95_mm] = mean_and_p95(of_seen.collect());
    let sprang = held.iter().zip(&state.position);
    let sprang = sprang.map(|(a, b)| (Vec3::from(*a) - Vec3::from(*b)).norm());
    let fit = ScanFit {
        mean_mm,
        p95_mm,
        vertices_mean_mm,
        vertices_p95_mm,
        pulled_mean_mm,
        spring_back_mm: 1e3 * sprang.sum::<f64>() / held.len() as f64,
        unseen_share,
        stray_share,
        dropped_count: cloud.dropped_count,
        other_places,
    };
    Ok((state, fit))
}

/// Refuses a share that is above `most`, in words of both as percentages.
fn refuse_above(
    most: f64,
    found: f64,
    fault: impl Fn(String, String) -> String,
) -> Result<(), String> {
    let percent = |share: f64| format!("{:.0} %", 1e2 * share);
    match found > most {
        true => Err(fault(percent(found), percent(most))),
        false => Ok(()),
    }
}

/// Mean and 95th percentile of lengths [m], in millimetres.
fn mean_and_p95(mut all: Vec<f64>) -> [f64; 2] {
    all.sort_by(f64::total_cmp);
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    [mean, all[(0.95 * (all.len() - 1) as f64).round() as usize]].map(|x| 1e3 * x)
}

/// The points of a scan without parts that are too small to be of the blank, thinned. Refuses a scan that has no other.
pub(super) fn of_the_blank(points: &[Vec3], lamina: &Lamina) -> Result<Vec<Vec3>, String> {
    let cell = lamina.cell()[0].min(lamina.cell()[1]);
    let points = thinned(points, THIN * cell);
    // Neighbours are in the same of coarser cubes, or in cubes that touch.
    let side = 2.0 * cell;
    let mut open: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (k, x) in points.iter().enumerate() {
        open.entry(cube(x, side)).or_default().push(k);
    }
    let mut kept = Vec::new();
    while let Some((first, own)) = open.pop_first() {
        let (mut part, mut cubes) = (own, vec![first]);
        while let Some([x, y, z]) = cubes.pop() {
            for n in 0..27 {
                let next = [x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1];
                if let Some(own) = open.remove(&next) {
                    part.extend(own);
                    cubes.push(next);
                }
            }
        }
        if part.len() as f64 >= STRAY * points.len() as f64 {
            kept.extend(part);
        }
    }
    if kept.is_empty() {
        return Err(format!(
            "its points lie too far apart to hang together, expected at most {:.1} mm between them for cells of {:.1} mm",
            1e3 * side,
            1e3 * cell
        ));
    }
    kept.sort_unstable();
    Ok(kept.into_iter().map(|k| points[k]).collect())
}

/// Refuses points that spread too far or too little for the blank, and says in which unit they would not;
/// where no unit is given, always, in millimetres.
pub(super) fn check_size(
    points: &[Vec3],
    lamina: &Lamina,
    unit: Option<Unit>,
) -> Result<(), String> {
    let flat = lamina.rest.iter().map(|&[x, y]| Vec3::new(x, y, 0.0));
    let (found, blank) = (spread(points), spread(&flat.collect::<Vec<_>>()));
    let usual = SPREAD[0]..=SPREAD[1];
    let read_in = unit.unwrap_or(Unit::Mm);
    let of_unit = |unit: &Unit| found / read_in.metres() * unit.metres() / blank;
    let guess = Unit::ALL
        .into_iter()
        .find(|unit| usual.contains(&of_unit(unit)));
    let guess =
        guess.map(|unit| format!("in {:?} it would have the size of the blank", unit.name()));
    let guess = guess.unwrap_or("in no unit it would have the size of the blank".into());
    match unit {
        None => Err(format!(
            "`placement.scan_unit` is missing, expected \"mm\", \"cm\", \"in\" or \"m\": {guess}"
        )),
        Some(_) if usual.contains(&(found / blank)) => Ok(()),
        Some(unit) => Err(format!(
            "`placement.scan_unit` is {:?}, with which it is {:.3} times as large as the blank, expected \
             {} to {}: {guess}",
            unit.name(),
            found / blank,
            usual.start(),
            usual.end()
        )),
    }
}

/// Root mean square distance of points from their middle [m].
fn spread(points: &[Vec3]) -> f64 {
    let middle = middle(points);
    let squares = points.iter().map(|x| (x - middle).norm_squared());
    (squares.sum::<f64>() / points.len() as f64).sqrt()
}

fn middle(points: &[Vec3]) -> Vec3 {
    points.iter().sum::<Vec3>() / points.len() as f64
}
