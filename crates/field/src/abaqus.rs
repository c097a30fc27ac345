use drape_cloth::math::Vec3;
use drape_task::path::inp::Deck;

use super::{Fibre, Field};

const MM: f64 = 1e3;

/// The field for Abaqus, in mm: mesh, both yarn directions and thickness of every element.
///
/// A local system of Abaqus is orthogonal: its first axis is the first direction of a distribution's line, the second only
/// says where its plane lies. Sheared yarns are no such system, so there are two orientations: WARP with the first axis
/// along the warp, and WEFT along the weft, for two layers of a composite shell section. Elements without fabric stand in
/// no line and not in the set FABRIC.
pub fn abaqus(field: &Field, remarks: &[String]) -> String {
    let mut deck = Deck::new("drape fibre field");
    deck.comment("written by drape; mm");
    for remark in remarks {
        deck.comment(remark);
    }
    let count = field.mesh.triangles.len();
    deck.nodes("NODES", 1, &field.mesh.vertices)
        .elements("S3", "ALL", 1..=count, 1, &field.mesh.triangles)
        .card("ELSET, ELSET=FABRIC")
        .labels(&field.elements().map(|(t, _)| t + 1).collect::<Vec<_>>());
    deck.card("DISTRIBUTION TABLE, NAME=DIRECTION_TABLE")
        .line("COORD3D, COORD3D");
    type Axes = fn(&Fibre) -> [Vec3; 2];
    let families: [(&str, Axes); 2] = [
        ("WARP", |fibre| [fibre.warp, fibre.weft]),
        // Minus the warp, so that the third axis stays on the same side.
        ("WEFT", |fibre| [fibre.weft, -fibre.warp]),
    ];
    for (name, axes) in families {
        deck.card(&format!(
            "DISTRIBUTION, NAME={name}_DIRECTIONS, LOCATION=ELEMENT, TABLE=DIRECTION_TABLE"
        ))
        .line(", 1., 0., 0., 0., 1., 0.");
        for (element, fibre) in field.elements() {
            let numbers = axes(fibre).map(|axis| axis.map(|x| x + 0.0));
            let numbers: Vec<String> = (numbers.iter().flatten())
                .map(|x| format!("{x:.9}"))
                .collect();
            deck.line(&format!("{}, {}", element + 1, numbers.join(", ")));
        }
        deck.card(&format!("ORIENTATION, NAME={name}, SYSTEM=RECTANGULAR"))
            .line(&format!("{name}_DIRECTIONS"))
            .line("3, 0.");
    }
    let thickness = MM * field.thickness;
    deck.card("DISTRIBUTION TABLE, NAME=THICKNESS_TABLE")
        .line("LENGTH")
        .card("DISTRIBUTION, NAME=THICKNESS, LOCATION=ELEMENT, TABLE=THICKNESS_TABLE")
        .line(&format!(", {thickness:.9}"));
    for (element, fibre) in field.elements() {
        let thickness = thickness * fibre.thickness_factor;
        deck.line(&format!("{}, {thickness:.9}", element + 1));
    }
    deck.text().into()
}
