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
//! differ by millimetres whatever the rate. [`Noise`] is what a push of the start by a thousandth of
//! a millimetre does at the rate of `accurate`. Below it no error can be told.

mod press;
mod settings;
mod table;
mod twin;

use std::sync::Arc;

use cpu_time::ProcessTime;
use serde::Serialize;

use super::points::{apart_mm, distance, same_points};
use drape_cloth::fabric::Lamina;
use drape_cloth::math::{Purpose, Stream, mean_and_deviation};
use drape_cloth::scene::{Scene, SceneConfig, SceneError};
use drape_cloth::sim::Solver;
use drape_cloth::tool::Tool;
use drape_cloth::sim::Precision;
use drape_task::env::{EnvConfig, EnvError};
use press::{Pressed, press, sequences};

pub use settings::{Extent, Kind, Setting, settings};
pub use table::csv;
pub use twin::{Twinned, TwinnedFall, against_twin};

/// How far the start is pushed to measure the noise [m].
const PUSH: f64 = 1e-6;

/// Pushed starts.
const PUSHES: usize = 2;

/// A measured point. Numbers that do not exist, as after a divergence, are NaN. Errors are
/// distances between the same material points; summed distances count as many points as the
/// default mesh has, whatever the mesh.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    pub axis: &'static str,
    pub value: String,
    pub kind: Kind,
    pub solver: Solver,
    pub precision: Precision,
    pub substep_rate: f64,
    pub contact_interval: usize,
    /// Of the whole blank.
    pub vertices: usize,
    /// CPU time of an environment step in a group of lanes; in f64 of one alone [us].
    pub microseconds: f64,
    /// CPU time of the fall [s].
    pub initial_seconds: f64,
    /// Error of the state that the fall leaves.
    pub initial_mean_mm: f64,
    pub initial_max_mm: f64,
    /// Summed distance to the tool, and its error.
    pub initial_distance_m: f64,
    pub initial_distance_error_m: f64,
    /// Error of the focus region after the first row of the sweep.
    pub early_mean_mm: f64,
    /// Errors after the whole sweep.
    pub region_mean_mm: f64,
    pub region_max_mm: f64,
    pub sheet_mean_mm: f64,
    pub sheet_max_mm: f64,
    /// Summed distances to the tool after it.
    pub region_distance_m: f64,
    pub sheet_distance_m: f64,
    /// Error of the distance that the sweep has removed from the region, over that distance.
    pub removed_error: f64,
    /// Tension of the yarns after the sweep [-].
    pub tension_p95: f64,
    pub tension_max: f64,
    /// Summed distance of the region after all sequences: mean and standard deviation.
    pub sequences_distance_m: f64,
    pub sequences_deviation_m: f64,
    /// Its difference from the reference, sequence by sequence: mean and root mean square.
    pub sequences_bias_m: f64,
    pub sequences_rms_m: f64,
    /// Mean error of the region over all sequences.
    pub sequences_mean_mm: f64,
}

/// What a push of the start by a micrometre does to what `accurate` ends with.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Noise {
    /// Change of the region's summed distance, root mean square over the sequences [m].
    pub distance_rms_m: f64,
    /// Mean change of place in the region [mm].
    pub mean_mm: f64,
}

/// The cheapest point that differs from the converged solution by no more than twice the noise.
#[derive(Clone, Debug, Serialize)]
pub struct Recommendation {
    /// Its number in the points; none if no setting stayed sound.
    pub point: Option<usize>,
    /// Whether there was one; else it is the one that differs least.
    pub is_within: bool,
    /// Twice the noise [m]; none where the noise has no measure.
    pub tolerance_m: Option<f64>,
    /// All of it in one line.
    pub text: String,
}

/// What the study has found.
#[derive(Clone, Debug, Serialize)]
pub struct Findings {
    pub points: Vec<Point>,
    /// Those of the axis `preset`, again.
    pub presets: Vec<Point>,
    pub noise: Noise,
    /// Presses in a sequence.
    pub presses: usize,
    /// Vertices of the focus region.
    pub region_vertices: usize,
    pub recommendation: Recommendation,
}

/// A study that cannot be done.
#[derive(Debug, thiserror::Error)]
pub enum TradeoffError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Env(#[from] EnvError),
}

/// Measures `settings`, which are around `scene` and `env`. `progress` is told what is being
/// computed, before each point.
pub fn run(
    scene: &SceneConfig,
    env: &EnvConfig,
    settings: &[Setting],
    mut progress: impl FnMut(&Setting),
) -> Result<Findings, TradeoffError> {
    let mut bench = Bench::new(scene, env)?;
    let mut points = Vec::with_capacity(settings.len());
    for setting in settings {
        progress(setting);
        points.push(bench.measure(setting)?);
    }
    let noise = bench.noise()?;
    let presets = points.iter().filter(|point| point.axis == "preset");
    Ok(Findings {
        presets: presets.cloned().collect(),
        recommendation: recommend(&points, noise),
        points,
        noise,
        presses: bench.sequences[0].len(),
        region_vertices: bench.region_vertices,
    })
}

/// The cheapest method within twice the noise.
fn recommend(points: &[Point], noise: Noise) -> Recommendation {
    // Where a pushed start is lost there is no tolerance, and nothing is within it.
    let tolerance = Some(2.0 * noise.distance_rms_m).filter(|tolerance| tolerance.is_finite());
    let methods = || {
        let all = points.iter().enumerate();
        all.filter(|(_, p)| p.kind == Kind::Method && p.sequences_rms_m.is_finite())
    };
    let within = methods()
        .filter(|(_, p)| tolerance.is_some_and(|tolerance| p.sequences_rms_m <= tolerance))
        .min_by(|(_, a), (_, b)| a.microseconds.total_cmp(&b.microseconds));
    let least =
        || methods().min_by(|(_, a), (_, b)| a.sequences_rms_m.total_cmp(&b.sequences_rms_m));
    let Some((index, point)) = within.or_else(least) else {
        return Recommendation {
            point: None,
            is_within: false,
            tolerance_m: tolerance,
            text: "no setting stayed sound: raise the substep rate".into(),
        };
    };
    let solver = serde_json::to_value(point.solver).expect("a name");
    let reason = match tolerance {
        None => "the least error; the noise is unknown, a pushed start was lost".to_owned(),
        Some(tolerance) if within.is_some() => {
            format!("the cheapest within twice the noise, {tolerance:.4} m")
        }
        Some(tolerance) => {
            format!("the least error, none is within twice the noise, {tolerance:.4} m")
        }
    };
    Recommendation {
        point: Some(index),
        is_within: within.is_some(),
        tolerance_m: tolerance,
        text: format!(
            "solver = {solver}, substep_rate = {}, contact_interval = {}, {:?}: {:.0} us a step, {:.4} m \
             from the converged distance; {reason}",
            point.substep_rate,
            point.contact_interval,
            point.precision,
            point.microseconds,
            point.sequences_rms_m,
        )
        .replace("F32", "f32")
        .replace("F64", "f64"),
    }
}

/// All that points share, and what has been computed already.
struct Bench<'a> {
    scene: &'a SceneConfig,
    env: &'a EnvConfig,
    sequences: Vec<Vec<[f64; 2]>>,
    /// On the default mesh.
    sheet_vertices: usize,
    region_vertices: usize,
    falls: Vec<(SceneConfig, Option<Arc<Fallen>>)>,
    played: Vec<(settings::Around, Option<Arc<Played>>)>,
}

struct Fallen {
    scene: Scene,
    seconds: f64,
}

struct Played {
    scene: Arc<Scene>,
    pressed: Pressed,
}

/// Vertices of two meshes which are the same material points.
struct Shared {
    pairs: Vec<[usize; 2]>,
    /// Those of the focus region.
    region: Vec<[usize; 2]>,
}

impl<'a> Bench<'a> {
    fn new(scene: &'a SceneConfig, env: &'a EnvConfig) -> Result<Self, TradeoffError> {
        scene.check()?;
        let material = scene.read_material()?;
        let lamina = Lamina::new(&scene.blank, material).map_err(SceneError::from)?;
        Ok(Self {
            sequences: sequences(&lamina, env)?,
            scene,
            env,
            sheet_vertices: lamina.vertex_count(),
            region_vertices: env.region(&lamina)?.vertices.count_ones(..),
            falls: Vec::new(),
            played: Vec::new(),
        })
    }

    /// The fall of a scene; none if it diverges.
    fn fall(&mut self, config: &SceneConfig) -> Result<Option<Arc<Fallen>>, TradeoffError> {
        if let Some((_, fallen)) = self.falls.iter().find(|(known, _)| known == config) {
            return Ok(fallen.clone());
        }
        let start = ProcessTime::now();
        let fallen = match Scene::new(config, |_| ()) {
            Ok(scene) => Some(Arc::new(Fallen {
                scene,
                seconds: start.elapsed().as_secs_f64(),
            })),
            Err(SceneError::Diverged { .. }) => None,
            Err(error) => return Err(error.into()),
        };
        self.falls.push((config.clone(), fallen.clone()));
        Ok(fallen)
    }

    /// The scene of a point at the converged start, which all points of a mesh share.
    fn start(&mut self, config: &SceneConfig) -> Result<Option<Scene>, TradeoffError> {
        let around = (self.scene.clone(), self.env.clone());
        let (mut converged, _) = settings::converged(&around);
        converged.blank = config.blank.clone();
        let Some(fallen) = self.fall(&converged)? else {
            return Ok(None);
        };
        let mut scene = fallen.scene.with_physics(config.physics.clone());
        if config.tool != scene.config.tool {
            scene.tool = Tool::new(&config.tool).map_err(SceneError::from)?;
        }
        scene.config = config.clone();
        Ok(Some(scene))
    }

    fn play(
        &mut self,
        at: &(SceneConfig, EnvConfig),
    ) -> Result<Option<Arc<Played>>, TradeoffError> {
        if let Some((_, played)) = self.played.iter().find(|(known, _)| known == at) {
            return Ok(played.clone());
        }
        let played = match self.start(&at.0)? {
            None => None,
            Some(scene) => {
                let scene = Arc::new(scene);
                let pressed = press(&scene, &at.1, &self.sequences)?;
                Some(Arc::new(Played { scene, pressed }))
            }
        };
        self.played.push((at.clone(), played.clone()));
        Ok(played)
    }

    fn measure(&mut self, setting: &Setting) -> Result<Point, TradeoffError> {
        let at = (setting.scene.clone(), setting.env.clone());
        let physics = &setting.scene.physics;
        let stepping = setting.env.stepping();
        let mut point = Point {
            axis: setting.axis,
            value: setting.value.clone(),
            kind: setting.kind,
            solver: physics.solver,
            precision: setting.env.precision,
            substep_rate: stepping.substep_rate,
            contact_interval: stepping.control(1.0).contact_interval,
            ..Point::NONE
        };
        let fallen = [self.fall(&at.0)?, self.fall(&setting.reference.0)?];
        if let [Some(a), Some(b)] = &fallen {
            self.compare_falls(&mut point, a, b);
        }
        // Checked by its fall, which was refused otherwise.
        let played = [self.play(&at)?, self.play(&setting.reference)?];
        if let [Some(a), Some(b)] = &played {
            self.compare_presses(&mut point, a, b);
        }
        Ok(point)
    }

    fn compare_falls(&self, point: &mut Point, a: &Fallen, b: &Fallen) {
        let shared = self.shared(&a.scene.lamina, &b.scene.lamina);
        let [x, y] = [a, b].map(|fallen| &fallen.scene.initial.position[..]);
        let tool = &b.scene.tool;
        let on_sheet = |x, side| {
            side_distance(tool, x, &shared.pairs, side)
                * scale(self.sheet_vertices, shared.pairs.len())
        };
        let [mean, max] = apart_mm(x, y, &shared.pairs);
        point.vertices = a.scene.lamina.vertex_count();
        point.initial_seconds = a.seconds;
        (point.initial_mean_mm, point.initial_max_mm) = (mean, max);
        point.initial_distance_m = on_sheet(x, 0);
        point.initial_distance_error_m = point.initial_distance_m - on_sheet(y, 1);
    }

    fn compare_presses(&self, point: &mut Point, a: &Played, b: &Played) {
        let shared = self.shared(&a.scene.lamina, &b.scene.lamina);
        let tool = &b.scene.tool;
        let in_region = |x: &[[f64; 3]], side| {
            side_distance(tool, x, &shared.region, side)
                * scale(self.region_vertices, shared.region.len())
        };
        point.vertices = a.scene.lamina.vertex_count();
        point.microseconds = a.pressed.microseconds;
        if let (Some(x), Some(y)) = (&a.pressed.early, &b.pressed.early) {
            [point.early_mean_mm, _] = apart_mm(x, y, &shared.region);
        }
        let ends = || a.pressed.ends.iter().zip(&b.pressed.ends);
        if let Some((Some(x), Some(y))) = ends().next() {
            [point.region_mean_mm, point.region_max_mm] = apart_mm(x, y, &shared.region);
            [point.sheet_mean_mm, point.sheet_max_mm] = apart_mm(x, y, &shared.pairs);
            point.region_distance_m = in_region(x, 0);
            point.sheet_distance_m = side_distance(tool, x, &shared.pairs, 0)
                * scale(self.sheet_vertices, shared.pairs.len());
            let removed = in_region(&a.scene.initial.position, 0) - point.region_distance_m;
            let expected = in_region(&b.scene.initial.position, 1) - in_region(y, 1);
            point.removed_error = (removed - expected) / expected;
            let mut state = a.scene.initial.clone();
            state.position.clone_from(x);
            let summary = a.scene.summary(&state);
            (point.tension_p95, point.tension_max) = (summary.tension_p95, summary.tension_max);
        }
        // One lost sequence leaves no statistic: the others are not the same sample.
        let both: Option<Vec<_>> = ends().map(|(x, y)| x.as_ref().zip(y.as_ref())).collect();
        let Some(both) = both else { return };
        let left: Vec<f64> = both.iter().map(|(x, _)| in_region(x, 0)).collect();
        let more = both.iter().zip(&left);
        let more: Vec<f64> = more.map(|((_, y), left)| left - in_region(y, 1)).collect();
        let errors = both
            .iter()
            .map(|(x, y)| apart_mm(x, y, &shared.region)[0])
            .collect::<Vec<_>>();
        [point.sequences_distance_m, point.sequences_deviation_m] = mean_and_deviation(&left);
        point.sequences_bias_m = mean(&more);
        point.sequences_rms_m = rms(&more);
        point.sequences_mean_mm = mean(&errors);
    }

    /// Presses from pushed starts, as `accurate` steps them.
    fn noise(&mut self) -> Result<Noise, TradeoffError> {
        let around = (self.scene.clone(), self.env.clone());
        let (config, env) = settings::accurate(&around);
        let none = Noise {
            distance_rms_m: f64::NAN,
            mean_mm: f64::NAN,
        };
        let Some(scene) = self.start(&config)? else {
            return Ok(none);
        };
        let shared = self.shared(&scene.lamina, &scene.lamina);
        let mut ends = Vec::new();
        for push in 0..=PUSHES {
            let mut scene = scene.clone();
            let mut stream = Stream::new(1, Purpose::Evaluation, 100 + push as u32);
            let size = if push == 0 { 0.0 } else { PUSH };
            let fixed = &scene.initial.fixed;
            for (v, x) in scene.initial.position.iter_mut().enumerate() {
                if !fixed.contains(v) {
                    *x = x.map(|x| x + size * stream.normal());
                }
            }
            ends.push(press(&Arc::new(scene), &env, &self.sequences)?.ends);
        }
        let (mut distances, mut places) = (Vec::new(), Vec::new());
        for pushed in &ends[1..] {
            for end in ends[0].iter().zip(pushed) {
                let (Some(x), Some(y)) = end else {
                    return Ok(none);
                };
                let [a, b] = [x, y].map(|x| side_distance(&scene.tool, x, &shared.region, 0));
                distances.push(b - a);
                places.push(apart_mm(x, y, &shared.region)[0]);
            }
        }
        Ok(Noise {
            distance_rms_m: rms(&distances),
            mean_mm: mean(&places),
        })
    }

    fn shared(&self, a: &Lamina, b: &Lamina) -> Shared {
        let pairs = same_points(&a.rest, &b.rest);
        let region = self.env.region(a).map(|region| region.vertices);
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

fn scale(count: usize, of: usize) -> f64 {
    count as f64 / of as f64
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

impl Point {
    const NONE: Self = Self {
        axis: "",
        value: String::new(),
        kind: Kind::Method,
        solver: Solver::Yarn,
        precision: Precision::F32,
        substep_rate: f64::NAN,
        contact_interval: 0,
        vertices: 0,
        microseconds: f64::NAN,
        initial_seconds: f64::NAN,
        initial_mean_mm: f64::NAN,
        initial_max_mm: f64::NAN,
        initial_distance_m: f64::NAN,
        initial_distance_error_m: f64::NAN,
        early_mean_mm: f64::NAN,
        region_mean_mm: f64::NAN,
        region_max_mm: f64::NAN,
        sheet_mean_mm: f64::NAN,
        sheet_max_mm: f64::NAN,
        region_distance_m: f64::NAN,
        sheet_distance_m: f64::NAN,
        removed_error: f64::NAN,
        tension_p95: f64::NAN,
        tension_max: f64::NAN,
        sequences_distance_m: f64::NAN,
        sequences_deviation_m: f64::NAN,
        sequences_bias_m: f64::NAN,
        sequences_rms_m: f64::NAN,
        sequences_mean_mm: f64::NAN,
    };
}

#[cfg(test)]
mod tests;
