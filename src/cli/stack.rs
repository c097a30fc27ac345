//! Plies that are draped one on the other.

use std::io::Write as _;
use std::path::{Path, PathBuf, absolute};

use anyhow::{Context, anyhow};
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::Failure;
use super::failure::{Interrupted, OrInvalid};
use super::field::{OntoArgs, Writer};
use super::loaded::{self, Loaded};
use super::next_tool::{NEXT_TOOL, sheet, write_next_tool};
use super::output::print;
use super::setup::read_config;
use super::terminal::{Told, note};
use super::training::{TrainArgs, train};
use crate::cluster::ClusterSession;
use crate::run::{RunConfig, RunError, RunFolder};
use drape_cloth::file::{ValueError, read_toml, write_atomic};
use drape_cloth::mesh::TriMesh;
use drape_cloth::scene::Scene;
use drape_cloth::tool::{MeshSource, Source};
use drape_field::{PlyGap, vtu};
use drape_learn::policy::DeviceKind;
use drape_task::path::Frame;

/// Train several plies, each on the one before
///
/// Every ply is a run of its own, NAME/ply-1 and so on in the folder of the runs, with its draping points, its fibre
/// field as field.vtu and, where another ply follows, what that falls on as next-tool.stl. Given again, the command
/// goes on where it was interrupted: a ply that is proved is not trained again.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape stack dome.toml
  drape stack dome.toml --name thick --json")]
pub struct StackArgs {
    /// Stack file: a run configuration, and what differs from ply to ply (docs/PLIES.md)
    file: PathBuf,

    /// Name of the folder that holds the runs of the plies; that of the file if not given
    #[arg(long, value_name = "NAME")]
    name: Option<String>,

    /// Where networks and cloth are computed: flex (the CPU), gpu or gpu:N
    #[arg(long, value_name = "DEVICE")]
    device: Option<DeviceKind>,

    /// Folder that holds the runs
    #[arg(long, value_name = "DIR", default_value = "runs")]
    runs: PathBuf,
}

/// A stack file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stack {
    /// Run configuration of all plies; the built-in quickstart if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    config: Option<PathBuf>,
    /// From the tool upwards.
    plies: Vec<Ply>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Ply {
    /// Of the warp against x, as `blank.yarn_angle_deg`.
    angle_deg: f64,
    /// Keys that differ from the configuration of all plies.
    #[serde(default)]
    config: Table,
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    plies: Vec<Draped>,
}

/// What is printed of a ply.
#[derive(Serialize)]
struct Draped {
    run: Told,
    angle_deg: f64,
    /// In the physics in which its path was proved.
    score: f64,
    points: usize,
    #[serde(flatten)]
    lie: Lie,
    field: Told,
}

/// How a ply lies on what is below it.
#[derive(Serialize)]
struct Lie {
    thickness_m: f64,
    /// Greatest distance of a vertex from what is below [m]: what it spans is solid for the next ply.
    spanned_m: f64,
    /// How far pressed vertices lie over the sheet of the ply below; none for the first ply.
    gap: Option<PlyGap>,
}

impl Lie {
    /// That of a blank whose vertices are at `position` [m], of which those `within` a distance [m] count as pressed.
    fn new(
        scene: &Scene,
        position: &[[f64; 3]],
        within: f64,
        below: Option<&TriMesh>,
    ) -> Result<Self, Failure> {
        let tool = &scene.tool;
        let distances: Vec<f64> = position.iter().map(|&x| tool.distance(x).0).collect();
        let near = position.iter().zip(&distances);
        let near = near.filter(|(_, phi)| **phi <= within);
        let pressed: Vec<[f64; 3]> = near.map(|(x, _)| *x).collect();
        let pressed = tool.in_scene(&pressed);
        let gap = below
            .map(|below| PlyGap::new(below, &pressed))
            .transpose()?;
        Ok(Self {
            thickness_m: scene.lamina.material.thickness(),
            spanned_m: distances.into_iter().fold(0.0, f64::max),
            gap: gap.flatten(),
        })
    }
}

/// Runs `drape stack`.
pub fn run(args: StackArgs) -> Result<(), Failure> {
    let stack: Stack = read_toml(&args.file).or_invalid()?;
    let configs = configs(&stack, &args)?;
    let root = args.runs.join(name(&args)?);
    if root.join("run.json").exists() {
        return Err(Failure::invalid(anyhow!(
            "{} is a run, expected a folder of the runs of a stack: choose another --name",
            root.display()
        )));
    }
    let session = ClusterSession::start().map_err(Failure::invalid)?;
    let mut plies = Vec::new();
    // The sheet of the ply below in the scene [m], and the file of the tool that it makes.
    let mut below: Option<(TriMesh, PathBuf)> = None;
    for (number, (ply, mut config)) in (1..).zip(stack.plies.iter().zip(configs)) {
        if let Some((_, path)) = &below {
            let path = absolute(path)?;
            config.scene.tool.source = Source::Mesh(MeshSource { path, scale: 1e-3 });
        }
        let run = train_ply(&root, number, config, &args, &session)?;
        let loaded = Loaded::open(&run, loaded::Source::Path, None, args.device)?;
        let (played, Some(proved)) = loaded.play_path()? else {
            let fault = "has no proved path, expected one for its fibre field and for the next ply";
            return Err(anyhow!("{} {fault}", run.display()).into());
        };
        let (scene, draped) = (&*loaded.scene, played.recording.end());
        let frame = Frame::tool(&scene.config.tool.pose);
        let field = run.join("field.vtu");
        let onto = OntoArgs::default();
        let writer: Writer = |field, remarks| vtu(field, remarks).into();
        onto.write(None, scene, draped, &frame, writer, &field)?;
        let within = 1e-3 * loaded.env.drape_threshold_mm;
        let under = below.as_ref().map(|(sheet, _)| sheet);
        plies.push(Draped {
            angle_deg: ply.angle_deg,
            score: proved.path.score,
            points: proved.path.vertices.len(),
            lie: Lie::new(scene, draped, within, under)?,
            field: field.into(),
            run: (&run).into(),
        });
        if number < stack.plies.len() {
            let file = run.join(NEXT_TOOL);
            write_next_tool(scene, draped, &frame, &run, &file)?;
            below = Some((sheet(scene, draped), file));
        }
    }
    print(&Report { plies }, text)
}

/// The name of the folder of the plies.
fn name(args: &StackArgs) -> Result<String, Failure> {
    let stem = args.file.file_stem().unwrap_or_default();
    let name = args.name.clone();
    let name = name.unwrap_or_else(|| stem.to_string_lossy().into());
    let is_one = Path::new(&name).file_name() == Some(name.as_ref());
    match is_one && !name.contains(char::is_control) {
        true => Ok(name),
        false => Err(RunError::Name(name).into()),
    }
}

/// The run configurations of all plies, as if each lay on the tool itself, checked as far as that needs no cloth.
fn configs(stack: &Stack, args: &StackArgs) -> Result<Vec<RunConfig>, Failure> {
    let name = args.file.display().to_string();
    let count = stack.plies.len();
    ValueError::unless(count > 0, "plies", count, "one or more").or_invalid_in(&name)?;
    let folder = args.file.parent().unwrap_or(Path::new(""));
    let file = stack.config.as_ref().map(|file| folder.join(file));
    let (base, place) = read_config(file.as_deref())?;
    let alone = |config: &RunConfig, place: &str| {
        let expected = "none in a stack, whose plies lie on one another";
        let found = config.scenes.len();
        ValueError::unless(found == 0, "scenes", found, expected).or_invalid_in(place)?;
        let found = config.scene.placement.scan.as_deref();
        let told = found.unwrap_or(Path::new("")).display();
        let is_none = found.is_none();
        ValueError::unless(is_none, "scene.placement.scan", told, expected).or_invalid_in(place)
    };
    alone(&base, &place)?;
    let base = base.with_task(&base.scene, &base.env)?;
    let whole: Table = base.to_toml().parse().context("a configuration is TOML")?;
    let config = |(number, ply): (usize, &Ply)| {
        let place = format!("{name}, ply {number}");
        let expected = "it in the configuration of all plies, whose keys it has filled in";
        let is_free = !ply.config.contains_key("preset");
        ValueError::unless(is_free, "preset", "it in a ply", expected).or_invalid_in(&place)?;
        let below = |table: &Table, key: &str| table.get(key)?.as_table().cloned();
        let blank = below(&ply.config, "scene").and_then(|scene| below(&scene, "blank"));
        let is_free = blank.is_none_or(|blank| !blank.contains_key("yarn_angle_deg"));
        let expected = "`angle_deg` of the ply, which is what gives it";
        let key = "scene.blank.yarn_angle_deg";
        ValueError::unless(is_free, key, "it in a ply", expected).or_invalid_in(&place)?;
        let mut table = whole.clone();
        overlay(&mut table, &ply.config);
        let text = toml::to_string(&table).expect("what was read is representable");
        let mut config = RunConfig::parse(&text, Path::new(&place)).or_invalid()?;
        alone(&config, &place)?;
        let is_same = config.scene.tool == base.scene.tool;
        let expected = "the tool of all plies, each of which lies on the one before";
        ValueError::unless(is_same, "scene.tool", "another", expected).or_invalid_in(&place)?;
        config.scene.blank.yarn_angle_deg = ply.angle_deg;
        config.set_device(args.device);
        let config = config.with_task(&config.scene, &config.env)?;
        config.check_before_fall().or_invalid_in(&place)?;
        Ok(config)
    };
    (1..).zip(&stack.plies).map(config).collect()
}

/// Puts values in place of others, table by table.
fn overlay(table: &mut Table, over: &Table) {
    for (key, value) in over {
        match (table.get_mut(key), value) {
            (Some(Value::Table(below)), Value::Table(above)) => overlay(below, above),
            _ => drop(table.insert(key.clone(), value.clone())),
        }
    }
}

/// Trains a ply, or goes on with it, unless it is proved. Gives its run.
fn train_ply(
    root: &Path,
    number: usize,
    config: RunConfig,
    args: &StackArgs,
    session: &ClusterSession,
) -> Result<PathBuf, Failure> {
    let name = format!("ply-{number}");
    let run = root.join(&name);
    let mut training = TrainArgs::default();
    training.device = args.device;
    if run.exists() {
        let folder = RunFolder::open(&run).or_invalid()?;
        let mut kept = config;
        kept.keep_inputs().or_invalid()?;
        let found: Table = read_toml(&folder.config).or_invalid()?;
        if found != kept.to_toml().parse()? {
            return Err(Failure::invalid(anyhow!(
                "{} was draped by another configuration, or on another ply, than {} says now, expected the same: \
                 choose another --name, or remove the folder",
                run.display(),
                args.file.display()
            )));
        }
        if folder.read_proof()?.is_some() {
            return Ok(run);
        }
        training.resume = Some(run.clone());
    } else {
        let file = run.with_extension("toml");
        let text = config.to_toml();
        std::fs::create_dir_all(root)
            .with_context(|| format!("cannot create {}", root.display()))?;
        write_atomic(&file, |to| to.write_all(text.as_bytes()))?;
        training.config = Some(file);
        training.name = Some(name);
        training.runs = root.into();
    }
    note(format_args!("ply {number}: {}", run.display()));
    let outcome = train(&training, session)?;
    match outcome.and_then(|outcome| outcome.interrupted) {
        Some(signal) => Err(Interrupted(signal).into()),
        None => Ok(run),
    }
}

fn text(report: &Report) -> String {
    let line = |(number, ply): (usize, &Draped)| {
        let lie = &ply.lie;
        let gap = lie.gap.map_or(String::new(), |gap| {
            format!(
                "; {} pressed vertices lie {:.3} mm over the ply below on average, at least {:.3}",
                gap.points,
                1e3 * gap.mean_m,
                1e3 * gap.least_m
            )
        });
        format!(
            "ply {number} at {} degrees, {}: {} points, score {:.2} %, spans up to {:.1} mm{gap}",
            ply.angle_deg,
            ply.run.display(),
            ply.points,
            100.0 * ply.score,
            1e3 * lie.spanned_m
        )
    };
    let lines: Vec<String> = (1..).zip(&report.plies).map(line).collect();
    lines.join("\n")
}
