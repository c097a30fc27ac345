use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::ValueEnum;
use serde::Serialize;

use super::{REGION, as_option, folder, region, scene_config, set_mesh, twin_failure};
use crate::cli::Failure;
use crate::cli::compare::picture;
use crate::cli::failure::{OrInvalid, scene_failure};
use crate::cli::output::{Progress, print, print_json};
use crate::run::{RunConfig, RunFolder};
use drape_cloth::fabric::{Drape, Lamina};
use drape_cloth::mesh::{write_stl, write_vtk};
use drape_cloth::scene::{Scene, SceneConfig};
use drape_cloth::twin::Hold;
use drape_study::compare::{Comparison, Parts};
use drape_study::episodes::{Order, sequences};
use drape_study::nearest;
use drape_study::twin::{
    ACCELERATION, Balance, Case, Compared, Ran, SPEED, SelfComparison, compare_all, set_up,
    stencil_mm,
};
use drape_task::env::EnvConfig;
use drape_task::path::read_json;

/// Solve the paper's test case in the finite-element twin and compare the fast solver with it
///
/// The blank falls and is pressed along one path: in the twin, in the twin with scaled mass, and
/// in the fast solver. Writes each before and after the presses as STL (millimetres), VTK and
/// state files for `drape compare`, and pictures of how fast and accelerated deviate from the
/// twin. Files of an earlier study in the folder are replaced.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study twin
  drape study twin --convergence
  drape study twin --mesh 65 --path runs/quickstart --out twin
  drape study twin mine.toml --path points.json --region=-60,-60,60,60 --json > twin.json")]
pub struct Args {
    /// Scene file; that of the run if PATH is one, or else the built-in rib
    config: Option<PathBuf>,

    /// Vertices along the blank's longer side; 33 if not given, 65 are the paper's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(3..=257))]
    mesh: Option<u16>,

    /// What is pressed: points that `drape export` wrote as JSON, for the mesh of the scene as
    /// it is configured, or a run folder, for its best sequence. A straight sweep if not given
    #[arg(long, value_name = "FILE|RUN")]
    path: Option<PathBuf>,

    /// Focus region on the flat blank [mm]: least x, least y, greatest x, greatest y; that of
    /// the run if PATH is one, or else that of the quickstart
    #[arg(long, value_name = "X,Y,X,Y", value_parser = region, allow_hyphen_values = true)]
    region: Option<[f64; 4]>,

    /// What holds draped vertices in the twin: the pressure, as in the paper, or nothing moves
    /// them any more, as in the fast solver
    #[arg(long, value_enum, default_value_t = HoldName::Pressure)]
    hold: HoldName,

    /// How fast the twin's roller comes down [m/s]
    #[arg(long, value_name = "M/S", default_value_t = SPEED, value_parser = speed)]
    speed: f64,

    /// Inertia over mass of the accelerated twin
    #[arg(long, value_name = "FACTOR", default_value_t = ACCELERATION, value_parser = factor)]
    scaling: f64,

    /// Also hold the twin against itself: with half the time step, from a pushed start, and its
    /// fall with every second vertex, where the blank is a rectangle with even numbers of cells;
    /// takes three times the twin's time
    #[arg(long)]
    convergence: bool,

    /// Folder for meshes, states and pictures; runs/study-twin-DATE if not given
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
enum HoldName {
    Pressure,
    Fixed,
}

fn factor(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(number) if (1.0..=1e6).contains(&number) => Ok(number),
        _ => Err("expected a number from 1 to 1000000".into()),
    }
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(number) if (0.01..=100.0).contains(&number) => Ok(number),
        _ => Err("expected a number from 0.01 to 100".into()),
    }
}

/// What the paper quotes for its test case (Section 7.2.2) [s].
#[derive(Serialize)]
struct Paper {
    baseline_s: f64,
    accelerated_s: f64,
    surrogate_s: f64,
}

const PAPER: Paper = Paper {
    baseline_s: 8.15 * 3600.0,
    accelerated_s: 40.2 * 60.0,
    surrogate_s: 19.0,
};

/// What is printed.
#[derive(Serialize)]
struct Report {
    vertices: usize,
    /// Side of the stencil [mm].
    stencil_mm: f64,
    region_mm: [f64; 4],
    hold: HoldName,
    speed_m_s: f64,
    mass_scaling: f64,
    presses: usize,
    /// Vertices in the order they were pressed.
    sequence: Vec<u32>,
    runs: [Ran; 3],
    /// CPU time of the twin over that of the fast solver, of the whole case and of its presses,
    /// and of the twin over the accelerated one.
    twin_over_fast: f64,
    twin_over_fast_presses: f64,
    twin_over_accelerated: f64,
    paper: Paper,
    comparisons: Vec<ComparisonReport>,
    /// The twin against itself, where that was asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    convergence: Vec<SelfComparison>,
    out: PathBuf,
}

#[derive(Serialize)]
struct ComparisonReport {
    moment: &'static str,
    /// A, which is held against the twin.
    name: &'static str,
    picture: String,
    #[serde(flatten)]
    comparison: Comparison,
}

/// Runs `drape study twin`.
pub fn run(args: Args) -> Result<(), Failure> {
    let case = source(&args)?;
    let mut config = case.config;
    set_mesh(&mut config, args.mesh.map(usize::from))?;
    let given = match &case.vertices {
        Some(vertices) => Some((vertices, lamina(&case.own, &case.place)?)),
        None => None,
    };
    // Refused before the work: a region without vertices, and a folder that cannot be made.
    let mut env = EnvConfig {
        region_mm: Some(case.region),
        crop: true,
        ..case.env
    };
    let blank = lamina(&config, &case.place)?;
    env.stencil_mm = stencil_mm(&blank, env.stencil_mm);
    let region = env.region(&blank);
    region.map_err(|error| Failure::invalid(anyhow!(as_option(&error))))?;
    let out = folder(args.out.as_deref(), "study-twin-")?;

    let bar = Progress::new("falling", args.json);
    let set = set_up(&config, |share| bar.set(share));
    drop(bar);
    let (scene, fall_cpu_s) = set.map_err(|error| scene_failure(error, &case.place))?;
    let sequence = match given {
        Some((vertices, own)) => transferred(vertices, &own, &scene.lamina),
        None => sequences(&scene, &env, Order::Sweep, 1, 0)
            .or_invalid()?
            .pop()
            .ok_or_else(|| anyhow!("the simulation diverged in the sweep"))?,
    };
    if !args.json {
        eprintln!(
            "computing the fall and {} presses in the twin",
            sequence.len()
        );
    }
    let whole = Case {
        scene: &scene,
        fall_cpu_s,
        env: &env,
        sequence: &sequence,
        hold: match args.hold {
            HoldName::Pressure => Hold::Pressure,
            HoldName::Fixed => Hold::Fixed,
        },
        speed: args.speed,
        acceleration: args.scaling,
    };
    let fail = |error| twin_failure(error, &case.place);
    let bar = Progress::new("pressing in the twin", args.json);
    let runs = whole.run(|share| bar.set(share)).map_err(fail)?;
    drop(bar);
    let region = case.region.map(|x| 1e-3 * x);
    let compared = compare_all(&scene, &runs, Some(region));
    let compared = compared.map_err(fail)?;
    write_states(&scene, &runs, &out.path)?;
    let comparisons = draw(&scene, compared, region, &out.path)?;
    let convergence = if args.convergence {
        if !args.json {
            eprintln!("holding the twin against itself");
        }
        whole.converge(&runs[1]).map_err(fail)?
    } else {
        Vec::new()
    };

    let [fast, twin, accelerated] = &runs;
    let ratio = |a: f64, b: f64| a / b.max(1e-9);
    let report = Report {
        vertices: scene.lamina.vertex_count(),
        stencil_mm: env.stencil_mm,
        region_mm: case.region,
        hold: args.hold,
        speed_m_s: args.speed,
        mass_scaling: args.scaling,
        presses: sequence.len(),
        twin_over_fast: ratio(twin.cpu_s(), fast.cpu_s()),
        twin_over_fast_presses: ratio(twin.press_cpu_s, fast.press_cpu_s),
        twin_over_accelerated: ratio(twin.cpu_s(), accelerated.cpu_s()),
        sequence,
        runs,
        paper: PAPER,
        comparisons,
        convergence,
        out: out.path.clone(),
    };
    if args.json {
        return print_json(&report);
    }
    print(&text(&report))
}

/// What the arguments lead to.
struct Source {
    config: SceneConfig,
    /// The scene that the vertices of a path are counted in.
    own: SceneConfig,
    env: EnvConfig,
    region: [f64; 4],
    vertices: Option<Vec<u32>>,
    place: String,
}

fn source(args: &Args) -> Result<Source, Failure> {
    let run = args.path.as_ref().filter(|path| path.is_dir());
    if let Some(path) = run {
        let folder = RunFolder::open(path).or_invalid()?;
        let config = RunConfig::read(&folder.config()).or_invalid()?;
        let (scene, place) = match &args.config {
            Some(_) => scene_config(args.config.as_deref())?,
            None => (config.scene.clone(), folder.config().display().to_string()),
        };
        return Ok(Source {
            config: scene,
            own: config.scene,
            region: args.region.or(config.env.region_mm).unwrap_or(REGION),
            env: config.env,
            vertices: Some(folder.read_best_sequence().or_invalid()?.vertices),
            place,
        });
    }
    let (config, place) = scene_config(args.config.as_deref())?;
    let vertices = match &args.path {
        None => None,
        Some(path) => {
            let points = read_json(path).or_invalid()?;
            let vertices: Vec<u32> = points.iter().map(|point| point.vertex).collect();
            let count = lamina(&config, &place)?.vertex_count();
            if let Some(&found) = vertices.iter().find(|&&v| v as usize >= count) {
                return Err(Failure::invalid(anyhow!(
                    "{} presses vertex {found}, expected one below {count} as in {place}",
                    path.display()
                )));
            }
            Some(vertices)
        }
    };
    Ok(Source {
        own: config.clone(),
        config,
        env: EnvConfig::default(),
        region: args.region.unwrap_or(REGION),
        vertices,
        place,
    })
}

fn lamina(config: &SceneConfig, place: &str) -> Result<Lamina, Failure> {
    let fail = |error| scene_failure(error, place);
    let material = config.read_material().map_err(fail)?;
    Lamina::new(&config.blank, material).map_err(|error| fail(error.into()))
}

/// The vertices of another mesh that are nearest on the flat blank to those of a path, each once.
fn transferred(vertices: &[u32], own: &Lamina, other: &Lamina) -> Vec<u32> {
    let mut pressed = Vec::new();
    for &vertex in vertices {
        let nearest = nearest(&other.rest, own.rest[vertex as usize]);
        if !pressed.contains(&nearest) {
            pressed.push(nearest);
        }
    }
    pressed
}

/// Writes every state as STL, VTK and state file.
fn write_states(scene: &Scene, runs: &[Ran; 3], folder: &Path) -> Result<(), Failure> {
    write_stl(folder.join("tool.stl"), &scene.tool.mesh, "tool")?;
    for ran in runs {
        for (moment, position) in [("initial", &ran.initial), ("draped", &ran.end)] {
            let name = format!("{moment}-{}", ran.name);
            let file = |extension| folder.join(format!("{name}.{extension}"));
            let drape = Drape::new(&scene.lamina, position);
            drape.write(&file("json"))?;
            let mesh = drape.mesh();
            write_stl(file("stl"), &mesh, &name)?;
            let distance = position.iter().map(|&x| scene.tool.distance(x).0).collect();
            let tangents: Vec<_> = (0..drape.triangles.len())
                .map(|t| drape.tangents(t))
                .collect();
            let strain = |k: usize| tangents.iter().map(|t| t.strain()[k]).collect();
            let shear = tangents.iter().map(|t| t.shear().to_degrees()).collect();
            let triangles = [
                ("warp_strain", strain(0)),
                ("weft_strain", strain(1)),
                ("shear_deg", shear),
            ];
            let points = [("distance", distance)];
            write_vtk(file("vtk"), &mesh, &name, &points, &triangles)?;
        }
    }
    Ok(())
}

fn draw(
    scene: &Scene,
    compared: Vec<Compared>,
    region: [f64; 4],
    folder: &Path,
) -> Result<Vec<ComparisonReport>, Failure> {
    let mut reports = Vec::new();
    // The same colours for both moments of both.
    let range = (compared.iter())
        .filter(|c| c.name == "fast")
        .map(|c| picture::range(&c.comparison))
        .fold(0.0, f64::max);
    for found in compared {
        let picture = format!("{}-{}.png", found.moment, found.name);
        let (a, b) = (&found.surface, &found.reference);
        let image = picture::deviation(a, b, Some(&scene.tool), Some(region), range);
        image.save_png(&folder.join(&picture))?;
        reports.push(ComparisonReport {
            moment: found.moment,
            name: found.name,
            picture,
            comparison: found.comparison,
        });
    }
    Ok(reports)
}

fn text(report: &Report) -> String {
    let mut text = format!(
        "{} vertices, {} presses of a stencil of {:.1} mm; the fast solver presses with {:.0} \
         substeps a second\n\n{:12} {:>9} {:>9} {:>9} {:>10} {:>10} {:>8}\n",
        report.vertices,
        report.presses,
        report.stencil_mm,
        report.runs[0].time_step_s.recip(),
        "CPU time [s]",
        "fall",
        "presses",
        "all",
        "before [m]",
        "left [m]",
        "draped"
    );
    for ran in &report.runs {
        let _ = writeln!(
            text,
            "{:12} {:9.3} {:9.3} {:9.3} {:10.4} {:10.4} {:8}",
            ran.name,
            ran.fall_cpu_s,
            ran.press_cpu_s,
            ran.cpu_s(),
            ran.region_initial_m,
            ran.region_left_m,
            ran.draped
        );
    }
    let _ = writeln!(
        text,
        "twin over fast {:.0} (presses alone {:.0}), twin over accelerated {:.1}\n\
         the paper's: 8.15 h, accelerated 40.2 min, surrogate 19 s: {:.0} and {:.1}\n",
        report.twin_over_fast,
        report.twin_over_fast_presses,
        report.twin_over_accelerated,
        report.paper.baseline_s / report.paper.surrogate_s,
        report.paper.baseline_s / report.paper.accelerated_s
    );
    for ran in &report.runs {
        for (moment, balance) in ["fall", "presses"].iter().zip(ran.energy.iter().flatten()) {
            let Balance {
                energies,
                residual,
                residual_share,
            } = balance;
            let _ = writeln!(
                text,
                "energy of {} after {moment} [mJ]: supplied {:.3}, kinetic {:.4}, strain {:.3}, \
                 dissipated {:.3}, residual {:.4} ({:.2} %)",
                ran.name,
                1e3 * energies.supplied(),
                1e3 * energies.kinetic,
                1e3 * energies.strain(),
                1e3 * energies.dissipated(),
                1e3 * residual,
                1e2 * residual_share
            );
        }
    }
    let _ = write!(
        text,
        "\n{:30} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9}\n",
        "against the twin",
        "min mm",
        "max mm",
        "|p95| mm",
        "edge mm",
        "max mm",
        "warp %",
        "weft %",
        "points mm"
    );
    for found in &report.comparisons {
        let ComparisonReport {
            moment,
            name,
            comparison,
            ..
        } = found;
        let edge = comparison.contour_a_to_b_mm.map(|c| [c.mean, c.max]);
        row(
            &mut text,
            &format!("{moment} {name}"),
            &comparison.all,
            edge,
        );
        for (place, parts) in [
            ("inside", &comparison.inside),
            ("outside", &comparison.outside),
        ] {
            if let Some(parts) = parts {
                row(&mut text, &format!("  {place} the region"), parts, None);
            }
        }
        if let (Some(a), Some(b)) = (comparison.a.shear_deg, comparison.b.shear_deg) {
            let _ = writeln!(
                text,
                "  shear {:.2} to {:.2} deg, rms {:.2}; the twin's {:.2} to {:.2}, rms {:.2}",
                a.min, a.max, a.rms, b.min, b.max, b.rms
            );
        }
    }
    if report.convergence.len() == 2 {
        text += "twice the cell: not for this blank, which is no rectangle with even numbers of cells\n";
    }
    for variant in &report.convergence {
        let [mean, max] = variant.initial_mm;
        let [own, twin] = variant.initial_distance_m;
        let _ = write!(
            text,
            "{} ({} vertices): after the fall {mean:.3} mm off on average, {max:.3} at most, \
             {own:.3} m to the tool ({twin:.3})",
            variant.name.replace('_', " "),
            variant.vertices
        );
        if let (Some([mean, max]), Some([own, twin])) = (variant.draped_mm, variant.left_m) {
            let _ = write!(
                text,
                "; after the presses {mean:.3} and {max:.3} mm, {own:.4} m left ({twin:.4})"
            );
        }
        text.push('\n');
    }
    let _ = write!(text, "files in {}", report.out.display());
    text
}

/// A row as of the paper's Table 3: topology, contour, share of fibre angles below 5 degrees; and
/// how far material points are apart on average.
fn row(text: &mut String, name: &str, parts: &Parts, edge: Option<[f64; 2]>) {
    let number = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.2}"));
    let topology = parts.topology_a_to_b_mm;
    let share = |k: usize| parts.fibre_angle_deg.map(|a| 1e2 * a[k].share_below);
    let figures = [
        topology.map(|t| t.min),
        topology.map(|t| t.max),
        topology.map(|t| t.p95),
        edge.map(|e| e[0]),
        edge.map(|e| e[1]),
        share(0),
        share(1),
        parts.material_points_mm.map(|p| p.mean),
    ];
    let _ = write!(text, "{name:30}");
    for figure in figures {
        let _ = write!(text, " {:>8}", number(figure));
    }
    text.push('\n');
}
