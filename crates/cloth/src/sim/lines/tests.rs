use super::super::tests::standard_trellis;
use super::*;
use crate::fabric::{BlankConfig, Material};

fn plain() -> Lamina {
    Lamina::new(&BlankConfig::default(), Material::interglas_92125()).unwrap()
}

fn holed() -> Lamina {
    let config = BlankConfig {
        outline: Some(
            concat!(
                env!("CARGO_MANIFEST_DIR"),
                "/../../assets/outlines/plate-with-hole.csv"
            )
            .into(),
        ),
        cell_mm: Some(10.0),
        yarn_angle_deg: 20.0,
        ..BlankConfig::default()
    };
    Lamina::new(&config, Material::interglas_92125()).unwrap()
}

/// Warps hold every vertex once, and so do wefts; their edges number those of the yarns in
/// their order.
#[test]
fn each_family_holds_every_vertex_once() {
    for lamina in [plain(), holed()] {
        let lines = Lines::new(&lamina, &PhysicsConfig::default(), Some(standard_trellis()));
        for family in [&lines.warps, &lines.wefts] {
            let mut held: Vec<u32> = family.iter().flat_map(|l| l.vertices.clone()).collect();
            held.sort_unstable();
            let all: Vec<u32> = (0..lamina.vertex_count() as u32).collect();
            assert!(held == all);
        }
        let mut edges = 0;
        for (line, yarn) in lines
            .warps
            .iter()
            .chain(&lines.wefts)
            .filter(|line| line.vertices.len() > 1)
            .zip(&lamina.yarns)
        {
            assert_eq!(line.vertices, yarn.vertices);
            assert_eq!(line.edges, edges..edges + yarn.vertices.len() - 1);
            edges = line.edges.end;
        }
        assert_eq!(lines.edge_count, edges);
        let strains = lamina.yarn_strain(&vec![[0.0; 3]; lamina.vertex_count()]);
        assert!(lines.edge_count <= strains.len());
    }
    assert!(holed().membranes.len() > 20, "yarns end at a border");
    let alone = |line: &&Line| line.vertices.len() == 1;
    let lines = Lines::new(
        &holed(),
        &PhysicsConfig::default(),
        Some(standard_trellis()),
    );
    assert!(
        lines
            .warps
            .iter()
            .chain(&lines.wefts)
            .any(|line| alone(&line))
    );
}

/// Strung together, every diagonal is there once.
#[test]
fn rows_hold_every_diagonal_once() {
    for lamina in [plain(), holed()] {
        let lines = Lines::new(&lamina, &PhysicsConfig::default(), Some(standard_trellis()));
        let mut found: Vec<[u32; 2]> = Vec::new();
        for row in &lines.diagonals {
            assert!(row.vertices.len() > 1 && row.edges.is_empty());
            assert!(row.vertices.len() <= lines.longest);
            assert!((row.rest_length / lamina.cell_diagonal() - 1.0).abs() < 1e-12);
            found.extend(row.vertices.windows(2).map(|v| [v[0], v[1]]));
        }
        let mut expected: Vec<_> = lamina.diagonals.clone();
        found.sort_unstable();
        expected.sort_unstable();
        assert!(found == expected);
    }
    // Of 64 x 64 cells: 127 rows.
    let lines = Lines::new(
        &plain(),
        &PhysicsConfig::default(),
        Some(standard_trellis()),
    );
    assert_eq!(lines.diagonals.len(), 127);
}
