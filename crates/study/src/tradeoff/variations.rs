//! The settings of the study: what is varied, and what is pressed.

use std::f64::consts::TAU;

use crate::points::coarser;
use crate::study::stencil_mm;
use drape_cloth::fabric::{Lamina, Material};
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
/// method would hide what the model changes.
pub fn variations(scene: &SceneConfig, env: &EnvConfig, quick: bool) -> Vec<Variation> {
    let around = stepped(&(scene.clone(), env.clone()), env.stepping());
    let mut axes = Axes {
        converged: converged(&around),
        fall: scene.fall.stepping(),
        around,
        variations: Vec::new(),
    };

    for solver in Solver::ALL {
        for rate in [60.0, 120.0, 300.0, 600.0, 1200.0, 2400.0, 6000.0, 12_000.0] {
            let interval = if rate < 1e4 { 5 } else { 10 };
            axes.method(solver.name(), format!("{rate}/s"), |around| {
                around.0.physics.solver = solver;
                step_at(around, Stepping::every(rate, interval));
            });
        }
    }
    for precision in [Precision::F32, Precision::F64] {
        axes.method("precision", precision.name().into(), |(_, env)| {
            env.precision = precision;
        });
    }
    let accurate = stepped(&axes.around, Accuracy::Accurate.stepping());
    axes.push("pushed", "1 um".into(), [accurate.clone(), accurate]);

    // Frames of both. The first of an axis is the reference.
    let (presses, settles): (&[u8], &[u8]) = match quick {
        true => (&[4, 1, 4, 1], &[8, 0, 0, 4]),
        false => (&[8, 1, 2, 4, 8, 1, 1, 4], &[16, 0, 0, 0, 0, 1, 4, 8]),
    };
    for (k, (&press, &settle)) in presses.iter().zip(settles).enumerate() {
        let value = format!("{press} + {settle} frames");
        axes.model("press and settle", k, value, |(_, env)| {
            (env.press_s, env.settle_s) = (f64::from(press) / 60.0, f64::from(settle) / 60.0);
        });
    }
    for (k, spacing) in [2.0, 4.0, 8.0].into_iter().enumerate() {
        axes.model("tool grid", k, format!("{spacing} mm"), |(scene, _)| {
            scene.tool.grid.spacing_mm = Some(spacing);
        });
    }
    for (k, vertices) in meshes(scene, quick).into_iter().enumerate() {
        let value = format!("{} x {}", vertices[0], vertices[1]);
        axes.model("mesh", k, value, |(scene, env)| {
            scene.blank.vertices = vertices;
            // A blank that cannot be cut is refused later.
            if let Ok(lamina) = Lamina::new(&scene.blank, Material::interglas_92125()) {
                env.stencil_mm = stencil_mm(&lamina, env.stencil_mm);
            }
        });
    }
    type Change = fn(&mut PhysicsConfig);
    let features: [(&str, Change); 6] = [
        ("as configured", |_| ()),
        ("no friction", |p| p.friction = false),
        ("no shear", |p| p.shear = false),
        ("no bending", |p| p.bending = Bending::Off),
        ("dihedral bending", |p| p.bending = Bending::Dihedral),
        ("strain limit 0.5 %", |p| p.strain_limit = Some(0.005)),
    ];
    for (k, (value, change)) in features.into_iter().enumerate() {
        axes.model("physics", k, value.into(), |(scene, _)| {
            change(&mut scene.physics);
        });
    }
    axes.variations
}

struct Axes {
    around: Around,
    /// Of the scene as it is configured.
    fall: Stepping,
    converged: Around,
    variations: Vec<Variation>,
}

impl Axes {
    fn push(&mut self, axis: &'static str, value: String, [around, reference]: [Around; 2]) {
        self.variations.push(Variation {
            axis,
            value,
            around,
            reference,
        });
    }

    /// Held against the converged solution.
    fn method(&mut self, axis: &'static str, value: String, change: impl Fn(&mut Around)) {
        let mut around = self.around.clone();
        change(&mut around);
        self.push(axis, value, [around, self.converged.clone()]);
    }

    /// Number `k` of an axis of models, held against number 0.
    fn model(&mut self, axis: &'static str, k: usize, value: String, change: impl Fn(&mut Around)) {
        let mut around = self.around.clone();
        around.0.fall.set_stepping(self.fall);
        change(&mut around);
        let reference = match k {
            0 => around.clone(),
            _ => self.variations[self.variations.len() - k].around.clone(),
        };
        self.push(axis, value, [around, reference]);
    }
}

/// Steps the fall and the presses alike.
fn step_at((scene, env): &mut Around, stepping: Stepping) {
    scene.fall.set_stepping(stepping);
    env.set_stepping(stepping);
}

/// The same model stepped otherwise.
fn stepped(around: &Around, stepping: Stepping) -> Around {
    let mut around = around.clone();
    step_at(&mut around, stepping);
    around
}

/// The same model, converged: 48 000 substeps a second, and 2400 refreshes of the tool's planes,
/// more than any preset has.
pub fn converged(around: &Around) -> Around {
    let (mut scene, mut env) = stepped(around, Stepping::every(48_000.0, 20));
    scene.physics.solver = Solver::Yarn;
    env.precision = Precision::F64;
    (scene, env)
}

/// Vertices along the sides, the finest mesh first. They share the places of the coarsest. Cut
/// blanks have other borders on every mesh, so theirs is not varied.
fn meshes(scene: &SceneConfig, quick: bool) -> Vec<[usize; 2]> {
    let here = scene.blank.vertices;
    let mut meshes = vec![here];
    if !quick && scene.blank.is_plain() {
        meshes.insert(0, here.map(|n| 2 * (n - 1) + 1));
    }
    meshes.extend(coarser(scene));
    meshes
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
