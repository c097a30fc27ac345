use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;

use anyhow::Context;

use super::Failure;
use super::failure::{OrInvalid, scene_failure};
use super::output::Progress;
use crate::run::{Input, RunConfig, Scenes};
use drape_cloth::math::Vec3;
use drape_cloth::scene::{Scene, SceneConfig};
use drape_cloth::tool::Source;
use drape_task::cluster::Cluster;
use drape_task::env::{Draping, EnvConfig, ImageShape, Member, Task, Tasks};

/// A blank that is nowhere as near to the tool as this has missed it [m].
pub(super) const MISSED: f64 = 0.05;

/// Root mean square speed after the fall above which a blank does not lie yet [mm/s].
const RESTLESS: f64 = 2.0;

/// Distance to the tool from which on clamps leave a part of the blank in the air [mm]: what stands
/// farther off counts as a wrinkle.
const IN_THE_AIR: f64 = 15.0;
/// Depth in the tool that the distance grid may not see [m].
const UNSEEN: f64 = 1e-4;

/// What is wrong with a blank that has missed the tool by `clearance` [m].
pub(super) fn missed(clearance: f64) -> String {
    format!(
        "after the fall the blank is {:.1} mm off the tool at its nearest, expected at most {} mm",
        1e3 * clearance,
        1e3 * MISSED
    )
}

/// Sets up the scene that was read from `place`, with a progress bar.
pub(super) fn set_up(config: &SceneConfig, place: &str, json: bool) -> Result<Scene, Failure> {
    let progress = Progress::new("draping", json);
    let scene = Scene::new(config, |share| progress.set(share));
    drop(progress);
    let scene = scene.map_err(|error| scene_failure(error, place))?;
    let flat = scene.lamina.rest.iter().map(|&[x, y]| Vec3::new(x, y, 0.0));
    let in_mm = "that its lengths are in mm";
    let of_tool = match config.tool.source {
        Source::Mesh(_) => "the unit of its file",
        Source::Shape(_) => in_mm,
    };
    let tool = extent(scene.tool.mesh.vertices.iter().copied());
    for (what, key, size) in [("tool", of_tool, tool), ("blank", in_mm, extent(flat))] {
        if let Some(size) = absurd(size) {
            eprintln!("warning: {place}: the {what} measures {size}: check {key}");
        }
    }
    let lies = scene.clearance() <= MISSED;
    if let Some((index, distance)) = scene.farthest_clamp()
        && lies
        && 1e3 * distance > IN_THE_AIR
    {
        eprintln!(
            "warning: {place}: `clamps[{index}]` holds the blank {:.1} mm off the tool, expected at \
             most {IN_THE_AIR}: bring it down by `move_mm` or `placement`",
            1e3 * distance
        );
    }
    let blank = extent(scene.lamina.rest.iter().map(|&[x, y]| Vec3::new(x, y, 0.0)));
    if let Source::Mesh(file) = &config.tool.source
        && absurd(tool).is_none()
        && let Some(advice) = unit_advice(tool, file.scale, 0.2 * blank..=20.0 * blank)
    {
        let blank = 1e3 * blank;
        eprintln!(
            "warning: {place}: beside a blank of {blank:.0} mm the tool has an odd size: {advice}"
        );
    }
    warn_of_what_the_grid_does_not_see(&scene, place);
    let strain = scene.lamina.yarn_strain(&scene.initial.position);
    let tension = strain.into_iter().fold(0.0, f64::max);
    let believable = EnvConfig::default().max_tension;
    if tension > believable {
        eprintln!(
            "warning: {place}: after the fall a yarn is stretched by {:.0} %, expected at most {:.0}: \
             raise `fall.substep_rate`, or check `[physics]`",
            1e2 * tension,
            1e2 * believable
        );
    }
    let v_rms = 1e3 * scene.initial.v_rms();
    if v_rms > RESTLESS && lies {
        eprintln!(
            "warning: {place}: after the fall the blank still moves at {v_rms:.1} mm/s, expected \
             at most {RESTLESS}: raise `fall.substep_rate` or `fall.settle_s`"
        );
    }
    Ok(scene)
}

/// A grid of a given spacing swallows what is thinner.
fn warn_of_what_the_grid_does_not_see(scene: &Scene, place: &str) {
    let Some(spacing) = scene.config.tool.grid.spacing_mm else {
        return;
    };
    let (depth, vertex) = scene.tool.deepest(&scene.initial.position);
    let x = scene.initial.position[vertex];
    let unseen = depth + scene.tool.distance(x).0;
    if unseen.min(depth) > UNSEEN {
        let [x, y, z] = x.map(|x| 1e3 * x);
        eprintln!(
            "warning: {place}: at ({x:.1}, {y:.1}, {z:.1}) mm the blank is {:.2} mm inside the tool, \
             {:.2} mm more than a distance grid of {spacing} mm sees: leave out \
             `tool.grid.spacing_mm`, and distances at edges and thin walls are exact",
            1e3 * depth,
            1e3 * unseen
        );
    }
}

/// Sets a scene up, and refuses one whose blank has missed its tool.
pub(super) fn set_up_over_tool(
    config: &SceneConfig,
    place: &str,
    json: bool,
) -> Result<Scene, Failure> {
    let scene = set_up(config, place, json)?;
    let clearance = scene.clearance();
    if clearance > MISSED {
        let error = anyhow::anyhow!("{place}: {}", missed(clearance));
        return Err(Failure::invalid(error));
    }
    Ok(scene)
}

/// The configuration of a file, or else the built-in quickstart, and what messages call it.
pub fn read_config(path: Option<&Path>) -> Result<(RunConfig, String), Failure> {
    let Some(path) = path else {
        return Ok((RunConfig::quickstart(), "built-in quickstart".into()));
    };
    let config = RunConfig::read(path).or_invalid()?;
    Ok((config, path.display().to_string()))
}

/// What a run keeps of its configuration: as text, and files.
type Kept = (String, Vec<Input>);

/// Checks the task of a new run and sets up its scene. Gives what the run keeps, too.
pub(super) fn set_up_run(
    config: &RunConfig,
    place: &str,
    quiet: bool,
) -> Result<(Arc<Scene>, Kept), Failure> {
    // Just before the scene is set up from them, so that the run keeps what it is made with.
    let mut kept = config.clone();
    let inputs = kept.keep_inputs().or_invalid_in(place)?;
    let draping = set_up_tasks(config, 1, place, quiet)?;
    Ok((draping.scene().clone(), (kept.to_toml(), inputs)))
}

/// Sets up the scenes that a policy learns on beside its own, `first`.
pub(super) fn set_up_scenes(
    config: &RunConfig,
    first: Arc<Scene>,
    place: &str,
    quiet: bool,
) -> Result<Scenes, Failure> {
    let mut all = vec![first];
    let members = config.members().or_invalid_in(place)?;
    for member in &members {
        member
            .check_memory(config.environments)
            .or_invalid_in(place)?;
    }
    for (k, member) in members.iter().enumerate().skip(1) {
        let place = format!("{place}, member {k} of `scenes`");
        // Members that differ in their task alone lie on the same scene, others perhaps over the same tool.
        let known = members[..k]
            .iter()
            .position(|other| other.scene == member.scene);
        if let Some(known) = known {
            all.push(all[known].clone());
            continue;
        }
        let mut scene = set_up_member((&member.scene, &member.env), &place, quiet)?;
        let tools = all.iter().map(|other| &other.tool);
        let same = tools
            .zip(&members)
            .find(|(_, other)| other.scene.tool == member.scene.tool);
        if let Some((tool, _)) = same {
            Arc::make_mut(&mut scene).tool = tool.clone();
        }
        all.push(scene);
    }
    // Whether they look alike, and can be.
    let alike = members.iter().zip(&all).map(|(member, scene)| Member {
        scene: scene.clone(),
        config: member.env.clone(),
        count: 1,
    });
    Draping::on(alike.collect(), &Cluster::default()).or_invalid_in(place)?;
    Ok(all)
}

/// Sets up `count` tasks of a configuration that was read from `place`, each at its start. `quiet`
/// shows no progress.
///
/// # Errors
/// If the memory is exhausted, the scene or the task cannot be, the blank has missed its tool, nothing is left to be brought
/// down, or the network does not fit the image.
pub fn set_up_tasks(
    config: &RunConfig,
    count: usize,
    place: &str,
    quiet: bool,
) -> Result<Draping, Failure> {
    config.check_memory().or_invalid_in(place)?;
    let scene = set_up_member((&config.scene, &config.env), place, quiet)?;
    let draping = Draping::new(scene, &config.env, count).or_invalid_in(place)?;
    let ImageShape { rows, columns } = draping.shape();
    let policy = config.policy.validate(rows, columns).context("policy");
    policy.or_invalid_in(place)?;
    Ok(draping)
}

pub(super) fn set_up_member(
    (scene, env): (&SceneConfig, &EnvConfig),
    place: &str,
    quiet: bool,
) -> Result<Arc<Scene>, Failure> {
    let scene = Arc::new(set_up_over_tool(scene, place, quiet)?);
    let task = Task::new(scene.clone(), env).or_invalid_in(place)?;
    // Below a micrometre there is nothing to win, and scores divide by it.
    let initial = task.initial;
    if initial < 1e-6 {
        return Err(Failure::invalid(anyhow::anyhow!(
            "{place}: `env.region_mm` has {initial} m to bring down, expected a region of cloth that \
             does not lie on the tool yet"
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
    let in_unit = |unit: f64| size / scale * unit;
    let fits = UNITS
        .iter()
        .filter(|(_, unit)| usual.contains(&in_unit(*unit)));
    let fits: Vec<String> = fits
        .map(|(name, unit)| format!("{unit} ({name}) makes it {:.0} mm", 1e3 * in_unit(*unit)))
        .collect();
    let advice = match fits.is_empty() {
        true => "no usual unit fits".into(),
        false => fits.join(", "),
    };
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
