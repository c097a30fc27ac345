use super::*;
use drape_cloth::fabric::{BlankConfig, Lamina, Material};

fn lamina(vertices: [usize; 2]) -> Lamina {
    let config = BlankConfig {
        size_mm: [200.0, 200.0],
        vertices,
        ..BlankConfig::default()
    };
    Lamina::new(&config, Material::interglas_92125()).unwrap()
}

fn draped(vertices: [usize; 2], place: impl Fn(f64, f64) -> [f64; 3]) -> Surveyed {
    let lamina = lamina(vertices);
    let position: Vec<_> = lamina.rest.iter().map(|&[x, y]| place(x, y)).collect();
    Surveyed::draped(Drape::new(&lamina, &position)).unwrap()
}

/// z = 0.
fn plate() -> Surface {
    let plate = TriMesh {
        vertices: [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| Vec3::new(x, y, 0.0))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    Surface::new(&plate).unwrap()
}

fn close(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-9, "{found} is not {expected}");
}

/// Surface distance ignores sliding, the material points do not; meshes may differ.
#[test]
fn sliding_shows_at_the_material_points_only() {
    let flat = draped([11, 11], |x, y| [x, y, 0.0]);
    let slid = draped([8, 16], |x, y| [x + 0.003, y - 0.004, 0.001]);
    let found = compare(&slid, &flat, &Criteria::default());
    let topology = found.all.topology_a_to_b_mm.unwrap();
    close(topology.mean, 1.0);
    close(topology.p95, 1.0);
    let points = found.all.material_points_mm.unwrap();
    let expected = 26f64.sqrt();
    close(points.mean, expected);
    close(points.max, expected);
    close(found.all.topology_b_to_a_mm.unwrap().mean, -1.0);
    // The corner that sticks out farthest.
    close(found.all.hausdorff_mm.unwrap(), expected);
    let [a, b] = found.all.beyond_border_share;
    assert!(a > 0.0 && a < 0.2 && b > 0.0 && b < 0.2, "{a} {b}");
    let [warp, weft] = found.all.fibre_angle_deg.unwrap();
    for angles in [warp, weft] {
        close(angles.share_below, 1.0);
        assert!(angles.spread.max < 1e-6);
    }
    close(found.a.shear_deg.unwrap().spread.rms, 0.0);
    // All of both tools' metrics need a tool.
    assert_eq!(found.a.tool, None);
    let metrics: Vec<_> = found
        .not_applicable
        .iter()
        .map(|n| &n.metrics[..])
        .collect();
    assert_eq!(metrics, [["tool"]]);
}

/// Half of the blank is turned by 10 degrees and lifted: inside and outside tell them apart.
#[test]
fn region_divides_the_deviations() {
    let flat = draped([21, 21], |x, y| [x, y, 0.0]);
    let (sin, cos) = 10f64.to_radians().sin_cos();
    let region = Some([0.001, -0.2, 0.2, 0.2]);
    let bent = draped([21, 21], |x, y| {
        if x > 0.0 {
            [cos * x - sin * y, sin * x + cos * y, 0.002]
        } else {
            [x, y, 0.0]
        }
    });
    let criteria = Criteria {
        region,
        ..Criteria::default()
    };
    let found = compare(&bent, &flat, &criteria);
    let (inside, outside) = (found.inside.unwrap(), found.outside.unwrap());
    close(inside.topology_a_to_b_mm.unwrap().min, 2.0);
    close(outside.topology_a_to_b_mm.unwrap().max, 0.0);
    close(outside.material_points_mm.unwrap().max, 0.0);
    let angles = inside.fibre_angle_deg.unwrap();
    // One column of triangles joins the halves; the region begins in it.
    assert!(angles[1].share_below < 0.11, "{angles:?}");
    assert!((angles[1].spread.p95 - 10.0).abs() < 0.2, "{angles:?}");
    let [warp, _] = outside.fibre_angle_deg.unwrap();
    assert!(warp.share_below > 0.9, "{warp:?}");
    let [all, _] = found.all.fibre_angle_deg.unwrap();
    assert!((all.share_below - 0.5).abs() < 0.06, "{all:?}");
}

#[test]
fn locked_area_strain_and_bridging_are_those_made() {
    // A trellis of 50 degrees in the upper half, 2 % longer along the warp.
    let (sin, cos) = 50f64.to_radians().sin_cos();
    let sheared = draped([11, 11], |x, y| {
        let up = y.max(0.0);
        [1.02 * x + sin * up, y.min(0.0) + cos * up, 0.0003]
    });
    let tool = plate();
    let criteria = Criteria {
        tool: Some(&tool),
        ..Criteria::default()
    };
    let found = compare(&sheared, &sheared, &criteria);
    close(found.a.shear_deg.unwrap().locked_area_mm2, 20_000.0);
    close(found.a.shear_deg.unwrap().spread.max, 50.0);
    let strain = found.a.strain.unwrap();
    close(strain.tension_max, 0.02);
    close(strain.p95, 0.02);
    assert!(strain.compression_max < 1e-9);
    close(found.a.tool.unwrap().bridged_area_mm2, 0.0);
    close(found.a.tool.unwrap().penetration_mm, 0.0);
    assert_eq!(found.a, found.b);
    assert!(found.not_applicable.is_empty());

    let lower = draped([11, 11], |x, y| {
        [x, y, if y > 1e-9 { 0.001 } else { -0.002 }]
    });
    let tooling = compare(&lower, &sheared, &criteria).a.tool.unwrap();
    close(tooling.penetration_mm, 2.0);
    assert!((tooling.bridged_share - 0.5).abs() < 0.06);
}

/// A sheet crushed by a tenth along its warps on one side: 10 mm of each of 11 of 22 yarns, and of
/// 11 of 17 in a region around that side.
#[test]
fn surplus_is_of_the_yarns_in_the_region() {
    let tool = plate();
    let crushed = draped([11, 11], |x, y| [if x < 0.0 { 0.9 * x } else { x }, y, 0.0]);
    for (region, exact) in [
        (None, 10.0 * 11.0 / 22.0),
        (Some([-0.11, -0.11, 0.001, 0.11]), 10.0 * 11.0 / 17.0),
    ] {
        let criteria = Criteria {
            tool: Some(&tool),
            region,
        };
        let found = compare(&crushed, &crushed, &criteria).a.tool.unwrap();
        close(found.surplus_mm.unwrap(), exact);
    }
    let scan = Surveyed::scan(crushed.mesh.clone()).unwrap();
    let criteria = |region| Criteria {
        tool: Some(&tool),
        region,
    };
    // Between the vertices there is no edge.
    let between = criteria(Some([0.001, 0.001, 0.019, 0.019]));
    for (surface, criteria) in [(&scan, criteria(None)), (&crushed, between)] {
        let found = compare(surface, surface, &criteria);
        assert_eq!(found.a.tool.unwrap().surplus_mm, None);
        let last = found.not_applicable.last().unwrap();
        assert_eq!(last.metrics, ["surplus_mm"]);
    }
}

/// A mesh alone has no yarns: its figures are none, and the reason is given.
#[test]
fn scans_say_what_cannot_be_measured() {
    let flat = draped([11, 11], |x, y| [x, y, 0.0]);
    let mut mesh = draped([5, 5], |x, y| [x, y, 0.01]).mesh;
    mesh.flip();
    let scan = Surveyed::scan(mesh).unwrap();
    let criteria = Criteria {
        region: Some([0.0, 0.0, 0.1, 0.1]),
        ..Criteria::default()
    };
    let found = compare(&scan, &flat, &criteria);
    close(found.all.topology_a_to_b_mm.unwrap().mean, 10.0);
    // Turned over, it looks up again.
    close(found.all.topology_b_to_a_mm.unwrap().mean, -10.0);
    assert_eq!(found.all.material_points_mm, None);
    assert_eq!(found.all.fibre_angle_deg, None);
    assert_eq!((found.inside, found.outside), (None, None));
    assert!(found.a.strain.is_none() && found.b.strain.is_some());
    assert_eq!(found.not_applicable.len(), 4);
    let why = &found.not_applicable[0].why;
    assert_eq!(why, "no material coordinates: A is a mesh only");
}
