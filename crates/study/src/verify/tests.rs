use super::bending::{ELASTICA, elastica, stiffness_shown};
use super::cloth::{AREAL_MASS, GRAVITY};
use super::dome::{at_polar, fishnet};
use super::length::{elastic_stretch, one_pass_stretch};
use super::shear::{bias_extension, frame_angle};
use super::trials::FISHNET;
use super::*;
use drape_cloth::fabric::Family;

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() < tolerance,
        "{found} is not {expected}"
    );
}

#[test]
fn fishnet_converges_to_that_of_the_table() {
    for edges in [50, 200] {
        let net = fishnet(0.95, edges);
        for [polar, shear] in FISHNET {
            let found = at_polar(&net, polar.to_radians()).to_degrees();
            // Its error falls with the square of the edge.
            close(found, shear, 5e-4 + 15.0 / (edges * edges) as f64);
        }
    }
    assert!(at_polar(&fishnet(0.5, 50), 1.4).is_nan());
}

#[test]
fn trellis_shears_as_in_the_table() {
    for (d, gamma, force) in [
        (0.01, 9.998, 0.301),
        (0.02, 21.168, 0.725),
        (0.03, 34.229, 1.416),
    ] {
        let [found, pull] = bias_extension(d);
        close(found.to_degrees(), gamma, 5e-4);
        close(pull, force, 5e-4);
    }
    for (d, gamma) in [(0.02, 8.420), (0.04, 17.628), (0.06, 27.987)] {
        close(frame_angle(d).to_degrees(), gamma, 5e-4);
    }
}

#[test]
fn elastica_ends_at_the_tips_of_the_table_and_shows_its_stiffness() {
    for [gamma, drop, reach] in ELASTICA {
        let tip = elastica(gamma)[100];
        close(tip[0], reach, 1e-5);
        close(tip[1], drop, 1e-5);
        let stiffness = AREAL_MASS * GRAVITY / gamma;
        let shown = stiffness_shown(drop, 1.0) / stiffness;
        close(shown, 1.0, 1e-3);
    }
}

#[test]
fn chain_stretches_as_in_the_table() {
    for (h, stretch) in [(1.0 / 600.0, 0.1508), (1e-3, 0.0543), (1e-4, 0.000_543)] {
        close(one_pass_stretch(h) / stretch, 1.0, 1e-3);
    }
    close(elastic_stretch(Family::Warp), 0.000_002_4, 5e-8);
}

/// Every subject is asked, in order, with equal numbers for any number of threads; only the fast
/// solver knows of its substeps.
#[test]
fn rows_are_ordered_by_case_and_the_same_on_one_thread() {
    let motion = || {
        let mut motion = trials(Extent::Quick);
        motion.retain(|trial| trial.group == "motion");
        motion
    };
    let subjects = Subject::all();
    let asked = std::sync::atomic::AtomicUsize::new(0);
    let found = run(&motion(), &subjects, || {
        asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    });
    assert_eq!(asked.into_inner(), motion().len() * subjects.len());
    assert_eq!(found.rows.len(), 5 * 6);
    for of_case in found.rows.chunks(6) {
        assert!(of_case.iter().all(|row| row.case == of_case[0].case));
        let who: Vec<_> = of_case.iter().map(|row| (row.solver, row.preset)).collect();
        let expected: Vec<_> = subjects[..6]
            .iter()
            .map(|s| (s.solver(), s.preset()))
            .collect();
        assert_eq!(who, expected);
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let alone = pool.unwrap().install(|| run(&motion(), &subjects, || ()));
    let numbers =
        |v: &Verification| -> Vec<u64> { v.rows.iter().map(|row| row.found.to_bits()).collect() };
    assert_eq!(numbers(&found), numbers(&alone));
}

#[test]
fn names_of_groups_are_those_of_the_trials() {
    let mut groups: Vec<_> = trials(Extent::Full).iter().map(|t| t.group).collect();
    groups.dedup();
    assert_eq!(groups, GROUPS);
}
