//! Length and shear: hanging, standing and sheared cloth at rest.

use drape_study::verify::length::{SAG, catenary_sag, elastic_stretch, hanging};

use super::*;

/// One pass of Gauss-Seidel leaves the stretch g h^2 N / (2 a), whatever the material.
#[test]
fn one_gauss_seidel_pass_stretches_by_its_floor() {
    for (h, floor) in [(1.0 / 600.0, 0.1508), (1e-3, 0.0543), (1e-4, 0.000_543)] {
        let found = hanging(&fast(Solver::GaussSeidel, h), Family::Warp);
        close(found, floor, 0.02);
    }
}

/// Mean strain rho g L / (2 E h): the yarn solver carries the weight at the material's
/// stiffness at any substep.
#[test]
fn yarn_solver_hangs_at_the_elastic_truth() {
    for family in [Family::Warp, Family::Weft] {
        for h in [1.0 / 600.0, 1e-4] {
            let found = hanging(&fast(Solver::Yarn, h), family);
            close(found, elastic_stretch(family), 1e-5);
        }
    }
}

/// Displacement rho g (L s - s^2 / 2) / (E h) along the whole strip, under 500 g, which
/// strains it by up to 0.24 %: force over strain is k = E h b / a for every edge.
#[test]
fn uniaxial_tension_has_the_stiffness_of_table_2() {
    for (family, modulus) in [(Family::Warp, 600e6), (Family::Weft, 5e6 / 0.006)] {
        let strip = strip(family, 0.37, 16);
        let mut state = placed(&strip, |s, t| [t, 0.0, -s]);
        fix(&strip, &mut state, &[0]);
        let physics = PhysicsConfig {
            gravity: 500.0 * GRAVITY,
            ..yarns_alone(50.0)
        };
        let end = run(&Model::new(&strip, &physics), &NOWHERE, &state, 1e-4, 1.0);
        for k in 1..=16 {
            let s = 0.37 * k as f64 / 16.0;
            let u = AREAL_MASS * 500.0 * GRAVITY * (0.37 * s - 0.5 * s * s) / (modulus * 0.35e-3);
            close(-mean_at(&strip, &end, k).z - s, u, 1e-4);
        }
    }
}

/// Strains of the edges of a hanging strip of 16, from the top, so soft that its weight would
/// stretch the uppermost by 47 %.
fn soft(solver: Solver, strain_limit: Option<f64>) -> Vec<f64> {
    let mut strip = strip(Family::Warp, 0.37, 16);
    let law = &mut strip.material.warp;
    law.tension = law.tension.scaled(1e-5);
    law.compression = law.compression.scaled(1e-3);
    let mut state = placed(&strip, |s, t| [t, 0.0, -s]);
    fix(&strip, &mut state, &[0]);
    let physics = PhysicsConfig {
        solver,
        strain_limit,
        ..yarns_alone(20.0)
    };
    let end = run(&Model::new(&strip, &physics), &NOWHERE, &state, 1e-4, 4.0);
    assert!(end.v_rms() < 1e-6, "still moves at {} m/s", end.v_rms());
    let z: Vec<f64> = (0..=16).map(|k| mean_at(&strip, &end, k).z).collect();
    z.windows(2)
        .map(|z| (z[0] - z[1]) / (0.37 / 16.0) - 1.0)
        .collect()
}

/// Strain of the edge `k` of the soft strip with the law of tension alone.
fn unlimited(k: usize) -> f64 {
    AREAL_MASS * GRAVITY * 0.37 * (15.5 - k as f64) / 16.0 / (6e3 * 0.35e-3)
}

/// Below the limit the law is that of tension, to the bit; beyond it a yarn gives a thousandth as
/// much. One pass of Gauss-Seidel adds its floor.
#[test]
fn soft_yarns_stretch_to_their_limit_and_no_further() {
    for (solver, tolerance) in [(Solver::Yarn, 1e-6), (Solver::GaussSeidel, 3e-4)] {
        let free = soft(solver, None);
        assert_eq!(free, soft(solver, Some(1.5)));
        // At the tip one border has a third and the other two thirds of an edge's weight: no
        // limit lies between the loads of both.
        for limit in [0.025, 0.21] {
            let strains = soft(solver, Some(limit));
            for (k, (strain, free)) in strains.into_iter().zip(&free).enumerate() {
                let load = unlimited(k);
                assert!((free - load).abs() < tolerance, "{free} is not {load}");
                let expected = load.min(limit) + 1e-3 * (load - limit).max(0.0);
                assert!(
                    (strain - expected).abs() < tolerance,
                    "edge {k} is strained by {strain}, not {expected}"
                );
            }
        }
    }
}

/// A strip of eight edges under gravity, held at section `held`. It stands above that and
/// hangs below, until it topples: implicit Euler damps motion along the yarns within a few
/// hundredths of a second, long before that.
fn standing(strip: Lamina, held: usize) -> (Lamina, Snapshot) {
    let mut state = placed(&strip, |s, t| [t, 0.0, -s]);
    fix(&strip, &mut state, &[held]);
    let end = run(
        &Model::new(&strip, &yarns_alone(0.0)),
        &NOWHERE,
        &state,
        1e-3,
        0.1,
    );
    (strip, end)
}

/// Mean strain between two sections of a strip of eight edges and 0.1 m.
fn strain_between((strip, state): &(Lamina, Snapshot), upper: usize, lower: usize) -> f64 {
    let length = mean_at(strip, state, upper).z - mean_at(strip, state, lower).z;
    length / (0.1 * (lower - upper) as f64 / 8.0) - 1.0
}

/// A strip that stands on its fixed lower end: mean strain -rho g L / (2 E_c h).
#[test]
fn compression_carries_with_the_branch_of_the_material() {
    let weight = AREAL_MASS * GRAVITY * 0.1 / (2.0 * 0.35e-3);
    for (family, tension, compression) in [
        (Family::Warp, 600e6, 6e6),
        (Family::Weft, 5e6 / 0.006, 2.025e6),
    ] {
        let soft = strain_between(&standing(strip(family, 0.1, 8), 8), 0, 8);
        close(soft, -weight / compression, 1e-6);
        let stiff = strain_between(&standing(rigid(strip(family, 0.1, 8)), 8), 0, 8);
        close(stiff, -weight / tension, 1e-6);
    }
}

/// Held in the middle, the lower half hangs and the upper half stands: at rest, no edge may
/// jump between the two branches.
#[test]
fn mixed_tension_and_compression_come_to_rest() {
    let weight = AREAL_MASS * GRAVITY * 0.05 / (2.0 * 0.35e-3);
    let end = standing(strip(Family::Warp, 0.1, 8), 4);
    let v_rms = end.1.v_rms();
    assert!(v_rms < 1e-9, "v_rms {v_rms}");
    close(strain_between(&end, 4, 8), weight / 600e6, 1e-6);
    close(strain_between(&end, 0, 4), -weight / 6e6, 1e-6);
}

#[test]
fn catenary_has_its_sag_at_second_order() {
    let solver = fast(Solver::Yarn, 5e-4);
    let sags = [8, 16, 32, 64].map(|edges| catenary_sag(&solver, edges));
    close(sags[3], SAG, 2e-4);
    for order in orders(&sags[..3].iter().map(|s| s - SAG).collect::<Vec<_>>()) {
        assert!((1.8..2.2).contains(&order), "order {order}");
    }
}

/// A cell that hangs by one corner: its yarns are stiff, so its weight works against shear
/// alone: 3 m g at its lower end where a triangle's third weighs m. The diagonal l of a trellis
/// pulls with G h gamma l / cos gamma: with the weight if it hangs upright, and with that times the
/// tangent of half the angle between the yarns if it lies across.
#[test]
fn sheared_cell_has_the_stiffness_of_its_branch() {
    let a = 0.01;
    let cell = lamina([a, a], [2, 2]);
    let third = cell.mass[1];
    let weight = 300.0 * GRAVITY;
    let physics = PhysicsConfig {
        shear: true,
        gravity: weight,
        ..yarns_alone(200.0)
    };
    let model = Model::new(&cell, &physics);
    let length = |state: &Snapshot, [p, q]: [usize; 2]| {
        (Vec3::from(state.position[p]) - Vec3::from(state.position[q])).norm()
    };
    let hung = |corner: usize| {
        let [x, y] = cell.rest[corner];
        let (sin, cos) = (std::f64::consts::FRAC_PI_2 - y.atan2(x)).sin_cos();
        let mut state = placed(&cell, |_, _| [0.0; 3]);
        for (v, [x, y]) in cell.rest.iter().enumerate() {
            state.position[v] = [cos * x - sin * y, 0.0, sin * x + cos * y];
        }
        state.fixed.insert(corner);
        run(&model, &NOWHERE, &state, 2e-5, 1.0)
    };
    let end = hung(0);
    assert!(end.v_rms() < 1e-6);
    // The fit of the law is good to 0.2 %.
    let pull = |l: f64, modulus: f64| {
        let sine = 0.5 * l * l / (a * a) - 1.0;
        modulus * 0.35e-3 * sine.asin() * l / (1.0 - sine * sine).sqrt()
    };
    let positive = cell.material.shear.positive.modulus();
    let upright = length(&end, [0, 3]);
    close(pull(upright, positive), 3.0 * third * weight, 3e-3);

    let end = hung(1);
    assert!(end.v_rms() < 1e-6);
    let across = length(&end, [0, 3]);
    let tangent = across / length(&end, [1, 2]);
    let negative = cell.material.shear.negative.modulus();
    close(
        -pull(across, negative),
        3.0 * third * weight * tangent,
        3e-3,
    );
}
