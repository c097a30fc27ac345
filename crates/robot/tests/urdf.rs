//! Descriptions of arms: those that are right, those that are not, and noise.

use std::path::Path;

use drape_robot::{Arm, InverseSolver};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The CRB 15000 with boxes for links and a camera beside the flange.
const CRB: &str = r#"<?xml version="1.0"?>
<robot name="crb">
  <link name="world"/>
  <link name="base"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
  <link name="a"/><link name="b"/><link name="c"/><link name="d"/><link name="e"/><link name="f"/>
  <link name="flange"/><link name="tool0"/><link name="camera"/>
  <joint name="w" type="fixed"><parent link="world"/><child link="base"/></joint>
  <joint name="j1" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0 0 0.265"/>
    <axis xyz="0 0 1"/><limit lower="-3.14159265358979" upper="3.14159265358979" velocity="2.18166156499291"/></joint>
  <joint name="j2" type="revolute"><parent link="a"/><child link="b"/>
    <axis xyz="0 1 0"/><limit lower="-3.14159265358979" upper="3.14159265358979" velocity="2.18166156499291"/></joint>
  <joint name="j3" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0 0 0.444"/>
    <axis xyz="0 1 0"/><limit lower="-3.92699081698724" upper="1.48352986419518" velocity="2.4434609527920612"/></joint>
  <joint name="j4" type="revolute"><parent link="c"/><child link="d"/><origin xyz="0 0 0.11"/>
    <axis xyz="1 0 0"/><limit lower="-3.14159265358979" upper="3.14159265358979" velocity="3.490658503988659"/></joint>
  <joint name="j5" type="revolute"><parent link="d"/><child link="e"/><origin xyz="0.47 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-3.14159265358979" upper="3.14159265358979" velocity="3.490658503988659"/></joint>
  <joint name="j6" type="revolute"><parent link="e"/><child link="f"/><origin xyz="0.101 0 0.08"/>
    <axis xyz="2 0 0"/><limit lower="-3.14159265358979" upper="3.14159265358979" velocity="3.490658503988659"/></joint>
  <joint name="k" type="fixed"><parent link="f"/><child link="flange"/></joint>
  <joint name="t" type="fixed"><parent link="flange"/><child link="tool0"/><origin rpy="0 1.5707963267948966 0"/></joint>
  <joint name="v" type="fixed"><parent link="f"/><child link="camera"/></joint>
</robot>
"#;

fn read(text: &str) -> Result<Arm, String> {
    Arm::from_urdf(text, Path::new("arm.urdf")).map_err(|error| error.to_string())
}

#[test]
fn a_description_is_the_arm_that_it_describes() {
    let (read, shipped) = (read(CRB).unwrap(), Arm::shipped("crb15000-5").unwrap());
    let joints = [0.3, -0.5, 0.2, 1.0, -0.7, 2.0];
    let [a, b] = [&read, &shipped].map(|arm| arm.flange_at(&joints));
    assert!((a.to_homogeneous() - b.to_homogeneous()).norm() < 1e-12);
    for (a, b) in read.joints.iter().zip(&shipped.joints) {
        assert!((0..2).all(|k| (a.limits[k] - b.limits[k]).abs() < 1e-9));
        assert!((a.speed - b.speed).abs() < 1e-9);
    }
    assert_eq!(read.hulls[0].len(), 8);
    assert!(InverseSolver::new(&read).solve(&a).len() > 1);
}

#[test]
fn wrong_descriptions_say_where_and_what() {
    let joint_6 = CRB.lines().position(|line| line.contains("j6")).unwrap();
    for (find, put, expected) in [
        ("<robot name", "<robbot name", "no XML"),
        ("</robot>", "", "no XML"),
        (
            r#"type="fixed"><parent link="world""#,
            r#"type="prismatic"><parent link="world""#,
            "\"prismatic\", expected revolute",
        ),
        (
            r#"name="j6" type="revolute""#,
            r#"name="j6" type="fixed""#,
            "5 joints turn",
        ),
        (
            r#"name="w" type="fixed""#,
            r#"name="w" type="continuous""#,
            "its limit has no \"velocity\"",
        ),
        (
            r#"<child link="e"/>"#,
            r#"<child link="c"/>"#,
            "expected one: a tree without loops",
        ),
        (
            r#"<parent link="world"/>"#,
            r#"<parent link="tool0"/>"#,
            "hangs on itself, expected a tree",
        ),
        (
            r#"<child link="camera"/>"#,
            r#"<child link="lens"/>"#,
            "its child is \"lens\", expected a link",
        ),
        (
            r#"<link name="camera"/>"#,
            "",
            "its child is \"camera\", expected a link",
        ),
        (
            r#"<link name="a"/>"#,
            r#"<link name="base"/>"#,
            "is there twice",
        ),
        (r#"<link name="a"/>"#, "<link/>", "a link has no name"),
        (
            r#"lower="-3.92699081698724""#,
            r#"lower="x""#,
            "lower is \"x\", expected a number",
        ),
        (
            r#"lower="-3.92699081698724""#,
            r#"lower="2""#,
            "expected a lower limit below an upper one",
        ),
        (r#"lower="-3.92699081698724" "#, "", "no \"lower\""),
        (
            r#"xyz="0 0 0.444""#,
            r#"xyz="0 0""#,
            "expected three numbers",
        ),
        (
            r#"xyz="0 0 0.444""#,
            r#"xyz="0 0 nan""#,
            "expected three numbers",
        ),
        (
            r#"<axis xyz="2 0 0"/>"#,
            r#"<axis xyz="0 0 0"/>"#,
            "expected a direction",
        ),
        (
            r#"<box size="0.2 0.2 0.2"/>"#,
            r#"<mesh filename="package://x/y.stl"/>"#,
            "is not there",
        ),
        (
            r#"<box size="0.2 0.2 0.2"/>"#,
            r#"<cylinder radius="-1" length="1"/>"#,
            "expected a number above 0",
        ),
        (
            r#"<box size="0.2 0.2 0.2"/>"#,
            r#"<box size="0.2 0.2 0"/>"#,
            "in a plane",
        ),
        (
            r#"<box size="0.2 0.2 0.2"/>"#,
            r#"<torus/>"#,
            "geometry \"torus\"",
        ),
        (
            r#"<axis xyz="2 0 0"/>"#,
            r#"<mimic joint="j1"/>"#,
            "mimics another",
        ),
    ] {
        assert!(CRB.contains(find), "{find}");
        let error = read(&CRB.replacen(find, put, 1)).unwrap_err();
        assert!(error.contains(expected), "{find} -> {put}: {error}");
        assert!(
            error.starts_with("arm.urdf") && !error.contains('\n'),
            "{error}"
        );
    }
    // With line and column where there is one.
    let error = read(&CRB.replacen(r#"xyz="0.101 0 0.08""#, r#"xyz="1""#, 1)).unwrap_err();
    assert!(
        error.starts_with(&format!("arm.urdf:{}:3: ", joint_6 + 1)),
        "{error}"
    );
}

/// Bytes turned over, pieces left out and doubled: an arm or a line, never a panic.
#[test]
fn noise_is_an_arm_or_an_error() {
    let toml = include_str!("../robots/ur5e.toml");
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut arms = 0;
    for k in 0..4000 {
        let text = if k % 2 == 0 { CRB } else { toml };
        let mut bytes = text.as_bytes().to_vec();
        for _ in 0..rng.random_range(1..4) {
            let at = rng.random_range(0..bytes.len());
            let to = (at + rng.random_range(1..40)).min(bytes.len());
            match rng.random_range(0..4) {
                0 => bytes[at] = rng.random(),
                1 => drop(bytes.drain(at..to)),
                2 => {
                    let piece = bytes[at..to].to_vec();
                    bytes.splice(at..at, piece);
                }
                _ => bytes[at] = b"0123456789-.eE\"<>[]=\n"[rng.random_range(0..21)],
            }
        }
        let text = String::from_utf8_lossy(&bytes);
        let read = match k % 2 {
            0 => Arm::from_urdf(&text, Path::new("arm")),
            _ => Arm::from_toml(&text, Path::new("arm")),
        };
        match read {
            Ok(arm) => {
                assert!(
                    arm.flange_at(&[0.1; 6])
                        .to_homogeneous()
                        .iter()
                        .all(|x| x.is_finite())
                );
                arms += 1;
            }
            Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
        }
    }
    assert!(arms > 100, "{arms}");
}
