use serde::Serialize;

use crate::points::coarser;
use crate::twin::stencil_mm;
use drape_cloth::fabric::{Lamina, Material};
use drape_cloth::scene::SceneConfig;
use drape_cloth::sim::{Accuracy, Bending, PhysicsConfig, Solver, Stepping};
use drape_cloth::sim::Precision;
use drape_task::env::{EnvConfig};

/// Substeps a second of what counts as converged [1/s], and of them between two looks for the
/// tool's planes: 2400 looks a second, more than any preset has.
const CONVERGED: (f64, usize) = (48_000.0, 20);

/// How much of the axes is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Some three minutes of CPU time on the standard scene.
    Quick,
    /// More values, and a mesh of half the cell.
    Full,
}

/// What a point is held against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The same model, converged: `yarn`, f64, 12 000 substeps a second.
    Method,
    /// Another model: the one of its axis that leaves least out, stepped as usual; its fall as
    /// the scene says.
    Model,
}

/// One way of simulating: a point to be measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// What is varied.
    pub axis: &'static str,
    /// Where on the axis this is.
    pub value: String,
    pub kind: Kind,
    /// Physics, mesh and tool, of the fall and of the presses.
    pub scene: SceneConfig,
    pub env: EnvConfig,
    /// What it is held against.
    pub(super) reference: (SceneConfig, EnvConfig),
}

/// The points of a study around `scene` and `env`: the plane of solver and rate, then one axis
/// at a time. A fall takes the rate of its point; that of a model is the scene's own, for at the
/// rate of the presses the error of the method would hide what the model changes.
pub fn settings(scene: &SceneConfig, env: &EnvConfig, extent: Extent) -> Vec<Setting> {
    let around = at((scene.clone(), env.clone()), env.stepping());
    let mut axes = Axes {
        converged: converged(&around),
        fall_stepping: scene.fall.stepping(),
        around,
        settings: Vec::new(),
    };
    let quick = extent == Extent::Quick;

    for (axis, solver) in [
        ("yarn", Solver::Yarn),
        ("gauss_seidel", Solver::GaussSeidel),
    ] {
        for rate in [60.0, 120.0, 300.0, 600.0, 1200.0, 2400.0, 6000.0] {
            axes.method(axis, format!("{rate}/s"), |around| {
                around.0.physics.solver = solver;
                step_at(around, Stepping::every(rate, 5));
            });
        }
    }
    // Planes looked up 120 times a second each.
    for (rate, interval) in [(600.0, 5), (2400.0, 20)] {
        let value = format!("{rate}/s every {interval}");
        axes.method("even looks", value, |around| {
            step_at(around, Stepping::every(rate, interval));
        });
    }
    for interval in [1, 2, 5, 10, 20] {
        axes.method("contact_interval", interval.to_string(), |around| {
            let rate = around.1.stepping().substep_rate;
            step_at(around, Stepping::every(rate, interval));
        });
    }
    for (value, precision) in [("f32", Precision::F32), ("f64", Precision::F64)] {
        axes.method("precision", value.into(), |(_, env)| {
            env.precision = precision;
        });
    }
    for preset in Accuracy::ALL {
        axes.method("preset", preset.name().into(), |around| {
            step_at(around, preset.stepping());
        });
    }

    let presses: &[[u32; 2]] = if quick {
        &[[4, 8], [1, 0], [2, 0], [4, 0], [1, 1], [1, 4]]
    } else {
        &[
            [8, 16],
            [1, 0],
            [2, 0],
            [4, 0],
            [8, 0],
            [1, 1],
            [1, 2],
            [1, 4],
            [1, 8],
            [4, 8],
        ]
    };
    axes.model(
        "press and settle",
        presses.iter().map(|&[press, settle]| {
            let change = move |(_, env): &mut Around| {
                (env.press_s, env.settle_s) = (f64::from(press) / 60.0, f64::from(settle) / 60.0);
            };
            (format!("{press} + {settle} frames"), change)
        }),
    );
    let spacings: &[f64] = if quick {
        &[2.0, 4.0, 8.0]
    } else {
        &[2.0, 3.0, 4.0, 6.0, 8.0]
    };
    axes.model(
        "tool grid",
        spacings.iter().map(|&spacing| {
            let change = move |(scene, _): &mut Around| scene.tool.grid.spacing_mm = spacing;
            (format!("{spacing} mm"), change)
        }),
    );
    axes.model(
        "mesh",
        meshes(scene, extent).into_iter().map(|vertices| {
            let change = move |(scene, env): &mut Around| {
                scene.blank.vertices = vertices;
                // As many vertices under the stencil as on the paper's mesh. A blank that cannot
                // be cut is refused later.
                if let Ok(lamina) = Lamina::new(&scene.blank, Material::interglas_92125()) {
                    env.stencil_mm = stencil_mm(&lamina, env.stencil_mm);
                }
            };
            (format!("{} x {}", vertices[0], vertices[1]), change)
        }),
    );
    let features: [(&str, Change); 8] = [
        ("as configured", |_| ()),
        ("no friction", |p| p.friction = false),
        ("no shear", |p| p.shear = false),
        ("no bending", |p| p.bending = Bending::Off),
        ("dihedral bending", |p| p.bending = Bending::Dihedral),
        ("strain limit 0.5 %", |p| p.strain_limit = Some(0.005)),
        ("damping x 0.5", |p| p.damping *= 0.5),
        ("no speed cap", |p| p.speed_cap = 0.0),
    ];
    axes.model(
        "physics",
        features.map(|(name, change)| {
            let change = move |(scene, _): &mut Around| change(&mut scene.physics);
            (name.to_owned(), change)
        }),
    );
    axes.settings
}

/// What a feature changes.
type Change = fn(&mut PhysicsConfig);

/// A scene and a task.
pub(super) type Around = (SceneConfig, EnvConfig);

struct Axes {
    around: Around,
    /// Of the scene as it is configured [1/s].
    fall_stepping: Stepping,
    converged: Around,
    settings: Vec<Setting>,
}

impl Axes {
    /// A point that is held against the converged solution.
    fn method(&mut self, axis: &'static str, value: String, change: impl Fn(&mut Around)) {
        let mut at = self.around.clone();
        change(&mut at);
        self.settings.push(Setting {
            axis,
            value,
            kind: Kind::Method,
            scene: at.0,
            env: at.1,
            reference: self.converged.clone(),
        });
    }

    /// An axis of models: all are held against the first.
    fn model<F: Fn(&mut Around)>(
        &mut self,
        axis: &'static str,
        points: impl IntoIterator<Item = (String, F)>,
    ) {
        let mut first = None;
        for (value, change) in points {
            let mut at = self.around.clone();
            step_fall_at(&mut at.0, self.fall_stepping);
            change(&mut at);
            let reference = first.get_or_insert_with(|| at.clone()).clone();
            self.settings.push(Setting {
                axis,
                value,
                kind: Kind::Model,
                scene: at.0,
                env: at.1,
                reference,
            });
        }
    }
}

/// Steps the fall and the presses alike.
fn step_at((scene, env): &mut Around, stepping: Stepping) {
    step_fall_at(scene, stepping);
    env.set_stepping(stepping);
}

fn step_fall_at(scene: &mut SceneConfig, stepping: Stepping) {
    scene.fall.substep_rate = stepping.substep_rate;
    scene.fall.contact_rate = stepping.contact_rate;
}

fn at(mut around: Around, stepping: Stepping) -> Around {
    step_at(&mut around, stepping);
    around
}

/// The same model, converged.
pub(super) fn converged(around: &Around) -> Around {
    let (rate, interval) = CONVERGED;
    let (mut scene, mut env) = at(around.clone(), Stepping::every(rate, interval));
    scene.physics.solver = Solver::Yarn;
    env.precision = Precision::F64;
    (scene, env)
}

/// The same model as the finest preset steps it.
pub(super) fn accurate(around: &Around) -> Around {
    at(around.clone(), Accuracy::Accurate.stepping())
}

/// Vertices along the sides, the finest mesh first. They share the places of the coarsest. Cut
/// blanks have other borders on every mesh, so theirs is not varied.
fn meshes(scene: &SceneConfig, extent: Extent) -> Vec<[usize; 2]> {
    let here = scene.blank.vertices;
    let mut meshes = vec![here];
    if extent == Extent::Full && scene.blank.is_plain() {
        meshes.insert(0, here.map(|n| 2 * (n - 1) + 1));
    }
    meshes.extend(coarser(scene));
    meshes
}
