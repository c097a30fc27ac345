//! The settings of the study: what is varied, and what is pressed.

use std::f64::consts::TAU;

use crate::points::coarser;
use crate::study::{Effort, lamina, stencil_mm};
use drape_cloth::fabric::Lamina;
use drape_cloth::file::ValueError;
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::scene::SceneConfig;
use drape_cloth::sim::{Accuracy, Bending, PhysicsConfig, Precision, Solver, Stepping};
use drape_task::env::EnvConfig;

/// A scene and a task.
pub type Around = (SceneConfig, EnvConfig);

/// One way of simulating.
#[derive(Clone, Debug, PartialEq)]
pub struct Variation {
    /// What is varied; `pushed` starts the presses where the cloth has been pushed.
    pub axis: &'static str,
    /// Where on the axis this is.
    pub value: String,
    /// Physics, mesh and tool, of the fall and of the presses.
    pub around: Around,
    /// What it is held against.
    pub reference: Around,
}

/// The settings around a scene and a task, one axis at a time. A fall takes the rate of its
/// method; that of a model is the scene's own, for at the rate of the presses the error of the
/// method would hide what the model changes. The first of an axis of models is their reference.
pub fn variations(scene: &SceneConfig, env: &EnvConfig, effort: Effort) -> Vec<Variation> {
    let around = stepped(&(scene.clone(), env.clone()), env.stepping());
    let reference = converged(&around);
    let mut all = Vec::new();
    let mut push = |axis, value, around, reference: &Around| {
        all.push(Variation {
            axis,
            value,
            around,
            reference: reference.clone(),
        });
    };
    for solver in Solver::ALL {
        for rate in [60.0, 120.0, 300.0, 600.0, 1200.0, 2400.0, 6000.0, 12_000.0] {
            let interval = if rate < 1e4 { 5 } else { 10 };
            let mut own = stepped(&around, Stepping::every(rate, interval));
            own.0.physics.solver = solver;
            push(solver.name(), format!("{rate}/s"), own, &reference);
        }
    }
    let accurate = stepped(&around, Accuracy::Accurate.stepping());
    push("pushed", "1 um".into(), accurate.clone(), &accurate);

    let mut model = around;
    model.0.fall.set_stepping(scene.fall.stepping());
    // The finest first. All have the places of the coarsest.
    let here = scene.blank.vertices;
    let finer = (effort == Effort::Full).then(|| here.map(|n| 2 * (n - 1) + 1));
    let meshes = finer.into_iter().chain([here]).chain(coarser(scene));
    let meshes = meshes.map(|vertices| {
        let (mut scene, mut env) = model.clone();
        scene.blank.vertices = vertices;
        let lamina = lamina(&scene).expect("the blank can be cut");
        env.stencil_mm = stencil_mm(&lamina, env.stencil_mm);
        (format!("{} x {}", vertices[0], vertices[1]), (scene, env))
    });
    type Change = fn(&mut PhysicsConfig);
    let features: [(&str, Change); 3] = [
        ("as configured", |_| ()),
        ("no shear", |p| p.shear = false),
        ("no bending", |p| p.bending = Bending::Off),
    ];
    let physics = features.map(|(value, change)| {
        let mut own = model.clone();
        change(&mut own.0.physics);
        (value.into(), own)
    });
    for (axis, models) in [("mesh", meshes.collect()), ("physics", Vec::from(physics))] {
        for (value, own) in &models {
            push(axis, String::clone(value), own.clone(), &models[0].1);
        }
    }
    all
}

/// A model, its fall and its presses stepped otherwise.
fn stepped(around: &Around, stepping: Stepping) -> Around {
    let (mut scene, mut env) = around.clone();
    scene.fall.set_stepping(stepping);
    env.set_stepping(stepping);
    (scene, env)
}

/// A model, converged: 48 000 substeps a second, and 2400 refreshes of the tool's planes,
/// more than any preset has.
pub fn converged(around: &Around) -> Around {
    let (mut scene, mut env) = stepped(around, Stepping::every(48_000.0, 20));
    scene.physics.solver = Solver::Yarn;
    env.precision = Precision::F64;
    (scene, env)
}

/// Places on the flat blank [m], the same in eight orders of pressing: every second row and column
/// of the region. The first is a straight sweep along the rows, then follow sweeps the other way,
/// along the columns, along a diagonal, from the middle and back, and two random orders.
pub fn sequences(lamina: &Lamina, env: &EnvConfig) -> Result<Vec<Vec<[f64; 2]>>, ValueError> {
    let region = env.region(lamina)?;
    let mut vertices: Vec<usize> = region.vertices.ones().collect();
    let every_second = |v: &usize| lamina.place(*v as u32).iter().all(|k| k % 2 == 0);
    if vertices.iter().any(every_second) {
        vertices.retain(every_second);
    }
    let middle = [&region.rows, &region.columns].map(|r| (r.start + r.end - 1) as f64 / 2.0);
    let order = |number: usize| {
        let mut sorted = vertices.clone();
        let rank = |v: usize| {
            let [row, column] = lamina.place(v as u32).map(|k| k as f64);
            let outwards = (row - middle[0]).hypot(column - middle[1]);
            let (sin, cos) = (0.11 * TAU).sin_cos();
            match number {
                0 => row,
                1 => -row,
                2 => column,
                3 => cos * column + sin * row,
                4 => outwards,
                _ => -outwards,
            }
        };
        // Ties stay row by row.
        sorted.sort_by(|&a, &b| rank(a).total_cmp(&rank(b)));
        if number > 5 {
            Stream::new(1, Purpose::Evaluation, number as u32).shuffle(&mut sorted);
        }
        sorted.into_iter().map(|v| lamina.rest[v]).collect()
    };
    Ok((0..8).map(order).collect())
}
