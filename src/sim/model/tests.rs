use super::*;
use crate::fabric::{BlankConfig, Material};

fn passes(physics: PhysicsConfig) -> Vec<Pass> {
    let blank = BlankConfig::default();
    let lamina = Lamina::new(&blank, Material::interglas_92125()).unwrap();
    Model::new(&lamina, &physics).passes
}

#[track_caller]
fn close(found: f64, expected: f64) {
    assert!(
        (found / expected - 1.0).abs() < 5e-4,
        "{found} is not {expected}"
    );
}

/// Table 2 as compliance of the edges of the standard blank; border yarns are half as wide.
#[test]
fn yarn_compliances_are_those_of_table_2() {
    let passes = passes(PhysicsConfig::default());
    let [Pass::Yarns(warps), Pass::Yarns(wefts)] = &passes[..2] else {
        panic!("all warps, then all wefts");
    };
    assert_eq!((warps.len(), wefts.len()), (65, 65));
    for (yarns, tension, compression) in [(warps, 4.762e-6, 4.762e-4), (wefts, 3.429e-6, 1.411e-3)]
    {
        close(yarns[30].law.tension, tension);
        close(yarns[30].law.compression, compression);
        for border in [0, 64] {
            close(yarns[border].law.tension, 2.0 * tension);
        }
    }
}

/// A spring of 2 G h along the diagonal: 35 N/m for +45 degrees, 25.2 N/m for -45 degrees.
#[test]
fn shear_springs_have_twice_the_shear_stiffness() {
    let passes = passes(PhysicsConfig {
        bending: Bending::Off,
        ..PhysicsConfig::default()
    });
    let mut count = 0;
    for pass in &passes[2..] {
        let Pass::Edges(class) = pass else {
            panic!("shear is a pass over edges");
        };
        for law in &class.law {
            close(1.0 / law.tension, 35.0);
            close(1.0 / law.compression, 25.2);
            count += 1;
        }
    }
    assert_eq!(count, 64 * 64);
}

/// What a scene does not list costs no pass.
#[test]
fn passes_are_those_that_were_asked_for() {
    let bare = PhysicsConfig {
        shear: false,
        bending: Bending::Off,
        ..PhysicsConfig::default()
    };
    assert_eq!(passes(bare.clone()).len(), 2);
    let stiffness = BendingStiffness::NewtonMetre(0.0);
    for bending in [Bending::Yarns, Bending::Dihedral] {
        let limp = PhysicsConfig {
            bending,
            bending_stiffness: stiffness,
            ..bare.clone()
        };
        assert_eq!(passes(limp).len(), 2, "no stiffness, no pass");
    }
}

/// Whatever runs in one pass shares no vertex, and all passes together hold everything once.
#[test]
fn passes_hold_everything_once_without_conflict() {
    let yarn_edges = 2 * 65 * 64;
    let triples = 2 * 65 * 63;
    let hinges = (3 * 8192 - 4 * 64) / 2;
    for (solver, bending, expected) in [
        (Solver::Yarn, Bending::Yarns, 130 + 4096 + triples),
        (
            Solver::GaussSeidel,
            Bending::Yarns,
            yarn_edges + 4096 + triples,
        ),
        (
            Solver::GaussSeidel,
            Bending::Dihedral,
            yarn_edges + 4096 + hinges,
        ),
    ] {
        let passes = passes(PhysicsConfig {
            solver,
            bending,
            ..PhysicsConfig::default()
        });
        let mut count = 0;
        for pass in &passes {
            let members: Vec<Vec<u32>> = match pass {
                Pass::Yarns(chains) => chains.iter().map(|c| c.vertices.clone()).collect(),
                Pass::Edges(class) => class.vertices.iter().map(|v| v.to_vec()).collect(),
                Pass::Triples(triples) => triples.iter().map(|t| t.vertices.to_vec()).collect(),
                Pass::Hinges(hinges) => hinges.iter().map(|h| h.vertices.to_vec()).collect(),
                Pass::Membrane(elements) => elements.iter().map(|e| e.vertices.to_vec()).collect(),
            };
            count += members.len();
            let mut vertices = members.concat();
            let all = vertices.len();
            vertices.sort_unstable();
            vertices.dedup();
            assert_eq!(vertices.len(), all, "{solver:?} {bending:?}");
        }
        assert_eq!(count, expected, "{solver:?} {bending:?}");
    }
}

/// Energy D b |C|^2 / (2 l^3): compliance l^3 / (D b), from the bimodulus warp and weft apart.
#[test]
fn bending_compliance_follows_the_material() {
    let passes = passes(PhysicsConfig {
        shear: false,
        bending_stiffness: BendingStiffness::Material,
        ..PhysicsConfig::default()
    });
    let l: f64 = 0.37 / 64.0;
    let mut stiffness: Vec<f64> = passes[2..]
        .iter()
        .flat_map(|pass| match pass {
            Pass::Triples(triples) => triples.iter(),
            _ => panic!("bending along the yarns is a pass over triples"),
        })
        .map(|t| l * l / t.compliance)
        .collect();
    stiffness.sort_by(f64::total_cmp);
    stiffness.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-9);
    // Weft and warp, each for yarns on the border and inside.
    for (found, expected) in stiffness.iter().zip([1.315e-5, 2.63e-5, 3.545e-5, 7.09e-5]) {
        assert!((found / expected - 1.0).abs() < 2e-3, "{stiffness:?}");
    }
    assert_eq!(stiffness.len(), 4);
}

#[test]
fn impossible_values_are_refused_with_key_found_and_expected() {
    let message = |change: fn(&mut PhysicsConfig)| {
        let mut physics = PhysicsConfig::default();
        change(&mut physics);
        physics.check().unwrap_err().to_string()
    };
    assert_eq!(
        message(|p| p.speed_cap = f64::NAN),
        "`physics.speed_cap` is NaN, expected 0 for none, or a number from 1e-6 to 1e6"
    );
    assert_eq!(
        message(|p| p.gravity = f64::INFINITY),
        "`physics.gravity` is inf, expected a finite number"
    );
    assert_eq!(
        message(|p| p.bending_stiffness = BendingStiffness::NewtonMetre(-1e-4)),
        "`physics.bending_stiffness` is -0.0001, expected a number >= 0"
    );
}
