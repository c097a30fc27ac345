//! The settled rib, left alone with the substeps of an episode: wrinkles must not sink.

use drape_cloth::math::Vec3;
use drape_cloth::sim::{Backend, Control, Cpu, Precision, Snapshot, World};

use super::*;

/// What a second without presses does to the settled rib.
struct Rest {
    /// Summed distance after it over that before.
    share: f64,
    /// Mean way of a vertex [m].
    way: f64,
    v_rms: f64,
}

fn leave(precision: Precision, substeps: usize) -> Rest {
    let Scene {
        tool,
        model,
        initial,
        ..
    } = &**RIB;
    let world = World::new(model.clone(), tool.clone());
    let mut batch = Cpu::new(&world, 1, precision);
    batch.load(0, initial);
    let control = Control {
        dt: 1.0 / 60.0,
        substeps,
        contact_interval: 5,
        sweeps: 1,
    };
    for _ in 0..60 {
        batch.step(&control, &[]);
    }
    let end = batch.snapshot(0);
    let distance = |state: &Snapshot| -> f64 {
        let phi = state.position.iter().map(|&x| tool.distance(x).0.max(0.0));
        phi.sum()
    };
    let pairs = end.position.iter().zip(&initial.position);
    let way = pairs.map(|(x, start)| (Vec3::from(*x) - Vec3::from(*start)).norm());
    Rest {
        share: distance(&end) / distance(initial),
        way: way.sum::<f64>() / end.position.len() as f64,
        v_rms: end.v_rms(),
    }
}

/// At 20 substeps a frame, in either precision.
#[test]
fn settled_rib_stays() {
    for rest in [Precision::F32, Precision::F64].map(|precision| leave(precision, 20)) {
        assert!((0.98..=1.0).contains(&rest.share), "{}", rest.share);
        assert!(rest.way < 1e-4, "{:e} m", rest.way);
    }
}

/// The way falls with the substep: at least at first order until it is that of the state's own
/// creep.
#[test]
fn rest_converges_in_the_substep() {
    let [coarse, fine] = [20, 80].map(|substeps| leave(Precision::F64, substeps));
    assert!((0.99..=1.01).contains(&fine.share), "{}", fine.share);
    assert!(fine.way < 1e-5, "{:e} m", fine.way);
    assert!(fine.v_rms < 1e-4, "{:e} m/s", fine.v_rms);
    let order = (coarse.way / fine.way).log2() / 2.0;
    assert!(order > 1.0, "order {order}");
}
