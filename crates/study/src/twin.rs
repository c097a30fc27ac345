//! The paper's test case (Section 7.2) in the finite-element twin: fall of the blank, then a
//! list of presses, as it is and accelerated, next to the fast solver.
//!
//! Both start from the same flat blank with the same mass, bending stiffness, damping and
//! clamps, and are pressed at the same vertices. Speeds are not capped in the twin, and its
//! roller stops cloth by pressure where the fast solver's stencil has a place.

mod case;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use cpu_time::ProcessTime;

use crate::points::nearest;
use crate::study::{
    CORNER, Context, Report, SceneOptions, Study, StudyError, TrainedPath, lamina, stencil_mm,
};
use case::{PaperCase, Ran, SelfComparison};
use drape_cloth::fabric::{Drape, Lamina};
use drape_cloth::measure::surplus;
use drape_cloth::mesh::write_stl;
use drape_cloth::scene::{Scene, SceneError};
use drape_cloth::tool::Tool;
use drape_cloth::twin::Energies;
use drape_proof::orders::sequences;
use drape_proof::presses::Positions;
use drape_proof::twin::twin_config;
use drape_proof::{Comparison, Criteria, Parts, Surveyed, compare, picture};
use drape_report::Table;
use drape_task::env::EnvConfig;
use drape_task::path::read_json;
use drape_task::search::Order;

/// Solve the paper's test case in the finite-element twin and compare the fast solver with it
///
/// The blank falls and is pressed along one path: in the twin, in the twin with scaled mass, and
/// in the fast solver. Writes each before and after the presses as STL (millimetres) and
/// state files for `drape compare`, and pictures of how fast and accelerated deviate from the
/// twin. The blank has 33 vertices along its longer side where `--mesh` does not say otherwise; 65
/// are the paper's. The region is that of the run if PATH is one, or else the
/// front left corner of the rib, the paper's case.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study twin
  drape study twin --convergence
  drape study twin --mesh 65 --path runs/quickstart --out twin
  drape study twin mine.toml --path points.json --region=-60,-60,60,60 --json > twin.json")]
pub struct TwinStudy {
    #[command(flatten)]
    scene: SceneOptions,

    /// What is pressed: points that `drape export` wrote as JSON, for the mesh of the scene as
    /// it is configured, or a run folder, for the path that `drape export` writes. A straight
    /// sweep if not given
    #[arg(long, value_name = "FILE|RUN")]
    path: Option<PathBuf>,

    /// Also hold the twin against itself: with half the time step, from a pushed start, and its
    /// fall with every second vertex, where the blank is a rectangle with even numbers of cells;
    /// takes three times the twin's time
    #[arg(long)]
    convergence: bool,
}

impl TwinStudy {
    fn presses_a_run(&self) -> bool {
        self.path.as_ref().is_some_and(|path| path.is_dir())
    }

    /// What is pressed, and the scene that its vertices are counted in; a sweep if there are none.
    fn source(&self, context: &Context) -> Result<TrainedPath, StudyError> {
        if let Some(run) = self.path.as_ref().filter(|path| path.is_dir()) {
            return (context.read_run)(run);
        }
        let (scene, region_mm) = self.scene.read(context)?;
        let mut source = TrainedPath {
            scene,
            env: EnvConfig {
                region_mm,
                ..EnvConfig::default()
            },
            vertices: Vec::new(),
        };
        if let Some(path) = &self.path {
            let points = read_json(path).map_err(|error| StudyError::Read(error.into()))?;
            source.vertices = points.iter().map(|point| point.vertex).collect();
            let count = lamina(&source.scene)?.vertex_count();
            if let Some(found) = source.vertices.iter().find(|&&v| v as usize >= count) {
                return Err(StudyError::Invalid(format!(
                    "{} presses vertex {found}, expected one below {count} as in {}",
                    path.display(),
                    self.scene.place()
                )));
            }
        }
        Ok(source)
    }
}

/// The vertices of another mesh that are nearest on the flat blank to those of a path, each once.
fn transferred(vertices: &[u32], own: &Lamina, other: &Lamina) -> Vec<u32> {
    let places = vertices.iter().map(|&v| own.rest[v as usize]);
    let mut seen = BTreeSet::new();
    let nearest = places.map(|at| nearest(&other.rest, at));
    nearest.filter(|&v| seen.insert(v)).collect()
}

impl Study for TwinStudy {
    const NAME: &'static str = "twin";
    const TABLES: &'static [&'static str] = &["runs", "energy", "comparisons", "convergence"];

    fn scene(&self) -> Option<&SceneOptions> {
        // That of a run has been valid.
        (!self.presses_a_run() || self.scene.config.is_some()).then_some(&self.scene)
    }

    fn run(&self, context: &Context) -> Result<Report, StudyError> {
        let source = self.source(context)?;
        let mut config = match self.scene.config {
            Some(_) if self.presses_a_run() => self.scene.read(context)?.0,
            _ => source.scene.clone(),
        };
        self.scene.set_mesh(&mut config, Some(33))?;
        let region_mm = self.scene.region.or(source.env.region_mm);
        let region_mm = region_mm.unwrap_or(CORNER);
        let blank = lamina(&config)?;
        let env = EnvConfig {
            region_mm: Some(region_mm),
            crop: true,
            stencil_mm: stencil_mm(&blank, source.env.stencil_mm),
            ..source.env
        };
        // Refused before the work.
        let region = env.region(&blank)?;
        twin_config(&config)?;
        config.check()?;
        // The tool is made once more: its time is not that of the fall.
        let start = ProcessTime::now();
        Tool::new(&config.tool).map_err(SceneError::from)?;
        let tool = start.elapsed();
        let start = ProcessTime::now();
        let fall = |share| (context.progress)(share, "falling");
        let scene = Arc::new(Scene::new(&config, fall)?);
        let fall_cpu_s = start.elapsed().saturating_sub(tool).as_secs_f64();
        let sequence = match self.path {
            Some(_) => transferred(&source.vertices, &lamina(&source.scene)?, &scene.lamina),
            None => sequences(&scene, &env, Order::Sweep, 1, 0)?
                .pop()
                .ok_or(StudyError::FastDiverged)?,
        };
        let case = PaperCase {
            scene,
            fall_cpu_s,
            env,
            region,
            sequence,
        };
        let runs = case.run(|share| (context.progress)(share, "pressing in the twin"))?;
        let region = region_mm.map(|x| 1e-3 * x);
        let compared = compare_all(&case.scene, &runs, region)?;
        let mut convergence = Vec::new();
        if self.convergence {
            (context.progress)(0.5, "holding the twin against itself");
            convergence = case.converge(&runs[1])?;
        }
        let mut report = tables(&case, &runs, &compared, &convergence);
        report.fact("region_mm", region_mm);
        pictures(&mut report, &case.scene, &compared, region);
        states(&mut report, case.scene, &runs);
        Ok(report)
    }
}

fn tables(
    case: &PaperCase,
    runs: &[Ran; 3],
    compared: &[Compared],
    convergence: &[SelfComparison],
) -> Report {
    let (presses, region) = (case.sequence.len(), &case.region.vertices);
    let Scene { lamina, tool, .. } = &*case.scene;
    let surplus_mm = |x: &Positions| 1e3 * surplus(lamina, tool, x, region);
    let title = format!(
        "{} vertices, {presses} presses of a stencil of {:.1} mm; CPU time, and the region's summed \
         distance to the tool",
        lamina.vertex_count(),
        case.env.stencil_mm
    );
    let time = Table::of("runs", title, runs)
        .text("model", |ran| ran.name)
        .number("fall [s]", 3, |ran| ran.fall_cpu_s)
        .number("presses [s]", 3, |ran| ran.press_cpu_s)
        .number("all [s]", 3, Ran::cpu_s)
        .number("before [m]", 4, |ran| case.distance_m(&ran.ends[0]))
        .number("left [m]", 4, |ran| case.distance_m(&ran.ends[1]))
        .number("surplus before [mm]", 3, |ran| surplus_mm(&ran.ends[0]))
        .number("surplus left [mm]", 3, |ran| surplus_mm(&ran.ends[1]))
        .text("draped", |ran| {
            let in_region = |v: &&u32| region.contains(**v as usize);
            ran.draped.iter().filter(in_region).count()
        })
        .number("step [us]", 2, |ran| 1e6 * ran.time_step_s)
        .number("v_rms before [mm/s]", 3, |ran| 1e3 * ran.v_rms[0])
        .number("v_rms after [mm/s]", 3, |ran| 1e3 * ran.v_rms[1]);
    let mut moments: Vec<(&str, &str, Energies)> = Vec::new();
    for ran in runs {
        let energies = ran.energy.iter().flatten().zip(["fall", "presses"]);
        moments.extend(energies.map(|(energies, moment)| (ran.name, moment, *energies)));
    }
    let energy = Table::of("energy", "Balance since the start of the fall", &moments)
        .text("model", |(name, ..)| *name)
        .text("after", |(_, moment, _)| *moment)
        .number("supplied [mJ]", 3, |(.., e)| 1e3 * e.supplied())
        .number("kinetic [mJ]", 4, |(.., e)| 1e3 * e.kinetic)
        .number("strain [mJ]", 3, |(.., e)| 1e3 * e.strain())
        .number("dissipated [mJ]", 3, |(.., e)| 1e3 * e.dissipated())
        .number("residual [mJ]", 4, |(.., e)| 1e3 * e.residual())
        .number("residual of the greatest amount [%]", 3, |(.., e)| {
            1e2 * e.residual().abs() / e.size().max(f64::MIN_POSITIVE)
        });
    let mut tables = vec![time.end(), energy.end(), comparison_table(compared)];
    if !convergence.is_empty() {
        let title =
            "The twin against itself: between the same material points, and summed distances";
        let table = Table::of("convergence", title, convergence)
            .text("variant", |v| v.name)
            .text("vertices", |v| v.vertices)
            .number("step [us]", 2, |v| 1e6 * v.time_step_s)
            .number("fall mean [mm]", 4, |v| v.initial_mm[0])
            .number("fall max [mm]", 3, |v| v.initial_mm[1])
            .number("sheet [m]", 3, |v| v.initial_m[0])
            .number("sheet of the twin [m]", 3, |v| v.initial_m[1])
            .number("presses mean [mm]", 3, |v| v.draped_mm[0])
            .number("presses max [mm]", 3, |v| v.draped_mm[1])
            .number("left [m]", 4, |v| v.left_m[0])
            .number("left of the twin [m]", 4, |v| v.left_m[1]);
        tables.push(table.end());
    }
    let mut report = Report::new(tables);
    let [fast, twin, accelerated] = runs;
    let ratio = |a: f64, b: f64| a / b.max(1e-9);
    report.notes.push(format!(
        "twin over fast {:.0} (presses alone {:.0}), twin over accelerated {:.1}; the paper's, of \
         8.15 h, 40.2 min and 19 s: 1544 and 12.2",
        ratio(twin.cpu_s(), fast.cpu_s()),
        ratio(twin.press_cpu_s, fast.press_cpu_s),
        ratio(twin.cpu_s(), accelerated.cpu_s())
    ));
    report.fact("sequence", &case.sequence);
    report
}

/// A drape, `initial` or `draped`, next to the twin's.
struct Compared {
    moment: &'static str,
    name: &'static str,
    surface: Surveyed,
    reference: Surveyed,
    comparison: Comparison,
}

/// Fast against twin and accelerated against twin, before the presses and after them, with a
/// `region` [m on the flat blank].
fn compare_all(
    scene: &Scene,
    runs: &[Ran; 3],
    region: [f64; 4],
) -> Result<Vec<Compared>, StudyError> {
    let criteria = Criteria {
        tool: Some(&scene.tool.surface),
        region: Some(region),
    };
    let [fast, twin, accelerated] = runs;
    let mut all = Vec::new();
    for (k, moment) in ["initial", "draped"].into_iter().enumerate() {
        let survey = |ran: &Ran| {
            let drape = Drape::new(&scene.lamina, &ran.ends[k]);
            Surveyed::draped(drape).map_err(|error| StudyError::Named(ran.name, error.into()))
        };
        let reference = survey(twin)?;
        for ran in [fast, accelerated] {
            let surface = survey(ran)?;
            all.push(Compared {
                moment,
                name: ran.name,
                comparison: compare(&surface, &reference, &criteria),
                surface,
                reference: reference.clone(),
            });
        }
    }
    Ok(all)
}

/// Rows as of the paper's Table 3, and how far material points are apart.
fn comparison_table(compared: &[Compared]) -> Table {
    type Row<'a> = (&'a Compared, &'static str, &'a Parts);
    let mut rows: Vec<Row> = Vec::new();
    for found in compared {
        let parts = found.comparison.parts();
        rows.extend(parts.map(|(part, parts)| (found, part, parts)));
    }
    let height = |row: &Row| row.2.topology_a_to_b_mm;
    let points = |row: &Row| row.2.material_points_mm;
    let contours = |found: &Compared| found.comparison.contour_a_to_b_mm;
    let contour = |(found, part, _): &Row| contours(found).filter(|_| *part == "all");
    let fibres = |parts: &Parts, k: usize| parts.fibre_angle_deg.map(|a| 1e2 * a[k].share_below);
    Table::of("comparisons", "Against the twin", &rows)
        .text("moment", |(found, ..)| found.moment)
        .text("model", |(found, ..)| found.name)
        .text("part", |(_, part, _)| *part)
        .number("min [mm]", 2, |row| height(row).map(|t| t.min))
        .number("max [mm]", 2, |row| height(row).map(|t| t.max))
        .number("p95 [mm]", 2, |row| height(row).map(|t| t.p95))
        .number("contour mean [mm]", 2, |row| contour(row).map(|c| c.mean))
        .number("contour max [mm]", 2, |row| contour(row).map(|c| c.max))
        .number("warp < 5 deg [%]", 1, |(.., p)| fibres(p, 0))
        .number("weft < 5 deg [%]", 1, |(.., p)| fibres(p, 1))
        .number("points mean [mm]", 2, |row| points(row).map(|m| m.mean))
        .number("points max [mm]", 1, |row| points(row).map(|m| m.max))
        .end()
}

/// How fast and accelerated deviate from the twin; the same colours for both moments of both.
fn pictures(report: &mut Report, scene: &Scene, compared: &[Compared], region: [f64; 4]) {
    let range = (compared.iter())
        .filter(|found| found.name == "fast")
        .filter_map(|found| found.comparison.all.topology_a_to_b_mm)
        .map(|off| picture::range(off.p95))
        .fold(0.0, f64::max);
    for found in compared {
        let (a, b) = (&found.surface, &found.reference);
        let image = picture::deviation(a, b, Some(&scene.tool), Some(region), range);
        report.image(format!("{}-{}.png", found.moment, found.name), image);
    }
}

/// Every state as STL and state file.
fn states(report: &mut Report, scene: Arc<Scene>, runs: &[Ran; 3]) {
    let tool = scene.tool.clone();
    report.file("tool.stl", move |path| {
        write_stl(path, &tool.mesh_in_scene(), "tool")
    });
    for ran in runs {
        for (moment, position) in ["initial", "draped"].into_iter().zip(&ran.ends) {
            let name = format!("{moment}-{}", ran.name);
            let drape = Drape::new(&scene.lamina, &scene.tool.in_scene(position));
            let mesh = drape.mesh();
            report.file(format!("{name}.json"), move |path| drape.write(path));
            let file = format!("{name}.stl");
            report.file(file, move |path| write_stl(path, &mesh, &name));
        }
    }
}

#[cfg(test)]
pub mod tests;
