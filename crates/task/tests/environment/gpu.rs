//! The task with its cloth on a GPU.

use drape_cloth::sim::{Device, Mask};
use drape_task::env::Task;

use super::checker::check;
use super::*;

fn on_gpu(config: EnvConfig) -> EnvConfig {
    EnvConfig {
        device: Device::Gpu(0),
        ..config
    }
}

#[test]
fn gpu_obeys_the_rules_step_by_step() {
    for (scene, seed) in [(&*COARSE, 1), (&*GAUSS_SEIDEL, 2)] {
        for mask in [Mask::Stroke, Mask::Free] {
            let config = EnvConfig {
                mask,
                ..small_region()
            };
            check(scene, &on_gpu(config), 3, seed);
        }
    }
}

/// A whole episode that was found on the CPU ends on the GPU with the same distance and surplus.
#[test]
fn gpu_replays_a_path() {
    for scene in [&*COARSE, &*GAUSS_SEIDEL] {
        let mut cpu = Draping::new(scene.clone(), &small_region(), 1).unwrap();
        let mut gpu = Draping::new(scene.clone(), &on_gpu(small_region()), 1).unwrap();
        let mut player = Player::new(3, 1);
        let mut presses = 0;
        loop {
            let actions = player.choose(&cpu);
            let episode = cpu.step(&actions).swap_remove(0).episode;
            gpu.press(&[gpu.vertex(actions[0])]);
            presses += 1;
            if episode.is_some() {
                break;
            }
        }
        let (expected, found) = (cpu.finished(0).unwrap().cloth(), &gpu.state(0));
        for (what, measure) in [
            ("distance", Task::distance as fn(&Task, &_) -> f64),
            ("surplus", Task::surplus),
        ] {
            let [a, b] = [measure(cpu.task(0), expected), measure(gpu.task(0), found)];
            eprintln!(
                "{presses} presses, {what} {a:.9} m, on the GPU {:+.3e} m",
                b - a
            );
            assert!((a - b).abs() <= 0.02 * a, "{what}: {a} {b}");
        }
    }
}
