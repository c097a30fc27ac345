//! The heavy elastica, and bending stiffness by virtual work.

use drape_study::verify::bending::{Cantilever, ELASTICA};

use super::*;

/// Drop and reach of the tip of a heavy strip of length 1 m, clamped level, over its length.
fn cantilever(family: Family, gamma: f64, edges: usize, h: f64) -> [f64; 2] {
    let strip = Cantilever {
        family,
        stiffness: AREAL_MASS * GRAVITY / gamma,
        length: 1.0,
        edges,
    };
    let end = strip.sink(&fast(Solver::Yarn, h));
    assert!(end.v_rms < 1e-5, "still moves at {} m/s", end.v_rms);
    end.tip
}

/// Substep at which a pass of Gauss-Seidel resolves the bending stiffness to one part in
/// `share`: the pass adds about 6 h^2 / m to the compliance l^3 / (D b).
pub fn resolving(gamma: f64, edges: usize, share: f64) -> f64 {
    (gamma / (6.0 * share * GRAVITY * (edges as f64).powi(4))).sqrt()
}

#[test]
fn cantilever_bends_as_the_elastica() {
    for [gamma, drop, reach] in [ELASTICA[1], ELASTICA[3], ELASTICA[5]] {
        for family in [Family::Warp, Family::Weft] {
            let h = resolving(gamma, 24, 400.0);
            let [found_drop, found_reach] = cantilever(family, gamma, 24, h);
            assert!(
                (found_drop - drop).abs() < 2e-3,
                "{found_drop} is not {drop}"
            );
            assert!(
                (found_reach - reach).abs() < 2e-3,
                "{found_reach} is not {reach}"
            );
        }
    }
}

#[test]
fn cantilever_converges_at_second_order_in_the_edge_length() {
    let [gamma, drop, _] = ELASTICA[3];
    let errors = [8, 16, 32].map(|edges| {
        let at = |share: f64| {
            let h = resolving(gamma, edges, share);
            cantilever(Family::Warp, gamma, edges, h)[0]
        };
        // The error of the substep is of second order too: extrapolated away.
        (4.0 * at(400.0) - at(100.0)) / 3.0 - drop
    });
    for order in orders(&errors) {
        assert!((1.7..2.3).contains(&order), "order {order}");
    }
}

/// At rest every force is that of its law, however long the substep is.
#[test]
fn bent_yarn_at_rest_does_not_depend_on_the_substep() {
    let [gamma, ..] = ELASTICA[3];
    let drop = |share: f64| {
        let h = resolving(gamma, 8, share);
        cantilever(Family::Warp, gamma, 8, h)[0]
    };
    let truth = drop(40_000.0);
    for share in [25.0, 100.0, 400.0] {
        let off = drop(share) - truth;
        assert!(off.abs() < 1e-8, "{off:e} at {share}");
    }
}

/// Bending stiffness over D of a square sheet that is bent to a cylinder across `direction`,
/// by virtual work: in a substep too short for anything to move, each vertex gains the
/// velocity h F / m, and the work of the forces F on a growing curvature is -D kappa A.
fn apparent_stiffness(bending: Bending, direction: f64) -> f64 {
    let cells = 48;
    let side = 0.1;
    let sheet = lamina([side, side], [cells + 1, cells + 1]);
    let (sin, cos) = direction.to_radians().sin_cos();
    let kappa = 1e-4;
    let mut state = placed(&sheet, |_, _| [0.0; 3]);
    let way: Vec<f64> = sheet
        .rest
        .iter()
        .map(|[x, y]| 0.5 * (cos * x + sin * y).powi(2))
        .collect();
    for ((x, [u, v]), way) in state.position.iter_mut().zip(&sheet.rest).zip(&way) {
        *x = [*u, *v, kappa * way];
    }
    let stiffness = 1e-4;
    let physics = PhysicsConfig {
        bending,
        bending_stiffness: BendingStiffness::NewtonMetre(stiffness),
        gravity: 0.0,
        ..yarns_alone(0.0)
    };
    let h = 1e-7;
    let end = run(&Model::new(&sheet, &physics), &NOWHERE, &state, h, h);
    let work: f64 = (0..way.len())
        .map(|v| sheet.mass[v] * end.velocity[v][2] / h * way[v])
        .sum();
    -work / (stiffness * kappa * side * side)
}

/// Along its yarns the sheet has the stiffness that was asked for, across the bias half of it:
/// the twist that belongs to this curvature is free. Nodes on the border carry none, hence 47
/// of 48 parts.
#[test]
fn yarn_bending_has_its_stiffness_in_every_direction() {
    for (direction, expected) in [(0.0, 1.0), (90.0, 1.0), (45.0, 0.5), (-45.0, 0.5)] {
        let found = apparent_stiffness(Bending::Yarns, direction);
        close(found, expected * 47.0 / 48.0, 1e-3);
    }
}

/// The mesh's diagonals make one bias direction three times as stiff as the others.
#[test]
fn dihedral_bending_has_its_stiffness_in_every_direction() {
    for (direction, expected) in [(0.0, 1.0), (90.0, 1.0), (45.0, 3.0), (-45.0, 1.0)] {
        let found = apparent_stiffness(Bending::Dihedral, direction);
        // Hinges on the border are missing: 1/48 of those across the yarns.
        close(found, expected, 0.025);
    }
}
