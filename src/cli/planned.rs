//! A robot's plan for the path of a run, which several commands tell.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::anyhow;

use super::Failure;
use super::failure::OrInvalid;
use super::loaded::Loaded;
use super::output::Progress;
use super::result::path;
use crate::run::{RunConfig, RunFolder, cell, path_points};
use drape_cloth::file::read_toml;
use drape_cloth::math::Vec3;
use drape_cloth::scene::Scene;
use drape_robot::{Cell, CellConfig, PathPoint, Place, Plan, Pushed};
use drape_task::path::{DrapingPoint, Frame};
use drape_task::recording::Recording;

/// In the folder of a run, what `drape robot` leaves, and in that the cell as it was resolved.
pub(super) const FOLDER: &str = "robot";
pub(super) const RESOLVED: &str = "cell.toml";

/// A cell and a path, as files and a run describe them.
pub(super) struct Planned {
    pub cell: Cell,
    pub path: Vec<PathPoint>,
    pub plan: Plan,
    /// Presses at which the arm pushes cloth aside.
    pub pushed: Vec<Pushed>,
    /// Places where the program, played at finer steps, hits something: none.
    pub collisions: Vec<String>,
    /// With the base as it was found, where none was given.
    pub config: CellConfig,
}

impl Planned {
    /// Plans the path of a run in the cell of [`cell_config`].
    pub fn new(loaded: &Loaded, file: Option<&Path>) -> Result<Self, Failure> {
        let (cell, place) = cell_config(file, Some(&loaded.folder), &loaded.config)?;
        let (played, _) = loaded.play_path()?;
        let points = path(&played.recording)?;
        let progress = Progress::new("strokes");
        let done = AtomicUsize::new(0);
        let watch = |more: usize| {
            let done = done.fetch_add(more, Ordering::Relaxed) + more;
            progress.set(done as f64 / points.len().max(1) as f64);
        };
        let mut planned = Self::of(&points, cell, &place, &loaded.scene, watch)?;
        let sheets = sheets(&played.recording, &loaded.scene);
        planned.collisions = planned.cell.collisions(&planned.plan);
        planned.pushed = planned
            .cell
            .pushed(&planned.plan, |point| &sheets[point + 1]);
        Ok(planned)
    }

    /// Plans a path in a cell, which is from `place`; it is not played. `watch` hears how many more points are done.
    pub fn of(
        points: &[DrapingPoint],
        mut config: CellConfig,
        place: &str,
        scene: &Scene,
        watch: impl Fn(usize) + Sync,
    ) -> Result<Self, Failure> {
        let mut cell = cell(&config, scene).or_invalid_in(place)?;
        let path = path_points(points, scene);
        if config.base.is_none() {
            // Wherever it reaches most; a shop that has a place names it.
            let best = cell.best_base(&path);
            let (base, _) = best.ok_or_else(|| anyhow!("{place}: the base has no place"))?;
            // As the file will have it, so that it gives the same again.
            let micrometres = base.translation.vector.map(|x| (1e6 * x).round());
            let base = Place {
                at_mm: micrometres.map(|x| 1e-3 * x + 0.0).into(),
                ..Place::default()
            };
            cell = cell.moved(base.pose());
            config.base = Some(base);
        }
        let plan = cell.plan(&path, watch).or_invalid_in(place)?;
        Ok(Self {
            collisions: Vec::new(),
            pushed: Vec::new(),
            cell,
            path,
            plan,
            config,
        })
    }
}

/// The cell of a file, or else that of a run, what `drape robot` has left in it, or the default; and what messages call it.
pub(super) fn cell_config(
    file: Option<&Path>,
    run: Option<&RunFolder>,
    config: &RunConfig,
) -> Result<(CellConfig, String), Failure> {
    let kept = run.map(|run| run.path.join(FOLDER).join(RESOLVED));
    match (file, &config.cell, kept.filter(|kept| kept.exists())) {
        (Some(file), _, _) => read_cell(file),
        (None, Some(cell), _) => {
            let place = run.map(|run| run.config.display().to_string());
            Ok((cell.clone(), place.unwrap_or("the task's cell".into())))
        }
        (None, None, Some(kept)) => read_cell(&kept),
        (None, None, None) => Ok((CellConfig::unnamed(), "the default cell".into())),
    }
}

/// A cell of a file, and what messages call it.
fn read_cell(file: &Path) -> Result<(CellConfig, String), Failure> {
    let mut config: CellConfig = read_toml(file).or_invalid()?;
    let place = file.display().to_string();
    config.check().or_invalid_in(&place)?;
    config
        .locate(file.parent().unwrap_or(Path::new("")))
        .or_invalid_in(&place)?;
    Ok((config, place))
}

/// The cloth of each frame in the tool's own frame [m]: vertices, and middles of edges and triangles, since holders are no
/// thicker than yarns of a coarse blank are apart.
fn sheets(recording: &Recording, scene: &Scene) -> Vec<Vec<Vec3>> {
    let frame = Frame::tool(&scene.config.tool.pose);
    let sheet = |position: &Vec<[f64; 3]>| {
        let place = |&x: &[f64; 3]| frame.point(&(Vec3::from(x) + scene.tool.origin));
        let mut places: Vec<Vec3> = position.iter().map(place).collect();
        for triangle in &scene.lamina.triangles {
            let [a, b, c] = triangle.map(|v| places[v as usize]);
            places.extend([
                (a + b) / 2.0,
                (b + c) / 2.0,
                (c + a) / 2.0,
                (a + b + c) / 3.0,
            ]);
        }
        places
    };
    let frames = recording.frames.iter();
    frames.map(|frame| sheet(&frame.position)).collect()
}

/// What programs of a run are called.
pub(super) fn name(run: &Path) -> String {
    run.file_name()
        .map_or("drape".into(), |name| name.to_string_lossy().into_owned())
}
