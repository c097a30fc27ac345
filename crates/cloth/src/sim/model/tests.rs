use super::super::law::LIMITED;
use super::super::line::Line;
use super::super::physics::{Bending, BendingStiffness, Tension};
use super::*;
use crate::fabric::{BlankConfig, Curve, Material};

fn model(physics: PhysicsConfig) -> Model {
    let blank = BlankConfig::default();
    let lamina = Lamina::new(&blank, Material::interglas_92125()).unwrap();
    Model::new(&lamina, &physics)
}

fn lines(physics: PhysicsConfig) -> Lines {
    model(physics).lines.unwrap()
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
    let lines = lines(PhysicsConfig::default());
    assert_eq!((lines.warps.len(), lines.wefts.len()), (65, 65));
    for (yarns, tension, compression) in [
        (lines.warps, 4.762e-6, 4.762e-4),
        (lines.wefts, 3.429e-6, 1.411e-3),
    ] {
        close(yarns[30].law.tension, tension);
        close(yarns[30].law.compression, compression);
        for border in [0, 64] {
            close(yarns[border].law.tension, 2.0 * tension);
        }
    }
}

/// The second slope of Table 2 begins at its knee, where the law is continuous; a strain limit
/// takes its place, and without both there is nothing.
#[test]
fn knee_and_limit_are_branches_of_a_yarn() {
    let material = PhysicsConfig {
        tension: Some(Tension::Material),
        ..PhysicsConfig::default()
    };
    let lines = lines(material.clone());
    let rest = lines.warps[30].rest_length;
    // Force of an edge: MPa times thickness and width, at the knee and at the end of the curve.
    for (yarn, knee, end) in [
        (&lines.warps[30], [0.005, 3.0], [0.02, 40.0]),
        (&lines.wefts[30], [0.006, 5.0], [0.025, 60.0]),
    ] {
        let limit = yarn.limit.unwrap();
        close(limit.force, knee[1] * 350.0 * rest);
        for [strain, stress] in [knee, end] {
            let stretch = limit.offset + limit.compliance * stress * 350.0 * rest;
            close(stretch, strain * rest);
        }
    }
    let strain_limit = Some(0.01);
    let limited = self::lines(PhysicsConfig {
        strain_limit,
        ..material
    });
    let line = &limited.warps[30];
    close(line.limit.unwrap().force, 0.01 * rest / line.law.tension);
    close(line.limit.unwrap().compliance, LIMITED * line.law.tension);
    let plain = self::lines(PhysicsConfig::default());
    assert!(
        plain
            .warps
            .iter()
            .chain(&plain.wefts)
            .all(|l| l.limit.is_none())
    );
    let by_edge = |solver, tension, strain_limit| {
        let passes = model(PhysicsConfig {
            solver,
            tension: Some(tension),
            strain_limit,
            ..PhysicsConfig::default()
        })
        .passes;
        let limited = |pass: &&Pass| matches!(pass, Pass::Edges(_, limits) if !limits.is_empty());
        passes.iter().filter(limited).count()
    };
    let solver = Solver::GaussSeidel;
    assert_eq!(by_edge(solver, Tension::FirstBranch, None), 0);
    assert_eq!(by_edge(solver, Tension::FirstBranch, strain_limit), 4);
    assert_eq!(by_edge(solver, Tension::Material, None), 4);
}

/// Near rest, a spring of 2 G h along the diagonal: 35 N/m for +45 degrees, 25.2 N/m for -45.
#[test]
fn diagonals_at_rest_have_twice_the_shear_stiffness() {
    let rows = lines(PhysicsConfig::default()).diagonals;
    let in_rows = rows.iter().map(|row| (row.law, row.vertices.len() - 1));
    let coloured = model(PhysicsConfig {
        bending: Bending::Off,
        solver: Solver::GaussSeidel,
        ..PhysicsConfig::default()
    });
    // Yarns are the passes before, two colours of each family.
    let passes = coloured.passes[4..].iter().map(|pass| match pass {
        Pass::Diagonals(class, _) => class,
        _ => panic!("shear is a pass over diagonals"),
    });
    let in_passes = passes.flat_map(|class| class.law.iter().map(|law| (*law, 1)));
    for springs in [in_rows.collect::<Vec<_>>(), in_passes.collect()] {
        for (law, _) in &springs {
            close(1.0 / law.tension, 35.0);
            close(1.0 / law.compression, 25.2);
        }
        assert_eq!(springs.iter().map(|s| s.1).sum::<usize>(), 64 * 64);
    }
}

/// What a scene does not list costs no pass, no row and no arithmetic along the yarns.
#[test]
fn passes_and_lines_are_those_that_were_asked_for() {
    let bare = PhysicsConfig {
        shear: false,
        bending: Bending::Off,
        ..PhysicsConfig::default()
    };
    let limp = |bending| PhysicsConfig {
        bending,
        bending_stiffness: BendingStiffness::NewtonMetre(0.0),
        ..bare.clone()
    };
    let straight = |line: &Line| line.bending == 0.0;
    for physics in [bare.clone(), limp(Bending::Yarns), limp(Bending::Dihedral)] {
        let model = model(physics.clone());
        let lines = model.lines.unwrap();
        assert!(model.passes.is_empty() && lines.diagonals.is_empty());
        assert!(lines.warps.iter().chain(&lines.wefts).all(straight));
        assert!(model.layers.is_none());
        // The edges of warps and wefts by Gauss-Seidel: two colours each, and nothing along lines.
        let model = self::model(PhysicsConfig {
            solver: Solver::GaussSeidel,
            ..physics
        });
        assert!(model.lines.is_none());
        assert_eq!(model.passes.len(), 4);
    }
    // All that the default lists is in its lines; dihedral bending is passes.
    let whole = model(PhysicsConfig::default());
    assert!(whole.passes.is_empty());
    let whole = whole.lines.unwrap();
    assert!(whole.locking.is_none());
    assert!(!whole.warps.iter().chain(&whole.wefts).any(straight));
    let dihedral = model(PhysicsConfig {
        bending: Bending::Dihedral,
        ..PhysicsConfig::default()
    });
    let hinges = |pass: &Pass| matches!(pass, Pass::Hinges(_));
    assert!(!dihedral.passes.is_empty() && dihedral.passes.iter().all(hinges));
    let lines = dihedral.lines.unwrap();
    assert!(lines.warps.iter().chain(&lines.wefts).all(straight));
}

/// Whatever runs in one pass shares no vertex, and all passes together hold everything once.
#[test]
fn passes_hold_everything_once_without_conflict() {
    let yarn_edges = 2 * 65 * 64;
    let triples = 2 * 65 * 63;
    let hinges = (3 * 8192 - 4 * 64) / 2;
    for (solver, bending, expected) in [
        (Solver::Yarn, Bending::Yarns, 0),
        (Solver::Yarn, Bending::Dihedral, hinges),
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
        let passes = model(PhysicsConfig {
            solver,
            bending,
            ..PhysicsConfig::default()
        })
        .passes;
        let mut count = 0;
        for pass in &passes {
            let members: Vec<Vec<u32>> = match pass {
                Pass::Edges(class, _)
                | Pass::Diagonals(class, _)
                | Pass::CurvedDiagonals(class, _)
                | Pass::LockingDiagonals(class, _) => {
                    class.vertices.iter().map(|v| v.to_vec()).collect()
                }
                Pass::Triples(triples) => triples.iter().map(|t| t.vertices.to_vec()).collect(),
                Pass::Hinges(hinges) => hinges.iter().map(|h| h.vertices.to_vec()).collect(),
                Pass::Membrane(elements)
                | Pass::CurvedMembrane(elements, _)
                | Pass::LockingMembrane(elements, _) => {
                    elements.iter().map(|e| e.vertices.to_vec()).collect()
                }
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

/// Energy k |C|^2 / 2 with k = D b / l^3, from the bimodulus warp and weft apart; the coloured
/// passes have the same.
#[test]
fn bending_stiffness_follows_the_material() {
    let physics = PhysicsConfig {
        shear: false,
        bending_stiffness: BendingStiffness::Material,
        ..PhysicsConfig::default()
    };
    let l: f64 = 0.37 / 64.0;
    let lines = lines(physics.clone());
    for (yarns, inside) in [(&lines.warps, 7.09e-5), (&lines.wefts, 2.63e-5)] {
        for (yarn, expected) in [(0, 0.5 * inside), (30, inside), (64, 0.5 * inside)] {
            let found = yarns[yarn].bending * l * l;
            assert!((found / expected - 1.0).abs() < 2e-3, "{found}");
        }
    }
    let coloured = model(PhysicsConfig {
        solver: Solver::GaussSeidel,
        ..physics
    });
    let along = lines.warps.iter().chain(&lines.wefts);
    let mut expected: Vec<f64> = along
        .flat_map(|line| vec![line.bending; line.vertices.len() - 2])
        .collect();
    let triples = coloured.passes.iter().flat_map(|pass| match pass {
        Pass::Triples(triples) => triples.clone(),
        _ => Vec::new(),
    });
    let mut found: Vec<f64> = triples.map(|triple| 1.0 / triple.compliance).collect();
    expected.sort_by(f64::total_cmp);
    found.sort_by(f64::total_cmp);
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found / expected - 1.0).abs() < 1e-12);
    }
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
        "`physics.speed_cap` is NaN, expected 0 for none, or a number from 0.05 to 1e6"
    );
    assert_eq!(
        message(|p| (p.shear, p.shear_locking) = (false, true)),
        "`physics.shear_locking` is true, expected false where `physics.shear` is false"
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

/// Of tension curves other than the built-in material's no slope goes unused without a word.
#[test]
fn slopes_of_tension_are_used_or_refused() {
    let mut material = Material::interglas_92125();
    let check = |material: &Material, tension| {
        let lamina = Lamina::new(&BlankConfig::default(), material.clone()).unwrap();
        let physics = PhysicsConfig {
            tension,
            ..PhysicsConfig::default()
        };
        let checked = physics.check_for(&lamina);
        checked.map_or_else(|error| error.to_string(), |()| String::new())
    };
    assert_eq!(check(&material, None), "");
    let points = [[0.0, 0.0], [0.01, 1.0], [0.02, 5.0], [0.03, 20.0]];
    material.weft.tension = Curve::new(points[..3].to_vec());
    assert_eq!(check(&material, Some(Tension::Material)), "");
    material.weft.tension = Curve::new(points.to_vec());
    for (tension, expected) in [
        (Some(Tension::FirstBranch), ""),
        (
            Some(Tension::Material),
            "`physics.tension` is material, expected first_branch where `weft.tension` has 3 slopes",
        ),
        (
            None,
            "`physics.tension` is not given, expected first_branch or material (two slopes) where \
             `weft.tension` has 3 slopes",
        ),
    ] {
        assert_eq!(check(&material, tension), expected);
    }
}
