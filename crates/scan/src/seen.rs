//! What a scan shows of a blank whose place is known, as after presses.

use drape_cloth::file::{ReadError, ValueError};
use drape_cloth::math::Vec3;
use drape_cloth::mesh::compare::{Distances, Sheet, SheetError};
use drape_cloth::scene::{Scene, SceneError, Unit};
use rstar::RTree;
use serde::Serialize;

use super::cloud::Cloud;
use super::place::{moved, placed};
use super::scan::{check_size, of_the_blank};

/// Most of the points that may be far from the blank.
const MOST_FAR: f64 = 0.25;

/// A scan in the frame of a scene.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Points of the blank, the mean of those in each cube of a third of a cell [m].
    pub points: Vec<Vec3>,
    /// All that the scanner saw [m].
    pub all: Vec<Vec3>,
    /// Points of the file that were left out, as their coordinates are no numbers.
    pub dropped_count: usize,
    /// Other ways to lie in which the scan is as near to the blank; 0 where its frame or marks are known.
    pub other_places: usize,
}

/// How a scan and a simulated blank differ.
#[derive(Clone, Debug, Serialize)]
pub struct Deviation {
    /// Distances of the scanned points from the blank [mm], positive on its upper side.
    pub scan_to_run_mm: Distances,
    /// Those of seen vertices to the nearest scanned point [mm], no smaller than what lies between points.
    pub run_to_scan_mm: Option<Distances>,
    /// Share of the scanned points that are farther from the blank than the diagonal of a cell; they count above.
    pub far_share: f64,
    /// Share of the vertices that no point is as near to; they do not count above.
    pub unseen_share: f64,
    /// Shares of either that are farther from the tool than the threshold of the task.
    pub undraped_share_scan: f64,
    pub undraped_share_run: f64,
    /// At every vertex the signed distance of the nearest point from the blank [mm], NaN where it is unseen.
    #[serde(skip)]
    pub at_vertices: Vec<f64>,
}

/// Reads the scan that the placement of `scene` names and puts it on to the blank where `scene.initial` has it, as
/// [`set_up`](crate::set_up) does, but pulls nothing.
///
/// # Errors
/// If the scan cannot be read or cannot be of this blank, which the message says why.
pub fn seen(scene: &Scene) -> Result<Seen, SceneError> {
    scene.config.check()?;
    let (placement, lamina) = (&scene.config.placement, &scene.lamina);
    let missing = || ValueError::new("placement.scan", "missing", "the file of a scan");
    let path = placement.scan.as_ref().ok_or_else(missing)?;
    let scale = placement.scan_unit.map_or(1e-3, Unit::metres);
    let refuse = |fault: String| ReadError::fault(path, fault);
    let cloud = Cloud::read(path, scale)?;
    check_size(&cloud.points, lamina, placement.scan_unit).map_err(refuse)?;
    let points = of_the_blank(&cloud.points, lamina).map_err(refuse)?;
    let (rigid, other_places) = placed(scene, &points, scale).map_err(refuse)?;
    let in_scene = |points: &[Vec3]| -> Vec<Vec3> {
        let moved = moved(points, &rigid).into_iter();
        moved.map(|x| x + scene.tool.origin).collect()
    };
    let seen = Seen {
        points: in_scene(&points),
        all: in_scene(&cloud.points),
        dropped_count: cloud.dropped_count,
        other_places,
    };
    let sheet = sheet(scene).map_err(|error| refuse(error.to_string()))?;
    let near = lamina.cell_diagonal();
    let is_far = |x: &&Vec3| sheet.foot(**x).distance > near;
    let far = seen.points.iter().filter(is_far).count() as f64 / seen.points.len() as f64;
    if far > MOST_FAR {
        return Err(refuse(format!(
            "{:.0} % of its points are more than {:.1} mm off the simulated blank, expected at most {:.0} %: is it \
             of this blank, pressed so, and are its marks right?",
            1e2 * far,
            1e3 * near,
            1e2 * MOST_FAR
        ))
        .into());
    }
    Ok(seen)
}

fn sheet(scene: &Scene) -> Result<Sheet, SheetError> {
    let position = scene.tool.in_scene(&scene.initial.position);
    Sheet::new(&scene.lamina.mesh(&position))
}

impl Seen {
    /// How the scan differs from the blank where `scene.initial` has it. Cloth farther than `threshold` from the tool is
    /// undraped [m].
    ///
    /// # Errors
    /// If the blank has no upper side.
    pub fn deviation(&self, scene: &Scene, threshold: f64) -> Result<Deviation, SheetError> {
        let (sheet, near) = (sheet(scene)?, scene.lamina.cell_diagonal());
        let origin = scene.tool.origin;
        let is_undraped = |x: Vec3| scene.tool.distance((x - origin).into()).0 > threshold;
        let share = |points: &[Vec3]| {
            let undraped = points.iter().filter(|&&x| is_undraped(x)).count();
            undraped as f64 / points.len() as f64
        };
        let signed = |x: Vec3| {
            let foot = sheet.foot(x);
            foot.distance.copysign(foot.deviation)
        };
        let off: Vec<f64> = self.points.iter().map(|&x| signed(x)).collect();
        let far = off.iter().filter(|off| off.abs() > near).count() as f64;

        let position = scene.tool.in_scene(&scene.initial.position);
        let position: Vec<Vec3> = position.into_iter().map(Vec3::from).collect();
        let tree: RTree<[f64; 3]> = RTree::bulk_load(self.all.iter().map(|&x| x.into()).collect());
        let nearest = |x: &Vec3| {
            let nearest = tree
                .nearest_neighbor((*x).into())
                .expect("there are points");
            Vec3::from(*nearest)
        };
        let nearest: Vec<Vec3> = position.iter().map(nearest).collect();
        let gaps = position.iter().zip(&nearest).map(|(x, y)| (x - y).norm());
        let gaps: Vec<f64> = gaps.collect();
        let seen = gaps.iter().filter(|&&gap| gap <= near);
        let at_vertex = |(gap, &at): (&f64, &Vec3)| match *gap <= near {
            true => 1e3 * signed(at),
            false => f64::NAN,
        };
        let alike = |x: &f64| (1e3 * x, 1.0);
        Ok(Deviation {
            scan_to_run_mm: Distances::new(off.iter().map(alike)).expect("there are points"),
            run_to_scan_mm: Distances::new(seen.clone().map(alike)),
            far_share: far / off.len() as f64,
            unseen_share: 1.0 - seen.count() as f64 / gaps.len() as f64,
            undraped_share_scan: share(&self.points),
            undraped_share_run: share(&position),
            at_vertices: gaps.iter().zip(&nearest).map(at_vertex).collect(),
        })
    }
}
