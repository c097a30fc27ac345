//! Time of a control step of the standard sheet on the rib, of looking up distances, and of a
//! step of the draping task. Results depend on the machine; compare within one.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use drape::env::{Draping, EnvConfig, Tasks};
use drape::math::Isa;
use drape::scene::{Scene, SceneConfig};
use drape::sim::{Batch, Bending, Control, Cpu, Model, PhysicsConfig, Solver, batch};

const CONTROL: Control = Control {
    dt: 1.0 / 60.0,
    substeps: 20,
};

/// The built-in scene after a short fall, as an episode finds it.
fn rib() -> Arc<Scene> {
    let mut config = SceneConfig::rib();
    config.fall.substep_rate = 2400.0;
    Arc::new(Scene::new(&config, |_| {}).expect("the built-in scene is valid"))
}

/// One control step of twenty substeps; an element is one environment.
fn step(criterion: &mut Criterion) {
    let scene = rib();
    let mut group = criterion.benchmark_group("step");
    group.sample_size(20);
    for (solver, bending) in [
        (Solver::Yarn, Bending::Yarns),
        (Solver::GaussSeidel, Bending::Yarns),
        (Solver::GaussSeidel, Bending::Dihedral),
    ] {
        let physics = PhysicsConfig {
            solver,
            bending,
            ..PhysicsConfig::default()
        };
        let model = Model::new(&scene.lamina, &physics);
        let mut batches: Vec<(String, Box<dyn Batch>)> = vec![
            ("f64".into(), Box::new(Cpu::<f64>::new(&model))),
            ("f32".into(), Box::new(Cpu::<f32>::new(&model))),
        ];
        for isa in Isa::available() {
            batches.push((format!("{isa:?}"), batch(&model, isa)));
        }
        for (name, mut batch) in batches {
            for lane in 0..batch.lanes() {
                batch.load(lane, &scene.initial);
            }
            group.throughput(Throughput::Elements(batch.lanes() as u64));
            let id = BenchmarkId::new(format!("{solver:?} {bending:?}"), name);
            group.bench_function(id, |bencher| {
                bencher.iter(|| batch.step(&model, &scene.tool, &CONTROL, &[]));
            });
        }
    }
}

/// Looking up distance and normal under every vertex of the sheet.
fn distance(criterion: &mut Criterion) {
    let scene = rib();
    let positions = &scene.initial.position;
    let mut group = criterion.benchmark_group("distance");
    group.throughput(Throughput::Elements(positions.len() as u64));
    group.bench_function("grid", |bencher| {
        bencher.iter(|| {
            for &x in positions {
                black_box(scene.tool.distance(black_box(x)));
            }
        });
    });
}

/// One action in every environment; an element is one environment.
fn action(criterion: &mut Criterion) {
    let scene = rib();
    let mut group = criterion.benchmark_group("action");
    group.sample_size(20);
    for count in [1, 16, 32] {
        let mut env = Draping::new(scene.clone(), &EnvConfig::default(), count)
            .expect("the default task is valid");
        group.throughput(Throughput::Elements(count as u64));
        group.bench_function(BenchmarkId::from_parameter(count), |bencher| {
            bencher.iter(|| {
                let first = |index| env.observation(index).mask.ones().next();
                let actions: Vec<u32> = (0..count)
                    .map(|index| first(index).expect("a mask is never empty") as u32)
                    .collect();
                env.step(&actions)
            });
        });
    }
}

criterion_group!(benches, step, distance, action);
criterion_main!(benches);
