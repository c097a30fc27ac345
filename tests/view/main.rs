//! `drape view`: what a page sees and may do, over the socket alone and in a real browser.

mod browser;
mod door;
mod figures;
mod flood;
mod pages;
mod saved;
mod viewer;

/// A task on a coarse blank over a dome, which falls in a moment.
const TASK: &str = r#"
steps = 64
environments = 4
[env]
region_mm = [-131.0, -131.0, 0.0, 0.0]
stencil_mm = 30.0
[ppo]
rollout_steps = 8
[ppo.imitation]
episodes = 4
samples = 16
coefficient = 0.3
pretraining = 20
[scene.tool.grid]
spacing_mm = 8.0
[scene.tool.source.shape]
kind = "hemisphere"
radius_mm = 75.0
[scene.blank]
size_mm = [260.0, 260.0]
vertices = [17, 17]
[scene.placement]
height_mm = 80.0
tilt_deg = 0.0
[scene.fall]
fall_s = 0.3
settle_s = 1.0
substep_rate = 1200.0
"#;
