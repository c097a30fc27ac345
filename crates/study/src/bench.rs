//! How fast the simulation is.
//!
//! Measured on the standard sheet (65 x 65 vertices, 370 mm) lying settled on the built-in rib:
//! every solver on every instruction set, what each feature of `[physics]` adds or saves, and what
//! is left of it in training. Simulation is timed by the CPU time of its thread, throughput by
//! wall time; all variants of a table take turns, so that noise which lasts hits all alike.

use std::sync::Arc;
use std::time::Instant;

use cpu_time::ThreadTime;
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use crate::study::{CORNER, Context, Report, Study, StudyError};
use crate::table::Table;
use crate::verify::solver_name;
use drape_cloth::fabric::Lamina;
use drape_cloth::math::{Isa, Purpose, Stream};
use drape_cloth::scene::{Scene, SceneConfig};
use drape_cloth::sim::{
    Backend as _, Control, Cpu, Model, PhysicsConfig, Precision, Solver, World,
};
use drape_task::env::{Draping, EnvConfig, Tasks};

/// Measure the speed of the simulation on this machine
///
/// The standard sheet on the built-in rib: time of a substep for every solver, instruction set
/// and feature, and environment steps a second. Leave the machine alone meanwhile.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  drape bench --quick
  drape bench --json > bench.json")]
pub struct Bench {
    /// Few repeats: some ten seconds instead of about a minute
    #[arg(long)]
    quick: bool,

    /// Turns of every variant; fewer than the usual say nothing about speed
    #[arg(long, hide = true, value_parser = clap::value_parser!(u16).range(1..))]
    repeats: Option<u16>,
}

/// A frame at 1200 substeps a second.
pub const CONTROL: Control = Control {
    dt: 1.0 / 60.0,
    substeps: 20,
    contact_interval: 5,
    sweeps: 1,
};

/// Environments stepped together, as the presets do.
pub const ENVIRONMENTS: usize = 32;

/// Numbers of threads that are compared.
pub const THREADS: [usize; 2] = [1, 2];

/// The features of `[physics]`, each as a scene file would change it.
pub const FEATURES: [&str; 10] = [
    "bending = \"dihedral\"",
    "bending = \"off\"",
    "friction = false",
    "shear = false",
    "speed_cap = 0",
    "self_collision = \"material\"",
    "adhesion = 1",
    "strain_limit = 0.02",
    "tension = \"material\"",
    "shear_locking = true",
];

/// The physics of which nothing is listed that [`absent`] could compute.
const UNLISTED: &str = "shear = false\nbending = \"off\"";
/// Listed, but without stiffness: together with a sheet without diagonals, [`UNLISTED`].
const ABSENT: &str = "bending_stiffness = { newton_metre = 0.0 }";

impl Study for Bench {
    const NAME: &'static str = "bench";
    const TABLES: &'static [&'static str] = &["core", "features", "throughput"];

    fn run(&self, context: &Context) -> Result<Report, StudyError> {
        // Turns of every variant, control steps of a turn, actions of a turn of the throughput.
        let (repeats, steps, actions) = if self.quick { (9, 2, 8) } else { (31, 6, 20) };
        let repeats = self.repeats.map_or(repeats, usize::from);
        let told = |from: f64, to: f64, doing: &'static str| {
            move |share: f64| (context.progress)(from + share * (to - from), doing)
        };
        let scene = Arc::new(standard_scene(told(0.0, 0.1, "falling")));

        let mut cases = variants()
            .into_iter()
            .map(|(solver, backend)| {
                let physics = PhysicsConfig {
                    solver,
                    ..PhysicsConfig::default()
                };
                Timed::new(&scene, &scene.lamina, &physics, backend)
            })
            .collect::<Vec<_>>();
        let told_core = told(0.1, 0.4, "solvers");
        let times = sample(repeats, &mut cases, told_core, |case| {
            case.time(&scene, steps)
        });
        let core: Vec<_> = variants().into_iter().zip(times).collect();

        let best = Device::Group(Isa::best());
        let on_sheet = |change: &str| Timed::new(&scene, &scene.lamina, &physics(change), best);
        let names = ["default", "shear and bending off", "nothing there for them"];
        let mut cases = vec![on_sheet(""), on_sheet(UNLISTED), absent(&scene, best)];
        cases.extend(FEATURES.map(on_sheet));
        let told_features = told(0.4, 0.8, "features");
        let times = sample(repeats, &mut cases, told_features, |case| {
            case.time(&scene, steps)
        });
        let default = times[0].clone();
        let features: Vec<_> = names.into_iter().chain(FEATURES).zip(times).collect();

        let mut players = Vec::new();
        for threads in THREADS {
            players.push(Player::new(&scene, ENVIRONMENTS, threads)?);
        }
        let told_rates = told(0.8, 1.0, "environments");
        let rates = sample(repeats, &mut players, told_rates, |player| {
            let start = Instant::now();
            (0..actions).for_each(|_| player.step());
            (actions * ENVIRONMENTS) as f64 / start.elapsed().as_secs_f64()
        });
        let rates: Vec<_> = THREADS.into_iter().zip(rates).collect();

        let title = "CPU time for an environment and substep of the standard sheet";
        let core = Table::of("core", title, &core)
            .text("solver", |((solver, _), _)| solver_name(*solver))
            .text("isa", |((_, backend), _)| backend.isa())
            .text("precision", |((_, backend), _)| backend.precision())
            .text("lanes", |((_, backend), _)| backend.lanes())
            .number("median", "us", 2, |(_, times)| times.median())
            .number("min", "us", 2, |(_, times)| times.min())
            .end();
        let title = "The same with one key of [physics] changed, on the widest lanes";
        let features = Table::of("features", title, &features)
            .text("physics", |(physics, _)| *physics)
            .number("median", "us", 2, |(_, times)| times.median())
            .number("min", "us", 2, |(_, times)| times.min())
            .number("difference", "us", 2, |(_, times)| {
                times.minus(&default).median()
            })
            .end();
        let title = format!("{ENVIRONMENTS} environments on a corner of the rib, random presses");
        let alone = rates[0].1.median();
        let throughput = Table::of("throughput", title, &rates)
            .text("threads", |(threads, _)| *threads)
            .number("environment steps", "1/s", 0, |(_, rates)| rates.median())
            .number("over one thread", "", 2, |(_, rates)| {
                rates.median() / alone
            })
            .end();
        Ok(Report::new([core, features, throughput]))
    }
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
        match sorted.len() % 2 {
            1 => sorted[middle],
            _ => 0.5 * (sorted[middle - 1] + sorted[middle]),
        }
    }

    /// Turn by turn, so that what slows a whole turn down cancels out.
    fn minus(&self, other: &Self) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(a, b)| a - b).collect())
    }
}

/// Measures all cases in turns.
fn sample<C>(
    repeats: usize,
    cases: &mut [C],
    progress: impl Fn(f64),
    mut measure: impl FnMut(&mut C) -> f64,
) -> Vec<Samples> {
    let mut samples = vec![Samples::default(); cases.len()];
    for repeat in 0..repeats {
        for (case, samples) in cases.iter_mut().zip(&mut samples) {
            samples.0.push(measure(case));
        }
        progress((repeat + 1) as f64 / repeats as f64);
    }
    samples
}

/// What computes the environments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Device {
    /// One environment in f64, as scenes are set up.
    AloneF64,
    /// One environment in f32, as sequences are evaluated.
    AloneF32,
    /// As many environments as an instruction set has lanes, as training steps them.
    Group(Isa),
}

impl Device {
    /// All that this processor can run, widest last.
    pub fn all() -> Vec<Self> {
        let groups = Isa::available().into_iter().map(Self::Group);
        let alone = [Self::AloneF64, Self::AloneF32];
        alone.into_iter().chain(groups).collect()
    }

    fn cloth(self, world: &World) -> Cpu {
        match self {
            Self::AloneF64 => Cpu::new(world, 1, Precision::F64),
            Self::AloneF32 => Cpu::new(world, 1, Precision::F32),
            Self::Group(isa) => Cpu::on(world, isa.lanes(), Precision::F32, isa),
        }
    }

    /// Number of environments.
    fn lanes(self) -> usize {
        match self {
            Self::AloneF64 | Self::AloneF32 => 1,
            Self::Group(isa) => isa.lanes(),
        }
    }

    /// One environment has its lines in the widest lanes, as far as its solver works along lines.
    fn isa(self) -> String {
        let isa = match self {
            Self::AloneF64 | Self::AloneF32 => Isa::best(),
            Self::Group(isa) => isa,
        };
        format!("{isa:?}").to_lowercase()
    }

    fn precision(self) -> &'static str {
        match self {
            Self::AloneF64 => "f64",
            Self::AloneF32 | Self::Group(_) => "f32",
        }
    }
}

/// Every solver on every backend: the rows of the table `core`.
pub fn variants() -> Vec<(Solver, Device)> {
    let of = |solver| Device::all().into_iter().map(move |b| (solver, b));
    let solvers = [Solver::Yarn, Solver::GaussSeidel];
    solvers.into_iter().flat_map(of).collect()
}

/// The default physics with the lines of a scene file's `[physics]` in `change`.
pub fn physics(change: &str) -> PhysicsConfig {
    toml::from_str(change).expect("the features are keys of `[physics]`")
}

/// The built-in rib with the standard sheet settled on it.
pub fn standard_scene(progress: impl FnMut(f64)) -> Scene {
    Scene::new(&SceneConfig::rib(), progress).expect("the built-in scene is valid")
}

/// A sheet on which shear and bending are listed and find nothing to do.
fn absent(scene: &Scene, backend: Device) -> Timed {
    let mut lamina = Lamina::clone(&scene.lamina);
    lamina.diagonals.clear();
    Timed::new(scene, &lamina, &physics(ABSENT), backend)
}

/// Environments on the sheet of a scene, to be timed.
pub struct Timed(Cpu);

impl Timed {
    /// `lamina` under `physics` on `backend`, over the tool of `scene`.
    pub fn new(scene: &Scene, lamina: &Lamina, physics: &PhysicsConfig, backend: Device) -> Self {
        let world = World::new(Model::new(lamina, physics), scene.tool.clone());
        Self(backend.cloth(&world))
    }

    /// Puts every environment into the settled state of `scene`, and steps once: then memory is
    /// in the caches, and edges have found their branch.
    pub fn start(&mut self, scene: &Scene) {
        for environment in 0..self.0.count() {
            self.0.load(environment, &scene.initial);
        }
        self.step();
    }

    /// One control step.
    pub fn step(&mut self) {
        self.0.step(&CONTROL, &[]);
    }

    /// Number of environments.
    pub fn lanes(&self) -> usize {
        self.0.count()
    }

    /// CPU time of this thread for an environment and substep [us].
    fn time(&mut self, scene: &Scene, control_steps: usize) -> f64 {
        self.start(scene);
        let start = ThreadTime::now();
        (0..control_steps).for_each(|_| self.step());
        let substeps = control_steps * CONTROL.substeps * self.lanes();
        1e6 * start.elapsed().as_secs_f64() / substeps as f64
    }
}

/// Draping tasks on a number of threads of their own, played by a seeded masked random policy.
pub struct Player {
    pool: ThreadPool,
    env: Draping,
    stream: Stream,
}

impl Player {
    /// `environments` tasks on a wrinkle of the rib, at their start.
    pub fn new(
        scene: &Arc<Scene>,
        environments: usize,
        threads: usize,
    ) -> Result<Self, ThreadPoolBuildError> {
        let config = EnvConfig {
            region_mm: Some(CORNER),
            crop: true,
            ..EnvConfig::default()
        };
        Ok(Self {
            pool: ThreadPoolBuilder::new().num_threads(threads).build()?,
            env: Draping::new(scene.clone(), &config, environments)
                .expect("the region lies on the standard sheet"),
            stream: Stream::new(1, Purpose::Evaluation, 0),
        })
    }

    /// One allowed action in every environment: a press and the observation.
    pub fn step(&mut self) {
        let actions: Vec<u32> = (0..self.env.count())
            .map(|index| {
                let mask = &self.env.observation(index).mask;
                let chosen = self.stream.below(mask.count_ones(..));
                mask.ones().nth(chosen).expect("a mask is never empty") as u32
            })
            .collect();
        self.pool.install(|| self.env.step(&actions));
    }
}

#[cfg(test)]
mod tests;
