//! Forward and inverse kinematics against each other.

use std::f64::consts::TAU;

use drape_robot::{Arm, InverseSolver, Joints, Pose};
use nalgebra::{Quaternion, Translation3, Unit, UnitQuaternion, Vector3, Vector4};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn random(arm: &Arm, rng: &mut ChaCha8Rng) -> Joints {
    std::array::from_fn(|j| {
        let [min, max] = arm.joints[j].limits;
        rng.random_range(min..max)
    })
}

#[test]
fn the_crb_stands_where_its_description_says() {
    let arm = Arm::shipped("crb15000-5").unwrap();
    let at = arm.flange_at(&[0.0; 6]).translation.vector;
    assert!(
        (at - nalgebra::Vector3::new(0.571, 0.0, 0.899)).norm() < 1e-12,
        "{at}"
    );
}

/// Every pose that is found brings the flange there, and the one that it was made with is among them.
#[test]
fn inverse_undoes_forward() {
    for name in Arm::names() {
        let arm = Arm::shipped(name).unwrap();
        let solver = InverseSolver::new(&arm);
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let (mut found, mut solutions, count) = (0, 0, 10_000);
        let (mut worst_way, mut worst_angle) = (0f64, 0f64);
        let start = std::time::Instant::now();
        for _ in 0..count {
            let joints = random(&arm, &mut rng);
            let flange = arm.flange_at(&joints);
            let all = solver.solve(&flange);
            for one in &all {
                let there = arm.flange_at(one);
                worst_way =
                    worst_way.max((there.translation.vector - flange.translation.vector).norm());
                worst_angle =
                    worst_angle.max((there.rotation.matrix() - flange.rotation.matrix()).norm());
                assert!(arm.is_within_limits(one));
            }
            solutions += all.len();
            let same = |one: &Joints| {
                one.iter().zip(&joints).all(|(a, b)| {
                    let d = (a - b).rem_euclid(std::f64::consts::TAU);
                    d.min(std::f64::consts::TAU - d) < 1e-5
                })
            };
            found += i32::from(all.iter().any(same));
        }
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{name}: {:.2} % found, {:.2} solutions a pose, {worst_way:.1e} m, {worst_angle:.1e} rad, {:.0} us a pose",
            1e2 * f64::from(found) / f64::from(count),
            solutions as f64 / f64::from(count),
            1e6 * seconds / f64::from(count)
        );
        assert!(worst_way < 1e-9 && worst_angle < 2e-9);
        assert_eq!(found, count, "{name}");
    }
}

/// Against an independent solver, all branches: what it finds within the limits is found, and nothing else.
#[test]
fn branches_are_those_of_another_solver() {
    for name in Arm::names() {
        let arm = Arm::shipped(name).unwrap();
        let solver = InverseSolver::new(&arm);
        let file = format!("{}/tests/fixtures/{name}.json", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(file).unwrap();
        let fixture: serde_json::Value = serde_json::from_str(&text).unwrap();
        let list = |value: &serde_json::Value| -> Vec<f64> {
            let all = value.as_array().unwrap().iter();
            all.map(|x| x.as_f64().unwrap()).collect()
        };
        let (mut theirs_all, mut ours_all, mut missed, mut more) = (0, 0, 0, 0);
        for pose in fixture["poses"].as_array().unwrap() {
            let at = Translation3::from(Vector3::from_vec(list(&pose["position"])));
            let turned = Vector4::from_vec(list(&pose["quaternion_xyzw"]));
            let turned = UnitQuaternion::from_quaternion(Quaternion::from_vector(turned));
            let flange = Pose::from_parts(at, turned.to_rotation_matrix());
            let ours = solver.solve(&flange);
            let theirs: Vec<Joints> = pose["joints"]
                .as_array()
                .unwrap()
                .iter()
                .map(|joints| list(joints).try_into().unwrap())
                .collect();
            let turns = |angle: f64, limits: [f64; 2]| {
                let all = [0.0, TAU, -TAU].map(|turn| angle + turn);
                all.into_iter()
                    .any(|angle| (limits[0]..=limits[1]).contains(&angle))
            };
            let within = |joints: &&Joints| {
                joints
                    .iter()
                    .zip(&arm.joints)
                    .all(|(&q, joint)| turns(q, joint.limits))
            };
            let same = |a: &Joints, b: &Joints| {
                a.iter().zip(b).all(|(a, b)| {
                    let d = (a - b).rem_euclid(TAU);
                    d.min(TAU - d) < 1e-4
                })
            };
            let theirs: Vec<&Joints> = theirs.iter().filter(within).collect();
            theirs_all += theirs.len();
            ours_all += ours.len();
            missed += theirs
                .iter()
                .filter(|one| !ours.iter().any(|other| same(one, other)))
                .count();
            more += ours
                .iter()
                .filter(|one| !theirs.iter().any(|other| same(one, other)))
                .count();
        }
        println!(
            "{name}: {theirs_all} of theirs, {missed} missed; {ours_all} of ours, {more} more"
        );
        assert_eq!((missed, more), (0, 0), "{name}");
    }
}

/// Arms of every kind of wrist, made from the CRB: with a shoulder beside the first axis as its larger sisters have, with
/// axes 4, 5 and 6 through one point, and with an axis 3 that is parallel to none.
#[test]
fn other_wrists_are_undone_too() {
    let crb = || Arm::shipped("crb15000-5").unwrap();
    let moved = |k: usize, by: [f64; 3]| {
        let mut arm = crb();
        arm.joints[k].origin.translation.vector += Vector3::from(by);
        arm
    };
    let mut bent = crb();
    bent.joints[2].axis = Unit::new_normalize(Vector3::new(0.1, 1.0, 0.05));
    for (name, arm, count, share) in [
        ("beside", moved(1, [0.15, 0.0, 0.0]), 500, 1.0),
        ("spherical", moved(5, [0.0, 0.0, -0.08]), 500, 1.0),
        // By Levenberg and Marquardt from poses all over: not all branches.
        ("bent", bent, 40, 0.7),
    ] {
        let solver = InverseSolver::new(&arm);
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let mut found = 0;
        for _ in 0..count {
            let joints = random(&arm, &mut rng);
            let flange = arm.flange_at(&joints);
            let all = solver.solve(&flange);
            for one in &all {
                let there = arm.flange_at(one);
                let miss = there.to_homogeneous() - flange.to_homogeneous();
                assert!(miss.norm() < 1e-8, "{name}: {miss}");
            }
            let same = |one: &Joints| {
                one.iter().zip(&joints).all(|(a, b)| {
                    let d = (a - b).rem_euclid(TAU);
                    d.min(TAU - d) < 1e-5
                })
            };
            found += i32::from(all.iter().any(same));
        }
        println!("{name}: {found} of {count}");
        assert!(
            f64::from(found) >= share * f64::from(count),
            "{name}: {found} of {count}"
        );
    }
}
