//! Shear beyond the locking angle, at rest.

use drape_cloth::fabric::ShearLocking;
use drape_cloth::measure::{shear, sheared};
use drape_cloth::sim::Stepping;
use drape_cloth::tool::Hemisphere;
use drape_study::cloth::{Piece, laid, shearing};
use drape_study::verify::solve::{Reference, Solve};

use super::*;

/// Thickness [m], locking angle [rad] and stiffening of the built-in fabric.
const THICKNESS: f64 = 0.35e-3;
const ANGLE: f64 = 0.7;
const STIFFENING: f64 = 20.0;

/// A square cell that hangs by one corner, sheared to `gamma` by its weight at rest: the lower
/// corner and half of those beside it pull at the vertical diagonal of length l with
/// dE/dl = t G l / cos gamma (gamma + (stiffening - 1)(gamma - angle)).
///
/// It is so heavy that this takes `gravity` [m/s^2].
fn hanging(gamma: f64, gravity: f64) -> Piece {
    let side = 0.01;
    let mut cell = rigid(lamina([side; 2], [2, 2]));
    let modulus = if gamma > 0.0 { 50e3 } else { 36e3 };
    // The mesh's own diagonal where it gets longer, the other one else: either gets longer by
    // |gamma|.
    let [top, bottom] = if gamma > 0.0 { [0, 3] } else { [1, 2] };
    let gamma = gamma.abs();
    let length = side * (2.0 + 2.0 * gamma.sin()).sqrt();
    let turned = gamma + (STIFFENING - 1.0) * (gamma - ANGLE).max(0.0);
    let force = THICKNESS * modulus * turned * length / gamma.cos();
    let beside: f64 = cell.mass.iter().sum::<f64>() - cell.mass[top] - cell.mass[bottom];
    let scale = force / gravity / (cell.mass[bottom] + 0.5 * beside);
    for mass in &mut cell.mass {
        *mass *= scale;
    }
    let from: Vec3 = [cell.rest[top][0], cell.rest[top][1], 0.0].into();
    let down: Vec3 = [cell.rest[bottom][0], cell.rest[bottom][1], 0.0].into();
    let down = (down - from).normalize();
    let across = Vec3::new(-down.y, down.x, 0.0);
    let mut start = laid(&cell, |[x, y]| {
        let r = Vec3::new(x, y, 0.0) - from;
        [r.dot(&across), 0.0, -r.dot(&down)]
    });
    start.fixed.insert(top);
    let physics = PhysicsConfig {
        // Nothing bends in a cell, but only stiff yarns keep the compression of the lower sides.
        bending: Bending::Yarns,
        bending_stiffness: BendingStiffness::NewtonMetre(1.0),
        shear: true,
        shear_locking: true,
        gravity,
        ..yarns_alone(50.0)
    };
    Piece::new(cell, physics, start)
}

fn shear_of(piece: &Piece, state: &Snapshot) -> f64 {
    let found = shear(&piece.lamina, &state.position);
    0.5 * (found[0] + found[1])
}

/// Both solvers and the twin come to rest at the angle of the closed form, before the locking
/// angle, at it and beyond, of either sign. The error falls with the square of the substep.
#[test]
fn hanging_cell_has_the_shear_of_its_weight() {
    for degrees in [20.0f64, 39.0, 42.0, 50.0, 58.0] {
        for gamma in [degrees.to_radians(), -degrees.to_radians()] {
            let piece = hanging(gamma, 200.0);
            let off = |end: &Snapshot| (shear_of(&piece, end) - gamma).to_degrees();
            for solver in Solver::ALL {
                for (rate, tolerance) in [(6000.0, 0.1), (48_000.0, 0.05)] {
                    let end = fast(solver, 1.0 / rate).settle(&piece, [1e-7, 2.0]);
                    let (off, speed) = (off(&end), end.v_rms());
                    assert!(
                        off.abs() < tolerance && speed < 1e-6,
                        "{solver:?} at {rate}/s is {off} degrees off {gamma}, at {speed} m/s"
                    );
                }
            }
            let off = off(&Reference.settle(&piece, [1e-6, 2.0]));
            assert!(off.abs() < 0.02, "the twin is {off} degrees off {gamma}");
        }
    }
}

/// A picture frame of 8 x 8 cells beyond locking, its inside pushed about at first, comes to rest
/// with one angle all over, in both precisions.
#[test]
fn locked_picture_frame_comes_to_rest() {
    for degrees in [40.0f64, 47.0, -40.0, -47.0, -55.0] {
        let sheet = lamina([0.08; 2], [9, 9]);
        let (sin, cos) = (0.5 * degrees.to_radians()).sin_cos();
        let mut stream = Stream::new(1, Purpose::Evaluation, 0);
        let mut start = laid(&sheet, |[x, y]| [cos * x + sin * y, sin * x + cos * y, 0.0]);
        for v in 0..sheet.vertex_count() {
            if sheet.neighbors(v as u32).count() < 8 {
                start.fixed.insert(v);
            } else {
                for k in 0..2 {
                    start.position[v][k] += 1e-3 * stream.normal();
                }
            }
        }
        for solver in Solver::ALL {
            let physics = PhysicsConfig {
                solver,
                shear: true,
                shear_locking: true,
                gravity: 0.0,
                ..yarns_alone(50.0)
            };
            let world = World::new(Model::new(&sheet, &physics), NOWHERE.clone());
            let stepping = Stepping {
                substep_rate: 48_000.0,
                contact_rate: 60.0,
            };
            for (precision, still) in [(Precision::F32, 1e-3), (Precision::F64, 1e-9)] {
                let mut cloth = Cpu::new(&world, 1, precision);
                cloth.load(0, &start);
                for _ in 0..60 {
                    cloth.step(&stepping.control(1.0 / 60.0), &[]);
                }
                let end = cloth.snapshot(0);
                let found = shear(&sheet, &end.position).into_iter();
                let off = found.map(|angle| (angle.to_degrees() - degrees).abs());
                let (off, speed) = (off.fold(0.0, f64::max), end.v_rms());
                assert!(
                    off < 0.3 && speed < still,
                    "{solver:?} {precision:?} at {degrees}: {off} off, {speed} m/s"
                );
            }
        }
    }
}

/// A soft square that sinks on to a hemisphere under ten times its weight shears by twice the angle
/// at which locking holds it.
#[test]
fn locking_holds_shear_on_a_hemisphere() {
    let radius = 0.1;
    let dome = Hemisphere {
        radius_mm: 1e3 * radius,
        ..Hemisphere::default()
    };
    let dome = Arc::new(tool(Shape::Hemisphere(dome), Pose::default(), 4.0));
    let mut material = shearing(50.0);
    material.shear.locking = Some(ShearLocking {
        angle_rad: 0.4,
        stiffening: 1e4,
    });
    let sheet = sheet([1.9 * radius; 2], [21; 2], material);
    let mut start = laid(&sheet, |[x, y]| [x, y, radius]);
    start.fixed.insert(220);
    for solver in Solver::ALL {
        let [free, held] = [false, true].map(|shear_locking| {
            let physics = PhysicsConfig {
                bending: Bending::Yarns,
                bending_stiffness: BendingStiffness::NewtonMetre(1e-5),
                shear: true,
                shear_locking,
                adhesion: 1.0,
                gravity: 10.0 * GRAVITY,
                ..yarns_alone(50.0)
            };
            let piece = Piece::new(sheet.clone(), physics, start.clone()).on(&dome);
            let end = fast(solver, 1.0 / 6000.0).settle(&piece, [1e-5, 2.0]);
            let all = (0..sheet.vertex_count()).collect();
            sheared(&sheet, &end.position, &all, 0.5)
        });
        assert!(free.max > 0.7 && held.max < 0.5, "{free:?} {held:?}");
        assert!(free.share_beyond > 0.02 && held.share_beyond == 0.0);
    }
}
