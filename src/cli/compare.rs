use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::anyhow;
use serde::Serialize;

use super::Failure;
use super::args::{png, positive};
use super::failure::OrInvalid;
use super::loaded::{Loaded, Source};
use super::output::{check_outputs, print};
use super::scanned::ScanArgs;
use super::setup::{absurd, extent, read_scene_or_run};
use super::terminal::{Told, tell};
use drape_cloth::fabric::Drape;
use drape_cloth::math::Vec3;
use drape_cloth::mesh::compare::Distances;
use drape_cloth::mesh::read_mesh;
use drape_cloth::scene::Scene;
use drape_cloth::tool::{GridConfig, Tool};
use drape_proof::presses::resting;
use drape_proof::{Comparison, Criteria, Inapplicable, Surveyed, compare, picture};
use drape_scan::Deviation;
use drape_study::study::region;

/// Compare two drapes
///
/// A and B are each a run folder (the path that `drape export` writes is played again), a state
/// file of `drape scene --state` or `drape eval --state`, or an STL file of a lamina. B is the
/// reference. Both must be in the frame of the scene, into which
/// tool.pose has moved the tool: nothing is moved to fit. With `--unit` A is what a scanner saw after the path of the
/// run B was pressed, points in STL, PLY or text (docs/SCAN.md), and is put on to it.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape compare runs/a runs/b
  drape compare fast.json twin.json --region=-186,-186,-60,-60 --out deviation.png
  drape compare scan.stl fast.json --config scene.toml --json
  drape compare pressed.ply runs/a --unit mm --marks marks.toml --out deviation.png")]
pub struct CompareArgs {
    /// What is compared
    a: PathBuf,

    /// The reference
    b: PathBuf,

    /// Scene or run configuration with the tool; that of the run if A or B is one, and of both if
    /// they have the same
    #[arg(long, value_name = "FILE", conflicts_with = "unit")]
    config: Option<PathBuf>,

    /// Also compare inside and outside of this part of the flat blank [mm]
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = region, allow_hyphen_values = true,
          conflicts_with = "unit")]
    region: Option<[f64; 4]>,

    /// PNG of A coloured by its signed distance from B
    #[arg(long, value_name = "FILE.png", value_parser = png)]
    out: Option<PathBuf>,

    /// Distance at the ends of the colours [mm]; not given, what 95 % of the area keep within
    #[arg(long, value_name = "MM", value_parser = positive, requires = "out")]
    range: Option<f64>,

    /// Metres per unit of STL files; 0.001 if not given
    #[arg(long, value_name = "METRES", value_parser = positive, conflicts_with = "unit")]
    scale: Option<f64>,

    #[command(flatten)]
    scan: ScanArgs,
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    a_source: Origin,
    b_source: Origin,
    /// Where the tool came from.
    tool_source: Option<Told>,
    /// Least x, least y, greatest x, greatest y on the flat blank.
    region_mm: Option<[f64; 4]>,
    #[serde(flatten)]
    comparison: Comparison,
    picture: Option<Told>,
}

#[derive(Serialize)]
struct Origin {
    path: Told,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Run,
    State,
    Stl,
    Scan,
}

/// What is printed of a scan beside a run.
#[derive(Serialize)]
struct ScanReport {
    a_source: Origin,
    b_source: Origin,
    /// Of the scan, evenly thinned, and those left out whose coordinates are no numbers.
    points: usize,
    dropped_count: usize,
    /// Other ways to lie in which the scan is as near.
    other_places: usize,
    #[serde(flatten)]
    deviation: Deviation,
    not_applicable: Vec<Inapplicable>,
    picture: Option<Told>,
}

/// Runs `drape compare`.
pub fn run(args: CompareArgs) -> Result<(), Failure> {
    let read = [&args.a, &args.b].into_iter().chain(&args.config);
    check_outputs(args.out.as_deref(), read.map(PathBuf::as_path))?;
    if args.scan.unit.is_some() {
        return beside_run(&args);
    }
    if args.scale.is_some() && !is_stl(&args.a) && !is_stl(&args.b) {
        let error = anyhow!("--scale is for STL files, found none, expected A or B to be one");
        return Err(Failure::invalid(error));
    }
    let (a, a_scene, a_kind) = survey(&args.a, &args)?;
    let (b, b_scene, b_kind) = survey(&args.b, &args)?;
    let (tool, tool_source) = match &args.config {
        Some(path) => (Some(Arc::new(tool(path)?)), Some(path.clone())),
        None => match (a_scene, b_scene) {
            (Some(a), Some(b)) if a.tool.mesh_in_scene() != b.tool.mesh_in_scene() => {
                return Err(Failure::invalid(anyhow!(
                    "{} and {} have different tools, expected the same: choose what both are \
                     measured against by --config",
                    args.a.display(),
                    args.b.display()
                )));
            }
            (Some(scene), _) => (Some(scene.tool), Some(args.a.clone())),
            (None, Some(scene)) => (Some(scene.tool), Some(args.b.clone())),
            (None, None) => (None, None),
        },
    };
    // Measured where the drapes are.
    let tool = match tool {
        Some(tool) if tool.origin != Vec3::zeros() => Some(
            Tool::from_mesh(tool.mesh_in_scene(), &GridConfig::default())
                .or_invalid()?
                .into(),
        ),
        tool => tool,
    };
    if let Some(region) = args.region {
        for (surface, path) in [(&a, &args.a), (&b, &args.b)] {
            on_the_blank(region, surface, path)?;
        }
    }
    let region = args.region.map(|region| region.map(|x| 1e-3 * x));
    let criteria = Criteria {
        tool: tool.as_ref().map(|tool| &tool.surface),
        region,
    };
    let comparison = compare(&a, &b, &criteria);
    if let Some(file) = &args.out {
        let p95 = (comparison.all.topology_a_to_b_mm).map_or(0.0, |off| off.p95);
        let range = args.range.unwrap_or_else(|| picture::range(p95));
        let image = picture::deviation(&a, &b, tool.as_deref(), region, range);
        image.save_png(file)?;
    }
    let origin = |path: &Path, kind| Origin {
        path: path.into(),
        kind,
    };
    let report = Report {
        a_source: origin(&args.a, a_kind),
        b_source: origin(&args.b, b_kind),
        tool_source: tool_source.map(Told::from),
        region_mm: args.region,
        comparison,
        picture: args.out.map(Told::from),
    };
    print(&report, text)
}

/// The report for a reader; what is not applicable is listed at the end.
fn text(report: &Report) -> String {
    let mut lines = vec![
        format!("A  {}", report.a_source.path.display()),
        format!("B  {} (reference)", report.b_source.path.display()),
    ];
    lines.extend((report.tool_source.iter()).map(|tool| format!("tool of {}", tool.display())));
    let comparison = &report.comparison;
    lines.extend((comparison.tables().iter()).map(|table| format!("\n{}", table.text())));
    lines.push(String::new());
    for missing in &comparison.not_applicable {
        let metrics = missing.metrics.join(", ");
        lines.push(format!("not applicable: {metrics} ({})", missing.why));
    }
    lines.extend((report.picture.iter()).map(|file| format!("picture in {}", file.display())));
    lines.join("\n").trim_end().into()
}

/// Compares a scan with where the path of a run has left its blank.
fn beside_run(args: &CompareArgs) -> Result<(), Failure> {
    if !args.b.is_dir() {
        return Err(Failure::invalid(anyhow!(
            "{} is no run folder, expected one whose path was pressed before the scan",
            args.b.display()
        )));
    }
    let loaded = Loaded::open(&args.b, Source::Path, None, None)?;
    let (played, _) = loaded.play_path()?;
    let pressed = resting(&loaded.scene, played.recording.end().to_vec());
    let seen = args.scan.seen(&args.a, &pressed)?;
    let threshold = 1e-3 * loaded.config.env.drape_threshold_mm;
    let deviation = seen
        .deviation(&pressed, threshold)
        .or_invalid_in(args.b.display())?;
    if let Some(file) = &args.out {
        let range = args
            .range
            .unwrap_or_else(|| picture::range(deviation.scan_to_run_mm.p95));
        let tool = pressed.tool.mesh_in_scene();
        let sheet = pressed.tool.in_scene(&pressed.initial.position);
        let sheet = pressed.lamina.mesh(&sheet);
        let title = "signed distance of the scan from the run [mm], positive above, grey where nothing was seen";
        let off = &deviation.at_vertices;
        picture::signed(&sheet, off, range, title, Some(&tool), &[]).save_png(file)?;
    }
    let origin = |path: &Path, kind| Origin {
        path: path.into(),
        kind,
    };
    let report = ScanReport {
        a_source: origin(&args.a, Kind::Scan),
        b_source: origin(&args.b, Kind::Run),
        points: seen.points.len(),
        dropped_count: seen.dropped_count,
        other_places: seen.other_places,
        deviation,
        not_applicable: vec![Inapplicable {
            metrics: vec!["surplus_mm", "material_points_mm", "fibre_angle_deg"],
            why: "points have no yarns".into(),
        }],
        picture: args.out.clone().map(Told::from),
    };
    print(&report, scan_text)
}

fn scan_text(report: &ScanReport) -> String {
    let Deviation {
        scan_to_run_mm,
        run_to_scan_mm,
        far_share,
        unseen_share,
        undraped_share_scan,
        undraped_share_run,
        ..
    } = &report.deviation;
    let row = |name: &str, s: &Distances| {
        let Distances {
            mean,
            rms,
            p95,
            min,
            max,
        } = s;
        format!("{name}  {mean:8.3} {rms:8.3} {p95:8.3} {min:8.3} {max:8.3}")
    };
    let (a, b) = (
        report.a_source.path.display(),
        report.b_source.path.display(),
    );
    let mut lines = vec![
        format!("A  {a} ({} points)", report.points),
        format!("B  {b} (reference)"),
        "\ndistance [mm]     mean      rms      p95      min      max".into(),
        row("scan to run ", scan_to_run_mm),
    ];
    lines.extend(
        run_to_scan_mm
            .iter()
            .map(|spread| row("run to scan ", spread)),
    );
    let [far, unseen, scan, run] = [
        far_share,
        unseen_share,
        undraped_share_scan,
        undraped_share_run,
    ]
    .map(|share| 1e2 * share);
    lines.push(format!(
        "\npoints far from the run {far:.1} %, vertices of the run that were not seen {unseen:.1} %\n\
         undraped: {scan:.1} % of the scan, {run:.1} % of the run\n"
    ));
    for missing in &report.not_applicable {
        let metrics = missing.metrics.join(", ");
        lines.push(format!("not applicable: {metrics} ({})", missing.why));
    }
    lines.extend((report.picture.iter()).map(|file| format!("picture in {}", file.display())));
    lines.join("\n")
}

fn is_stl(path: &Path) -> bool {
    let kinds = ["stl", "ply"];
    let is_one = |end: &OsStr| kinds.iter().any(|kind| end.eq_ignore_ascii_case(kind));
    path.extension().is_some_and(is_one)
}

/// The drape at `path`, with its scene if it is a run.
fn survey(path: &Path, args: &CompareArgs) -> Result<(Surveyed, Option<Scene>, Kind), Failure> {
    let (surveyed, scene, kind) = if path.is_dir() {
        let loaded = Loaded::open(path, Source::Path, None, None)?;
        let (played, _) = loaded.play_path()?;
        let Scene { lamina, tool, .. } = &*loaded.scene;
        let drape = Drape::new(lamina, &tool.in_scene(played.recording.end()));
        (
            Surveyed::draped(drape),
            Some((*loaded.scene).clone()),
            Kind::Run,
        )
    } else if is_stl(path) {
        let stl = read_mesh(path, args.scale.unwrap_or(1e-3)).or_invalid()?;
        if let Some(size) = absurd(extent(stl.mesh.vertices.iter().copied())) {
            tell(format_args!(
                "warning: {} measures {size}: check --scale",
                path.display()
            ));
        }
        (Surveyed::scan(stl.mesh), None, Kind::Stl)
    } else if path.exists() {
        let drape = Drape::read(path).or_invalid()?;
        (Surveyed::draped(drape), None, Kind::State)
    } else {
        let error = anyhow!(
            "there is no {}, expected a run folder, a state file or an STL file",
            path.display()
        );
        return Err(Failure::invalid(error));
    };
    let surveyed = surveyed.or_invalid_in(path.display())?;
    Ok((surveyed, scene, kind))
}

/// Refuses a region that misses the flat blank.
fn on_the_blank(region: [f64; 4], surface: &Surveyed, path: &Path) -> Result<(), Failure> {
    let Some(drape) = &surface.drape else {
        return Ok(());
    };
    let [x0, y0, x1, y1] = region.map(|x| 1e-3 * x);
    let is_inside = |[x, y]: &[f64; 2]| x0 <= *x && *x <= x1 && y0 <= *y && *y <= y1;
    if drape.rest.iter().any(is_inside) {
        return Ok(());
    }
    let ends = |axis: usize| {
        let places = || drape.rest.iter().map(|at| 1e3 * at[axis]);
        let low = places().fold(f64::INFINITY, f64::min);
        format!("{low:.1} to {:.1}", places().fold(low, f64::max))
    };
    Err(Failure::invalid(anyhow!(
        "--region {} has no vertex of {}, expected a part of its blank: x {} mm, y {} mm",
        region.map(|x| x.to_string()).join(","),
        path.display(),
        ends(0),
        ends(1)
    )))
}

/// The tool of a scene file or of a run configuration.
fn tool(path: &Path) -> Result<Tool, Failure> {
    Tool::new(&read_scene_or_run(path)?.scene.tool).or_invalid_in(path.display())
}
