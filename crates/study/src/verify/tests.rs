use super::bending::{ELASTICA, stiffness_shown};
use super::dome::{at_polar, fishnet};
use super::length::{elastic_stretch, one_pass_stretch};
use super::shear::{bias_extension, frame_angle};
use super::*;
use crate::cloth::{AREAL_MASS, GRAVITY};
use crate::truth;
use drape_cloth::fabric::Family;

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() < tolerance,
        "{found} is not {expected}"
    );
}

/// Polar angle and shear on the bias line of a fishnet on a sphere [degrees].
const FISHNET: [[f64; 2]; 5] = [
    [30.0, 7.521],
    [45.0, 16.113],
    [60.0, 26.946],
    [70.0, 35.039],
    [80.0, 43.592],
];

#[test]
fn fishnet_converges_to_that_of_the_table() {
    for edges in [50, 400] {
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
        let tip = truth::along(&truth::elastica(gamma), 1.0);
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
    let subjects = Subject::all();
    let run = || {
        let motion = only(cases(true), &["motion".into()], |case| case.group);
        ask(&motion.unwrap(), &subjects, &Context::quiet())
    };
    let rows = run();
    assert_eq!(rows.len(), 5 * 6);
    for of_case in rows.chunks(6) {
        let first = &of_case[0].answer.case;
        assert!(of_case.iter().all(|row| row.answer.case == *first));
        let who: Vec<Subject> = of_case.iter().map(|row| row.subject).collect();
        assert_eq!(who, subjects[..6]);
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    assert_eq!(pool.unwrap().install(run), rows);
}
