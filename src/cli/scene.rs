use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use super::Failure;
use super::failure::OrInvalid;
use super::output::{OutFolder, print, print_json, write_together};
use super::picture::{Studio, View};
use super::setup::{MISSED, missed, set_up};
use drape_cloth::fabric::Drape;
use drape_cloth::file::{check_writable, write_atomic};
use drape_cloth::mesh::write_stl;
use drape_cloth::scene::{Scene, SceneConfig, Summary};
use drape_report::Camera;

/// Width and height of the pictures [px].
const SIZE: [usize; 2] = [960, 720];

/// Let the blank fall on to the tool and show how it lies
///
/// Writes lamina.stl and tool.stl (millimetres), top.png and isometric.png, coloured by the
/// distance to the tool, and summary.json. Files of an earlier run are replaced.
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

    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

/// What is printed.
#[derive(Debug, Serialize)]
struct Report {
    #[serde(flatten)]
    summary: Summary,
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
    args.state.as_deref().map(check_writable).transpose()?;

    let start = Instant::now();
    let scene = set_up(&config, &place, args.json)?;
    let clearance = scene.clearance();
    if clearance > MISSED {
        eprintln!("warning: {place}: {}", missed(clearance));
    }
    let seconds = start.elapsed().as_secs_f64();
    let summary = scene.summary(&scene.initial);
    write_together(folder, |folder| write_files(&scene, &summary, folder))?;
    if let Some(file) = &args.state {
        Drape::new(&scene.lamina, &scene.initial.position).write(file)?;
    }

    if args.json {
        return print_json(&Report { summary, seconds });
    }
    let mut text = text(&scene, &summary);
    let _ = write!(text, "\nset up in {seconds:.1} s");
    let _ = write!(text, "\nwritten to {}", folder.display());
    print(&text)
}

fn write_files(scene: &Scene, summary: &Summary, folder: &Path) -> Result<(), Failure> {
    let state = &scene.initial;
    let lamina = scene.lamina.mesh(&state.position);
    write_stl(folder.join("lamina.stl"), &lamina, "lamina")?;
    write_stl(folder.join("tool.stl"), &scene.tool.mesh, "tool")?;
    let caption = caption(summary);
    let views: [(&str, View); 2] = [
        ("top.png", Camera::top),
        ("isometric.png", Camera::isometric),
    ];
    for (name, view) in views {
        let image = Studio::new(scene, view, SIZE).distance(&state.position, &caption);
        image.save_png(&folder.join(name))?;
    }
    let json = serde_json::to_string_pretty(summary)?;
    write_atomic(&folder.join("summary.json"), |file| {
        writeln!(file, "{json}")
    })?;
    Ok(())
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

fn text(scene: &Scene, summary: &Summary) -> String {
    let lamina = &scene.lamina;
    let cut = match lamina.membranes.len() {
        0 => String::new(),
        count => format!(", {count} of them along the outline"),
    };
    let mut text = format!(
        "lamina       {} vertices, {} triangles{cut}\ntool         {} vertices, {} triangles",
        lamina.vertex_count(),
        lamina.triangles.len(),
        scene.tool.mesh.vertices.len(),
        scene.tool.mesh.triangles.len(),
    );
    if scene.tool.dropped_facet_count > 0 {
        let _ = write!(
            text,
            ", {} facets without area dropped",
            scene.tool.dropped_facet_count
        );
    }
    if scene.tool.flipped {
        text += ", turned over to face outwards";
    }
    let _ = write!(
        text,
        "\ndistance     {:.3} m in sum, {:.2} mm a vertex\n\
         wrinkles     {}\n\
         yarn strain  p95 {:.3} %, max {:.3} %\n\
         penetration  {:.3} mm\n\
         self-intersections  {}\n\
         speed        {:.3} mm/s rms",
        summary.distance_m,
        1e3 * summary.distance_m / lamina.vertex_count() as f64,
        summary.wrinkles,
        1e2 * summary.strain_p95,
        1e2 * summary.strain_max,
        summary.penetration_mm,
        summary.self_intersections,
        summary.v_rms_mm_s,
    );
    text
}
