use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Error, anyhow, ensure};
use serde::Serialize;

use super::Failure;
use super::failure::OrInvalid;
use super::output::{print, print_json};
use drape_cloth::file::{ReadError, parse_toml};
use drape_cloth::mesh::write_stl;
use drape_cloth::tool::{GridConfig, GridError, Shape, Tool};

/// Points at which the distance grid is compared.
const GRID_SAMPLES: usize = 20_000;

/// Write a parametric tool as STL file (binary, millimetres)
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape tool rib --out rib.stl
  drape tool hemisphere --set radius_mm=90 --set 'plate_mm=[420, 420]' --out dome.stl
  drape tool incline --set angle_deg=30 --out incline.stl --grid-error --json")]
pub struct ToolArgs {
    /// Shape of the tool: rib, hemisphere, double-dome, plate, cylinder or incline
    shape: String,

    /// Replaces a value of the shape, in TOML; an unknown KEY lists the valid ones
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,

    /// STL file to write; its folder must exist
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Also compare the distance grid with the exact distance
    #[arg(long)]
    grid_error: bool,

    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

/// What is printed.
#[derive(Debug, Serialize)]
struct Report {
    file: PathBuf,
    shape: Shape,
    vertices: usize,
    triangles: usize,
    /// Least and greatest coordinates.
    bounds_mm: [[f64; 3]; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    /// Error of the distance grid.
    grid_error_mm: Option<GridError>,
}

/// Runs `drape tool`.
pub fn run(args: ToolArgs) -> Result<(), Failure> {
    let shape = shape(&args.shape, &args.set).or_invalid()?;
    let mesh = shape.mesh().or_invalid_in("--set")?;
    write_stl(&args.out, &mesh, &args.shape)?;

    let (low, high) = mesh.bounds();
    let mut report = Report {
        file: args.out,
        shape,
        vertices: mesh.vertices.len(),
        triangles: mesh.triangles.len(),
        bounds_mm: [low, high].map(|corner| (corner * 1e3).into()),
        grid_error_mm: None,
    };
    if args.grid_error {
        let tool = Tool::from_mesh(mesh, &GridConfig::default()).or_invalid()?;
        report.grid_error_mm = Some(tool.grid_error(GRID_SAMPLES));
    }
    if args.json {
        print_json(&report)
    } else {
        print(&report.text())
    }
}

/// A shape with the values of `set` in place of its own.
fn shape(name: &str, set: &[String]) -> Result<Shape, Error> {
    let kind = toml::Table::from_iter([("kind".to_owned(), name.into())]);
    let _: Shape = kind.clone().try_into().context("SHAPE")?;
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
        if let Some(error) = &self.grid_error_mm {
            let _ = write!(text, "\nerror of the distance grid within 2 mm: {error}");
        }
        text
    }
}
