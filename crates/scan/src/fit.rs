//! The cloth that a scan pulls into place.
//!
//! Each scanned point pulls the nearest place of the cloth, weighed by how likely it is of the cloth, and the
//! solver keeps yarns and tool (Schulman et al., ICRA 2013). Where nothing was seen, nothing pulls.

use std::sync::Arc;

use drape_cloth::fabric::Lamina;
use drape_cloth::math::Vec3;
use drape_cloth::mesh::compare::{Foot, Sheet};
use drape_cloth::scene::Scene;
use drape_cloth::sim::{Backend, Control, Cpu, Model, PhysicsConfig, Precision, Snapshot, World};
use rayon::prelude::*;

use super::place::{Spot, at};

/// Duration of a step, before each of which points pull [s], and steps for which what they are nearest to is kept.
const STEP: f64 = 1.0 / 600.0;
const STEPS: usize = 10;
/// How often that is looked up while the attraction grows, and after that.
const ROUNDS: [usize; 2] = [90, 30];
/// Share of its way that a pulled vertex is sent in a step, at first and at last.
const GAIN: [f64; 2] = [0.05, 0.3];
/// Damping of cloth that is pulled [1/s]: half of a velocity is left after a step.
const DAMPING: f64 = 416.0;
/// Distance at which a point hardly counts in the end, in medians of all: noise alone has few beyond.
const OUTLYING: f64 = 3.0;
/// It is at least this share of the diagonal of a cell: what lies beside its place by that must still be drawn there.
const NEAR: f64 = 0.5;
/// Of the points, the share whose distances tell how far the first pull reaches.
const REACHED: f64 = 0.98;
/// Duration of a control step of what is let go [s].
const FRAME: f64 = 1.0 / 60.0;
/// Points that a mark counts for.
const MARK: f64 = 8.0;

/// Pulls a blank on to scanned points, from where it has fallen, and then lets it go. `spots` are places of it that
/// were seen somewhere. Everything in the frame of the scene's cloth [m]. Gives where it was held in the end [m] and
/// the state at rest; none if it diverged.
pub(super) fn pulled(
    scene: &Scene,
    points: &[Vec3],
    spots: &[(Spot, Vec3)],
) -> Option<(Vec<[f64; 3]>, Snapshot)> {
    // Pulled cloth has neither weight nor friction: what was not seen must not sag, and all may slide.
    let physics = PhysicsConfig {
        gravity: 0.0,
        friction: false,
        adhesion: 0.0,
        damping: DAMPING,
        ..scene.config.physics.clone()
    };
    let control = Control::new(STEP, 1, 1);
    let mut cloth = cloth(scene, &physics);
    let mut state = Snapshot::clone(&scene.initial);
    state.velocity.fill([0.0; 3]);
    // Clamps are where the scan shows them, not where they were said to be.
    let fixed = std::mem::take(&mut state.fixed);
    let [growing, staying] = ROUNDS;
    let mut reach = None;
    for round in 0..growing + staying {
        let feet = feet(&scene.lamina, &state.position, points);
        let mut distances: Vec<f64> = feet.iter().map(|foot| foot.distance).collect();
        distances.sort_by(f64::total_cmp);
        let quantile = |share: f64| distances[(share * (distances.len() - 1) as f64) as usize];
        let hardness = (round as f64 / growing as f64).min(1.0);
        let between = |[first, last]: [f64; 2]| first.powf(1.0 - hardness) * last.powf(hardness);
        let least = (OUTLYING * quantile(0.5)).max(NEAR * scene.lamina.cell_diagonal());
        let most = *reach.get_or_insert_with(|| quantile(REACHED).max(least));
        let sigma = between([most, least]);
        let ways = ways(&scene.lamina, &state.position, points, &feet, sigma, spots);
        let planes = state.position.iter().zip(ways).map(|(&x, way)| {
            let normal = way.try_normalize(0.0).unwrap_or_default();
            (normal, normal.dot(&(Vec3::from(x) + way)))
        });
        let planes: Vec<(Vec3, f64)> = planes.collect();
        for _ in 0..STEPS {
            send(&mut state, &planes, between(GAIN));
            step(&mut cloth, &control, &mut state, 1)?;
        }
    }

    let held = state.position.clone();
    state.fixed = fixed;
    state.velocity.fill([0.0; 3]);
    let fall = &scene.config.fall;
    let quiet = PhysicsConfig {
        damping: fall.settle_damping,
        ..scene.config.physics.clone()
    };
    let frames = (fall.durations()[1] / FRAME).round() as usize;
    let mut cloth = self::cloth(scene, &quiet);
    step(
        &mut cloth,
        &fall.stepping().control(FRAME),
        &mut state,
        frames,
    )?;
    for vertex in state.fixed.ones() {
        state.velocity[vertex] = [0.0; 3];
    }
    Some((held, state))
}

/// One blank of the scene under other physics.
fn cloth(scene: &Scene, physics: &PhysicsConfig) -> Cpu {
    let model = Model::new(&scene.lamina, physics).over_that_of(&scene.model);
    let world = World::new(Arc::new(model), scene.tool.clone());
    Cpu::new(&world, 1, Precision::F64)
}

fn step(cloth: &mut Cpu, control: &Control, state: &mut Snapshot, frames: usize) -> Option<()> {
    cloth.load(0, state);
    for _ in 0..frames {
        cloth.step(control, &[]);
        if cloth.finite().contains(&false) {
            return None;
        }
    }
    *state = cloth.snapshot(0);
    Some(())
}

/// Where points meet the cloth.
pub(super) fn feet(lamina: &Lamina, position: &[[f64; 3]], points: &[Vec3]) -> Vec<Foot> {
    let sheet = Sheet::new(&lamina.mesh(position)).expect("a blank is oriented, and of some area");
    points.par_iter().map(|&x| sheet.foot(x)).collect()
}

/// The mean way of each vertex to the points that it is nearest to, those beyond `sigma` [m] counting little.
fn ways(
    lamina: &Lamina,
    position: &[[f64; 3]],
    points: &[Vec3],
    feet: &[Foot],
    sigma: f64,
    spots: &[(Spot, Vec3)],
) -> Vec<Vec3> {
    let mut sums = vec![(Vec3::zeros(), 0.0); position.len()];
    let mut pull = |triangle: [u32; 3], shares: [f64; 3], way: Vec3, weight: f64, count: f64| {
        for (v, share) in triangle.into_iter().zip(shares) {
            let (sum, whole) = &mut sums[v as usize];
            *sum += way * (weight * share);
            *whole += count * share;
        }
    };
    for (x, foot) in points.iter().zip(feet) {
        let weight = (-0.5 * (foot.distance / sigma).powi(2)).exp();
        let triangle = lamina.triangles[foot.triangle];
        pull(triangle, foot.weights, x - foot.position, weight, 1.0);
    }
    for (spot, x) in spots {
        pull(spot.0, spot.1, x - at(position, spot), MARK, MARK);
    }
    let mean = |(sum, whole): (Vec3, f64)| match whole > 0.0 {
        true => sum / whole,
        false => Vec3::zeros(),
    };
    sums.into_iter().map(mean).collect()
}

/// Sends vertices a share of their ways to the planes in which their goals are [m], in a step: they may slide.
fn send(state: &mut Snapshot, planes: &[(Vec3, f64)], gain: f64) {
    for (vertex, (normal, offset)) in planes.iter().enumerate() {
        let left = offset - normal.dot(&Vec3::from(state.position[vertex]));
        let way = normal * (left * gain / STEP);
        let velocity = &mut state.velocity[vertex];
        *velocity = (Vec3::from(*velocity) + way).into();
    }
}
