//! How fast the simulation is, and how far from what the machine could do.
//!
//! Measured on the standard sheet (65 x 65 vertices, 370 mm) lying settled on the built-in rib.
//! `core` holds every solver on every backend, `features` what each feature of `[physics]`
//! adds or saves, and throughput what is left of it in training. Simulation is timed by the CPU
//! time of its thread, throughput by wall time; all variants of a table take turns.
//!
//! The shares compare the fastest repeat with what the same lanes reach in loops which do
//! nothing else: see [`Operations`] for what is counted and [`Limits`] for the loops. They are
//! bounds for the method as counted, not goals: latencies along a yarn, traffic between cache
//! levels within a substep, and look-ups of the distance are not in them.

mod case;
mod limits;
mod operations;
mod throughput;

use std::sync::Arc;

use rayon::ThreadPoolBuildError;
use serde::Serialize;

use case::sample;
use drape_cloth::math::Isa;
use drape_cloth::scene::{Scene, SceneConfig};
use drape_cloth::sim::{PhysicsConfig, Solver};
use operations::{bytes_moved, numbers_held, operations};
use throughput::throughput;

pub use case::{Backend, CONTROL, Case, FEATURES, physics, variants};
pub use limits::Limits;
pub use operations::{Constraints, Operations};
pub use throughput::{ENVIRONMENTS, Player, THREADS};

/// How long to measure.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Turns of every variant.
    pub repeats: usize,
    /// Control steps of a turn.
    pub control_steps: usize,
    /// Actions in every environment in a turn of the throughput.
    pub actions: usize,
}

impl Effort {
    /// About a minute.
    pub const FULL: Self = Self {
        repeats: 31,
        control_steps: 6,
        actions: 20,
    };
    /// Some seconds.
    pub const QUICK: Self = Self {
        repeats: 9,
        control_steps: 2,
        actions: 8,
    };
}

/// What the repeats of one measurement gave.
#[derive(Clone, Debug, Default)]
struct Samples(Vec<f64>);

impl Samples {
    fn min(&self) -> f64 {
        self.0.iter().copied().fold(f64::INFINITY, f64::min)
    }

    fn median(&self) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        let middle = sorted.len() / 2;
        if sorted.len() % 2 == 1 {
            sorted[middle]
        } else {
            0.5 * (sorted[middle - 1] + sorted[middle])
        }
    }

    /// Turn by turn, so that what slows a whole turn down cancels out.
    fn minus(&self, other: &Self) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(a, b)| a - b).collect())
    }
}

/// All that was measured.
#[derive(Debug, Serialize)]
pub struct Findings {
    pub sheet: Constraints,
    pub core: Vec<Row>,
    /// Environment steps a second with the most threads over those with one.
    pub thread_ratio: f64,
    pub features: Vec<Feature>,
    pub unlisted: Unlisted,
    pub operations: Vec<Counted>,
    pub limits: Vec<Limit>,
}

/// A row of `core`: a variant of the simulation on one thread, or throughput with a number of
/// threads. What was not measured is none.
#[derive(Debug, Serialize)]
pub struct Row {
    pub solver: Solver,
    pub precision: &'static str,
    pub isa: &'static str,
    /// Environments in lockstep.
    pub lanes: usize,
    /// CPU time for an environment and substep, median [us].
    pub microseconds: Option<f64>,
    /// The same, least [us].
    pub microseconds_min: Option<f64>,
    /// Least time for the arithmetic of a substep over `microseconds_min`.
    pub arithmetic_share: Option<f64>,
    /// Least time for the memory traffic of a substep over `microseconds_min`.
    pub bandwidth_share: Option<f64>,
    /// Threads of the throughput.
    pub threads: Option<usize>,
    /// Median over wall time [1/s].
    pub env_steps_per_second: Option<f64>,
}

/// The step with one feature changed.
#[derive(Debug, Serialize)]
pub struct Feature {
    /// As in a scene file; `default` for none.
    pub physics: &'static str,
    /// CPU time for an environment and substep, median [us].
    pub microseconds: f64,
    /// The same, least [us].
    pub microseconds_min: f64,
    /// Median of what it adds to the default, turn by turn [us].
    pub difference: f64,
}

/// Shear and bending not listed, held against a sheet on which they find nothing to do.
#[derive(Debug, Serialize)]
pub struct Unlisted {
    /// The sheet with both switched off, median [us].
    pub unlisted: f64,
    /// Both listed, but no diagonals and no stiffness, median [us].
    pub absent: f64,
    /// Median of `unlisted` minus `absent`, turn by turn [us].
    pub difference: f64,
}

/// The work of a substep of one environment.
#[derive(Debug, Serialize)]
pub struct Counted {
    pub solver: Solver,
    #[serde(flatten)]
    pub operations: Operations,
    /// Bytes in f32.
    pub bytes: usize,
}

/// The limits of one kind of lanes.
#[derive(Debug, Serialize)]
pub struct Limit {
    pub precision: &'static str,
    pub isa: &'static str,
    pub lanes: usize,
    #[serde(flatten)]
    pub limits: Limits,
}

/// Shares of the time at which the parts of a run end.
const ENDS: [f64; 5] = [0.1, 0.4, 0.5, 0.8, 1.0];

/// Measures everything. `progress` is told the share that is done, 0 to 1.
pub fn run(
    effort: &Effort,
    mut progress: impl FnMut(f64),
) -> Result<Findings, ThreadPoolBuildError> {
    let mut part = |index: usize, share: f64| {
        let start = if index == 0 { 0.0 } else { ENDS[index - 1] };
        progress(start + share * (ENDS[index] - start));
    };
    let scene = Arc::new(standard_scene(|share| part(0, share)));
    let times = core_times(&scene, effort, |share| part(1, share));
    let limits = limits(&scene, effort, |share| part(2, share));
    let (features, unlisted) = features(&scene, effort, |share| part(3, share));
    let rates = throughput(&scene, effort, |share| part(4, share))?;

    let mut core: Vec<Row> = variants()
        .into_iter()
        .zip(&times)
        .map(|((solver, backend), times)| {
            let limit = limits.iter().find(|(of, _)| *of == backend);
            let (_, limits) = limit.expect("every backend has limits");
            row(&scene, solver, backend, times, limits)
        })
        .collect();
    let best = Backend::Group(Isa::best());
    core.extend(THREADS.iter().zip(&rates).map(|(&threads, rates)| Row {
        threads: Some(threads),
        env_steps_per_second: Some(rates.median()),
        ..unmeasured(PhysicsConfig::default().solver, best)
    }));
    let counted = |solver| Counted {
        solver,
        operations: operations(&scene.lamina, solver),
        bytes: bytes_moved(&scene.lamina, solver, size_of::<f32>()),
    };
    Ok(Findings {
        sheet: Constraints::of(&scene.lamina),
        core,
        thread_ratio: rates[rates.len() - 1].median() / rates[0].median(),
        features,
        unlisted,
        operations: [Solver::Yarn, Solver::GaussSeidel].map(counted).into(),
        limits: limits
            .into_iter()
            .map(|(backend, limits)| Limit {
                precision: precision(backend),
                isa: backend.isa(),
                lanes: backend.lanes(),
                limits,
            })
            .collect(),
    })
}

/// The built-in rib with the standard sheet settled on it.
pub fn standard_scene(progress: impl FnMut(f64)) -> Scene {
    Scene::new(&SceneConfig::rib(), progress).expect("the built-in scene is valid")
}

fn core_times(scene: &Scene, effort: &Effort, progress: impl FnMut(f64)) -> Vec<Samples> {
    let mut cases: Vec<Case> = variants()
        .into_iter()
        .map(|(solver, backend)| {
            let physics = PhysicsConfig {
                solver,
                ..PhysicsConfig::default()
            };
            Case::new(&scene.lamina, &physics, backend)
        })
        .collect();
    sample(&mut cases, scene, effort, progress)
}

fn limits(scene: &Scene, effort: &Effort, mut progress: impl FnMut(f64)) -> Vec<(Backend, Limits)> {
    let numbers = numbers_held(&scene.lamina);
    let mut all: Vec<_> = Backend::all()
        .into_iter()
        .map(|backend| (backend, Limits::NONE))
        .collect();
    for repeat in 0..effort.repeats {
        for (backend, limits) in &mut all {
            *limits = limits.max(backend.limits(numbers));
        }
        progress((repeat + 1) as f64 / effort.repeats as f64);
    }
    all
}

/// The physics of which nothing is listed that [`absent`] could compute.
const UNLISTED: &str = "shear = false\nbending = \"off\"";
/// Listed, but without stiffness: together with a sheet without diagonals, [`UNLISTED`].
const ABSENT: &str = "bending_stiffness = { newton_metre = 0.0 }";

fn features(scene: &Scene, effort: &Effort, progress: impl FnMut(f64)) -> (Vec<Feature>, Unlisted) {
    let backend = Backend::Group(Isa::best());
    let on_sheet = |change: &str| Case::new(&scene.lamina, &physics(change), backend);
    let mut cases = vec![on_sheet("")];
    cases.extend(FEATURES.map(on_sheet));
    cases.push(on_sheet(UNLISTED));
    cases.push(absent(scene, backend));
    let mut times = sample(&mut cases, scene, effort, progress);

    let absent = times.pop().expect("sampled last");
    let unlisted = times.pop().expect("sampled before it");
    let names = std::iter::once("default").chain(FEATURES);
    let features = names
        .zip(&times)
        .map(|(physics, samples)| Feature {
            physics,
            microseconds: samples.median(),
            microseconds_min: samples.min(),
            difference: samples.minus(&times[0]).median(),
        })
        .collect();
    let unlisted = Unlisted {
        unlisted: unlisted.median(),
        absent: absent.median(),
        difference: unlisted.minus(&absent).median(),
    };
    (features, unlisted)
}

/// A sheet on which shear and bending are listed and find nothing to do.
fn absent(scene: &Scene, backend: Backend) -> Case {
    let mut lamina = scene.lamina.clone();
    lamina.diagonals.clear();
    Case::new(&lamina, &physics(ABSENT), backend)
}

fn row(scene: &Scene, solver: Solver, backend: Backend, times: &Samples, limits: &Limits) -> Row {
    let seconds = 1e-6 * times.min();
    let arithmetic = operations(&scene.lamina, solver).seconds(limits);
    let bytes = bytes_moved(&scene.lamina, solver, backend.number_size());
    Row {
        microseconds: Some(times.median()),
        microseconds_min: Some(times.min()),
        arithmetic_share: Some(arithmetic / seconds),
        bandwidth_share: Some(bytes as f64 / limits.bytes_per_second / seconds),
        ..unmeasured(solver, backend)
    }
}

fn unmeasured(solver: Solver, backend: Backend) -> Row {
    Row {
        solver,
        precision: precision(backend),
        isa: backend.isa(),
        lanes: backend.lanes(),
        microseconds: None,
        microseconds_min: None,
        arithmetic_share: None,
        bandwidth_share: None,
        threads: None,
        env_steps_per_second: None,
    }
}

fn precision(backend: Backend) -> &'static str {
    match backend {
        Backend::AloneF64 => "f64",
        Backend::AloneF32 | Backend::Group(_) => "f32",
    }
}

#[cfg(test)]
mod tests;
