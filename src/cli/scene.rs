use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use super::Failure;
use super::failure::OrInvalid;
use super::output::{OutFolder, check_outputs, print, write_together};
use super::picture::{Studio, View};
use super::setup::{missed, set_up_fitted};
use super::terminal::tell;
use drape_cloth::fabric::{Drape, Membrane};
use drape_cloth::file::write_atomic;
use drape_cloth::mesh::write_stl;
use drape_cloth::scene::{Scene, SceneConfig, Summary};
use drape_report::Camera;
use drape_scan::ScanFit;

/// Width and height of the pictures [px].
const SIZE: [usize; 2] = [960, 720];

/// Let the blank fall on to the tool and show how it lies
///
/// Where the scene has a scan, the blank is fitted to it (docs/SCAN.md).
///
/// Writes lamina.stl and tool.stl (millimetres, where they lie in the scene), top.png and
/// isometric.png, coloured by the distance to the tool, and summary.json. Files of an earlier run are
/// replaced.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape scene --out rib
  drape scene configs/scenes/rib.toml --out rib
  drape scene mine.toml --out mine --json > mine.json")]
pub struct SceneArgs {
    /// Scene file; the built-in rib with two wrinkles if not given
    config: Option<PathBuf>,

    /// Folder for meshes, pictures and summary; created where missing
    #[arg(long, value_name = "DIR")]
    out: PathBuf,

    /// Also write where every vertex of the blank lies, for `drape compare`
    #[arg(long, value_name = "FILE")]
    state: Option<PathBuf>,
}

/// What is printed.
#[derive(Debug, Serialize)]
struct Report {
    #[serde(flatten)]
    summary: Summary,
    /// How the blank fits its scan.
    #[serde(skip_serializing_if = "Option::is_none")]
    fit: Option<ScanFit>,
    /// Wall time of setting up the scene [s].
    seconds: f64,
}

/// Runs `drape scene`.
pub fn run(args: SceneArgs) -> Result<(), Failure> {
    let (config, place) = match &args.config {
        Some(path) => {
            let config = SceneConfig::read(path).or_invalid()?;
            (config, path.display().to_string())
        }
        None => (SceneConfig::rib(), "built-in scene".into()),
    };
    let out = OutFolder::make(&args.out)?;
    let folder = &out.path;
    let written: Vec<PathBuf> = FILES.iter().map(|name| folder.join(name)).collect();
    let written = written.iter().chain(&args.state).map(PathBuf::as_path);
    let files = config.files();
    let read = files.iter().chain(&args.config).map(PathBuf::as_path);
    check_outputs(written, read)?;

    let start = Instant::now();
    let (scene, fit) = set_up_fitted(&config, &place)?;
    if let Some(fault) = missed(&scene) {
        tell(format_args!("warning: {place}: {fault}"));
    }
    let seconds = start.elapsed().as_secs_f64();
    let summary = scene.summary(&scene.initial);
    write_together(folder, |folder| write_files(&scene, &summary, folder))?;
    if let Some(file) = &args.state {
        let position = scene.tool.in_scene(&scene.initial.position);
        Drape::new(&scene.lamina, &position).write(file)?;
    }

    let report = Report {
        summary,
        fit,
        seconds,
    };
    print(&report, |report| {
        let fit = report.fit.as_ref().map(fit_text).unwrap_or_default();
        let (text, folder) = (text(&scene, &report.summary), folder.display());
        format!("{text}{fit}\nset up in {seconds:.1} s\nwritten to {folder}")
    })
}

/// What is written into the folder.
const FILES: [&str; 5] = [
    "lamina.stl",
    "tool.stl",
    "top.png",
    "isometric.png",
    "summary.json",
];

fn write_files(scene: &Scene, summary: &Summary, folder: &Path) -> Result<(), Failure> {
    let state = &scene.initial;
    let lamina = scene.lamina.mesh(&scene.tool.in_scene(&state.position));
    let [lamina_file, tool_file, top, isometric, json_file] = FILES.map(|name| folder.join(name));
    write_stl(lamina_file, &lamina, "lamina")?;
    write_stl(tool_file, &scene.tool.mesh_in_scene(), "tool")?;
    let caption = caption(summary);
    let draw = |file: &Path, view: View| {
        let image = Studio::new(scene, view, SIZE).distance(&state.position, &caption);
        image.save_png(file)
    };
    draw(&top, Camera::top)?;
    draw(&isometric, Camera::isometric)?;
    let json = serde_json::to_string_pretty(summary)?;
    Ok(write_atomic(&json_file, |file| writeln!(file, "{json}"))?)
}

/// Key figures in one line.
pub(super) fn caption(summary: &Summary) -> String {
    format!(
        "distance {:.2} m · {} wrinkles · strain p95 {:.2} % · penetration {:.2} mm",
        summary.distance_m,
        summary.wrinkles,
        1e2 * summary.strain_p95,
        summary.penetration_mm,
    )
}

fn fit_text(fit: &ScanFit) -> String {
    format!(
        "\nscan         {:.2} mm off in the mean, p95 {:.2} mm; {:.1} % of the vertices unseen\n\
         let go       sprang back by {:.2} mm in the mean",
        fit.mean_mm,
        fit.p95_mm,
        1e2 * fit.unseen_share,
        fit.spring_back_mm,
    )
}

fn text(scene: &Scene, summary: &Summary) -> String {
    let (lamina, tool) = (&scene.lamina, &scene.tool);
    // Where yarns stretch, halves of whole cells are membranes, too.
    let is_cut = |m: &&Membrane| !m.has_yarns || !lamina.diagonals.is_empty();
    let cut = match lamina.membranes.iter().filter(is_cut).count() {
        0 => String::new(),
        count => format!(", {count} of them along the outline"),
    };
    let dropped = match tool.dropped_facet_count {
        0 => String::new(),
        count => format!(", {count} facets without area dropped"),
    };
    let turned = match tool.flipped {
        true => ", turned over to face outwards",
        false => "",
    };
    format!(
        "lamina       {} vertices, {} triangles{cut}\n\
         tool         {} vertices, {} triangles{dropped}{turned}\n\
         distance     {:.3} m in sum, {:.2} mm a vertex\n\
         wrinkles     {}\n\
         yarn strain  p95 {:.3} %, max {:.3} %\n\
         penetration  {:.3} mm\n\
         self-intersections  {}\n\
         speed        {:.3} mm/s rms",
        lamina.vertex_count(),
        lamina.triangles.len(),
        tool.mesh.vertices.len(),
        tool.mesh.triangles.len(),
        summary.distance_m,
        1e3 * summary.distance_m / lamina.vertex_count() as f64,
        summary.wrinkles,
        1e2 * summary.strain_p95,
        1e2 * summary.strain_max,
        summary.penetration_mm,
        summary.self_intersections,
        summary.v_rms_mm_s,
    )
}
