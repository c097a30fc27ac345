use super::hdf5::{Attribute, Data, Node};
use super::{Fibre, Field};
use drape_cloth::math::Vec3;

/// The field in the layout of HDF5 Composite CAE, in metres: one mesh of the elements that have fabric, and one component
/// with their data map.
///
/// Angles of warp and weft count from `reference_directions`, the first side of each element, about `normals`; `thicknesses`
/// are those of the sheared fabric. Both yarn directions, shear and surplus stand beside them, under the names that other
/// formats of drape have for them.
pub fn composite_cae(field: &Field, remarks: &[String]) -> Vec<u8> {
    let vector = |of: &dyn Fn(usize, &Fibre) -> Vec3| {
        let rows = field.elements().map(|(t, fibre)| of(t, fibre));
        let rows: Vec<f64> = rows.flat_map(|v| [v.x, v.y, v.z]).collect();
        Node::Array(vec![rows.len() / 3, 3], Data::Floats(rows))
    };
    let number = |of: &dyn Fn(usize, &Fibre) -> f64| {
        let rows: Vec<f64> = field.elements().map(|(t, fibre)| of(t, fibre)).collect();
        Node::Array(vec![rows.len()], Data::Floats(rows))
    };
    let data_map = Node::group([
        (
            "matorient_0_angles",
            number(&|t, f| field.angle_deg(t, &f.warp)),
        ),
        (
            "matorient_90_angles",
            number(&|t, f| field.angle_deg(t, &f.weft)),
        ),
        ("normals", vector(&|t, _| field.axes(t)[1])),
        ("reference_directions", vector(&|t, _| field.axes(t)[0])),
        ("shear_deg", number(&|_, f| f.shear_deg)),
        ("surplus_m", number(&|_, f| f.surplus)),
        ("thickness_factor", number(&|_, f| f.thickness_factor)),
        (
            "thicknesses",
            number(&|_, f| field.thickness * f.thickness_factor),
        ),
        ("warp", vector(&|_, f| f.warp)),
        ("weft", vector(&|_, f| f.weft)),
    ]);
    let nodes: Vec<f64> = (field.mesh.vertices.iter())
        .flat_map(|v| [v.x, v.y, v.z])
        .collect();
    let corners = field.elements().flat_map(|(t, _)| field.mesh.triangles[t]);
    let corners: Vec<i32> = corners.map(|v| v as i32).collect();
    let numbers: Vec<i32> = field.elements().map(|(t, _)| t as i32 + 1).collect();
    let mesh = Node::group([
        (
            "element_nodes",
            Node::Array(vec![corners.len() / 3, 3], Data::Integers(corners)),
        ),
        (
            "element_numbers",
            Node::Array(vec![numbers.len()], Data::Integers(numbers)),
        ),
        (
            "nodes",
            Node::Array(vec![nodes.len() / 3, 3], Data::Floats(nodes)),
        ),
    ])
    .with("TITLE", Attribute::Text("fabric".into()));
    let component = Node::group([("data_map", data_map)])
        .with("TITLE", Attribute::Text("fabric".into()))
        .with("layer_id", Attribute::Integer(1))
        .with(
            "mesh",
            Attribute::Text("/composite_cae/meshes/fabric".into()),
        )
        .with("orientation", Attribute::Float(0.0));
    let cae = Node::group([
        ("components", Node::group([("fabric", component)])),
        ("meshes", Node::group([("fabric", mesh)])),
    ])
    .with("format_version", Attribute::Text("1.0".into()))
    .with("length_unit", Attribute::Text("m".into()))
    .with("remarks", Attribute::Text(remarks.join("\n")))
    .with("unit_system", Attribute::Text("SI".into()))
    .with("vendor", Attribute::Text("drape".into()));
    Node::group([("composite_cae", cae)]).file()
}
