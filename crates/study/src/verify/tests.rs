use super::bending::{ELASTICA, stiffness_shown};
use super::dome::{FISHNET, at_polar};
use super::length::{elastic_stretch, one_pass_stretch};
use super::shear::{bias_extension, frame_angle};
use super::*;
use crate::cloth::{AREAL_MASS, GRAVITY};
use crate::truth;
use drape_cloth::fabric::Family;
use drape_cloth::math::Vec3;

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() < tolerance,
        "{found} is not {expected}"
    );
}

/// Shear on the bias line of a fishnet on a sphere, [polar angle, shear] [rad], from the pole on:
/// inextensible yarns of `edges` edges over `arm` radii whose middle ones are geodesics.
///
/// Each node is where its two neighbours nearer to the middle yarns put it, at the length of an
/// edge from both; the shear is that between the directions to its four neighbours.
fn fishnet(arm: f64, edges: usize) -> Vec<[f64; 2]> {
    let step = arm / edges as f64;
    let cosine = step.cos();
    let mut net = vec![vec![Vec3::zeros(); edges + 1]; edges + 1];
    for (k, row) in net.iter_mut().enumerate() {
        let (sin, cos) = (k as f64 * step).sin_cos();
        row[0] = Vec3::new(sin, 0.0, cos);
    }
    for (k, node) in net[0].iter_mut().enumerate() {
        let (sin, cos) = (k as f64 * step).sin_cos();
        *node = Vec3::new(0.0, sin, cos);
    }
    for i in 1..=edges {
        for j in 1..=edges {
            let (a, b) = (net[i - 1][j], net[i][j - 1]);
            let along = (a + b) * (cosine / (1.0 + a.dot(&b)));
            let across = a.cross(&b).normalize() * (1.0 - along.norm_squared()).max(0.0).sqrt();
            // Of both intersections the one farther from the node before.
            let before = net[i - 1][j - 1];
            let (p, q) = (along + across, along - across);
            net[i][j] = if p.dot(&before) < q.dot(&before) {
                p
            } else {
                q
            };
        }
    }
    let mut found = vec![[0.0, 0.0]];
    for k in 1..edges {
        let warp = (net[k + 1][k] - net[k - 1][k]).normalize();
        let weft = (net[k][k + 1] - net[k][k - 1]).normalize();
        let shear = std::f64::consts::FRAC_PI_2 - warp.dot(&weft).acos();
        found.push([net[k][k].z.clamp(-1.0, 1.0).acos(), shear.abs()]);
    }
    found
}

#[test]
fn fishnet_converges_to_that_of_the_table() {
    // The error falls with the square of the edge; the table is of 400 edges.
    for (edges, tolerance) in [(50, 6e-3), (400, 1e-9)] {
        let net = fishnet(0.95, edges);
        for [polar, shear] in FISHNET {
            let found = at_polar(&net, polar.to_radians()).to_degrees();
            close(found, shear, tolerance);
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
        let motion = only(cases(Effort::Quick), &["motion".into()], |case| case.group);
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
