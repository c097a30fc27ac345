use super::*;
use drape_cloth::tool::Pose;

fn fabric() -> FabricCard {
    FabricCard {
        thickness: 0.35e-3,
        areal_mass: 0.28,
        tension: [
            vec![[0.0, 0.0], [0.005, 3.0], [0.02, 40.0]],
            vec![[0.0, 0.0], [0.006, 5.0], [0.025, 60.0]],
        ],
        compression: [
            vec![[0.0, 0.0], [0.02, 0.12]],
            vec![[0.0, 0.0], [0.02, 0.0405]],
        ],
        shear: [
            vec![[0.0, 0.0], [0.1, 0.005]],
            vec![[0.0, 0.0], [0.1, 0.0036]],
        ],
        bending: [7.09e-5, 2.63e-5],
        friction: [0.28, 0.25],
    }
}

fn square(z: f64) -> TriMesh {
    TriMesh {
        vertices: [[0.0, 0.0], [0.01, 0.0], [0.01, 0.01], [0.0, 0.01]]
            .map(|[x, y]| Vec3::new(x, y, z))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}

fn text(dialect: Dialect, presses: &[Vec<u32>]) -> String {
    woven(dialect, presses, [[Vec3::x(), Vec3::y()]; 2])
}

fn woven(dialect: Dialect, presses: &[Vec<u32>], yarns: [[Vec3; 2]; 2]) -> String {
    let (lamina, tool) = (square(0.001), square(0.0));
    let deck = DrapingDeck {
        title: "test",
        lamina: &lamina,
        yarns: &yarns,
        clamped: &[(3, Vec3::new(0.0, 0.002, 0.0))],
        tool: &tool,
        fabric: &fabric(),
        presses,
        step_s: 0.1,
        pressure: 1e6,
        gravity: 1.5,
        frame: Frame::tool(&Pose::default()),
    }
    .deck(dialect);
    deck.text().into()
}

/// E h and E h^3 / 12 of the elastic shell against Table 2.
#[test]
fn elastic_shell_has_the_stiffness_of_the_fabric() {
    let h = 1e-3 * fabric().elastic_thickness();
    let bending = [600e6, 833.333e6].map(|e| e * 0.35e-3 * h * h / 12.0);
    let mean = (bending[0] * bending[1]).sqrt();
    assert!((mean / (7.09e-5f64 * 2.63e-5).sqrt() - 1.0).abs() < 1e-5);
    // Each is wrong by less than two; with the fabric's own thickness it would be 30 and 113.
    for (found, expected) in bending.into_iter().zip([7.09e-5, 2.63e-5]) {
        assert!((0.5..2.0).contains(&(found / expected)), "{found}");
    }
}

#[test]
fn triangles_are_pressed_once_and_stay_pressed() {
    let presses = [vec![1], vec![1], vec![0, 1], vec![]];
    let abaqus = text(Dialect::Abaqus, &presses);
    assert!(abaqus.contains("*ELSET, ELSET=PRESS_1\n2\n*ELSET, ELSET=PRESS_2\n1\n"));
    assert_eq!(abaqus.matches("*STEP").count(), 3);
    assert_eq!(abaqus.matches("*END STEP").count(), 3);
    // Both triangles are one cell.
    let text = text(Dialect::Calculix, &presses);
    assert!(text.contains("*ELSET, ELSET=PRESS_1\n1\n") && !text.contains("PRESS_2"));
    assert_eq!(text.matches("*STEP").count(), 1);
    assert!(text.contains("*AMPLITUDE, NAME=LOAD_1\n1., 0., 2., 1.\n"));
    assert!(text.contains("*DLOAD, AMPLITUDE=LOAD_1\nPRESS_1, P, -1.00000000e0\n"));
    let clamp = "*BOUNDARY, AMPLITUDE=LOAD_0\n4, 1, 1, 0.00000000e0\n4, 2, 2, 2.00000000e0\n";
    assert!(text.contains(clamp), "{text}");
    assert!(text.contains("*NSET, NSET=CLAMPS\n4\n"));
    assert!(
        text.contains("\nLAMINA, GRAV, 1.50000000e3, 0.00000000e0, 0.00000000e0, -1.00000000e0\n"),
        "{text}"
    );
    // Tool after lamina: four vertices and four sides, then four nodes above and below.
    assert!(text.contains("TYPE=S8R, ELSET=LAMINA\n1, 1, 2, 3, 4, 5, 6, 7, 8\n"));
    assert!(text.contains("ELSET=TOOL\n3, 13, 14, 15, 9, 10, 11\n"));
}

#[test]
fn abaqus_has_the_test_data_from_compression_to_tension() {
    let text = text(Dialect::Abaqus, &[]);
    let warp = "*UNIAXIAL, COMPONENT=1\n*LOADING DATA, EXTRAPOLATION=LINEAR\n\
                -1.20000000e-1, -2.00000000e-2\n0.00000000e0, 0.00000000e0\n\
                3.00000000e0, 5.00000000e-3\n4.00000000e1, 2.00000000e-2\n\
                *UNIAXIAL, COMPONENT=2\n";
    assert!(text.contains(warp), "{text}");
    assert!(text.contains("*ELEMENT, TYPE=R3D3, ELSET=TOOL"));
    // 280 g/m^2 over 0.35 mm are 800 kg/m^3.
    assert!(text.contains("*DENSITY\n8.00000000e-10\n"));
}

/// A cell whose second half is sheared by 30 degrees: its axes are orthogonal, and its weft lies between them at 60.
#[test]
fn sheared_yarns_keep_both_directions() {
    let weft = Vec3::new(0.5, 0.75f64.sqrt(), 0.0);
    let text = woven(
        Dialect::Abaqus,
        &[],
        [[Vec3::x(), Vec3::y()], [Vec3::x(), weft]],
    );
    for (degrees, element, weft) in [(90, 1, "0.000000, 1.000000"), (60, 2, "0.500000, 0.866025")] {
        let orientation = format!(
            "*ELSET, ELSET=YARNS_{degrees}\n{element}\n\
             *ORIENTATION, NAME=YARNS_{degrees}, SYSTEM=RECTANGULAR, LOCAL DIRECTIONS=2\n\
             YARN_DIRECTIONS\n3, 0.\n1., 0., 0.\n{weft}, 0.\n"
        );
        assert!(text.contains(&orientation), "{text}");
        let section = format!(
            "*SHELL SECTION, ELSET=YARNS_{degrees}, MATERIAL=FABRIC, ORIENTATION=YARNS_{degrees}\n"
        );
        assert_eq!(text.matches(&section).count(), 1, "{text}");
    }
    assert_eq!(text.matches("*ORIENTATION").count(), 2);
}
