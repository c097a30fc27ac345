use std::path::{Path, PathBuf};

use std::io::Write as _;

use anyhow::{Context, anyhow};
use clap::ValueEnum;
use serde::Serialize;

use super::Failure;
use super::failure::OrInvalid;
use super::field::{FieldReport, OntoArgs, Writer as FieldWriter, picture, write_pattern};
use super::loaded::{Loaded, Source, read_checkpoint, shape_of};
use super::next_tool::{NEXT_TOOL, write_next_tool};
use super::output::{check_outputs, print};
use super::planned::{Planned, name};
use super::result::path;
use super::setup::open_run;
use super::terminal::Told;
use crate::run::Weights;
use drape_cloth::fabric::{Curve, Drape, Family};
use drape_cloth::file::{ValueError, write_atomic};
use drape_cloth::math::Vec3;
use drape_cloth::sim::{Bending, BendingStiffness};
use drape_field::{abaqus, composite_cae, elements_csv, radioss, vtu};
use drape_learn::policy::DeviceKind;
use drape_proof::Physics;
use drape_robot::{CellConfig, Program, ProgramError};
use drape_task::env::Scatter;
use drape_task::path::inp::{Deck, Dialect, DrapingDeck, FabricCard};
use drape_task::path::{DrapingPoint, Frame, PathFigures, write_csv, write_json};

/// Write the ordered draping points for the robot, or the fabric for finite elements
#[derive(Debug, clap::Args)]
pub struct ExportArgs {
    /// Run folder
    run: PathBuf,

    /// JSON in metres, CSV in millimetres, or a deck of lamina, tool, material and presses: Abaqus has
    /// the fabric's test data, CalculiX an elastic approximation. Or the program of a robot (docs/ROBOT.md): RAPID,
    /// URScript, joints over time for ROS, or points with joints. Or what the fabric has become (docs/FIELDS.md): yarn
    /// directions, shear and thickness of every element as VTU, for Abaqus, for Radioss, as HDF5 Composite CAE or
    /// as CSV, with a picture of the shear; and the flat pattern of the blank as DXF. Or the tool that the next ply falls on
    /// (docs/PLIES.md), as STL in millimetres. Or the policy, for `--from` of `drape train` and `plan`
    #[arg(long, value_enum, default_value_t = Format::Json)]
    format: Format,

    /// What coordinates count from: the tool's own file, or the scene, where tool.pose has moved it. Every
    /// format says which, and has the pose
    #[arg(long, value_enum, default_value_t = Axes::Tool)]
    frame: Axes,

    /// Robot, roller and table of a program; those of the run if not given, else those that `drape robot` has used
    #[arg(long, value_name = "FILE")]
    cell: Option<PathBuf>,

    #[command(flatten)]
    onto: OntoArgs,

    /// File to write; trajectory.json, trajectory.csv, draping.inp, program.*, field.*, pattern.dxf, next-tool.stl or
    /// policy.drape in the run folder if not given
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Export the greedy policy of a checkpoint (best, last, or a file) instead of the path that
    /// the run has proved, or before that its best sequence
    #[arg(long, value_name = "best|last|FILE")]
    checkpoint: Option<String>,

    /// Where networks and cloth are computed: flex (the CPU), gpu or gpu:N; as in training
    /// if not given
    #[arg(long, value_name = "DEVICE")]
    device: Option<DeviceKind>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    Json,
    Csv,
    Calculix,
    Abaqus,
    Rapid,
    Urscript,
    Trajectory,
    JointsJson,
    JointsCsv,
    Vtu,
    AbaqusOrientation,
    Radioss,
    Hdf5,
    CsvElements,
    Dxf,
    NextTool,
    Policy,
}

impl Format {
    /// How the program of a robot is written, with the end of its file's name; none for other formats.
    fn program(self) -> Option<(Writer, &'static str)> {
        match self {
            Self::Rapid => Some((|program| program.rapid(), "mod")),
            Self::Urscript => Some((|program| program.urscript(), "script")),
            Self::Trajectory => Some((|program| program.trajectory(), "yaml")),
            Self::JointsJson => Some((|program| program.points_json(), "json")),
            Self::JointsCsv => Some((|program| program.points_csv(), "csv")),
            _ => None,
        }
    }

    /// How a fibre field is written, with the end of its file's name; none for other formats.
    fn field(self) -> Option<(FieldWriter, &'static str)> {
        match self {
            Self::Vtu => Some((|field, remarks| vtu(field, remarks).into(), "vtu")),
            Self::AbaqusOrientation => {
                Some((|field, remarks| abaqus(field, remarks).into(), "inp"))
            }
            Self::Radioss => Some((|field, remarks| radioss(field, remarks).into(), "rad")),
            Self::Hdf5 => Some((composite_cae, "h5")),
            Self::CsvElements => {
                Some((|field, remarks| elements_csv(field, remarks).into(), "csv"))
            }
            _ => None,
        }
    }

    /// Names of those that write a fibre field.
    fn with_elements() -> String {
        let all = Self::value_variants().iter();
        let names = all.filter(|format| format.field().is_some());
        let names: Vec<_> = names.filter_map(Self::to_possible_value).collect();
        let names: Vec<_> = names.iter().map(|name| name.get_name()).collect();
        names.join(", ")
    }
}

type Writer = fn(&Program) -> Result<String, ProgramError>;

#[derive(Clone, Copy, Debug, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
enum Axes {
    Tool,
    Scene,
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    file: Told,
    frame: Axes,
    points: usize,
    #[serde(flatten)]
    path: PathFigures,
    /// In the physics in which the path was proved, or else in the task's own steps.
    score: f64,
    /// The physics in which the path was proved; none if it was not.
    proved: Option<Physics>,
    /// How the worlds scatter in which it was proved.
    scatter: Option<Scatter>,
    #[serde(flatten)]
    field: Option<FieldReport>,
}

/// Runs `drape export`.
pub fn run(args: ExportArgs) -> Result<(), Failure> {
    let others = args.format.field().is_none().then(Format::with_elements);
    let mesh = args.onto.read(others.as_deref())?;
    if let Format::Policy = args.format {
        return policy(&args);
    }
    let source = match &args.checkpoint {
        Some(name) => Source::Checkpoint(name),
        None => Source::Path,
    };
    let loaded = Loaded::open(&args.run, source, None, args.device)?;
    let file = args.out.clone().unwrap_or_else(|| {
        let json = loaded.folder.trajectory.clone();
        match args.format {
            Format::Json => json,
            Format::Csv => json.with_extension("csv"),
            Format::Calculix | Format::Abaqus => json.with_file_name("draping.inp"),
            Format::Dxf => json.with_file_name("pattern.dxf"),
            Format::NextTool => json.with_file_name(NEXT_TOOL),
            Format::Policy => unreachable!("it needs no path"),
            _ => match (args.format.program(), args.format.field()) {
                (Some((_, end)), _) => json.with_file_name("program").with_extension(end),
                (_, Some((_, end))) => json.with_file_name("field").with_extension(end),
                _ => unreachable!("the others are programs and fields"),
            },
        }
    });
    let drawn = args.format.field().map(|_| picture(&file));
    let written = std::iter::once(&file).chain(&drawn);
    let read = args.checkpoint.as_deref().map(Path::new);
    let read = read
        .into_iter()
        .chain(args.onto.onto.as_deref())
        .chain(args.cell.as_deref());
    check_outputs(written.map(PathBuf::as_path), read)?;
    if let Some((writer, _)) = args.format.program() {
        return program(&args, &loaded, writer, file);
    }
    let (played, proof) = match &args.checkpoint {
        Some(name) => (loaded.play(Some(name))?.0, None),
        None => loaded.play_path()?,
    };
    let points = path(&played.recording)?;
    let pose = &loaded.scene.config.tool.pose;
    let frame = match args.frame {
        Axes::Tool => Frame::tool(pose),
        Axes::Scene => Frame::scene(pose),
    };
    let mut field = None;
    match args.format {
        Format::Json => write_json(&file, &points, &frame)?,
        Format::Csv => write_csv(&file, &points, &frame)?,
        Format::Calculix => deck(&loaded, &points, frame, Dialect::Calculix)?.write(&file)?,
        Format::Abaqus => deck(&loaded, &points, frame, Dialect::Abaqus)?.write(&file)?,
        Format::Dxf => write_pattern(&loaded.scene, &points, &file)?,
        Format::NextTool => {
            let (draped, run) = (played.recording.end(), &loaded.folder.path);
            write_next_tool(&loaded.scene, draped, &frame, run, &file)?;
        }
        _ => {
            let (writer, _) = args.format.field().expect("programs are written above");
            let (scene, draped) = (&loaded.scene, played.recording.end());
            field = Some((args.onto).write(mesh, scene, draped, &frame, writer, &file)?);
        }
    }
    let report = Report {
        points: points.len(),
        path: played.summary.path,
        score: proof
            .as_ref()
            .map_or(played.summary.score, |p| p.path.score),
        scatter: proof.as_ref().map(|_| loaded.config.scatter.clone()),
        proved: proof.map(|proved| proved.physics),
        file: file.into(),
        frame: args.frame,
        field,
    };
    print(&report, text)
}

fn text(report: &Report) -> String {
    let (file, path) = (report.file.display(), report.path.text());
    let mut proved = match report.proved {
        Some(physics) => format!("proved: {}", physics.name()),
        None => "not proved".into(),
    };
    let scatter = report
        .scatter
        .iter()
        .flat_map(|scatter| scatter.spreads.keys());
    let vary: Vec<String> = scatter.map(|quantity| quantity.name()).collect();
    if !vary.is_empty() {
        proved += &format!(" in worlds in which these vary: {}", vary.join(", "));
    }
    let said = format!(
        "{file}: {path}, score {:.2} %, {proved}",
        100.0 * report.score
    );
    match &report.field {
        Some(field) => format!("{said}\n{}", field.text()),
        None => said,
    }
}

/// What is printed of a policy.
#[derive(Serialize)]
struct PolicyReport {
    file: Told,
    parameters: usize,
    digest: String,
}

/// Writes the policy of a checkpoint, the last one unless another is named.
fn policy(args: &ExportArgs) -> Result<(), Failure> {
    let (folder, config) = open_run(&args.run)?;
    let name = args.checkpoint.as_deref().unwrap_or("last");
    let (read, checkpoint) = read_checkpoint(&folder, name)?;
    let weights = Weights::of(&config, shape_of(&config)?, &checkpoint);
    let weights = weights.with_context(|| read.display().to_string())?;
    let default = || folder.path.join("policy.drape");
    let file = args.out.clone().unwrap_or_else(default);
    check_outputs([&*file], [&*read])?;
    weights.write(&file)?;
    let report = PolicyReport {
        parameters: weights.network().len() / size_of::<f32>(),
        digest: weights.digest(),
        file: file.into(),
    };
    print(&report, |report| {
        format!(
            "{}: {} parameters, {}",
            report.file.display(),
            report.parameters,
            report.digest
        )
    })
}

/// What is printed of a robot's program.
#[derive(Serialize)]
struct ProgramReport {
    file: Told,
    robot: String,
    points: usize,
    /// Points that it presses.
    reachable: usize,
    strokes: usize,
    program_s: f64,
    /// That is of nobody's shop.
    #[serde(skip)]
    is_default_cell: bool,
}

/// Writes the program by which a robot presses the path of the run.
fn program(
    args: &ExportArgs,
    loaded: &Loaded,
    writer: Writer,
    file: PathBuf,
) -> Result<(), Failure> {
    if args.checkpoint.is_some() {
        let error = "`--checkpoint` has points but no program, expected the run's path";
        return Err(Failure::invalid(anyhow!(error)));
    }
    let planned = Planned::new(loaded, args.cell.as_deref())?;
    if let Some(hit) = planned.collisions.first() {
        return Err(anyhow!(
            "{}: the program hits something {hit}, nothing is written",
            file.display()
        )
        .into());
    }
    let program = planned.cell.program(&planned.plan, &name(&args.run));
    let text = writer(&program).with_context(|| file.display().to_string())?;
    write_atomic(&file, |to| to.write_all(text.as_bytes()))?;
    // The base of the default one is found anew for each path.
    let cell = CellConfig {
        base: None,
        ..planned.config.clone()
    };
    let report = ProgramReport {
        robot: planned.cell.arm.name.clone(),
        points: planned.path.len(),
        reachable: planned.path.len() - planned.plan.failed.len(),
        strokes: program.strokes.len(),
        program_s: program.seconds(),
        is_default_cell: cell == CellConfig::unnamed(),
        file: file.into(),
    };
    print(&report, |report| {
        let mut text = format!(
            "{}: {} of {} points in {} strokes by a {}, {:.1} s",
            report.file.display(),
            report.reachable,
            report.points,
            report.strokes,
            report.robot,
            report.program_s
        );
        if report.reachable < report.points {
            text += "; `drape robot` says why others are not pressed";
        }
        if report.is_default_cell {
            text += "\nwarning: no cell was given, so this is for the default one: name yours with --cell";
        }
        text
    })
}

/// The lamina with the presses of `points`: for CalculiX before the fall, for Abaqus after it.
/// Under the stencil are the triangles whose middle is, on the flat blank, within half of its side
/// of the pressed vertex.
fn deck(
    loaded: &Loaded,
    points: &[DrapingPoint],
    frame: Frame,
    dialect: Dialect,
) -> Result<Deck, Failure> {
    let scene = &loaded.scene;
    let (lamina, material) = (&scene.lamina, &scene.lamina.material);
    let place = loaded.folder.config.display().to_string();
    if let (Dialect::Calculix, Some(scan)) = (dialect, &scene.config.placement.scan) {
        return Err(Failure::invalid(anyhow!(
            "{place}: `placement.scan` is {}, expected none in a deck for CalculiX, where the blank falls",
            scan.display()
        )));
    }
    let start = match dialect {
        // In a fall of a second velocities are displacements.
        Dialect::Calculix => scene.hung(1.0).with_context(|| place.clone())?,
        Dialect::Abaqus => (*scene.initial).clone(),
    };
    let drape = Drape::new(lamina, &scene.tool.in_scene(&start.position));
    let count = drape.triangles.len();
    let yarns: Vec<[Vec3; 2]> = (0..count)
        .map(|t| drape.tangents(t))
        .map(|tangents| [tangents.warp, tangents.weft])
        .collect();
    let half = 0.5e-3 * loaded.config.env.stencil_mm;
    let centres: Vec<[f64; 2]> = (0..count).map(|t| drape.rest_centre(t)).collect();
    let pressed = |point: &DrapingPoint| {
        let at = drape.rest[point.vertex as usize];
        let is_near = |centre: [f64; 2]| (0..2).all(|k| (centre[k] - at[k]).abs() <= half);
        let is_under = |t: &u32| is_near(centres[*t as usize]);
        (0..count as u32).filter(is_under).collect()
    };
    let presses: Vec<Vec<u32>> = points.iter().map(pressed).collect();
    let points = |curve: &Curve| curve.points().to_vec();
    let physics = scene.model.physics();
    let shear = material.shear.curves(physics.shear_locking);
    let fabric = FabricCard {
        thickness: material.thickness(),
        areal_mass: lamina.mass.iter().sum::<f64>() / lamina.area(),
        tension: [&material.warp, &material.weft].map(|law| points(&law.tension)),
        compression: [&material.warp, &material.weft].map(|law| points(&law.compression)),
        shear: shear.each_ref().map(points),
        bending: [Family::Warp, Family::Weft].map(|family| {
            match (physics.bending, physics.bending_stiffness) {
                (Bending::Off, _) => 0.0,
                (_, BendingStiffness::Material) => material.bending_stiffness(family),
                (_, BendingStiffness::NewtonMetre(stiffness)) => stiffness,
            }
        }),
        friction: match physics.friction {
            true => material.friction(),
            false => [0.0; 2],
        },
    };
    if dialect == Dialect::Calculix && !fabric.elastic_thickness().is_normal() {
        let (key, found) = match physics.bending {
            Bending::Off => ("physics.bending", "off".into()),
            _ => ("physics.bending_stiffness", fabric.bending[0].to_string()),
        };
        let expected = "bending that gives the elastic shell of CalculiX a thickness";
        return Err(ValueError::new(key, found, expected)).or_invalid_in(place);
    }
    let held = start.fixed.ones();
    let clamped: Vec<(u32, Vec3)> = held.map(|v| (v as u32, start.velocity[v].into())).collect();
    Ok(DrapingDeck {
        title: "woven lamina on a tool, pressed along a draping path",
        lamina: &drape.mesh(),
        yarns: &yarns,
        clamped: &clamped,
        tool: &scene.tool.mesh_in_scene(),
        fabric: &fabric,
        presses: &presses,
        step_s: loaded.config.env.press_s + loaded.config.env.settle_s,
        pressure: loaded.config.env.roller().pressure,
        gravity: physics.gravity,
        frame,
    }
    .deck(dialect))
}
