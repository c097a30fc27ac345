//! The cloth core against closed forms: numbers which nobody in this project chose.
//!
//! Everything runs in f64 and through the public API. Where a result depends on the substep
//! or the mesh, the order at which its error falls is tested too.

mod bending;
mod contact;
mod membranes;
mod motion;
mod stability;
mod verify;
mod yarns;

use std::sync::{Arc, LazyLock};

use drape_cloth::fabric::{BlankConfig, Family, Lamina, MassModel, Material};
use drape_cloth::math::{Purpose, Stream, Vec3};
use drape_cloth::sim::{
    Backend, Bending, BendingStiffness, Control, Cpu, Model, PhysicsConfig, Precision, Snapshot,
    Solver, World,
};
use drape_cloth::tool::{GridConfig, Incline, Plate, Pose, Shape, Source, Tool, ToolConfig};
use drape_study::cloth::rigid;
use drape_study::verify::cloth::Fast;

const GRAVITY: f64 = 9.81;

/// A plate so far below that nothing touches it.
static NOWHERE: LazyLock<Arc<Tool>> = LazyLock::new(|| {
    let pose = Pose {
        translation_mm: [0.0, 0.0, -50_000.0],
        ..Pose::default()
    };
    tool(Shape::Plate(Plate::default()), pose, 100.0).into()
});

fn tool(shape: Shape, pose: Pose, spacing_mm: f64) -> Tool {
    Tool::new(&ToolConfig {
        source: Source::Shape(shape),
        pose,
        grid: GridConfig {
            spacing_mm,
            ..GridConfig::default()
        },
    })
    .unwrap()
}

/// A blank of `size` [m] with the areal mass of the data sheet, 280 g/m^2.
fn lamina(size: [f64; 2], vertices: [usize; 2]) -> Lamina {
    let config = BlankConfig {
        size_mm: size.map(|s| 1e3 * s),
        vertices,
        mass: MassModel::Datasheet,
        ..BlankConfig::default()
    };
    Lamina::new(&config, Material::interglas_92125()).unwrap()
}

const AREAL_MASS: f64 = 0.280;

/// Yarns and gravity only, without any damping.
fn yarns_alone() -> PhysicsConfig {
    PhysicsConfig {
        bending: Bending::Off,
        shear: false,
        friction: false,
        damping: 0.0,
        speed_cap: 0.0,
        ..PhysicsConfig::default()
    }
}

/// A strip of one cell's width along the yarns of `family`, `edges` long. The yarns that are
/// tested are its two borders, half a cell wide each.
fn strip(family: Family, length: f64, edges: usize) -> Lamina {
    let width = length / edges as f64;
    match family {
        Family::Warp => lamina([length, width], [edges + 1, 2]),
        Family::Weft => lamina([width, length], [2, edges + 1]),
    }
}

/// Places each vertex by its coordinates along the strip (from 0) and across it.
fn placed(lamina: &Lamina, at: impl Fn(f64, f64) -> [f64; 3]) -> Snapshot {
    let long = usize::from(lamina.rows > lamina.columns);
    let start = lamina.rest[0][long];
    let position: Vec<_> = lamina
        .rest
        .iter()
        .map(|r| at(r[long] - start, r[1 - long]))
        .collect();
    Snapshot::at_rest(position)
}

/// The vertices at the end of the strip's `k`-th cross-section.
fn section(lamina: &Lamina, k: usize) -> [usize; 2] {
    if lamina.rows > lamina.columns {
        [2 * k, 2 * k + 1]
    } else {
        [k, k + lamina.columns]
    }
}

fn mean_at(lamina: &Lamina, state: &Snapshot, k: usize) -> Vec3 {
    let [a, b] = section(lamina, k).map(|v| Vec3::from(state.position[v]));
    (a + b) * 0.5
}

fn fix(lamina: &Lamina, state: &mut Snapshot, sections: &[usize]) {
    for &k in sections {
        state.fixed.extend(section(lamina, k));
    }
}

/// Lets `state` move for `seconds` in substeps of `h`.
fn run(model: &Model, tool: &Arc<Tool>, state: &Snapshot, h: f64, seconds: f64) -> Snapshot {
    let world = World::new(model.clone(), tool.clone());
    let mut batch = Cpu::new(&world, 1, Precision::F64);
    batch.load(0, state);
    let mut left = (seconds / h).round() as usize;
    while left > 0 {
        let substeps = left.min(1000);
        let dt = substeps as f64 * h;
        batch.step(
            &Control {
                dt,
                substeps,
                contact_interval: 5,
            },
            &[],
        );
        left -= substeps;
    }
    batch.snapshot(0)
}

/// The fast solver with a substep of its own.
fn fast(solver: Solver, substep: f64) -> Fast {
    Fast {
        solver,
        substep,
        contact_interval: 5,
    }
}

#[track_caller]
fn close(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found / expected - 1.0).abs() <= tolerance,
        "{found} is not {expected} within {tolerance}"
    );
}

/// Orders of convergence between neighbours of a list of errors, each at half the step
/// before.
fn orders(errors: &[f64]) -> Vec<f64> {
    errors
        .windows(2)
        .map(|e| (e[0] / e[1]).abs().log2())
        .collect()
}
