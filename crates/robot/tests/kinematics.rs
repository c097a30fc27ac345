//! Forward and inverse kinematics against each other.

use drape_robot::{Arm, Joints, Solver};
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
    for name in Arm::names()
        .filter(|n| std::env::var("ARM").is_err() || std::env::var("ARM").unwrap() == *n)
    {
        let arm = Arm::shipped(name).unwrap();
        let solver = Solver::new(&arm);
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
            if !all.iter().any(same) && name != "x" {
                println!(
                    "{joints:.4?} sigma {:.4} -> {}",
                    arm.sigma_min(&joints),
                    all.len()
                );
            }
            found += usize::from(all.iter().any(same));
        }
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{name}: {:.2} % found, {:.2} solutions a pose, {worst_way:.1e} m, {worst_angle:.1e} rad, {:.0} us a pose",
            1e2 * f64::from(found as u32) / f64::from(count),
            solutions as f64 / f64::from(count),
            1e6 * seconds / f64::from(count)
        );
        assert!(worst_way < 1e-9 && worst_angle < 2e-9);
        assert!(found as f64 >= 0.999 * f64::from(count), "{name}: {found}");
    }
}
