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
mod settings;

use std::sync::Arc;

use cpu_time::ProcessTime;

use crate::points::{apart_mm, distance, nearest, same_points};
use crate::presses::{Replayed, push, replay};
use crate::study::{Context, QUICKSTART, Report, SceneOptions, Study, StudyError};
use drape_cloth::fabric::Lamina;
use drape_cloth::math::{Isa, Purpose, Stream, mean_and_deviation};
use drape_cloth::scene::{Scene, SceneConfig, SceneError};
use drape_cloth::sim::{Accuracy, Precision, Snapshot};
use drape_cloth::tool::Tool;
use drape_task::env::{Draping, EnvConfig};
use point::{MeasuredPoint, Noise, chart, point_table, recommend};
use settings::{Around, Variation, converged, sequences, stepped, variations};

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
}

/// The region of `--quick`, a corner of the quickstart's [mm].
const QUICK_REGION: [f64; 4] = [-186.0, -186.0, -95.0, -95.0];

/// How far the start is pushed to measure the noise [m].
const PUSH: f64 = 1e-6;

/// Pushed starts.
const PUSHES: usize = 2;

/// Environments stepped together at least, as training does.
const ENVIRONMENTS: usize = 16;

impl Study for Tradeoff {
    const NAME: &'static str = "tradeoff";
    const TABLES: &'static [&'static str] = &["points"];

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
        let variations = variations(&scene, &env, self.quick);
        let (measuring, points, noise) = measure(&scene, &env, &variations, context)?;

        let title = format!(
            "{} presses on {} vertices; errors of the fall, of the sweep's first row and end, of eight \
             sequences; distance left, its mean and rms difference from the reference",
            measuring.sequences[0].len(),
            measuring.region_vertices
        );
        let mut report = Report::new([point_table(title, &points)]);
        let recommended = recommend(&points, noise);
        report.notes = vec![
            format!(
                "noise, start pushed by 1 um: {:.3} mm, {:.4} m",
                noise.mean_mm, noise.distance_rms_m
            ),
            format!("recommended: {}", recommended.text),
        ];
        report.fact("noise_mm", noise.mean_mm);
        report.fact("noise_m", noise.distance_rms_m);
        report.fact("recommended", &recommended.text);
        report.fact("recommended_point", recommended.point);
        report.fact("is_within_noise", recommended.is_within);
        report.chart("tradeoff", chart(&points, noise));
        Ok(report)
    }
}

/// Measures `variations`, which are around `scene` and `env`.
fn measure(
    scene: &SceneConfig,
    env: &EnvConfig,
    variations: &[Variation],
    context: &Context,
) -> Result<(Measuring, Vec<MeasuredPoint>, Noise), StudyError> {
    let mut measuring = Measuring::new(scene, env)?;
    let mut points = Vec::with_capacity(variations.len());
    for (done, variation) in variations.iter().enumerate() {
        let doing = format!("{} {}", variation.axis, variation.value);
        (context.progress)(done as f64 / variations.len() as f64, &doing);
        points.push(measuring.point(variation)?);
    }
    let noise = measuring.noise()?.unwrap_or(Noise::UNKNOWN);
    Ok((measuring, points, noise))
}

/// What the sequences have led to.
struct PressedSweeps {
    scene: Arc<Scene>,
    /// CPU time of an environment step, the median over the steps [us].
    microseconds: f64,
    /// After the first row and at the end of every sequence; none where it diverged.
    ends: Vec<Option<Replayed>>,
}

/// What has been computed already, by what it was computed for; none where it diverges.
type Known<K, V> = Vec<(K, Option<Arc<V>>)>;

fn known<K: PartialEq, V>(all: &Known<K, V>, key: &K) -> Option<Option<Arc<V>>> {
    let found = all.iter().find(|(known, _)| known == key);
    found.map(|(_, value)| value.clone())
}

/// All that points share.
struct Measuring {
    around: Around,
    sequences: Vec<Vec<[f64; 2]>>,
    /// On the default mesh.
    sheet_vertices: usize,
    region_vertices: usize,
    falls: Known<SceneConfig, Scene>,
    pressed: Known<Around, PressedSweeps>,
}

/// Vertices of two meshes which are the same material points: all, and those of the focus region.
struct Shared {
    all: Vec<[usize; 2]>,
    region: Vec<[usize; 2]>,
}

impl Measuring {
    fn new(scene: &SceneConfig, env: &EnvConfig) -> Result<Self, StudyError> {
        scene.check()?;
        let material = scene.read_material()?;
        let lamina = Lamina::new(&scene.blank, material).map_err(SceneError::from)?;
        Ok(Self {
            sequences: sequences(&lamina, env)?,
            around: (scene.clone(), env.clone()),
            sheet_vertices: lamina.vertex_count(),
            region_vertices: env.region(&lamina)?.vertices.count_ones(..),
            falls: Vec::new(),
            pressed: Vec::new(),
        })
    }

    fn fall(&mut self, config: &SceneConfig) -> Result<Option<Arc<Scene>>, StudyError> {
        if let Some(fallen) = known(&self.falls, config) {
            return Ok(fallen);
        }
        let fallen = match Scene::new(config, |_| ()) {
            Ok(scene) => Some(Arc::new(scene)),
            Err(SceneError::Diverged { .. }) => None,
            Err(error) => return Err(error.into()),
        };
        self.falls.push((config.clone(), fallen.clone()));
        Ok(fallen)
    }

    /// The scene of a point at the converged start, which all points of a mesh share.
    fn start(&mut self, config: &SceneConfig) -> Result<Option<Scene>, StudyError> {
        let (mut converged, _) = converged(&self.around);
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

    fn press(&mut self, at: &Around) -> Result<Option<Arc<PressedSweeps>>, StudyError> {
        if let Some(pressed) = known(&self.pressed, at) {
            return Ok(pressed);
        }
        let pressed = match self.start(&at.0)? {
            None => None,
            Some(scene) => Some(Arc::new(press(scene.into(), &at.1, &self.sequences)?)),
        };
        self.pressed.push((at.clone(), pressed.clone()));
        Ok(pressed)
    }

    fn point(&mut self, variation: &Variation) -> Result<MeasuredPoint, StudyError> {
        let (own, reference) = (&variation.around, &variation.reference);
        let fallen = self.fall(&own.0)?.zip(self.fall(&reference.0)?);
        let pressed = self.press(own)?.zip(self.press(reference)?);
        let mut point = MeasuredPoint::of(variation);
        if let Some((a, b)) = fallen {
            let pairs = self.shared(&a.lamina, &b.lamina).all;
            let [x, y] = [&a, &b].map(|scene| &scene.initial.position);
            let scale = self.sheet_vertices as f64 / pairs.len() as f64;
            let [left, expected] = side_distances(&b.tool, [x, y], &pairs).map(|d| scale * d);
            point.vertices = a.lamina.vertex_count();
            point.fall_mm = Some(apart_mm(x, y, &pairs));
            point.fall_m = Some([left, left - expected]);
        }
        if let Some((a, b)) = pressed {
            let shared = self.shared(&a.scene.lamina, &b.scene.lamina).region;
            self.compare_presses(&mut point, &a, &b, &shared);
        }
        Ok(point)
    }

    /// Compares the first sequence, the sweep, and all together, where none of them diverges: else
    /// the others are not the same sample.
    fn compare_presses(
        &self,
        point: &mut MeasuredPoint,
        a: &PressedSweeps,
        b: &PressedSweeps,
        shared: &[[usize; 2]],
    ) {
        let scale = self.region_vertices as f64 / shared.len() as f64;
        let left = |x: &[[f64; 3]], y: &[[f64; 3]]| {
            side_distances(&b.scene.tool, [x, y], shared).map(|d| scale * d)
        };
        point.microseconds = Some(a.microseconds);
        if let (Some([row, x]), Some([other_row, y])) = (&a.ends[0], &b.ends[0]) {
            point.row_mm = Some(apart_mm(row, other_row, shared)[0]);
            point.sweep_mm = Some(apart_mm(x, y, shared));
            let initial = [a, b].map(|pressed| &pressed.scene.initial.position[..]);
            let (before, after) = (left(initial[0], initial[1]), left(x, y));
            let [removed, expected] = [0, 1].map(|k| before[k] - after[k]);
            point.removed = Some((removed - expected) / expected);
            let mut state = Snapshot::clone(&a.scene.initial);
            state.position.clone_from(x);
            point.tension_p95 = Some(a.scene.summary(&state).tension_p95);
        }
        let ends = a.ends.iter().zip(&b.ends);
        let all: Option<Vec<[f64; 3]>> = ends
            .map(|(a, b)| {
                let ([_, x], [_, y]) = (a.as_ref()?, b.as_ref()?);
                let [own, expected] = left(x, y);
                Some([own, own - expected, apart_mm(x, y, shared)[0]])
            })
            .collect();
        if let Some(all) = all {
            let column = |k: usize| all.iter().map(|row| row[k]).collect::<Vec<_>>();
            point.left_m = Some(mean_and_deviation(&column(0)));
            point.bias_m = Some(mean_and_deviation(&column(1))[0]);
            point.rms_m = Some(rms(&column(1)));
            point.eight_mm = Some(mean_and_deviation(&column(2))[0]);
        }
    }

    /// Presses from pushed starts, as `accurate` steps them; none where one diverges.
    fn noise(&mut self) -> Result<Option<Noise>, StudyError> {
        let (config, env) = stepped(&self.around, Accuracy::Accurate.stepping());
        let Some(scene) = self.start(&config)? else {
            return Ok(None);
        };
        let region = self.shared(&scene.lamina, &scene.lamina).region;
        let mut ends = Vec::new();
        for pushed in 0..=PUSHES {
            let mut scene = scene.clone();
            let mut stream = Stream::new(1, Purpose::Evaluation, 100 + pushed as u32);
            if pushed > 0 {
                let mut positions = scene.initial.position.clone();
                push(&scene, &mut positions, PUSH, &mut stream);
                Arc::make_mut(&mut scene.initial).position = positions;
            }
            ends.push(press(scene.into(), &env, &self.sequences)?.ends);
        }
        let (mut distances, mut places) = (Vec::new(), Vec::new());
        for pushed in &ends[1..] {
            for end in ends[0].iter().zip(pushed) {
                let (Some([_, x]), Some([_, y])) = end else {
                    return Ok(None);
                };
                let [a, b] = side_distances(&scene.tool, [x, y], &region);
                distances.push(b - a);
                places.push(apart_mm(x, y, &region)[0]);
            }
        }
        Ok(Some(Noise {
            distance_rms_m: rms(&distances),
            mean_mm: mean_and_deviation(&places)[0],
        }))
    }

    fn shared(&self, a: &Lamina, b: &Lamina) -> Shared {
        let all = same_points(&a.rest, &b.rest);
        let region = self.around.1.region(a).map(|region| region.vertices);
        let inside = |pair: &&[usize; 2]| region.as_ref().is_ok_and(|r| r.contains(pair[0]));
        Shared {
            region: all.iter().filter(inside).copied().collect(),
            all,
        }
    }
}

/// Presses along every sequence from the scene's initial state. A group of lanes is timed as
/// training would step it, in f64 one environment alone.
fn press(
    scene: Arc<Scene>,
    env: &EnvConfig,
    sequences: &[Vec<[f64; 2]>],
) -> Result<PressedSweeps, StudyError> {
    let count = match env.precision {
        Precision::F32 => ENVIRONMENTS.max(Isa::best().lanes()),
        Precision::F64 => sequences.len(),
    };
    let on_mesh = |places: &Vec<[f64; 2]>| -> Vec<u32> {
        let nearest = places.iter().map(|at| nearest(&scene.lamina.rest, *at));
        nearest.collect()
    };
    let vertices: Vec<Vec<u32>> = sequences.iter().map(on_mesh).collect();
    let lists: Vec<&[u32]> = vertices
        .iter()
        .map(|list| &**list)
        .cycle()
        .take(count)
        .collect();
    let row = |length: usize| (length as f64).sqrt().round() as usize;
    let mut draping = Draping::new(scene.clone(), env, count)?;
    // What is observed of the last press is over; between it and the next is the step itself.
    let (mut times, mut last) = (Vec::new(), ProcessTime::now());
    let mut ends = replay(&mut draping, &lists, row, |presses| {
        if presses > times.len() {
            times.push(1e6 * last.elapsed().as_secs_f64() / count as f64);
        }
        last = ProcessTime::now();
    });
    ends.truncate(sequences.len());
    times.sort_by(f64::total_cmp);
    Ok(PressedSweeps {
        microseconds: times.get(times.len() / 2).copied().unwrap_or(f64::NAN),
        scene,
        ends,
    })
}

/// Summed distance to the tool of either side of `pairs` [m].
fn side_distances(tool: &Tool, x: [&[[f64; 3]]; 2], pairs: &[[usize; 2]]) -> [f64; 2] {
    [0, 1].map(|side| distance(tool, pairs.iter().map(|pair| pair[side]), x[side]))
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

#[cfg(test)]
mod tests;
