//! The cloth core against closed forms: numbers which nobody in this project chose.
//!
//! Everything runs in f64 and through the public API. Where a result depends on the substep
//! or the mesh, the order at which its error falls is tested too.

mod bending;
mod contact;
mod locking;
mod membranes;
mod motion;
mod stability;
mod verify;
mod yarns;

use std::sync::Arc;

use drape_cloth::fabric::{BlankConfig, Family, Lamina, MassModel, Material};
use drape_cloth::math::{Purpose, Stream, Vec3};
use drape_cloth::sim::{
    Backend, Bending, BendingStiffness, Control, Cpu, Model, PhysicsConfig, Precision, Snapshot,
    Solver, World,
};
use drape_cloth::tool::{Incline, Plate, Pose, Shape, Tool};
use drape_study::cloth::{
    AREAL_MASS, GRAVITY, NOWHERE, elastic_energy, fix, mean_at, momenta, placed, rigid, sheet,
    strip, tool, yarns_alone,
};
use drape_study::verify::solve::Fast;

/// A blank of `size` [m] with the areal mass of the data sheet, 280 g/m^2.
fn lamina(size: [f64; 2], vertices: [usize; 2]) -> Lamina {
    sheet(size, vertices, Material::interglas_92125())
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
        batch.step(&Control::new(dt, substeps, 5), &[]);
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
