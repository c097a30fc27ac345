use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::anyhow;
use serde::Serialize;

use super::Failure;
use super::loaded::{Loaded, Source};
use super::output::{print, write_together};
use super::planned::{FOLDER, Planned, RESOLVED, name};
use super::terminal::Told;
use drape_cloth::file::write_atomic;
use drape_cloth::math::Vec3;
use drape_cloth::mesh::TriMesh;
use drape_cloth::scene::Scene;
use drape_report::{Camera, Color, DRAPED, Drawing, Image, TOOL, creased, save_gif};
use drape_robot::{BaseProposal, Cell, FailedPoint, Joints, Point, Pose, Pushed, Reached};

/// Plan how a robot arm presses the path of a run: what it reaches, what it would hit, and the program
///
/// Writes pictures of the arm, a film of the program and the cell as it was resolved into RUN/robot; `drape export
/// --format rapid` and its like take the cell from there.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape robot runs/NAME
  drape robot runs/NAME --cell cell.toml --json
  drape export runs/NAME --format rapid --out drape.mod")]
pub struct RobotArgs {
    /// Run folder
    run: PathBuf,

    /// Robot, roller, table and frame, as docs/ROBOT.md has them; if not given the task's own, that of the last plan of
    /// the run, or a CRB 15000 that stands where it reaches most
    #[arg(long, value_name = "FILE")]
    cell: Option<PathBuf>,
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    run: Told,
    robot: String,
    /// Of the arm's base in the scene [mm].
    base_mm: [f64; 3],
    points: usize,
    /// Points that the program presses.
    reachable: usize,
    failed: Vec<FailedPoint>,
    /// What points take, each by itself.
    reached: Reached,
    /// Places where the program, played at finer steps, hits something: none.
    collisions: Vec<String>,
    /// Presses at which the arm pushes cloth aside that stands off the tool, how deep, and with what.
    pushed: Vec<Pushed>,
    /// Points that the arm would hit something at, if it went there at once.
    collisions_before: usize,
    strokes: usize,
    /// Strokes of the path that were lifted within.
    lifted: usize,
    /// Angles of the turntable that are used.
    stations_deg: Vec<f64>,
    program_s: f64,
    /// Least over the program: of the Jacobian's singular values, and the distance to what might be hit [mm].
    sigma_min: f64,
    clearance_mm: f64,
    /// Where the base would reach more.
    better_base: Option<BaseProposal>,
    seconds: f64,
    folder: Told,
}

const PICTURE: [usize; 2] = [720, 620];
const FILM: [usize; 2] = [480, 400];
/// Pictures of worst points, and frames of the film.
const WORST: usize = 4;
const FRAMES: usize = 90;
const ARM: Color = [200, 160, 60];
const BLOCK: Color = [120, 120, 124];

/// Runs `drape robot`.
pub fn run(args: RobotArgs) -> Result<(), Failure> {
    let start = Instant::now();
    let loaded = Loaded::open(&args.run, Source::Path, None, None)?;
    let mut planned = Planned::new(&loaded, args.cell.as_deref())?;
    let better = planned.cell.find_remedies(&planned.path, &mut planned.plan);
    let Planned {
        cell, path, plan, ..
    } = &planned;
    let program = cell.program(plan, &name(&args.run));
    let least = |of: fn(&drape_robot::Contact) -> f64| {
        plan.contacts()
            .map(|(_, contact)| of(contact))
            .fold(f64::INFINITY, f64::min)
    };
    let folder = loaded.folder.path.join(FOLDER);
    let report = Report {
        run: (&args.run).into(),
        robot: cell.arm.name.clone(),
        base_mm: cell.base.translation.vector.map(|x| 1e3 * x).into(),
        points: path.len(),
        reachable: path.len() - plan.failed.len(),
        failed: plan.failed.clone(),
        reached: cell.reached(path, better.as_ref().map(|(cell, _)| cell)),
        collisions: planned.collisions.clone(),
        pushed: planned.pushed.clone(),
        collisions_before: cell.collisions_at_once(path),
        strokes: plan.strokes.len(),
        lifted: plan.lifted,
        stations_deg: plan
            .stations
            .iter()
            .map(|station| station.angle.to_degrees())
            .collect(),
        program_s: program.seconds(),
        sigma_min: least(|contact| contact.sigma_min),
        clearance_mm: 1e3 * least(|contact| contact.clearance),
        better_base: better.map(|(_, proposal)| proposal),
        seconds: start.elapsed().as_secs_f64(),
        folder: (&folder).into(),
    };
    std::fs::create_dir_all(&folder)
        .map_err(|error| anyhow!("cannot create {}: {error}", folder.display()))?;
    write_together(&folder, |to| pictures(&planned, &loaded.scene, to))?;
    print(&report, Report::text)
}

impl Report {
    fn text(&self) -> String {
        let reached = &self.reached;
        let [x, y, z] = self.base_mm;
        let mut text = format!(
            "{} of {} points in {} strokes ({} of the path lifted within) by a {} at ({x:.0}, {y:.0}, {z:.0}) mm, {:.1} s\n\
             by themselves: {} at once, {} with the roller flipped, {} by tilting, {} by turning the table, {} by moving \
             the base, {} not at all\n\
             collisions: {} if every point was gone to at once, {} in the program; least clearance {:.1} mm, least \
             singular value {:.3}",
            self.reachable,
            self.points,
            self.strokes,
            self.lifted,
            self.robot,
            self.program_s,
            reached.at_once,
            reached.by_flipping,
            reached.by_tilting,
            reached.by_turning_the_table,
            reached.by_moving_the_base,
            reached.not_at_all,
            self.collisions_before,
            self.collisions.len(),
            self.clearance_mm,
            self.sigma_min,
        );
        for hit in &self.collisions {
            let _ = write!(text, "\n  hits: {hit}");
        }
        let deepest = (self.pushed.iter()).max_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm));
        if let Some(Pushed { part, depth_mm, .. }) = deepest {
            let (count, of) = (self.pushed.len(), self.reachable);
            let _ = write!(
                text,
                "\ncloth is pushed aside at {count} of {of} presses, {depth_mm:.1} mm at most, by the {part}"
            );
        }
        for point in &self.failed {
            let check = serde_json::to_string(&point.check).expect("a name");
            let _ = write!(
                text,
                "\n  point {}: {}: {}; tried {}; remedy: {}",
                point.index,
                check.trim_matches('"'),
                point.detail,
                point.tried,
                point.remedy
            );
        }
        let _ = write!(text, "\nwritten to {}", self.folder.display());
        text
    }
}

/// Pictures of the arm where it is nearest to trouble, a film of the program, and the cell.
fn pictures(planned: &Planned, scene: &Scene, folder: &Path) -> Result<(), Failure> {
    let text = toml::to_string(&planned.config).expect("a cell can be written");
    write_atomic(&folder.join(RESOLVED), |file| {
        std::io::Write::write_all(file, text.as_bytes())
    })?;
    let plan = &planned.plan;
    let stage = Stage::new(planned, scene);
    let mut worst: Vec<_> = plan.contacts().collect();
    worst.sort_by(|a, b| a.1.clearance.total_cmp(&b.1.clearance));
    for (k, (stroke, contact)) in worst.iter().take(WORST).enumerate() {
        let station = stage.station(stroke.station);
        let caption = format!(
            "point {}: clearance {:.1} mm, singular value {:.3}, tilt {:.0} deg",
            contact.point,
            1e3 * contact.clearance,
            contact.sigma_min,
            stroke.tilt.to_degrees()
        );
        let image = stage.picture(&contact.joints, station, &caption, PICTURE);
        image.save_png(&folder.join(format!("worst-{}.png", k + 1)))?;
    }
    let mut frames = Vec::new();
    for stroke in &plan.strokes {
        let station = stage.station(stroke.station);
        frames.extend(
            stroke
                .transfer
                .iter()
                .chain([&stroke.approach])
                .map(|q| (*q, station)),
        );
        frames.extend(
            stroke
                .contacts
                .iter()
                .map(|contact| (contact.joints, station)),
        );
        frames.push((stroke.retreat, station));
    }
    let skip = frames.len().div_ceil(FRAMES).max(1);
    let images: Vec<Image> = frames
        .iter()
        .step_by(skip)
        .map(|(joints, station)| stage.picture(joints, *station, "", FILM))
        .collect();
    if !images.is_empty() {
        save_gif(&images, 12, 150, &folder.join("program.gif"))?;
    }
    Ok(())
}

/// The cell as pictures show it.
struct Stage<'a> {
    planned: &'a Planned,
    tool: TriMesh,
    camera: Camera,
}

impl<'a> Stage<'a> {
    fn new(planned: &'a Planned, scene: &Scene) -> Self {
        let tool = creased(&scene.tool.mesh_in_scene());
        let (mut low, mut high) = tool.bounds();
        let arm = arm_mesh(&planned.cell, &planned.plan.home);
        (low, high) = (low.inf(&arm.bounds().0), high.sup(&arm.bounds().1));
        Self {
            planned,
            tool,
            camera: Camera::isometric((low, high)),
        }
    }

    /// The number in the cell of a station of the plan.
    fn station(&self, of: usize) -> usize {
        self.planned.cell.station(&self.planned.plan.stations[of])
    }

    fn picture(&self, joints: &Joints, station: usize, caption: &str, size: [usize; 2]) -> Image {
        let Planned {
            cell, path, plan, ..
        } = self.planned;
        let turn = cell.turn(station);
        let mut drawing = Drawing::new(&self.camera, size);
        let turned = |mut mesh: TriMesh| {
            for vertex in &mut mesh.vertices {
                *vertex = (turn * Point::from(*vertex)).coords;
            }
            mesh
        };
        drawing.mesh(&turned(self.tool.clone()), |_| TOOL, 0.0);
        let [standing, turning] = cell.blocks().map(soup);
        drawing.mesh(&turned(turning), |_| BLOCK, 0.0);
        drawing.mesh(&standing, |_| BLOCK, 0.0);
        drawing.mesh(&arm_mesh(cell, joints), |_| ARM, 0.0);
        for (k, point) in path.iter().enumerate() {
            let failed = plan.failed.iter().any(|failed| failed.index == k);
            let at = cell.in_scene(&point.position, station);
            drawing.disc(at, 3e-3, if failed { FAILED } else { DRAPED });
        }
        let mut image = drawing.image();
        image.label([10, 8], caption, 14.0, [232, 232, 228]);
        image
    }
}

const FAILED: Color = [220, 60, 50];

/// The arm in the scene.
fn arm_mesh(cell: &Cell, joints: &Joints) -> TriMesh {
    let shapes = cell.shapes();
    let placed = shapes.iter().zip(cell.frames(joints));
    let corner = |pose: Pose| move |at: &Vec3| (pose * Point::from(*at)).coords;
    let triangles = placed.flat_map(|(shape, pose)| {
        let place = move |triangle: &[Vec3; 3]| triangle.each_ref().map(corner(pose));
        shape.iter().map(place)
    });
    soup(triangles.collect())
}

fn soup(triangles: Vec<[Vec3; 3]>) -> TriMesh {
    let count = triangles.len() as u32;
    TriMesh {
        vertices: triangles.into_flattened(),
        triangles: (0..count).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect(),
    }
}
