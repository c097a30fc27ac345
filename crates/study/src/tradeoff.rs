//! What accuracy costs: CPU time of an environment step against the error that a setting makes.
//!
//! Points lie on a plane of solver and substep rate and on one axis at a time around the default.
//! Each is measured three times over:
//!
//! | Measured | Held against |
//! | --- | --- |
//! | the fall, made with the setting | the fall of the reference, at the same material points |
//! | a straight sweep of presses over the focus region, from one converged start | the same presses by the reference |
//! | the same presses in eight orders | the distance that the reference leaves in each |
//!
//! The reference of a *method* (solver, rates, precision) is the same model converged: `yarn`, f64,
//! 48 000 substeps a second, four times the finest preset. That of a *model* (mesh, tool grid,
//! press, physics) is the one on its axis that leaves least out, stepped as usual.
//!
//! Places diverge: what a press does to a wrinkle can hang on a hair, and then positions
//! differ by millimetres whatever the rate. `Noise` is what a push of the start by a thousandth
//! of a millimetre does at the rate of `accurate`. Below it no error can be told.

mod point;
mod press;
mod settings;

use std::sync::Arc;

use crate::points::{apart_mm, coarser, distance, same_points};
use crate::study::{Context, QUICKSTART, Report, SceneOptions, Study, StudyError};
use crate::table::Table;
use crate::twin::fall::{fallen, twin_config, unfallen};
use crate::verify::solver_name;
use drape_cloth::fabric::Lamina;
use drape_cloth::math::{Purpose, Stream, mean_and_deviation};
use drape_cloth::scene::{Scene, SceneConfig, SceneError};
use drape_cloth::sim::Snapshot;
use drape_cloth::sim::{Accuracy, Solver};
use drape_cloth::tool::Tool;
use drape_task::env::EnvConfig;
use point::{FallError, Noise, Point, PressError, SequenceError, chart, point_table, recommend};
use press::{Pressed, press, sequences};
use settings::{Around, Setting, converged, settings, stepped};

/// Measure what accuracy costs: CPU time of an environment step against error, over solver,
/// rates, precision, press, mesh, tool grid and physics
///
/// Writes tradeoff.png too, which shows cost against error with the presets marked. The
/// region is a corner of the built-in scene, the whole blank of another one if not given.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study tradeoff --quick
  drape study tradeoff mine.toml --region=-50,-50,50,50 --json > tradeoff.json")]
pub struct Tradeoff {
    #[command(flatten)]
    scene: SceneOptions,

    /// Fewer points on a smaller region: some three minutes of CPU time
    #[arg(long)]
    quick: bool,

    /// Also with --quick: hold falls against the finite-element twin on a mesh of twice the cell.
    /// Without it a scene that the twin has nothing for goes without
    #[arg(long)]
    twin: bool,
}

/// The region of `--quick`, a corner of the quickstart's [mm].
const QUICK_REGION: [f64; 4] = [-186.0, -186.0, -95.0, -95.0];

/// How far the start is pushed to measure the noise [m].
const PUSH: f64 = 1e-6;

/// Pushed starts.
const PUSHES: usize = 2;

impl Study for Tradeoff {
    const NAME: &'static str = "tradeoff";

    fn scene(&self) -> Option<&SceneOptions> {
        Some(&self.scene)
    }

    fn run(&self, context: &Context) -> Result<Report, StudyError> {
        let mut scene = self.scene.read()?;
        if let Some(mesh) = self.scene.mesh {
            self.scene.set_mesh(&mut scene, mesh)?;
        }
        let corner = if self.quick { QUICK_REGION } else { QUICKSTART };
        let corner = self.scene.config.is_none().then_some(corner);
        let env = self.scene.env(corner);
        // A scene that the twin has nothing for is refused before the work, or goes without.
        let has_twin = match twin_config(&scene) {
            Ok(_) => self.twin || !self.quick,
            Err(error) if self.twin => return Err(error.into()),
            Err(_) => false,
        };
        let settings = settings(&scene, &env, self.quick);
        let (measuring, points, noise) = measure(&scene, &env, &settings, context)?;

        let title = format!(
            "{} presses on {} vertices; errors of the fall, of the sweep's first row and end, of eight \
             sequences; distance left, its mean and rms difference from the reference",
            measuring.sequences[0].len(),
            measuring.region_vertices
        );
        let table = point_table(title, &points);
        let mut report = Report::new([table]);
        report.notes.push(format!(
            "noise, start pushed by 1 um: {:.3} mm, {:.4} m",
            noise.mean_mm, noise.distance_rms_m
        ));
        report.fact("noise_mm", noise.mean_mm);
        report.fact("noise_m", noise.distance_rms_m);
        let recommendation = recommend(&points, noise);
        report.fact("recommended", &recommendation.text);
        report.fact("recommended_point", recommendation.point);
        report.fact("is_within_noise", recommendation.is_within);
        report
            .notes
            .push(format!("recommended: {}", recommendation.text));
        report.chart("tradeoff", chart(&points, noise));
        if has_twin {
            (context.progress)(1.0, "finite-element twin");
            report.tables.push(against_twin(&scene)?);
        }
        Ok(report)
    }
}

/// Measures `settings`, which are around `scene` and `env`.
fn measure<'a>(
    scene: &'a SceneConfig,
    env: &'a EnvConfig,
    settings: &[Setting],
    context: &Context,
) -> Result<(Measuring<'a>, Vec<Point>, Noise), StudyError> {
    let mut measuring = Measuring::new(scene, env)?;
    let mut points = Vec::with_capacity(settings.len());
    for (done, setting) in settings.iter().enumerate() {
        let doing = format!("{} {}", setting.axis, setting.value);
        (context.progress)(done as f64 / settings.len() as f64, &doing);
        points.push(measuring.point(setting)?);
    }
    let noise = measuring.noise()?.unwrap_or(Noise {
        distance_rms_m: f64::NAN,
        mean_mm: f64::NAN,
    });
    Ok((measuring, points, noise))
}

/// All that points share, and what has been computed already.
struct Measuring<'a> {
    around: (&'a SceneConfig, &'a EnvConfig),
    sequences: Vec<Vec<[f64; 2]>>,
    /// On the default mesh.
    sheet_vertices: usize,
    region_vertices: usize,
    falls: Vec<(SceneConfig, Option<Arc<Scene>>)>,
    pressed: Vec<(Around, Option<Arc<Pressed>>)>,
}

/// Vertices of two meshes which are the same material points.
struct Shared {
    pairs: Vec<[usize; 2]>,
    /// Those of the focus region.
    region: Vec<[usize; 2]>,
}

impl<'a> Measuring<'a> {
    fn new(scene: &'a SceneConfig, env: &'a EnvConfig) -> Result<Self, StudyError> {
        scene.check()?;
        let material = scene.read_material()?;
        let lamina = Lamina::new(&scene.blank, material).map_err(SceneError::from)?;
        Ok(Self {
            sequences: sequences(&lamina, env)?,
            around: (scene, env),
            sheet_vertices: lamina.vertex_count(),
            region_vertices: env.region(&lamina)?.vertices.count_ones(..),
            falls: Vec::new(),
            pressed: Vec::new(),
        })
    }

    /// The fall of a scene; none if it diverges.
    fn fall(&mut self, config: &SceneConfig) -> Result<Option<Arc<Scene>>, StudyError> {
        if let Some((_, fallen)) = self.falls.iter().find(|(known, _)| known == config) {
            return Ok(fallen.clone());
        }
        let fallen = match Scene::new(config, |_| ()) {
            Ok(scene) => Some(Arc::new(scene)),
            Err(SceneError::Diverged { .. }) => None,
            Err(error) => return Err(error.into()),
        };
        self.falls.push((config.clone(), fallen.clone()));
        Ok(fallen)
    }

    fn owned(&self) -> Around {
        (self.around.0.clone(), self.around.1.clone())
    }

    /// The scene of a point at the converged start, which all points of a mesh share.
    fn start(&mut self, config: &SceneConfig) -> Result<Option<Scene>, StudyError> {
        let (mut converged, _) = converged(&self.owned());
        converged.blank = config.blank.clone();
        let Some(fallen) = self.fall(&converged)? else {
            return Ok(None);
        };
        let mut scene = fallen.with_physics(config.physics.clone());
        if config.tool != scene.config.tool {
            scene.tool = Tool::new(&config.tool).map_err(SceneError::from)?.into();
        }
        scene.config = config.clone();
        Ok(Some(scene))
    }

    fn press(&mut self, at: &Around) -> Result<Option<Arc<Pressed>>, StudyError> {
        if let Some((_, pressed)) = self.pressed.iter().find(|(known, _)| known == at) {
            return Ok(pressed.clone());
        }
        let pressed = match self.start(&at.0)? {
            None => None,
            Some(scene) => Some(Arc::new(press(Arc::new(scene), &at.1, &self.sequences)?)),
        };
        self.pressed.push((at.clone(), pressed.clone()));
        Ok(pressed)
    }

    fn point(&mut self, setting: &Setting) -> Result<Point, StudyError> {
        let (scene, env) = &setting.around;
        let stepping = env.stepping();
        let fallen = [self.fall(scene)?, self.fall(&setting.reference.0)?];
        let pressed = [
            self.press(&setting.around)?,
            self.press(&setting.reference)?,
        ];
        let mut point = Point {
            axis: setting.axis,
            value: setting.value.clone(),
            is_method: setting.is_method,
            solver: scene.physics.solver,
            precision: env.precision,
            substep_rate: stepping.substep_rate,
            contact_interval: stepping.control(1.0).contact_interval,
            fall: None,
            presses: None,
            sequences: None,
        };
        if let [Some(a), Some(b)] = &fallen {
            point.fall = Some(self.compare_falls(a, b));
        }
        if let [Some(a), Some(b)] = &pressed {
            let shared = self.shared(&a.scene.lamina, &b.scene.lamina);
            point.presses = Some(self.compare_sweeps(a, b, &shared));
            point.sequences = self.compare_sequences(a, b, &shared);
        }
        Ok(point)
    }

    fn compare_falls(&self, a: &Scene, b: &Scene) -> FallError {
        let pairs = self.shared(&a.lamina, &b.lamina).pairs;
        let [x, y] = [a, b].map(|scene| &scene.initial.position[..]);
        let scale = self.sheet_vertices as f64 / pairs.len() as f64;
        let on_sheet = |x, side| scale * side_distance(&b.tool, x, &pairs, side);
        let [mean_mm, max_mm] = apart_mm(x, y, &pairs);
        FallError {
            vertices: a.lamina.vertex_count(),
            mean_mm,
            max_mm,
            distance_m: on_sheet(x, 0),
            distance_error_m: on_sheet(x, 0) - on_sheet(y, 1),
        }
    }

    /// Summed distance of the region [m] on one `side` of what two meshes share.
    fn in_region(&self, tool: &Tool, shared: &Shared, x: &[[f64; 3]], side: usize) -> f64 {
        let scale = self.region_vertices as f64 / shared.region.len() as f64;
        scale * side_distance(tool, x, &shared.region, side)
    }

    fn compare_sweeps(&self, a: &Pressed, b: &Pressed, shared: &Shared) -> PressError {
        let in_region = |x: &[[f64; 3]], side| self.in_region(&b.scene.tool, shared, x, side);
        let apart = |x: &[[f64; 3]], y: &[[f64; 3]]| apart_mm(x, y, &shared.region);
        let early = a.early.as_ref().zip(b.early.as_ref());
        let ends = a.ends[0].as_ref().zip(b.ends[0].as_ref());
        let removed = |(x, y): (&Vec<[f64; 3]>, &Vec<[f64; 3]>)| {
            let [a, b] = [a, b].map(|pressed| &pressed.scene.initial.position);
            let removed = in_region(a, 0) - in_region(x, 0);
            let expected = in_region(b, 1) - in_region(y, 1);
            (removed - expected) / expected
        };
        let tension = |(x, _): (&Vec<[f64; 3]>, _)| {
            let mut state = Snapshot::clone(&a.scene.initial);
            state.position.clone_from(x);
            a.scene.summary(&state).tension_p95
        };
        PressError {
            microseconds: a.microseconds,
            early_mm: early.map(|(x, y)| apart(x, y)[0]),
            region_mm: ends.map(|(x, y)| apart(x, y)),
            removed: ends.map(removed),
            tension_p95: ends.map(tension),
        }
    }

    fn compare_sequences(
        &self,
        a: &Pressed,
        b: &Pressed,
        shared: &Shared,
    ) -> Option<SequenceError> {
        let in_region = |x: &[[f64; 3]], side| self.in_region(&b.scene.tool, shared, x, side);
        let (mut left, mut more, mut errors) = (Vec::new(), Vec::new(), Vec::new());
        for (x, y) in a.ends.iter().zip(&b.ends) {
            let (x, y) = (x.as_ref()?, y.as_ref()?);
            left.push(in_region(x, 0));
            more.push(in_region(x, 0) - in_region(y, 1));
            errors.push(apart_mm(x, y, &shared.region)[0]);
        }
        Some(SequenceError {
            left_m: mean_and_deviation(&left),
            bias_m: mean(&more),
            rms_m: rms(&more),
            mean_mm: mean(&errors),
        })
    }

    /// Presses from pushed starts, as `accurate` steps them; none where one diverges.
    fn noise(&mut self) -> Result<Option<Noise>, StudyError> {
        let (config, env) = stepped(&self.owned(), Accuracy::Accurate.stepping());
        let Some(scene) = self.start(&config)? else {
            return Ok(None);
        };
        let shared = self.shared(&scene.lamina, &scene.lamina);
        let mut ends = Vec::new();
        for push in 0..=PUSHES {
            let mut scene = scene.clone();
            let mut stream = Stream::new(1, Purpose::Evaluation, 100 + push as u32);
            let size = if push == 0 { 0.0 } else { PUSH };
            let fixed = scene.initial.fixed.clone();
            for (v, x) in Arc::make_mut(&mut scene.initial)
                .position
                .iter_mut()
                .enumerate()
            {
                if !fixed.contains(v) {
                    *x = x.map(|x| x + size * stream.normal());
                }
            }
            ends.push(press(Arc::new(scene), &env, &self.sequences)?.ends);
        }
        let (mut distances, mut places) = (Vec::new(), Vec::new());
        for pushed in &ends[1..] {
            for end in ends[0].iter().zip(pushed) {
                let (Some(x), Some(y)) = end else {
                    return Ok(None);
                };
                let [a, b] = [x, y].map(|x| side_distance(&scene.tool, x, &shared.region, 0));
                distances.push(b - a);
                places.push(apart_mm(x, y, &shared.region)[0]);
            }
        }
        Ok(Some(Noise {
            distance_rms_m: rms(&distances),
            mean_mm: mean(&places),
        }))
    }

    fn shared(&self, a: &Lamina, b: &Lamina) -> Shared {
        let pairs = same_points(&a.rest, &b.rest);
        let region = self.around.1.region(a).map(|region| region.vertices);
        let inside = |pair: &&[usize; 2]| region.as_ref().is_ok_and(|r| r.contains(pair[0]));
        Shared {
            region: pairs.iter().filter(inside).copied().collect(),
            pairs,
        }
    }
}

/// Summed distance to the tool of one `side` of `pairs` [m].
fn side_distance(tool: &Tool, x: &[[f64; 3]], pairs: &[[usize; 2]], side: usize) -> f64 {
    distance(tool, pairs.iter().map(|pair| pair[side]), x)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// Lets the twin and the fast solver fall alike, on a mesh of twice the cell: the same mass,
/// bending stiffness, damping and clamps; on the scene's own mesh where that cannot be halved. A
/// 33 x 33 twin takes 15 s and more.
fn against_twin(config: &SceneConfig) -> Result<Table, StudyError> {
    let mut config = config.clone();
    config.blank.vertices = coarser(&config).unwrap_or(config.blank.vertices);
    let hung = unfallen(&config)?;
    let twin = fallen(&hung, &twin_config(&config)?)?.positions();
    let all: Vec<[usize; 2]> = (0..twin.len()).map(|v| [v, v]).collect();
    let mut falls = Vec::new();
    for solver in [Solver::Yarn, Solver::GaussSeidel] {
        for rate in [300.0, 600.0, 1200.0, 6000.0, 12_000.0] {
            let mut fast = config.clone();
            fast.physics.solver = solver;
            fast.fall.substep_rate = rate;
            let found = match Scene::new(&fast, |_| ()) {
                Ok(scene) => {
                    let x = &scene.initial.position;
                    let [mean, max] = apart_mm(x, &twin, &all);
                    Some([mean, max, distance(&hung.tool, 0..x.len(), x)])
                }
                Err(SceneError::Diverged { .. }) => None,
                Err(error) => return Err(error.into()),
            };
            falls.push((solver, rate, found));
        }
    }
    let title = format!(
        "Falls against that of the finite-element twin, {} vertices, which leaves {:.3} m",
        twin.len(),
        distance(&hung.tool, 0..twin.len(), &twin)
    );
    let table = Table::of("falls", title, &falls)
        .text("solver", |(solver, ..)| solver_name(*solver))
        .number("substeps", "1/s", 0, |(_, rate, _)| *rate)
        .number("mean", "mm", 3, |(.., found)| found.map(|f| f[0]))
        .number("max", "mm", 2, |(.., found)| found.map(|f| f[1]))
        .number("distance", "m", 3, |(.., found)| found.map(|f| f[2]));
    Ok(table.end())
}

#[cfg(test)]
mod tests;
