use super::*;
use crate::mesh::{border, to_stl_bytes};

/// One of each kind.
pub fn all() -> [Shape; 9] {
    Shape::KINDS.map(|kind| toml::from_str(&format!("kind = \"{kind}\"")).unwrap())
}

#[test]
fn every_kind_is_listed() {
    let error = toml::from_str::<Shape>("kind = \"ball\"")
        .unwrap_err()
        .to_string();
    let quoted = Shape::KINDS.map(|kind| format!("`{kind}`"));
    assert!(
        error.contains(&format!("expected one of {}", quoted.join(", "))),
        "{error}"
    );
}

#[test]
fn every_shape_is_a_closed_ball_that_faces_outwards() {
    for shape in all() {
        let mesh = shape.mesh().unwrap();
        assert_eq!(border(&mesh), Ok(Vec::new()), "{shape:?}");
        // Euler's formula, V - E + F = 2; every edge has two triangles.
        let faces = mesh.triangles.len();
        assert_eq!(mesh.vertices.len() + faces, 2 + 3 * faces / 2, "{shape:?}");
        assert!(mesh.signed_volume() > 0.0, "{shape:?}");
        // Facets of the upper face face up, so no fold hides behind the volume.
        for t in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(t);
            let n = (b - a).cross(&(c - a));
            assert!(n.norm() > 0.0, "{shape:?} facet {t}");
            let is_bottom = n.normalize().z < -0.999;
            assert!(is_bottom || n.z > -1e-12, "{shape:?} facet {t}");
        }
    }
}

#[test]
fn rib_has_the_counts_and_heights_of_its_formula() {
    let mesh = Rib::default().mesh().unwrap();
    assert_eq!(mesh.vertices.len(), 4575);
    assert_eq!(mesh.triangles.len(), 9146);
    let (low, high) = mesh.bounds();
    assert!((low - Vec3::new(-0.24, -0.22, -0.02)).norm() < 1e-15);
    // The rows nearest to the crest lie at y = ±4 mm; 77 columns have one at x = 0.
    assert!((high.z - 0.06 * (1.0_f64 - 0.0016).powi(3)).abs() < 1e-12);
    let at_the_end = |v: &&Vec3| v.x == 0.24 && (v.y - 0.004).abs() < 1e-9;
    let end = mesh.vertices.iter().find(at_the_end).unwrap();
    assert!((end.z - 0.5 * high.z).abs() < 1e-12);
}

#[test]
fn volumes_approach_the_closed_forms() {
    let slab = |plate_mm: [f64; 2], base_mm: f64| plate_mm[0] * plate_mm[1] * base_mm * 1e-9;
    let close = |mesh: TriMesh, exact: f64, share: f64| {
        let found = mesh.signed_volume();
        assert!((found / exact - 1.0).abs() < share, "{found} for {exact}");
    };
    let shape = Hemisphere::default();
    let dome = 2.0 / 3.0 * PI * 0.075_f64.powi(3);
    close(
        shape.mesh().unwrap(),
        dome + slab(shape.plate_mm, 20.0),
        1e-3,
    );
    let shape = Cylinder::default();
    let half = 0.5 * PI * 0.1_f64.powi(2) * 0.4;
    close(
        shape.mesh().unwrap(),
        half + slab([400.0, 200.0], 20.0),
        1e-3,
    );
    let shape = Plate::default();
    close(shape.mesh().unwrap(), slab(shape.plate_mm, 20.0), 1e-12);
    // What a flank of the third power takes: 32/35 of its half-width times its depth.
    let shape = Trough::default();
    let groove = 32.0 / 35.0 * 0.1 * 0.04 * 0.4;
    close(
        shape.mesh().unwrap(),
        slab(shape.plate_mm, 60.0) - groove,
        1e-3,
    );
    // What two sides rise the others fall.
    let shape = Saddle::default();
    close(shape.mesh().unwrap(), slab(shape.plate_mm, 60.0), 1e-3);
    let shape = DoubleDome {
        waist_radius_mm: 60.0,
        ..DoubleDome::default()
    };
    let capsule = 2.0 / 3.0 * PI * 0.06_f64.powi(3) + 0.5 * PI * 0.06_f64.powi(2) * 0.14;
    close(
        shape.mesh().unwrap(),
        capsule + slab(shape.plate_mm, 20.0),
        1e-3,
    );
}

#[test]
fn hills_repeat_under_a_seed_and_lie_within_their_height() {
    let of = |seed| {
        let shape = Hills {
            seed,
            hill_count: 1,
            ..Hills::default()
        };
        shape.mesh().unwrap()
    };
    assert!(of(3).vertices == of(3).vertices && of(3).vertices != of(4).vertices);
    for seed in 0..20 {
        let (low, high) = of(seed).bounds();
        // One hill rises or falls, and nothing else does; far from it the plate lies at 0.
        assert!(high.z <= 0.06 && low.z >= -0.04, "{seed}: {low} {high}");
        assert!(high.z.abs() < 1e-3 || (low.z + 0.02).abs() < 1e-3, "{seed}");
    }
}

#[test]
fn incline_falls_by_its_angle() {
    let mesh = Incline::default().mesh().unwrap();
    let [a, b, c] = mesh.corners(0);
    let n = (b - a).cross(&(c - a)).normalize();
    let angle = 20.0_f64.to_radians();
    assert!((n - Vec3::new(angle.sin(), 0.0, angle.cos())).norm() < 1e-12);
}

#[test]
fn committed_rib_is_the_default_rib() {
    let bytes = to_stl_bytes(&Shape::default().mesh().unwrap(), "rib");
    assert!(bytes == include_bytes!("../../../../../assets/rib.stl"));
}

#[test]
fn senseless_values_name_their_key() {
    let rib = Rib {
        half_width_mm: 300.0,
        ..Rib::default()
    };
    assert_eq!(
        Shape::Rib(rib).mesh().unwrap_err().to_string(),
        "`half_width_mm` is 300, expected between 0 and 220"
    );
    let rib = Rib {
        height_mm: f64::NAN,
        ..Rib::default()
    };
    assert_eq!(
        Shape::Rib(rib).mesh().unwrap_err().to_string(),
        "`height_mm` is NaN, expected above 0 and at most 10000"
    );
    let dome = Hemisphere {
        segment_count: 30,
        ..Hemisphere::default()
    };
    assert_eq!(
        Shape::Hemisphere(dome).mesh().unwrap_err().to_string(),
        "`segment_count` is 30, expected a multiple of 4"
    );
    let rib = Rib {
        vertex_counts: [77, usize::MAX],
        ..Rib::default()
    };
    assert_eq!(Shape::Rib(rib).mesh().unwrap_err().key, "vertex_counts");
}

#[test]
fn unknown_keys_are_refused_and_missing_ones_default() {
    let shape: Shape = toml::from_str("kind = \"double-dome\"\nradius_mm = 50").unwrap();
    assert_eq!(
        shape,
        Shape::DoubleDome(DoubleDome {
            radius_mm: 50.0,
            ..DoubleDome::default()
        })
    );
    let error = toml::from_str::<Shape>("kind = \"rib\"\nheigth_mm = 50").unwrap_err();
    assert!(error.message().contains("heigth_mm"), "{error}");
}
