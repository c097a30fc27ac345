//! Flight, fall and oscillation: what the integrator does.

use super::*;

/// Every combination of passes that a scene can list.
fn all_physics() -> impl Iterator<Item = PhysicsConfig> {
    let solvers = [Solver::Yarn, Solver::GaussSeidel];
    let bendings = [Bending::Off, Bending::Yarns, Bending::Dihedral];
    solvers.into_iter().flat_map(move |solver| {
        bendings.into_iter().map(move |bending| PhysicsConfig {
            solver,
            bending,
            ..PhysicsConfig::default()
        })
    })
}

/// Every projection is a set of inner forces: they sum to zero, exactly, as long as no yarn
/// pulls so hard that the solve along lines gives its vertices inertia. This sheet starts with
/// edges stretched by up to 8 %: it needs substeps of 1e-5 s, and loses up to a quarter of its
/// momentum at those that cannot resolve their snap.
#[test]
fn free_flight_keeps_linear_momentum_to_round_off() {
    let sheet = lamina([0.1, 0.08], [7, 6]);
    let mut stream = Stream::new(1, Purpose::Evaluation, 0);
    let mut state = placed(&sheet, |s, t| [s, t, 0.01 * (40.0 * s).sin()]);
    for v in &mut state.velocity {
        *v = [0.5, -0.4, 0.3].map(|mean| mean + 0.3 * stream.normal());
    }
    let before = momenta(&sheet, &state)[0];
    for physics in all_physics() {
        let physics = PhysicsConfig {
            gravity: 0.0,
            damping: 0.0,
            speed_cap: 0.0,
            ..physics
        };
        let coarse = match physics.solver {
            Solver::Yarn => 0.25,
            Solver::GaussSeidel => 1e-12,
        };
        for (h, tolerance) in [(1e-3, coarse), (1e-5, 1e-10)] {
            let end = run(&Model::new(&sheet, &physics), &NOWHERE, &state, h, 0.05);
            let off = (momenta(&sheet, &end)[0] - before).norm() / before.norm();
            assert!(off < tolerance, "{off:e} at {h} s for {physics:?}");
        }
    }
}

/// A flat sheet that spins at omega about its centre. Inner forces have no moment about the
/// positions at the end of a substep, but these are not those at its start: implicit Euler
/// loses h omega^2 of the angular momentum a second, so omega = omega0 / sqrt(1 + 2 h omega0^2
/// t). First order in h, not round-off.
#[test]
fn spinning_sheet_loses_angular_momentum_as_implicit_euler() {
    let sheet = lamina([0.1, 0.08], [7, 6]);
    let omega = 10.0;
    let mut state = placed(&sheet, |_, _| [0.0; 3]);
    for (v, [x, y]) in sheet.rest.iter().enumerate() {
        state.position[v] = [*x, *y, 0.0];
        state.velocity[v] = [-omega * y, omega * x, 0.0];
    }
    for physics in all_physics() {
        let physics = PhysicsConfig {
            gravity: 0.0,
            damping: 0.0,
            ..physics
        };
        let model = Model::new(&sheet, &physics);
        let t = 0.5;
        let errors = [1e-3, 5e-4, 2.5e-4].map(|h| {
            let end = run(&model, &NOWHERE, &state, h, t);
            let left = momenta(&sheet, &end)[1].z / momenta(&sheet, &state)[1].z;
            let expected = (1.0 + 2.0 * h * omega * omega * t).powf(-0.5);
            close(1.0 - left, 1.0 - expected, 0.02);
            1.0 - left
        });
        for order in orders(&errors) {
            assert!((0.9..1.1).contains(&order), "order {order} for {physics:?}");
        }
    }
}

/// x = x0 + v0 t - g t (t + h) / 2, the sum that this integrator makes of constant
/// acceleration; no constraint sees a rigid translation.
#[test]
fn free_fall_is_a_rigid_translation() {
    let sheet = lamina([0.1, 0.08], [7, 6]);
    let mut state = placed(&sheet, |s, t| [s, t, 1.0]);
    state.velocity.fill([0.3, -0.2, 1.0]);
    let physics = PhysicsConfig {
        damping: 0.0,
        speed_cap: 0.0,
        ..PhysicsConfig::default()
    };
    let (h, t) = (1e-3, 0.5);
    let end = run(&Model::new(&sheet, &physics), &NOWHERE, &state, h, t);
    for (x, x0) in end.position.iter().zip(&state.position) {
        let fallen = [0.15, -0.1, 0.5 - 0.5 * GRAVITY * t * (t + h)];
        for k in 0..3 {
            let off = x[k] - x0[k] - fallen[k];
            // A velocity (x - p) / h is rounded to 1e-16 m / h in every substep.
            assert!(off.abs() < 1e-10, "{off:e}");
        }
    }
}

#[test]
fn rest_shape_without_gravity_is_a_fixed_point() {
    let sheet = lamina([0.1, 0.08], [7, 6]);
    // In a plane of its own: the shape is at rest wherever it lies.
    let state = placed(&sheet, |s, t| [0.6 * s, t, 0.8 * s]);
    for physics in all_physics() {
        let physics = PhysicsConfig {
            gravity: 0.0,
            damping: 0.0,
            ..physics
        };
        let end = run(&Model::new(&sheet, &physics), &NOWHERE, &state, 1e-3, 1.0);
        for (x, x0) in end.position.iter().zip(&state.position) {
            let off = (Vec3::from(*x) - Vec3::from(*x0)).norm();
            assert!(off < 1e-12, "{off} for {physics:?}");
        }
    }
}

/// Velocity decays by 1 / (1 + h c) a substep.
#[test]
fn damping_is_implicit() {
    let sheet = lamina([0.1, 0.08], [3, 3]);
    let mut state = placed(&sheet, |s, t| [s, t, 1.0]);
    state.velocity.fill([0.3, -0.2, 0.0]);
    let physics = PhysicsConfig {
        gravity: 0.0,
        damping: 40.0,
        ..PhysicsConfig::default()
    };
    let end = run(&Model::new(&sheet, &physics), &NOWHERE, &state, 2e-3, 0.1);
    let expected = 0.3 * (1.0 + 2e-3 * 40.0f64).powi(-50);
    for v in &end.velocity {
        assert!((v[0] - expected).abs() < 1e-12 && v[2] == 0.0);
    }
}

/// A single cell that breathes along its warps: implicit Euler takes 1 / (1 + (omega h)^2) of
/// the energy in every substep, exactly.
#[test]
fn oscillation_decays_as_implicit_euler() {
    let a = 0.01;
    let cell = rigid(lamina([a, a], [2, 2]));
    let [m0, m1] = [cell.mass[0], cell.mass[1]];
    let reduced = m0 * m1 / (m0 + m1);
    let k = 600e6 * 0.35e-3 * 0.5;
    let omega = (k / reduced).sqrt();
    for solver in [Solver::Yarn, Solver::GaussSeidel] {
        let physics = PhysicsConfig {
            solver,
            gravity: 0.0,
            ..yarns_alone(0.0)
        };
        let model = Model::new(&cell, &physics);
        let h = 0.5 / omega;
        // What is kept is force over length, so that the law is exact in the limit of small strain.
        let mut state = placed(&cell, |s, t| [(1.0 + 1e-7) * s, t, 0.0]);
        let energy = |state: &Snapshot| {
            let c = state.position[1][0] - state.position[0][0] - a;
            let v = state.velocity[1][0] - state.velocity[0][0];
            0.5 * (k * c * c + reduced * v * v)
        };
        for _ in 0..8 {
            let next = run(&model, &NOWHERE, &state, h, h);
            close(energy(&next), energy(&state) / (1.0 + 0.25), 1e-7);
            state = next;
        }
    }
}

/// A swinging strip without bending, against one of much smaller substeps.
#[test]
fn motion_converges_at_first_order_in_the_substep() {
    let strip = strip(Family::Warp, 0.2, 8);
    let mut state = placed(&strip, |s, t| [s, t, 0.0]);
    fix(&strip, &mut state, &[0]);
    let model = Model::new(&strip, &yarns_alone(0.0));
    let tip = |h: f64| mean_at(&strip, &run(&model, &NOWHERE, &state, h, 0.12), 8);
    let truth = tip(1e-3 / 512.0);
    let errors = [1e-3, 5e-4, 2.5e-4, 1.25e-4].map(|h| (tip(h) - truth).norm());
    for order in orders(&errors) {
        assert!((0.8..1.2).contains(&order), "order {order}");
    }
    assert!(errors[0] < 0.01 * 0.2, "{errors:?}");
}
