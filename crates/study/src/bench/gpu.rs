//! Cloth on a GPU beside all threads of the CPU, and [`training`] with both.

use std::time::Instant;

use super::training;
use crate::study::{Context, Effort, Report, StudyError};
use drape_cloth::scene::Scene;
use drape_cloth::sim::{
    Adapter, Backend, Control, Cpu, DeviceError, Gpu, Model, PhysicsConfig, Precision, Snapshot,
    Solver, World,
};
use drape_report::Table;

/// Environments that are stepped together.
const COUNTS: [usize; 6] = [1, 8, 64, 512, 4096, 8192];

/// After a control step that takes longer than this, more environments are not tried [s].
const PATIENCE: f64 = 5.0;

/// Substeps after which positions are compared.
const AFTER: [usize; 3] = [1, 100, 10_000];

struct Rate {
    solver: Solver,
    environments: usize,
    /// Of GPU and CPU: environments times substeps in a second.
    rates: [f64; 2],
    /// Of the GPU [GB/s, Gflop/s].
    moved: [f64; 2],
    /// Of the GPU, a control step.
    launches: usize,
}

struct Drift {
    solver: Solver,
    substeps: usize,
    /// Greatest difference of a coordinate from the CPU in single precision, by the GPU and by the CPU
    /// in double precision [um].
    off: [f64; 2],
}

/// Fills the tables `gpu` and `agreement` in control steps like `frame`, and the table `training`.
pub fn run(
    number: usize,
    scene: &Scene,
    frame: Control,
    effort: Effort,
    context: &Context,
) -> Result<Report, StudyError> {
    let invalid = |error: DeviceError| StudyError::Invalid(format!("`--device`: {error}"));
    let adapter = Adapter::number(number).map_err(invalid)?;
    let patience = effort.pick(0.1 * PATIENCE, PATIENCE);
    let (mut rates, mut drifts) = (Vec::new(), Vec::new());
    for (k, solver) in Solver::ALL.into_iter().enumerate() {
        let world = World {
            starts: vec![scene.initial.clone()],
            ..world(scene, solver)
        };
        for environments in COUNTS {
            (context.progress)(0.1 + 0.3 * k as f64, "environments");
            let gpu = match Gpu::new(&world, environments, &adapter) {
                Ok(gpu) => gpu,
                Err(DeviceError::TooMany { .. }) => break,
                Err(error) => return Err(invalid(error)),
            };
            let (traffic, launches) = (gpu.traffic(&frame), gpu.launches(&frame));
            let on_gpu = rate(gpu, &frame, effort);
            let cpu = Cpu::new(&world, environments, Precision::F32);
            let rate_of = |numbers: f64| 1e-9 * on_gpu * numbers;
            rates.push(Rate {
                solver,
                environments,
                rates: [on_gpu, rate(cpu, &frame, effort)],
                moved: [traffic.bytes, traffic.operations].map(rate_of),
                launches,
            });
            let seconds = (environments * frame.substeps) as f64 / on_gpu;
            if seconds > patience {
                break;
            }
        }
        let most = effort.pick(2, AFTER.len());
        for substeps in AFTER.into_iter().take(most) {
            (context.progress)(0.3 + 0.3 * k as f64, "agreement");
            // As often refreshed as in the other table.
            let control = Control {
                dt: frame.dt * substeps as f64 / frame.substeps as f64,
                substeps,
                ..frame
            };
            let single = after(Cpu::new(&world, 1, Precision::F32), &control);
            let double = after(Cpu::new(&world, 1, Precision::F64), &control);
            let gpu = Gpu::new(&world, 1, &adapter).map_err(invalid)?;
            drifts.push(Drift {
                solver,
                substeps,
                off: [&after(gpu, &control), &double].map(|state| furthest(state, &single)),
            });
        }
    }
    let title = format!("The standard sheet on {}", adapter.name());
    let rates = Table::of("gpu", title, &rates)
        .text("solver", |rate| rate.solver.name())
        .text("environments", |rate| rate.environments)
        .number("substeps [1/s]", 0, |rate| rate.rates[0])
        .number("on all threads of the CPU [1/s]", 0, |rate| rate.rates[1])
        .number("memory [GB/s]", 2, |rate| rate.moved[0])
        .number("arithmetic [Gflop/s]", 2, |rate| rate.moved[1])
        .text("launches", |rate| rate.launches);
    let title = "Greatest difference of a coordinate from the CPU in f32, from the settled sheet";
    let drifts = Table::of("agreement", title, &drifts)
        .text("solver", |drift| drift.solver.name())
        .text("substeps", |drift| drift.substeps)
        .number("GPU [um]", 3, |drift| drift.off[0])
        .number("CPU in f64 [um]", 3, |drift| drift.off[1]);
    let training = training::table(number, effort, patience, context)?;
    Ok(Report::new([rates.end(), drifts.end(), training]))
}

fn world(scene: &Scene, solver: Solver) -> World {
    let physics = PhysicsConfig {
        solver,
        ..PhysicsConfig::default()
    };
    World::new(Model::new(&scene.lamina, &physics), scene.tool.clone())
}

/// Environments times substeps in a second, after a step that compiles and fills caches.
fn rate(mut backend: impl Backend, frame: &Control, effort: Effort) -> f64 {
    let mut step = || {
        let start = Instant::now();
        backend.step(frame, &[]);
        // Waits for the device.
        assert!(backend.finite().iter().all(|&finite| finite));
        start.elapsed().as_secs_f64()
    };
    step();
    let turns = effort.pick(1, 3);
    let best = (0..turns).map(|_| step()).fold(f64::INFINITY, f64::min);
    (backend.count() * frame.substeps) as f64 / best
}

fn after(mut backend: impl Backend, control: &Control) -> Snapshot {
    backend.step(control, &[]);
    backend.snapshot(0)
}

/// [um]
fn furthest(a: &Snapshot, b: &Snapshot) -> f64 {
    let pairs = a.position.iter().flatten().zip(b.position.iter().flatten());
    1e6 * pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
