//! Cloth and networks on one GPU: what is seen stays there.

use std::sync::Arc;

use burn::backend::DispatchDevice;
use burn::tensor::Device as BurnDevice;
use drape_cloth::scene::{Scene, SceneConfig};
use drape_cloth::sim::Device;
use drape_learn::policy::{DeviceKind, PolicyConfig};
use drape_learn::ppo::{Iteration, PpoConfig, Trainer};
use drape_task::env::{Draping, EnvConfig, Tasks};

const GPU: DeviceKind = DeviceKind::Gpu(0);

/// Four environments on a coarse rib, few samples an iteration.
fn trainer(cloth: Device, networks: DeviceKind) -> Trainer<Draping> {
    let mut scene = SceneConfig::rib();
    scene.blank.vertices = [33; 2];
    scene.tool.grid.spacing_mm = Some(8.0);
    scene.fall.fall_s = 0.5;
    scene.fall.settle_s = 0.2;
    scene.fall.substep_rate = 2400.0;
    let scene = Arc::new(Scene::new(&scene, |_| {}).unwrap());
    let env = EnvConfig {
        region_mm: Some([-120.0, -150.0, -25.0, -55.0]),
        stencil_mm: 36.0,
        crop: true,
        device: cloth,
        ..EnvConfig::default()
    };
    let ppo = PpoConfig {
        rollout_steps: 40,
        epochs: 1,
        ..PpoConfig::compact()
    };
    let tasks = Draping::new(scene, &env, 4).unwrap().forgetting_ends();
    Trainer::new(ppo, &PolicyConfig::compact(), tasks, 1, networks).unwrap()
}

fn assert_close(a: &Iteration, b: &Iteration) {
    let actions = |iteration: &Iteration| {
        let episodes = iteration.episodes.iter();
        let actions = episodes.map(|episode| (episode.task, episode.actions.clone()));
        actions.collect::<Vec<_>>()
    };
    assert_eq!(actions(a), actions(b));
    for (a, b) in a.episodes.iter().zip(&b.episodes) {
        let [a, b] = [a, b].map(|episode| episode.score.unwrap());
        assert!((a - b).abs() < 1e-3, "{a} {b}");
    }
    let terms = |Iteration { metrics, .. }: &Iteration| {
        [metrics.entropy, metrics.value_loss, metrics.policy_loss]
    };
    for (a, b) in terms(a).into_iter().zip(terms(b)) {
        assert!((a - b).abs() < 1e-3 * (1.0 + a.abs()), "{a} {b}");
    }
}

/// Whatever is where, a training learns the same within rounding, on from a checkpoint of any other too; and
/// what has been seen on the GPU is what the host would have seen.
#[test]
fn gpu_learns_as_the_cpu_does() {
    let mut expected = trainer(Device::Cpu, DeviceKind::Flex);
    // In the middle of episodes, with something to imitate.
    assert!(!expected.iterate().unwrap().episodes.is_empty());
    let start = expected.save();
    let iteration = expected.iterate().unwrap();
    for (cloth, networks) in [
        (Device::Gpu(0), GPU),
        (Device::Cpu, GPU),
        (Device::Gpu(0), DeviceKind::Flex),
    ] {
        let mut found = trainer(cloth, networks);
        found.load(&start).unwrap();
        let seen = found.tasks().observations();
        assert_eq!(seen.is_on_device(), cloth != Device::Cpu);
        if let Some(there) = seen.distance.device() {
            // Networks there take it over.
            let there = there.adapter().device();
            assert!(BurnDevice::new(DispatchDevice::Cube(there)) == GPU.open().unwrap());
        }
        assert_close(&found.iterate().unwrap(), &iteration);

        let mut back = trainer(Device::Cpu, DeviceKind::Flex);
        back.load(&found.save()).unwrap();
        for task in 0..back.tasks().count() {
            let [a, b] = [back.tasks(), found.tasks()].map(|tasks| tasks.observation(task));
            assert_eq!(a.marks, b.marks);
            let pairs = a.distance.iter().zip(b.distance);
            assert!({ pairs }.all(|(a, b)| (a - b).abs() < 1e-6));
        }
        back.iterate().unwrap();
    }
}
