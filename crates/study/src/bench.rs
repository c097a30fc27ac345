//! How fast the simulation is, on the standard sheet as it lies settled on the built-in rib, and
//! how fast networks learn.
//!
//! Simulation is timed by the CPU time of its thread, throughput and learning by wall time; all
//! variants of a table take turns, so that noise which lasts hits all alike.

use std::sync::Arc;
use std::time::Instant;

use cpu_time::ThreadTime;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::statistics::{extremes, median};
use crate::study::{CORNER, Context, Effort, Report, Study, StudyError, restless};
use drape_cloth::fabric::{Lamina, Material};
use drape_cloth::math::{Isa, Purpose, Stream};
use drape_cloth::scene::{Scene, SceneConfig, SceneError};
use drape_cloth::sim::{Backend as _, Control, Cpu, Device as Backend, Model, PhysicsConfig};
use drape_cloth::sim::{Precision, Solver, Tension, World};
use drape_cloth::tool::{Shape, Source};
use drape_learn::benchmark::{Benchmark, Implementation};
use drape_report::Table;
use drape_task::cluster::Cluster;
use drape_task::env::{Draping, Member, Tasks};
use drape_task::search::{Order, choose};

/// Measure the speed of simulation and learner on this machine
///
/// The standard sheet on the built-in rib: time of a substep for every solver, instruction set
/// and feature, and environment steps a second. Then a training step of a network of convolutions.
/// Leave the machine alone meanwhile.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  drape bench --quick
  drape bench --json > bench.json")]
pub struct Bench {
    /// Few repeats: half a minute instead of about two
    #[arg(long)]
    quick: bool,

    /// Measure cloth on this GPU instead, gpu or gpu:N, beside all threads of the CPU: speed by the
    /// number of environments, how far positions drift apart, and trainings
    #[arg(long, value_name = "DEVICE", default_value_t)]
    device: Backend,

    /// Turns of every variant; fewer than the usual say nothing about speed
    #[arg(long, hide = true, value_parser = clap::value_parser!(u16).range(1..))]
    repeats: Option<u16>,
}

/// A frame at 1200 substeps a second.
pub const CONTROL: Control = Control::new(1.0 / 60.0, 20, 5);

/// Environments stepped together, as the presets do.
pub const ENVIRONMENTS: usize = 32;

/// Scenes that are trained on together.
const SCENES: usize = 8;

/// Numbers of threads that are compared.
pub const THREADS: [usize; 2] = [1, 2];

/// Images that the learner takes a step for.
const BATCH: usize = 400;

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
    const TABLES: &'static [&'static str] = &[
        "core",
        "features",
        "throughput",
        "learner",
        "gpu",
        "agreement",
        "training",
    ];

    fn run(&self, context: &Context) -> Result<Report, StudyError> {
        let effort = Effort::from(self.quick);
        if let Backend::Gpu(number) = self.device {
            let scene = standard_scene(|share| (context.progress)(0.1 * share, "falling"));
            return gpu::run(number, &scene, CONTROL, effort, context);
        }
        // Turns of every variant, control steps of a turn, actions of a turn of the throughput.
        let (repeats, steps, actions) = effort.pick((9, 2, 8), (31, 6, 20));
        let repeats = self.repeats.map_or(repeats, usize::from);
        // Steps of training take long.
        let trainings = repeats.div_ceil(3);
        // Turns that say nothing about speed take as little as they can.
        let is_timed = self.repeats.is_none();
        let batch = BATCH / if is_timed { 1 } else { 10 };
        let told = |from: f64, to: f64, doing: &'static str| {
            move |share: f64| (context.progress)(from + share * (to - from), doing)
        };
        let scene = Arc::new(standard_scene(told(0.0, 0.1, "falling")));

        let time = |case: &mut Timed| case.time(&scene, steps);
        let on_sheet = |physics, device| Timed::new(&scene, &scene.lamina, &physics, device);
        let cases = variants().into_iter();
        let cases = cases.map(|(solver, on)| ((solver, on), on_sheet(solved_by(solver), on)));
        let core = sample(repeats, cases, told(0.1, 0.4, "solvers"), time);

        let best = BenchDevice::group(Isa::best());
        let changed = |name, change| (name, on_sheet(physics(change), best));
        let first = [
            changed("default", ""),
            changed("shear and bending off", UNLISTED),
            ("nothing there for them", absent(&scene, best)),
        ];
        let others = FEATURES.map(|key| changed(key, key));
        let cases = first.into_iter().chain(others);
        let features = sample(repeats, cases, told(0.4, 0.6, "features"), time);

        // As many environments on one scene and on several that differ.
        (context.progress)(0.6, "falling");
        let differing = differing(is_timed)?;
        let mut players = Vec::new();
        for threads in THREADS {
            for scenes in [std::slice::from_ref(&scene), &differing] {
                players.push(([scenes.len(), threads], Player::new(scenes, threads)?));
            }
        }
        let told_rates = told(0.6, 0.7, "environments");
        let rates = sample(repeats, players, told_rates, |player| {
            let start = Instant::now();
            (0..actions).for_each(|_| player.step());
            (actions * ENVIRONMENTS) as f64 / start.elapsed().as_secs_f64()
        });

        let mut cases = Vec::new();
        for (side, threads) in [65, 33]
            .into_iter()
            .flat_map(|side| THREADS.map(|n| (side, n)))
        {
            for by in Implementation::ALL {
                let pool = ThreadPoolBuilder::new().num_threads(threads).build()?;
                // The first step is not timed: it makes the memory that the others use.
                let mut learner = Benchmark::new(side, batch, by);
                pool.install(|| learner.step());
                cases.push(((side, by, threads), (pool, learner)));
            }
        }
        let told_learning = told(0.7, 1.0, "learner");
        let learning = sample(trainings, cases, told_learning, |(pool, learner)| {
            let start = Instant::now();
            pool.install(|| learner.step());
            start.elapsed().as_secs_f64()
        });

        let title = "CPU time for an environment and substep of the standard sheet";
        let core = Table::of("core", title, &core)
            .text("solver", |((solver, _), _)| solver.name())
            .text("isa", |((_, on), _)| format!("{:?}", on.isa).to_lowercase())
            .text("precision", |((_, on), _)| on.precision.name())
            .text("lanes", |((_, on), _)| on.lanes)
            .number("median [us]", 2, |(_, times)| median(times))
            .number("min [us]", 2, |(_, times)| extremes(times)[0]);
        let title = "The same with one key of [physics] changed, on the widest lanes";
        let changes = Table::of("features", title, &features)
            .text("physics", |(physics, _)| *physics)
            .number("median [us]", 2, |(_, times)| median(times))
            .number("difference [us]", 2, |(_, times)| {
                by_turn(times, &features[0].1, |own, default| own - default)
            });
        let title = format!("{ENVIRONMENTS} environments on a corner of the rib, random presses");
        // Over the row of so many scenes and threads.
        let over = |own: &[f64], base: [usize; 2]| {
            let base = rates.iter().find(|(case, _)| *case == base);
            by_turn(own, &base.expect("is a row").1, |own, base| own / base)
        };
        let throughput = Table::of("throughput", title, &rates)
            .text("scenes", |([scenes, _], _)| *scenes)
            .text("threads", |([_, threads], _)| *threads)
            .number("environment steps [1/s]", 0, |(_, rates)| median(rates))
            .number("over one thread", 2, |([n, _], own)| over(own, [*n, 1]))
            .number("over one scene", 2, |([_, n], own)| over(own, [1, *n]));
        let title =
            "One step of training (forward, backward, Adam) by our convolutions and by burn's";
        let learner = Table::of("learner", title, &learning)
            .text("network", |_| "benchmark")
            .text("implementation", |((_, by, _), _)| by.name())
            .text("side", |((side, _, _), _)| *side)
            .text("batch", |_| batch)
            .text("threads", |((_, _, threads), _)| *threads)
            .number("seconds", 4, |(_, seconds)| median(seconds));
        Ok(Report::new([
            core.end(),
            changes.end(),
            throughput.end(),
            learner.end(),
        ]))
    }
}

/// The median over turns of what `of` says of both, so that what slows a whole turn down cancels
/// out.
fn by_turn(own: &[f64], base: &[f64], of: fn(f64, f64) -> f64) -> f64 {
    let turns = own.iter().zip(base).map(|(own, base)| of(*own, *base));
    median(&turns.collect::<Vec<_>>())
}

/// Measures all named cases in turns.
fn sample<N, C>(
    repeats: usize,
    cases: impl IntoIterator<Item = (N, C)>,
    progress: impl Fn(f64),
    measure: impl Fn(&mut C) -> f64,
) -> Vec<(N, Vec<f64>)> {
    let (names, mut cases): (Vec<N>, Vec<C>) = cases.into_iter().unzip();
    let mut samples = vec![Vec::new(); cases.len()];
    for repeat in 0..repeats {
        for (case, samples) in cases.iter_mut().zip(&mut samples) {
            samples.push(measure(case));
        }
        progress((repeat + 1) as f64 / repeats as f64);
    }
    names.into_iter().zip(samples).collect()
}

/// What computes environments: so many together, in a precision, on an instruction set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BenchDevice {
    lanes: usize,
    precision: Precision,
    isa: Isa,
}

impl BenchDevice {
    /// As many environments as an instruction set has lanes, as training steps them.
    pub fn group(isa: Isa) -> Self {
        Self {
            lanes: isa.lanes(),
            precision: Precision::F32,
            isa,
        }
    }

    /// All that this processor can run, widest last. One environment alone, in f64 as scenes are
    /// set up and in f32 as sequences are evaluated, has its lines in the widest lanes.
    fn all() -> Vec<Self> {
        let best = Self::group(Isa::best());
        let alone = [Precision::F64, Precision::F32].map(|precision| Self {
            lanes: 1,
            precision,
            ..best
        });
        let groups = Isa::available().into_iter().map(Self::group);
        alone.into_iter().chain(groups).collect()
    }
}

/// Every solver on every device: the rows of the table `core`.
pub fn variants() -> Vec<(Solver, BenchDevice)> {
    let devices = BenchDevice::all();
    let of = |solver| devices.iter().map(move |device| (solver, *device));
    Solver::ALL.into_iter().flat_map(of).collect()
}

/// The default physics with the lines of a scene file's `[physics]` in `change`.
pub fn physics(change: &str) -> PhysicsConfig {
    toml::from_str(change).expect("the features are keys of `[physics]`")
}

/// The default physics with lengths kept by `solver`.
pub fn solved_by(solver: Solver) -> PhysicsConfig {
    PhysicsConfig {
        solver,
        ..PhysicsConfig::default()
    }
}

/// The built-in rib with the standard sheet settled on it.
pub fn standard_scene(progress: impl FnMut(f64)) -> Scene {
    Scene::new(&SceneConfig::rib(), progress).expect("the built-in scene is valid")
}

/// Scenes that differ from the built-in one in their tool, the place of the blank and its yarns; coarse where nothing is
/// timed, since they have to fall first.
fn differing(is_timed: bool) -> Result<Vec<Arc<Scene>>, SceneError> {
    let scene = |k: usize| {
        let off = (k as f64 - 3.5) / 3.5;
        let mut config = SceneConfig::rib();
        if !is_timed {
            config.blank.vertices = [17, 17];
        }
        if let Source::Shape(Shape::Rib(rib)) = &mut config.tool.source {
            rib.height_mm *= 1.0 + 0.02 * off;
        }
        config.placement.centre_mm[0] += 2.0 * off;
        let mut material = Material::interglas_92125();
        for law in [&mut material.warp, &mut material.weft] {
            law.tension = law.tension.scaled(1.0 + 0.1 * off);
            law.static_friction *= 1.0 - 0.1 * off;
        }
        config.material = Some(material.into());
        config.physics.tension = Some(Tension::FirstBranch);
        Ok(Arc::new(Scene::new(&config, |_| ())?))
    };
    (0..SCENES).into_par_iter().map(scene).collect()
}

/// A sheet on which shear and bending are listed and find nothing to do.
fn absent(scene: &Scene, device: BenchDevice) -> Timed {
    let mut lamina = Lamina::clone(&scene.lamina);
    lamina.diagonals.clear();
    Timed::new(scene, &lamina, &physics(ABSENT), device)
}

/// Environments on the sheet of a scene, to be timed.
pub struct Timed(Cpu);

impl Timed {
    /// `lamina` under `physics` on `on`, over the tool of `scene`.
    pub fn new(scene: &Scene, lamina: &Lamina, physics: &PhysicsConfig, on: BenchDevice) -> Self {
        let world = World::new(
            Model::new(lamina, physics).over_that_of(&scene.model),
            scene.tool.clone(),
        );
        Self(Cpu::on(&world, on.lanes, on.precision, on.isa))
    }

    /// Puts every environment into the settled state of `scene`, and steps once: then memory is
    /// in the caches, and edges have found their branch.
    pub fn start(&mut self, scene: &Scene) {
        for environment in 0..self.0.count() {
            self.0.load(environment, &scene.initial);
        }
        self.step();
    }

    pub fn step(&mut self) {
        self.0.step(&CONTROL, &[]);
    }

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
    /// [`ENVIRONMENTS`] tasks on a wrinkle of the rib, at their start, as many on each scene.
    pub fn new(scenes: &[Arc<Scene>], threads: usize) -> Result<Self, StudyError> {
        let config = restless(Some(CORNER));
        let members = scenes.iter().map(|scene| Member {
            scene: scene.clone(),
            config: config.clone(),
            count: ENVIRONMENTS / scenes.len(),
            worlds: None,
        });
        Ok(Self {
            pool: ThreadPoolBuilder::new().num_threads(threads).build()?,
            env: Draping::on(members.collect(), &Cluster::default())?,
            stream: Stream::new(1, Purpose::Evaluation, 0),
        })
    }

    /// One allowed action in every environment: a press and the observation.
    pub fn step(&mut self) {
        let (env, stream) = (&self.env, &mut self.stream);
        let choose = |index| choose(env, index, Order::Random, 0.0, stream);
        let actions: Vec<u32> = (0..env.count()).map(choose).collect();
        self.pool.install(|| self.env.step(&actions));
    }
}

#[cfg(feature = "gpu")]
mod gpu;
#[cfg(feature = "gpu")]
mod training;

#[cfg(not(feature = "gpu"))]
mod gpu {
    use super::*;
    use drape_cloth::sim::DeviceError;

    pub fn run(
        _: usize,
        _: &Scene,
        _: Control,
        _: Effort,
        _: &Context,
    ) -> Result<Report, StudyError> {
        Err(StudyError::Invalid(format!(
            "`--device`: {}",
            DeviceError::NotBuilt
        )))
    }
}

#[cfg(test)]
mod tests;
