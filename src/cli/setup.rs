use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, anyhow};

use super::Failure;
use super::failure::OrInvalid;
use super::output::Progress;
use super::terminal::tell;
use crate::run::{Input, RunConfig, RunFolder, Scenes, TrainingPreset};
use drape_cloth::fabric::Lamina;
use drape_cloth::file::read_text;
use drape_cloth::math::Vec3;
use drape_cloth::scene::{Scene, SceneConfig};
use drape_cloth::tool::{Deepest, Source};
use drape_scan::ScanFit;
use drape_task::cluster::Cluster;
use drape_task::env::{Draping, EnvConfig, Member, Scatter, Task, Worlds};

/// A blank that is nowhere as near to the tool as this has missed it [mm].
const MISSED: f64 = 50.0;

/// Root mean square speed after the fall above which a blank does not lie yet [mm/s].
const RESTLESS: f64 = 2.0;

/// Distance to the tool from which on clamps leave a part of the blank in the air [mm]: what stands
/// farther off counts as a wrinkle.
const IN_THE_AIR: f64 = 15.0;
/// Depth in the tool that the distance grid may not see [m].
const UNSEEN: f64 = 1e-4;

/// What is wrong where the blank has missed the tool.
pub(super) fn missed(scene: &Scene) -> Option<String> {
    let off = 1e3 * scene.clearance();
    (off > MISSED).then(|| {
        format!(
            "after the fall the blank is {off:.1} mm off the tool at its nearest, expected at most \
             {MISSED} mm"
        )
    })
}

/// Sets up the scene that was read from `place`, with a progress bar.
pub(super) fn set_up(config: &SceneConfig, place: &str) -> Result<Scene, Failure> {
    Ok(set_up_fitted(config, place)?.0)
}

/// Does that, and tells how well its blank fits the scan that it starts from, if it has one.
pub(super) fn set_up_fitted(
    config: &SceneConfig,
    place: &str,
) -> Result<(Scene, Option<ScanFit>), Failure> {
    let progress = Progress::new("draping");
    let scene = drape_scan::set_up(config, |_, share, _| progress.set(share));
    drop(progress);
    let (scene, fit) = scene.with_context(|| place.to_string())?;
    let of_fit = fit.iter().flat_map(|fit| odd_fit(fit, &scene));
    warn(oddities(&scene).into_iter().chain(of_fit), place);
    Ok((scene, fit))
}

/// What is odd about a fit: a scan without marks may lie in several ways.
pub(super) fn odd_fit(fit: &ScanFit, scene: &Scene) -> Vec<String> {
    let (others, dropped, mean) = (fit.other_places, fit.dropped_count, fit.mean_mm);
    let others = (others > 0).then(|| {
        format!(
            "turned or tilted otherwise the scan lies as well in {others} more ways, expected one: give \
             `placement.scan_marks`"
        )
    });
    let dropped = (dropped > 0).then(|| {
        format!("{dropped} points of the scan are left out, as their coordinates are no numbers")
    });
    let most = 1e3 * drape_scan::MOST_OFF * scene.lamina.cell_diagonal();
    let off = (mean > most).then(|| {
        format!(
            "let go, the blank lies {mean:.1} mm off the scan on average, expected at most {most:.1} mm: its laws do not \
             hold that shape, or the scan lies elsewhere"
        )
    });
    others.into_iter().chain(dropped).chain(off).collect()
}

/// Tells what is odd about something that was read from `place`.
pub(super) fn warn(oddities: impl IntoIterator<Item = String>, place: &str) {
    for oddity in oddities {
        tell(format_args!("warning: {place}: {oddity}"));
    }
}

/// What is odd about a scene.
pub(super) fn oddities(scene: &Scene) -> Vec<String> {
    let (config, mut found) = (&scene.config, Vec::new());
    let in_mm = "that its lengths are in mm";
    let of_tool = match config.tool.source {
        Source::Mesh(_) => "the unit of its file",
        Source::Shape(_) => in_mm,
    };
    let tool = extent(scene.tool.mesh.vertices.iter().copied());
    let blank = extent(scene.lamina.rest.iter().map(|&[x, y]| Vec3::new(x, y, 0.0)));
    for (what, key, size) in [("tool", of_tool, tool), ("blank", in_mm, blank)] {
        if let Some(size) = absurd(size) {
            found.push(format!("the {what} measures {size}: check {key}"));
        }
    }
    let lies = missed(scene).is_none();
    let clamp = scene.farthest_clamp().map(|(k, off)| (k, 1e3 * off));
    if let Some((k, off)) = clamp.filter(|(_, off)| lies && *off > IN_THE_AIR) {
        found.push(format!(
            "`clamps[{k}]` holds the blank {off:.1} mm off the tool, expected at \
             most {IN_THE_AIR}: bring it down by `move_mm` or `placement`"
        ));
    }
    if let Source::Mesh(file) = &config.tool.source
        && absurd(tool).is_none()
        && let Some(advice) = unit_advice(tool, file.scale, 0.2 * blank..=20.0 * blank)
    {
        let blank = 1e3 * blank;
        found.push(format!(
            "beside a blank of {blank:.0} mm the tool has an odd size: {advice}"
        ));
    }
    found.extend(odd_depth(scene, &scene.initial.position));
    let strain = scene.lamina.yarn_strain(&scene.initial.position);
    let tension = 1e2 * strain.into_iter().fold(0.0, f64::max);
    let believable = 1e2 * EnvConfig::default().max_tension;
    if tension > believable {
        found.push(format!(
            "after the fall a yarn is stretched by {tension:.0} %, expected at most \
             {believable:.0}: raise `fall.substep_rate`, or check `[physics]`"
        ));
    }
    let v_rms = 1e3 * scene.initial.v_rms();
    if v_rms > RESTLESS && lies {
        found.push(format!(
            "after the fall the blank still moves at {v_rms:.1} mm/s, expected \
             at most {RESTLESS}: raise `fall.substep_rate` or `fall.settle_s`"
        ));
    }
    found
}

/// What of the tool reaches through the cloth: a grid of a given spacing swallows what is thinner, and cells
/// do what is finer than they are.
pub(super) fn odd_depth(scene: &Scene, position: &[[f64; 3]]) -> Option<String> {
    let sheet = scene.lamina.mesh(position);
    let Deepest { depth, at } = scene.tool.surface.deepest(&sheet);
    let unseen = depth + scene.tool.distance(at.into()).0;
    let [x, y, z] = (1e3 * (at + scene.tool.origin)).into();
    let held = scene.tolerance();
    let [mm, unseen_mm, held_mm] = [depth, unseen, held.depth].map(|x| 1e3 * x);
    let found = format!("at ({x:.1}, {y:.1}, {z:.1}) mm the blank is {mm:.2} mm inside the tool");
    let spacing = scene.config.tool.grid.spacing_mm;
    // Most of it: between vertices the cloth may lie in the tool as well.
    let is_grid = unseen.min(depth) > UNSEEN && unseen > 0.5 * depth;
    if let Some(spacing) = spacing.filter(|_| is_grid) {
        Some(format!(
            "{found}, {unseen_mm:.2} mm more than a distance grid of {spacing} mm sees: leave out \
             `tool.grid.spacing_mm`, and distances at edges and thin walls are exact"
        ))
    } else if mm > held_mm {
        let cell_mm = 1e3 * scene.lamina.cell_diagonal() / std::f64::consts::SQRT_2;
        let would_hold_mm = (cell_mm * held_mm / mm).min(1e3 * held.cell);
        let expected = match would_hold_mm >= 0.05 {
            true => format!(
                ", expected {would_hold_mm:.1} mm or less (`blank.vertices` or `blank.cell_mm`)"
            ),
            false => String::new(),
        };
        Some(format!(
            "{found}, expected at most {held_mm:.2} mm: the tool is finer than cells of {cell_mm:.1} mm{expected}"
        ))
    } else {
        None
    }
}

/// Sets a scene up, and refuses one whose blank has missed its tool.
pub(super) fn set_up_over_tool(config: &SceneConfig, place: &str) -> Result<Scene, Failure> {
    let scene = set_up(config, place)?;
    match missed(&scene) {
        Some(fault) => Err(Failure::invalid(anyhow!("{place}: {fault}"))),
        None => Ok(scene),
    }
}

/// The run folder at `path` with its configuration.
pub(super) fn open_run(path: &Path) -> Result<(RunFolder, RunConfig), Failure> {
    let folder = RunFolder::open(path).or_invalid()?;
    let config = RunConfig::read(&folder.config).or_invalid()?;
    Ok((folder, config))
}

/// The configuration of a file, or else the built-in quickstart, and what messages call it.
pub fn read_config(path: Option<&Path>) -> Result<(RunConfig, String), Failure> {
    let Some(path) = path else {
        return Ok((RunConfig::quickstart(), "built-in quickstart".into()));
    };
    let place = path.display().to_string();
    match RunConfig::read(path) {
        Ok(config) => Ok((config, place)),
        Err(_) if is_scene(path) => Err(Failure::invalid(anyhow!(
            "{place}: a scene, expected a run configuration, which names it as `scene_file`"
        ))),
        Err(error) => Err(error).or_invalid(),
    }
}

/// The run configuration in a file, or the scene in it under the compact preset.
pub fn read_scene_or_run(path: &Path) -> Result<RunConfig, Failure> {
    if !is_scene(path) {
        return Ok(read_config(Some(path))?.0);
    }
    let mut config = RunConfig::preset(TrainingPreset::Compact);
    config.scene = SceneConfig::read(path).or_invalid()?;
    Ok(config)
}

/// Whether a file has tables of a scene at its top, and none of a run configuration.
fn is_scene(path: &Path) -> bool {
    let table = read_text(path)
        .ok()
        .and_then(|text| text.parse::<toml::Table>().ok());
    let has = |table: &toml::Table, keys: &[&str]| keys.iter().any(|key| table.contains_key(*key));
    table.is_some_and(|table| {
        has(&table, &["tool", "blank", "placement"])
            && !has(&table, &["preset", "scene", "scene_file", "env"])
    })
}

/// What a run keeps of its configuration: as text, and files.
type Kept = (String, Vec<Input>);

/// Checks the task of a new run and sets up its scene. Gives what the run keeps, too.
pub(super) fn set_up_run(config: &RunConfig, place: &str) -> Result<(Arc<Scene>, Kept), Failure> {
    // Just before the scene is set up from them, so that the run keeps what it is made with.
    let mut kept = config.clone();
    let inputs = kept.keep_inputs().or_invalid_in(place)?;
    let draping = set_up_tasks(config, 1, place)?;
    Ok((draping.scene().clone(), (kept.to_toml(), inputs)))
}

/// Sets up the scenes that a policy learns on beside its own, `first`.
pub(super) fn set_up_scenes(
    config: &RunConfig,
    first: Arc<Scene>,
    place: &str,
) -> Result<Scenes, Failure> {
    let mut all = vec![first];
    let members = config.members().or_invalid_in(place)?;
    let place_of = |member: &crate::run::FamilyMember| match &member.name {
        Some(name) => format!("{place}: {name}"),
        None => place.into(),
    };
    for member in &members[1..] {
        let place = place_of(member);
        // Members that differ in their task alone lie on the same scene, others perhaps over the same tool.
        let mut known = all.iter().zip(members.iter().map(|other| &other.scene));
        if let Some((scene, _)) = known.clone().find(|(_, other)| **other == member.scene) {
            all.push(scene.clone());
            continue;
        }
        let mut scene = set_up_member(&member.scene, &member.env, &place)?;
        if let Some((other, _)) = known.find(|(_, other)| other.tool == member.scene.tool) {
            Arc::make_mut(&mut scene).tool = other.tool.clone();
        }
        all.push(scene);
    }
    // Whether they look alike, and can be.
    let alike = members.iter().zip(&all).map(|(member, scene)| Member {
        scene: scene.clone(),
        config: member.env.clone(),
        count: 1,
        worlds: None,
    });
    Draping::on(alike.collect(), &Cluster::default()).or_invalid_in(place)?;
    let lies = (LIES / all.len()).max(2);
    let with_worlds = |(k, scene): (usize, Arc<Scene>)| {
        let seed = config.seed.wrapping_add(k as u64);
        let place = place_of(&members[k]);
        let worlds = set_up_worlds(&scene, &config.scatter, lies, seed, &place)?;
        Ok((scene, worlds))
    };
    all.into_iter().enumerate().map(with_worlds).collect()
}

/// Lies of the blank that worlds are drawn from, of all scenes together.
pub(super) const LIES: usize = 16;

/// Sets up worlds round a scene, if anything scatters.
pub(super) fn set_up_worlds(
    scene: &Arc<Scene>,
    scatter: &Scatter,
    lies: usize,
    seed: u64,
    place: &str,
) -> Result<Option<Arc<Worlds>>, Failure> {
    if *scatter == Scatter::default() {
        return Ok(None);
    }
    let progress = Progress::new("scattering");
    let worlds = Worlds::new(scene, scatter, lies, seed, |share| progress.set(share));
    let worlds = worlds.with_context(|| format!("{place}: `scatter`"))?;
    Ok(Some(worlds.into()))
}

/// Sets up `count` tasks of a configuration that was read from `place`, each at its start.
///
/// # Errors
/// If the memory is exhausted, the scene or the task cannot be, the blank has missed its tool, nothing is left to be brought
/// down, or the network does not fit the image.
pub fn set_up_tasks(config: &RunConfig, count: usize, place: &str) -> Result<Draping, Failure> {
    config.check_before_fall().or_invalid_in(place)?;
    let scene = set_up_member(&config.scene, &config.env, place)?;
    Draping::new(scene, &config.env, count).or_invalid_in(place)
}

/// Sets up a scene with a task on it.
pub(super) fn set_up_member(
    scene: &SceneConfig,
    env: &EnvConfig,
    place: &str,
) -> Result<Arc<Scene>, Failure> {
    // A region that is not on the blank shows before the fall.
    let material = scene.read_material().or_invalid_in(place)?;
    let lamina = Lamina::new(&scene.blank, material).or_invalid_in(place)?;
    env.region(&lamina).or_invalid_in(place)?;
    let scene = Arc::new(set_up_over_tool(scene, place)?);
    let task = Task::new(scene.clone(), env).or_invalid_in(place)?;
    if !task.can_win() {
        return Err(Failure::invalid(anyhow!(
            "{place}: `env.region_mm` has {:.1e} m to bring down, expected a region of cloth that \
             does not lie on the tool yet",
            task.initial
        )));
    }
    Ok(scene)
}

/// Sizes of tools and blanks that need no second look [m].
const USUAL: RangeInclusive<f64> = 1e-3..=50.0;

/// Units of files, in metres.
const UNITS: [(&str, f64); 5] = [
    ("millimetres", 1e-3),
    ("centimetres", 1e-2),
    ("inches", 0.0254),
    ("feet", 0.3048),
    ("metres", 1.0),
];

/// For a mesh of `size` [m], read with `scale` metres a unit, that is out of the `usual` range [m]:
/// the units that would bring it in.
pub(super) fn unit_advice(size: f64, scale: f64, usual: RangeInclusive<f64>) -> Option<String> {
    if usual.contains(&size) {
        return None;
    }
    let fits = UNITS.iter().filter_map(|(name, unit)| {
        let in_unit = size / scale * unit;
        let fits = usual.contains(&in_unit);
        fits.then(|| format!("{unit} ({name}) makes it {:.0} mm", 1e3 * in_unit))
    });
    let advice = fits.reduce(|all, next| format!("{all}, {next}"));
    let advice = advice.unwrap_or("no usual unit fits".into());
    let size = 1e3 * size;
    Some(format!(
        "its longest side is {size:.2} mm; as `tool.source.mesh.scale` {advice}"
    ))
}

/// Longest side of the box that holds the points [m].
pub(super) fn extent(points: impl Iterator<Item = Vec3>) -> f64 {
    let inf = Vec3::repeat(f64::INFINITY);
    let (low, high) = points.fold((inf, -inf), |(low, high), x| (low.inf(&x), high.sup(&x)));
    (high - low).max()
}

/// A size [m] that points to another unit than was meant, and what was expected.
pub(super) fn absurd(size: f64) -> Option<String> {
    let is_absurd = !USUAL.contains(&size);
    is_absurd.then(|| format!("{:.3} mm, expected 1 mm to 50 m", 1e3 * size))
}
