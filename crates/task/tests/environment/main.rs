//! The draping task, checked step by step against its definition under random allowed actions.

mod branch;
mod checker;
mod cluster;
mod costs;
mod ends;
mod family;
#[cfg(feature = "gpu")]
mod gpu;
mod inwards;
mod replay;
mod rest;
mod scatter;
mod stencil;
mod strain;

use std::path::Path;
use std::sync::{Arc, LazyLock};

use drape_cloth::math::{Purpose, Stream};
use drape_cloth::scene::{Scene, SceneConfig};
use drape_cloth::sim::{Observations, Solver};
use drape_task::env::{Draping, EnvConfig, StepOutcome, Tasks};

/// The rib under a blank of 33 x 33 vertices.
static COARSE: LazyLock<Arc<Scene>> = LazyLock::new(|| Arc::new(rib(33, Solver::Yarn)));

/// The built-in scene as it is, settled.
static RIB: LazyLock<Arc<Scene>> =
    LazyLock::new(|| Arc::new(Scene::new(&SceneConfig::rib(), |_| {}).unwrap()));

/// The coarse rib by the paper's method.
static GAUSS_SEIDEL: LazyLock<Arc<Scene>> =
    LazyLock::new(|| Arc::new(rib(33, Solver::GaussSeidel)));

/// The rib after a short fall: quick, and still with wrinkles.
fn rib(vertices: usize, solver: Solver) -> Scene {
    let mut config = SceneConfig::rib();
    config.blank.vertices = [vertices; 2];
    config.tool.grid.spacing_mm = Some(8.0);
    config.fall.fall_s = 0.5;
    config.fall.settle_s = 0.2;
    config.fall.substep_rate = 2400.0;
    config.physics.solver = solver;
    Scene::new(&config, |_| {}).unwrap()
}

/// A plate with a hole, its yarns turned by 20 degrees, over a dome.
static HOLED: LazyLock<Arc<Scene>> = LazyLock::new(|| {
    let path = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../configs/scenes/outline-with-hole.toml"
    ));
    let mut config = SceneConfig::read(path).unwrap();
    config.blank.cell_mm = Some(11.0);
    config.fall.fall_s = 0.3;
    config.fall.settle_s = 0.1;
    config.fall.substep_rate = 2400.0;
    Arc::new(Scene::new(&config, |_| {}).unwrap())
});

/// A region of 9 x 9 vertices of the coarse blank under a wrinkle.
fn small_region() -> EnvConfig {
    EnvConfig {
        region_mm: Some([-120.0, -150.0, -25.0, -55.0]),
        crop: true,
        ..EnvConfig::default()
    }
}

/// A random allowed action for every environment.
struct Player(Vec<Stream>);

impl Player {
    fn new(seed: u64, count: usize) -> Self {
        let stream = |index| Stream::new(seed, Purpose::Evaluation, index as u32);
        Self((0..count).map(stream).collect())
    }

    fn choose(&mut self, env: &Draping) -> Vec<u32> {
        let choose = |(index, stream): (usize, &mut Stream)| {
            let allowed = env.observation(index).allowed();
            let chosen = stream.below(allowed.clone().count());
            allowed.clone().nth(chosen).unwrap()
        };
        self.0.iter_mut().enumerate().map(choose).collect()
    }
}

/// What an environment shows now, on its own.
fn seen(env: &Draping, index: usize) -> Observations {
    Observations::gather([(env.observations(), index)].into_iter())
}

/// Takes `steps` random steps.
fn play(env: &mut Draping, player: &mut Player, steps: usize) -> Vec<Vec<StepOutcome>> {
    (0..steps)
        .map(|_| {
            let actions = player.choose(env);
            env.step(&actions)
        })
        .collect()
}
