//! What holds at any step: energy does not grow, shapes at rest stay, and numbers that are
//! none do not get out.

use super::*;
use drape_cloth::math::Isa;
use drape_study::stability::{Outcome, SweepCell, compute, sweeps};
use drape_study::study::{Context, Effort, only};

const SIDE: f64 = 0.06;
const CELLS: usize = 6;

/// As stiff in compression as in tension.
fn square() -> Lamina {
    rigid(lamina([SIDE; 2], [CELLS + 1; 2]))
}

fn noisy(sheet: &Lamina, share: f64) -> Snapshot {
    let mut stream = Stream::new(11, Purpose::Evaluation, 0);
    let mut state = placed(sheet, |s, t| [s, t, 0.0]);
    for x in state.position.as_flattened_mut() {
        *x += share * SIDE / CELLS as f64 * stream.normal();
    }
    state
}

/// Nothing but inner forces, linear in strain.
fn undriven(solver: Solver) -> PhysicsConfig {
    PhysicsConfig {
        solver,
        bending_stiffness: BendingStiffness::NewtonMetre(STIFFNESS),
        gravity: 0.0,
        damping: 0.0,
        speed_cap: 0.0,
        ..PhysicsConfig::default()
    }
}

const STIFFNESS: f64 = 2e-4;

/// Kinetic and elastic energy [J] under [`undriven`], by the laws of docs/PHYSICS.md.
fn energy(sheet: &Lamina, state: &Snapshot) -> f64 {
    let x = |v: u32| Vec3::from(state.position[v as usize]);
    let kinetic = state.velocity.iter().zip(&sheet.mass);
    let mut sum: f64 = kinetic
        .map(|(v, m)| 0.5 * m * Vec3::from(*v).norm_squared())
        .sum();
    for yarn in &sheet.yarns {
        for v in yarn.vertices.windows(3) {
            let c = x(v[0]) - x(v[1]) * 2.0 + x(v[2]);
            sum += 0.5 * STIFFNESS * yarn.width / yarn.rest_length.powi(3) * c.norm_squared();
        }
    }
    sum + elastic_energy(sheet, state)
}

/// A sheet that is let go from a shape full of strain: implicit Euler takes energy out of
/// every oscillation and must never put any in, at no substep.
#[test]
fn energy_of_a_sheet_that_is_let_go_never_exceeds_what_it_had() {
    let sheet = square();
    let start = noisy(&sheet, 0.02);
    let before = energy(&sheet, &start);
    for solver in [Solver::Yarn, Solver::GaussSeidel] {
        let model = Model::new(&sheet, &undriven(solver));
        for h in [1e-2, 1e-3, 1e-4, 1e-5] {
            let world = World::new(model.clone(), NOWHERE.clone());
            let mut batch = Cpu::new(&world, 1, Precision::F64);
            batch.load(0, &start);
            let control = Control::new(h, 1, 5);
            let mut last = before;
            for substep in 0..400 {
                batch.step(&control, &[]);
                let now = energy(&sheet, &batch.snapshot(0));
                assert!(
                    now <= before * (1.0 + 1e-9),
                    "{now} J after {substep} substeps of {h} s, {before} J at the start, {solver:?}"
                );
                last = now;
            }
            assert!(
                last < 0.9 * before,
                "{last} of {before} J left, {h} s, {solver:?}"
            );
        }
    }
}

/// Turned, turned over or mirrored, and thrown: every edge keeps its length to round-off, and
/// the sheet flies on as it is.
#[test]
fn rest_shape_stays_after_any_rigid_motion() {
    let sheet = square();
    let turn = nalgebra::Rotation3::from_euler_angles(0.7, -1.1, 2.3);
    let away = Vec3::new(0.3, -0.2, 0.1);
    let throw = Vec3::new(0.5, -0.7, 0.2);
    let (h, t) = (1.0 / 1200.0, 1.0);
    for (name, mirror) in [("turned", [1.0, 1.0]), ("mirrored", [-1.0, 1.0])] {
        for solver in [Solver::Yarn, Solver::GaussSeidel] {
            let mut state = placed(&sheet, |s, t| {
                (turn * Vec3::new(mirror[0] * s, mirror[1] * t, 0.0) + away).into()
            });
            state.velocity.fill(throw.into());
            let end = run(
                &Model::new(&sheet, &undriven(solver)),
                &NOWHERE,
                &state,
                h,
                t,
            );
            for (x, x0) in end.position.iter().zip(&state.position) {
                let off = (Vec3::from(*x) - Vec3::from(*x0) - throw * t).norm();
                // A velocity (x - p) / h is rounded to 1e-16 m / h in every substep.
                assert!(off < 1e-10, "{off:e} m, {name}, {solver:?}");
            }
            let strain = sheet.yarn_strain(&end.position);
            assert!(strain.iter().all(|s| s.abs() < 1e-12), "{name}, {solver:?}");
        }
    }
}

/// Positions and velocities far beyond any scene: a lane is either sound, and then all of it
/// is numbers, or says that it is not; and its neighbours do not notice.
#[test]
fn absurd_states_are_reported_and_kept_from_the_neighbours() {
    let sheet = square();
    let good = noisy(&sheet, 0.02);
    let control = Control::new(1.0 / 60.0, 20, 5);
    for solver in [Solver::Yarn, Solver::GaussSeidel] {
        let model = Model::new(&sheet, &undriven(solver));
        let isa = Isa::best();
        let world = World::new(model, NOWHERE.clone());
        let lanes = isa.lanes();
        let [mut alone, mut shared] = [0; 2].map(|_| Cpu::new(&world, lanes, Precision::F32));
        let mut diverged = 0;
        for lane in 0..lanes {
            alone.load(lane, &good);
            let mut state = good.clone();
            let size = 10f64.powi(5 * lane as i32 / 2);
            if lane % 2 == 1 {
                state.position[lane][lane % 3] = size;
                state.velocity[lane + 1][0] = -size;
            }
            shared.load(lane, &state);
        }
        for _ in 0..10 {
            alone.step(&control, &[]);
            shared.step(&control, &[]);
        }
        for lane in 0..lanes {
            if lane % 2 == 0 {
                assert!(shared.finite()[lane] && shared.snapshot(lane) == alone.snapshot(lane));
            } else if shared.finite()[lane] {
                assert!(shared.snapshot(lane).is_finite(), "lane {lane}, {solver:?}");
            } else {
                diverged += 1;
            }
        }
        assert!(diverged > 0, "{solver:?}");
    }
}

/// A strip that hangs by its upper end at the N = h^2 T / (m a) of its first edge, let go
/// 20 degrees off the vertical: mean error of place over the length, and v_rms [m/s].
fn taut(number: f64, h: f64) -> (f64, f64) {
    let (length, edges) = (0.16, 16);
    let mut strip = strip(Family::Weft, length, edges);
    for row in strip.mass.chunks_exact_mut(2) {
        let mean = 0.5 * (row[0] + row[1]);
        row.fill(mean);
    }
    let edge = length / edges as f64;
    let gravity = number * edge / (edges as f64 * h * h);
    let physics = PhysicsConfig {
        gravity,
        ..yarns_alone(50.0)
    };
    let (sin, cos) = 20f64.to_radians().sin_cos();
    let mut state = placed(&strip, |s, t| [t, sin * s, -cos * s]);
    fix(&strip, &mut state, &[0]);
    let end = run(&Model::new(&strip, &physics), &NOWHERE, &state, h, 10.0);
    let modulus = strip.material.yarn(Family::Weft).tension.modulus();
    let mut off = 0.0;
    for k in 1..=edges {
        let s = edge * k as f64;
        let stretch = AREAL_MASS * gravity * (length * s - 0.5 * s * s) / (modulus * 0.35e-3);
        let expected = Vec3::new(0.0, 0.0, -s - stretch);
        off += (mean_at(&strip, &end, k) - expected).norm() / (length * edges as f64);
    }
    (off, end.v_rms())
}

/// N far above 1: yarns that would throw a vertex over many edges in a substep come to rest all
/// the same, each edge stretched by the weight below it.
#[test]
fn taut_strip_comes_to_rest() {
    for (h, numbers) in [
        (1.0 / 300.0, [1.0, 5.0, 100.0]),
        (1.0 / 1200.0, [0.1, 1.0, 5.0]),
    ] {
        for number in numbers {
            let (off, v_rms) = taut(number, h);
            assert!(
                off < 1e-5,
                "{off:e} of the length off at N = {number}, {h} s"
            );
            assert!(v_rms < 1e-5, "{v_rms:e} m/s at N = {number}, {h} s");
        }
    }
}

/// Two fixed ends too far apart: the free vertices between them come to rest on the straight
/// line, evenly spaced, whatever the substep.
#[test]
fn yarn_between_ends_too_far_apart_comes_to_rest_straight() {
    for edges in [2, 3, 8] {
        for share in [1.01, 1.1, 1.5] {
            let length = 0.01 * edges as f64;
            let strip = strip(Family::Warp, length, edges);
            let mut state = placed(&strip, |s, t| {
                let phase = 3.0 * std::f64::consts::PI * s / length;
                [share * s, t, 0.002 * phase.sin()]
            });
            fix(&strip, &mut state, &[0, edges]);
            let physics = PhysicsConfig {
                gravity: 0.0,
                ..yarns_alone(50.0)
            };
            let model = Model::new(&strip, &physics);
            for h in [1.0 / 300.0, 1.0 / 1200.0, 1.0 / 6000.0] {
                let end = run(&model, &NOWHERE, &state, h, 2.0);
                assert!(end.is_finite());
                assert!(end.v_rms() < 1e-8, "{:e} m/s, {h} s", end.v_rms());
                for k in 1..edges {
                    let [x, _, z] = mean_at(&strip, &end, k).into();
                    let off = (x - share * 0.01 * k as f64).hypot(z);
                    assert!(off < 1e-10, "{off:e} m, {edges} edges, {share}, {h} s");
                }
            }
        }
    }
}

/// The study of stability on some of its sweeps: no panic, no number that is none, and the
/// solver of episodes converges from 20 substeps a frame on.
#[test]
fn extremes_are_converged_wrong_or_diverged_and_nothing_else() {
    let names = ["time_step", "speed", "start", "pressure", "sliver"].map(String::from);
    let chosen = only(sweeps(Effort::Quick), &names, |sweep| sweep.name).unwrap();
    let cells = compute(&chosen, &Context::quiet());
    let of = |name: &'static str| cells.iter().filter(move |cell| cell.sweep == name);
    for cell in &cells {
        let is_fault = [Outcome::NonFinite, Outcome::Panicked].contains(&cell.outcome);
        assert!(!is_fault, "{cell:?}");
    }

    let axes = |name| &chosen.iter().find(|sweep| sweep.name == name).unwrap().axes;
    let exact = |cell: &&SweepCell| (cell.solver, cell.precision) == (Solver::Yarn, Precision::F64);
    for cell in of("time_step").filter(exact) {
        let enough = axes("time_step")[0].ticks[cell.at[0]].0 >= 20.0;
        assert!(!enough || cell.outcome == Outcome::Converged, "{cell:?}");
    }
    for cell in of("pressure") {
        assert_eq!(cell.outcome, Outcome::Converged, "{cell:?}");
    }
    let fastest = axes("speed")[1].ticks.len() - 1;
    for cell in of("speed").filter(|cell| cell.at[1] == fastest) {
        assert_eq!(cell.outcome, Outcome::Diverged, "{cell:?}");
    }
}
