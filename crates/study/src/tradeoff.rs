//! What accuracy costs: CPU time of an environment step against the error that a setting makes.
//!
//! Each setting, varied along one axis at a time, is measured three times over:
//!
//! | Measured | Held against |
//! | --- | --- |
//! | the fall, made with the setting | the fall of the reference, at the same material points |
//! | a straight sweep of presses over the focus region, from one converged start | the same presses by the reference |
//! | the same presses in eight orders | the distance that the reference leaves in each |
//!
//! The reference of a *method* (solver, rate) is the same model converged: `yarn`, f64,
//! 48 000 substeps a second, four times the finest preset. That of a *model* (mesh, physics) is the
//! one on its axis that leaves least out, stepped as usual.
//!
//! What a press does to a wrinkle can hang on a hair. The axis `pushed` is `accurate` against
//! itself from a start pushed by a thousandth of a millimetre: below it no error can be told.

mod variations;

use std::sync::Arc;

use cpu_time::ProcessTime;

use crate::points::{apart_mm, nearest, same_points, summed_m};
use crate::statistics::median;
use crate::study::{CORNER, Context, Report, Study, StudyError, lamina, restless};
use drape_cloth::math::{Isa, mean_and_deviation};
use drape_cloth::scene::{Scene, SceneConfig, SceneError};
use drape_cloth::sim::{Precision, Solver};
use drape_proof::presses::{pushed, replay};
use drape_report::Table;
use drape_report::{Chart, SERIES, Scale, Series};
use drape_task::env::{Draping, EnvConfig, EpisodeState};
use variations::{Around, Variation, converged, sequences, variations};

/// Measure what accuracy costs: CPU time of an environment step against error, over solver, rate,
/// mesh and physics
///
/// Writes tradeoff.png too, which shows cost against error, on a corner of the built-in scene.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study tradeoff --quick
  drape study tradeoff --json > tradeoff.json")]
pub struct Tradeoff {
    /// Fewer points on a smaller region: some three minutes of CPU time
    #[arg(long)]
    quick: bool,
}

/// The region of `--quick`, a part of the corner [mm].
const QUICK_REGION: [f64; 4] = [-186.0, -186.0, -95.0, -95.0];

impl Study for Tradeoff {
    const NAME: &'static str = "tradeoff";
    const TABLES: &'static [&'static str] = &["settings"];

    fn run(&self, context: &Context) -> Result<Report, StudyError> {
        let region = if self.quick { QUICK_REGION } else { CORNER };
        let (scene, env) = (SceneConfig::rib(), restless(Some(region)));
        let variations = variations(&scene, &env, self.quick.into());
        let mut measuring = Measuring::new(&scene, &env)?;
        let mut rows = Vec::with_capacity(variations.len());
        for (done, variation) in variations.iter().enumerate() {
            let doing = format!("{} {}", variation.axis, variation.value);
            (context.progress)(done as f64 / variations.len() as f64, &doing);
            rows.push(measuring.row(variation)?);
        }
        let title = format!(
            "{} presses on {} vertices; errors of the fall, of the sweep, of eight sequences; distance \
             left",
            measuring.sequences[0].len(),
            measuring.region_vertices
        );
        let mut report = Report::new([table(title, &rows)]);
        report.image("tradeoff.png", chart(&rows).image());
        Ok(report)
    }
}

/// A setting and what it does. Errors are distances between the same material points; summed
/// distances count as many points as the default mesh has, whatever the mesh. What diverges, or
/// whose reference does, has no figures.
struct Row {
    variation: Variation,
    /// Mean error of place after the fall [mm].
    fall_mm: Option<f64>,
    presses: Option<PressErrors>,
}

struct PressErrors {
    /// CPU time of an environment step in a group of lanes; in f64 of one alone [us].
    microseconds: f64,
    /// Mean error of place in the focus region after the sweep, and after all sequences [mm].
    sweep_mm: f64,
    eight_mm: f64,
    /// Summed distance of the region after all sequences, its mean [m].
    left_m: f64,
}

/// What the sequences have led to.
struct PressedSweeps {
    scene: Arc<Scene>,
    /// CPU time of an environment step, the median over the steps [us].
    microseconds: f64,
    /// Of every sequence; none where it diverged.
    ends: Vec<Option<EpisodeState>>,
}

/// What has been computed already, by what it was computed for; none where it diverges.
type Known<K, V> = Vec<(K, Option<Arc<V>>)>;

/// All that points share.
struct Measuring {
    around: Around,
    sequences: Vec<Vec<[f64; 2]>>,
    /// On the default mesh.
    region_vertices: usize,
    falls: Known<SceneConfig, Scene>,
    pressed: Known<(Around, bool), PressedSweeps>,
}

impl Measuring {
    fn new(scene: &SceneConfig, env: &EnvConfig) -> Result<Self, StudyError> {
        let lamina = lamina(scene)?;
        Ok(Self {
            sequences: sequences(&lamina, env)?,
            around: (scene.clone(), env.clone()),
            region_vertices: env.region(&lamina)?.vertices.count_ones(..),
            falls: Vec::new(),
            pressed: Vec::new(),
        })
    }

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

    /// Presses from the converged start, which all points of a mesh share, pushed or not.
    fn press(
        &mut self,
        at: &Around,
        is_pushed: bool,
    ) -> Result<Option<Arc<PressedSweeps>>, StudyError> {
        let key = (at.clone(), is_pushed);
        if let Some((_, pressed)) = self.pressed.iter().find(|(known, _)| *known == key) {
            return Ok(pressed.clone());
        }
        let (mut start, _) = converged(&self.around);
        start.blank = at.0.blank.clone();
        let mut pressed = None;
        if let Some(fallen) = self.fall(&start)? {
            let mut scene = fallen.with_physics(at.0.physics.clone());
            scene.config = at.0.clone();
            if is_pushed {
                let positions = pushed(&scene, scene.initial.position.clone(), 100);
                Arc::make_mut(&mut scene.initial).position = positions;
            }
            pressed = Some(Arc::new(press(scene.into(), &at.1, &self.sequences)?));
        }
        self.pressed.push((key, pressed.clone()));
        Ok(pressed)
    }

    fn row(&mut self, variation: &Variation) -> Result<Row, StudyError> {
        let (own, reference) = (&variation.around, &variation.reference);
        let fallen = self.fall(&own.0)?.zip(self.fall(&reference.0)?);
        let pressed =
            (self.press(own, variation.axis == "pushed")?).zip(self.press(reference, false)?);
        Ok(Row {
            variation: variation.clone(),
            fall_mm: fallen.map(|(a, b)| {
                let pairs = same_points(&a.lamina.rest, &b.lamina.rest);
                apart_mm(&a.initial.position, &b.initial.position, &pairs)[0]
            }),
            presses: pressed.and_then(|(a, b)| self.compare(&a, &b)),
        })
    }

    /// None where one of the sequences diverges: the others are not the same sample.
    fn compare(&self, a: &PressedSweeps, b: &PressedSweeps) -> Option<PressErrors> {
        let mut shared = same_points(&a.scene.lamina.rest, &b.scene.lamina.rest);
        let region = self.around.1.region(&a.scene.lamina).ok()?.vertices;
        shared.retain(|pair| region.contains(pair[0]));
        let scale = self.region_vertices as f64 / shared.len() as f64;
        let ends: Option<Vec<[&EpisodeState; 2]>> = (a.ends.iter().zip(&b.ends))
            .map(|(a, b)| Some([a.as_ref()?, b.as_ref()?]))
            .collect();
        let of_ends = ends?.into_iter().map(|ends| {
            let x = ends.map(|end| &end.cloth().position[..]);
            let left = summed_m(&b.scene.tool, x, &shared)[0];
            (apart_mm(x[0], x[1], &shared)[0], scale * left)
        });
        let (off_mm, left_m): (Vec<f64>, Vec<f64>) = of_ends.unzip();
        Some(PressErrors {
            microseconds: a.microseconds,
            sweep_mm: off_mm[0],
            eight_mm: mean_and_deviation(&off_mm)[0],
            left_m: mean_and_deviation(&left_m)[0],
        })
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
        // At least as many as training steps together.
        Precision::F32 => Isa::best().lanes().max(16),
        Precision::F64 => sequences.len(),
    };
    let on_mesh = |at: &[f64; 2]| nearest(&scene.lamina.rest, *at);
    let lists = sequences.iter().map(|list| list.iter().map(on_mesh));
    let vertices: Vec<Vec<u32>> = lists.map(Iterator::collect).collect();
    let lists = vertices.iter().map(|list| &**list).cycle();
    let lists: Vec<&[u32]> = lists.take(count).collect();
    let mut draping = Draping::new(scene.clone(), env, count)?;
    // What is observed of the last press is over; between it and the next is the step itself.
    let (mut times, mut last) = (Vec::new(), ProcessTime::now());
    let mut ends = replay(&mut draping, &lists, |presses| {
        if presses > times.len() {
            times.push(1e6 * last.elapsed().as_secs_f64() / count as f64);
        }
        last = ProcessTime::now();
    });
    ends.truncate(sequences.len());
    Ok(PressedSweeps {
        microseconds: median(&times),
        scene,
        ends,
    })
}

fn table(title: String, rows: &[Row]) -> Table {
    let of = |figure: fn(&PressErrors) -> f64| move |row: &Row| row.presses.as_ref().map(figure);
    Table::of("settings", title, rows)
        .text("axis", |row| row.variation.axis)
        .text("value", |row| row.variation.value.clone())
        .number("step [us]", 1, of(|errors| errors.microseconds))
        .number("fall [mm]", 3, |row| row.fall_mm)
        .number("sweep [mm]", 3, of(|errors| errors.sweep_mm))
        .number("eight [mm]", 3, of(|errors| errors.eight_mm))
        .number("left [m]", 4, of(|errors| errors.left_m))
        .end()
}

/// Cost against error of both solvers, as logarithms. What has no error has no place on it.
fn chart(rows: &[Row]) -> Chart {
    let place = |row: &Row| {
        let errors = row.presses.as_ref()?;
        let place = [errors.microseconds, errors.eight_mm].map(f64::log10);
        place.iter().all(|x| x.is_finite()).then_some(place)
    };
    let axes = Solver::ALL.map(Solver::name).into_iter().zip(SERIES);
    Chart {
        title: "Cost and error of the pressing sequences, 60 to 12 000 substeps a second".into(),
        x_label: "CPU time of an environment step [us]".into(),
        y_label: "mean error of place in the region [mm]".into(),
        series: axes
            .map(|(axis, color)| Series {
                label: axis.into(),
                points: (rows.iter().filter(|row| row.variation.axis == axis))
                    .filter_map(place)
                    .collect(),
                color,
            })
            .collect(),
        scale: Scale::Log10,
        ..Chart::default()
    }
}

#[cfg(test)]
mod tests;
