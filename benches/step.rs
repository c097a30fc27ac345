//! The variants of `drape bench` under criterion, which keeps results and compares with them:
//! every solver on every device, every feature, looking up distances, and a step of the
//! draping task. Results depend on the machine; compare within one.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use drape_cloth::math::Isa;
use drape_cloth::scene::Scene;
use drape_study::bench::{
    BenchDevice, CONTROL, ENVIRONMENTS, FEATURES, Player, THREADS, Timed, physics, solved_by,
    standard_scene, variants,
};

/// A control step; an element is a substep of one environment.
fn step(criterion: &mut Criterion, scene: &Scene) {
    let best = BenchDevice::group(Isa::best());
    let core = variants().into_iter().map(|(solver, device)| {
        let name = format!("{solver:?} {device:?}");
        ("core", name, solved_by(solver), device)
    });
    let features = FEATURES.map(|change| ("feature", change.into(), physics(change), best));
    for (group, name, physics, device) in core.chain(features) {
        let mut group = criterion.benchmark_group(group);
        group.sample_size(10);
        let mut case = Timed::new(scene, &scene.lamina, &physics, device);
        case.start(scene);
        group.throughput(Throughput::Elements(
            (case.lanes() * CONTROL.substeps) as u64,
        ));
        group.bench_function(name, |bencher| bencher.iter(|| case.step()));
    }
}

/// Looking up distance and normal under every vertex of the sheet.
fn distance(criterion: &mut Criterion, scene: &Scene) {
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
fn action(criterion: &mut Criterion, scene: &Arc<Scene>) {
    let mut group = criterion.benchmark_group("action");
    group.sample_size(10);
    group.throughput(Throughput::Elements(ENVIRONMENTS as u64));
    for threads in THREADS {
        let scenes = std::slice::from_ref(scene);
        let mut player = Player::new(scenes, threads).expect("threads can be started");
        let id = BenchmarkId::new("threads", threads);
        group.bench_function(id, |bencher| bencher.iter(|| player.step()));
    }
}

fn all(criterion: &mut Criterion) {
    let scene = Arc::new(standard_scene(|_| {}));
    step(criterion, &scene);
    distance(criterion, &scene);
    action(criterion, &scene);
}

criterion_group!(benches, all);
criterion_main!(benches);
