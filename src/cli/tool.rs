use std::collections::HashSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Error, anyhow, ensure};
use serde::Serialize;

use super::Failure;
use super::args::{not_negative, png, positive};
use super::failure::OrInvalid;
use super::output::{check_outputs, print};
use super::setup::unit_advice;
use super::terminal::Told;
use drape_cloth::file::{ReadError, ValueError, parse_toml};
use drape_cloth::mesh::{TriMesh, read_mesh, write_stl};
use drape_cloth::tool::{GridConfig, GridError, Shape, Thinnest, Tool};
use drape_report::{Camera, Drawing, TOOL, creased};
use drape_scan::{Changes, repair};

/// Points at which the distance grid is compared.
const GRID_SAMPLES: usize = 20_000;

/// What the distance may err by near the surface [mm].
const GRID_ERROR: &str = "0.1";

/// Width and height of the picture [px].
const SIZE: [usize; 2] = [960, 720];
/// Greatest tolerance of a repair, over the longest side of the tool.
const COARSEST: f64 = 0.01;

/// Write a parametric tool as STL file (binary, millimetres), or examine one of yours
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape tool rib --out rib.stl
  drape tool hemisphere --set radius_mm=90 --set 'plate_mm=[420, 420]' --out dome.stl
  drape tool punch.ply --scale 0.0254 --picture punch.png --grid-error
  drape tool scan.ply --repair --out tool.stl")]
pub struct ToolArgs {
    /// Shape of the tool: rib, hemisphere, double-dome, plate, cylinder, incline, trough, saddle or hills;
    /// or an STL or PLY file
    #[arg(value_name = "SHAPE|FILE")]
    tool: PathBuf,

    /// Replaces a value of the shape, in TOML; an unknown KEY lists the valid ones
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,

    /// Metres per unit of the file; 0.001 if not given
    #[arg(long, value_name = "METRES", value_parser = positive)]
    scale: Option<f64>,

    /// Close holes of the file, drop stray parts, turn facets to one side and decimate: for scanned
    /// tools
    #[arg(long)]
    repair: bool,

    /// How far the decimation may move facets [mm]; 0 for none
    #[arg(long, value_name = "MM", requires = "repair", default_value = "0.2",
          value_parser = not_negative)]
    tolerance: f64,

    /// STL file to write, which a shape needs; its folder must exist
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// PNG to draw
    #[arg(long, value_name = "FILE.png", value_parser = png)]
    picture: Option<PathBuf>,

    /// Compare the distance that the solver sees with the exact one, and fail where it errs by more
    /// than this [mm]
    #[arg(long, value_name = "MM", num_args = 0..=1, require_equals = true,
          default_missing_value = GRID_ERROR, value_parser = positive)]
    grid_error: Option<f64>,
}

/// What is printed.
#[derive(Debug, Serialize)]
struct Report {
    file: Told,
    #[serde(skip_serializing_if = "Option::is_none")]
    shape: Option<Shape>,
    vertices: usize,
    triangles: usize,
    /// Least and greatest coordinates.
    bounds_mm: [[f64; 3]; 2],
    #[serde(flatten)]
    body: Option<Body>,
    #[serde(skip_serializing_if = "Option::is_none")]
    repair: Option<Changes>,
    /// Error of the distance that the solver sees.
    #[serde(skip_serializing_if = "Option::is_none")]
    grid_error_mm: Option<GridError>,
}

/// What a file holds.
#[derive(Debug, Serialize)]
struct Body {
    /// The upper face of a block rather than a closed body.
    open: bool,
    /// None if open, or where some facets are there twice.
    volume_cm3: Option<f64>,
    /// The mesh as given faced inwards or downwards.
    turned_over: bool,
    facets_without_area: usize,
    /// Facets with the corners of an earlier one.
    doubled_facets: usize,
    thinnest_mm: Option<Thinnest>,
    /// What points to another unit.
    unit: Option<String>,
}

/// Runs `drape tool`.
pub fn run(args: ToolArgs) -> Result<(), Failure> {
    let written = args.picture.iter().chain(&args.out);
    check_outputs(written.map(PathBuf::as_path), [&*args.tool])?;
    let name = args.tool.to_string_lossy();
    let is_file = !Shape::KINDS.contains(&&*name) && (args.tool.is_file() || name.contains('.'));
    let scale = args.scale.unwrap_or(1e-3);
    let (shape, mut mesh, dropped) = if is_file {
        if let Some(set) = args.set.first() {
            let error = anyhow!("--set {set} is for shapes, found the file {name}");
            return Err(Failure::invalid(error));
        }
        let file = read_mesh(&args.tool, scale).or_invalid()?;
        (None, file.mesh, file.dropped_facet_count)
    } else {
        let shape = shape(&name, &args.set).or_invalid()?;
        if args.out.is_none() || args.scale.is_some() || args.repair {
            let error =
                anyhow!("the shape {name} needs --out FILE, and has no --scale or --repair");
            return Err(Failure::invalid(error));
        }
        (Some(shape.clone()), shape.mesh().or_invalid_in("--set")?, 0)
    };
    if let Some(end) = args.out.as_ref().and_then(|out| out.extension())
        && !end.eq_ignore_ascii_case("stl")
    {
        let end = end.display();
        return Err(Failure::invalid(anyhow!(
            "--out ends in .{end}, expected .stl: that is what is written"
        )));
    }
    let written = args.out.as_ref().filter(|_| !is_file || args.repair);
    let file = written.unwrap_or(&args.tool);
    let (mut place, mut changes) = (file.display().to_string(), None);
    if args.repair {
        let (low, high) = mesh.bounds();
        let most = 1e3 * COARSEST * (high - low).max();
        let expected = format!("at most {most:.3} mm, a hundredth of the longest side");
        ValueError::unless(
            args.tolerance <= most,
            "--tolerance",
            args.tolerance,
            expected,
        )
        .or_invalid_in(&name)?;
        place = format!("{name}: cannot be repaired");
        let (repaired, found) = repair(&mesh, 1e-3 * args.tolerance).or_invalid_in(&place)?;
        (mesh, changes) = (repaired, Some(found));
    }
    let (low, high) = mesh.bounds();
    let mut report = Report {
        file: file.into(),
        shape,
        vertices: mesh.vertices.len(),
        triangles: mesh.triangles.len(),
        bounds_mm: [low, high].map(|corner| (corner * 1e3).into()),
        body: None,
        repair: changes,
        grid_error_mm: None,
    };
    if is_file || args.grid_error.is_some() {
        let tool = Tool::from_mesh(mesh.clone(), &GridConfig::default()).or_invalid_in(place)?;
        report.grid_error_mm = Some(tool.grid_error(GRID_SAMPLES));
        let open = tool.surface.is_open();
        let mut known = HashSet::new();
        let is_new = |&&triangle: &&[u32; 3]| {
            let mut corners = triangle;
            corners.sort_unstable();
            known.insert(corners)
        };
        let doubled = mesh.triangles.len() - mesh.triangles.iter().filter(is_new).count();
        report.body = is_file.then(|| Body {
            open,
            volume_cm3: (!open && doubled == 0).then(|| 1e6 * tool.mesh.signed_volume()),
            turned_over: tool.flipped,
            facets_without_area: dropped,
            doubled_facets: doubled,
            thinnest_mm: tool.thinnest(GRID_SAMPLES),
            unit: unit_advice((high - low).max(), scale, 0.1..=5.0),
        });
    }
    if let Some(file) = &args.picture {
        picture(&mesh, file)?;
    }
    if let Some(out) = &args.out {
        // What is repaired again is the same file.
        write_stl(out, &mesh, if args.repair { "repaired" } else { &name })?;
    }
    print(&report, Report::text)?;
    if let (Some(bound), Some(error)) = (args.grid_error, report.grid_error_mm)
        && error.max > bound
    {
        let (file, [x, y, z]) = (report.file.display(), error.place);
        let error = anyhow!(
            "{file}: the distance errs by {:.3} mm at ({x:.1}, {y:.1}, {z:.1}) mm, expected at most \
             {bound} mm",
            error.max
        );
        return Err(error.into());
    }
    Ok(())
}

/// Draws the mesh from the front, left and above.
fn picture(mesh: &TriMesh, file: &Path) -> Result<(), Failure> {
    let mut drawing = Drawing::new(&Camera::isometric(mesh.bounds()), SIZE);
    drawing.mesh(&creased(mesh), |_| TOOL, 0.0);
    Ok(drawing.image().save_png(file)?)
}

/// A shape with the values of `set` in place of its own.
pub(super) fn shape(name: &str, set: &[String]) -> Result<Shape, Error> {
    let kind = toml::Table::from_iter([("kind".to_owned(), name.into())]);
    ensure!(
        Shape::KINDS.contains(&name),
        "there is no shape or file {name}, expected a file or one of {}",
        Shape::KINDS.join(", ")
    );
    let parse = |pairs: &[String]| {
        // The line of an error without a place is the first: it must not be quoted.
        let text = format!("\n{kind}\n{}", pairs.join("\n"));
        parse_toml(&text, Path::new("")).map_err(|error| match error {
            ReadError::Fault { fault, .. } => anyhow!("--set {}: {fault}", pairs.join(" --set ")),
            error => error.into(),
        })
    };
    for pair in set {
        ensure!(pair.contains('='), "--set {pair}: expected KEY=VALUE");
        let _: Shape = parse(std::slice::from_ref(pair))?;
    }
    parse(set)
}

impl Report {
    fn text(&self) -> String {
        let [low, high] = self.bounds_mm;
        let mut text = format!(
            "{}: {} vertices, {} triangles",
            self.file.display(),
            self.vertices,
            self.triangles
        );
        for (axis, (low, high)) in ["x", "y", "z"].iter().zip(low.iter().zip(high)) {
            let _ = write!(text, "\n{axis} {low:8.1} to {high:8.1} mm");
        }
        if let Some(body) = &self.body {
            text += &match body.volume_cm3 {
                Some(volume) => format!("\nclosed, {volume:.1} cm3"),
                None if body.open => "\nopen: the upper face of a block".to_owned(),
                None => "\nclosed".to_owned(),
            };
            if body.turned_over {
                text += ", turned over";
            }
            if body.facets_without_area > 0 {
                let _ = write!(text, ", {} facets without area", body.facets_without_area);
            }
            if body.doubled_facets > 0 {
                let _ = write!(
                    text,
                    ", {} facets with the corners of another, which --repair drops",
                    body.doubled_facets
                );
            }
            if let Some(Thinnest { thickness, place }) = body.thinnest_mm {
                let [x, y, z] = place;
                let _ = write!(
                    text,
                    "\nthinnest wall {thickness:.2} mm at ({x:.1}, {y:.1}, {z:.1}) mm"
                );
            }
            if let Some(unit) = &body.unit {
                let _ = write!(text, "\n{unit}");
            }
        }
        if let Some(changes) = &self.repair {
            text += &repaired(changes);
        }
        if let Some(error) = &self.grid_error_mm {
            let _ = write!(text, "\nerror of the distance within 2 mm: {error}");
        }
        text
    }
}

/// A line for each kind of change.
fn repaired(changes: &Changes) -> String {
    let mut text = String::new();
    let mut line = |count: usize, what: &str| {
        if count > 0 {
            let _ = write!(text, "\n{count} {what}");
        }
    };
    line(changes.doubled_facets, "doubled facets dropped");
    line(changes.stray_facets, "facets of stray parts dropped");
    line(changes.turned_facets, "facets turned over");
    let longest = format!(
        "holes closed, up to {:.1} mm round",
        changes.longest_hole_mm
    );
    line(changes.closed_holes, &longest);
    line(changes.holes_left, "cracks or holes left");
    line(changes.decimated_facets, "facets fewer after decimation");
    if text.is_empty() {
        text += "\nnothing to repair";
    }
    let (mean, max) = (changes.mean_mm, changes.max_mm);
    text + &format!("\nold vertices are {mean:.3} mm off in the mean, at most {max:.3} mm")
}
