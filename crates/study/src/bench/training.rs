//! Iterations of a training, by where its cloth and its networks are computed.

use std::sync::Arc;

use crate::study::{CORNER, Context, Effort, StudyError, restless, stencil_mm};
use drape_cloth::scene::{Scene, SceneConfig};
use drape_cloth::sim::Device;
use drape_learn::policy::{DeviceKind, PolicyConfig};
use drape_learn::ppo::{PpoConfig, TrainError, Trainer};
use drape_report::Table;
use drape_task::env::Draping;

/// Vertices along a side of the sheet on the rib: as many as software Vulkan has the time for.
const MESH: usize = 33;

/// Environments that are stepped together.
const COUNTS: [usize; 3] = [16, 128, 1024];

/// Steps of a rollout: all numbers of environments fill whole minibatches of the preset.
const ROLLOUT: usize = 25;

/// Iterations are counted until they have taken this long [s].
const LEAST: f64 = 1.0;

struct Row {
    cloth: Device,
    networks: DeviceKind,
    environments: usize,
    iterations: usize,
    /// Of all iterations: simulation, inference, update [s].
    seconds: [f64; 3],
}

impl Row {
    fn total(&self) -> f64 {
        self.seconds.iter().sum()
    }

    fn env_steps(&self) -> f64 {
        (self.iterations * self.environments * ROLLOUT) as f64
    }
}

/// Fills the table `training`, with the GPU of a `number` and without. After an iteration that takes longer
/// than `patience` [s], more environments are not tried; a quick one tries no more than the fewest.
pub fn table(
    number: usize,
    effort: Effort,
    patience: f64,
    context: &Context,
) -> Result<Table, StudyError> {
    let mut config = SceneConfig::rib();
    config.blank.vertices = [MESH; 2];
    let scene = Arc::new(Scene::new(&config, |_| {})?);
    let mut env = restless(Some(CORNER));
    env.stencil_mm = stencil_mm(&scene.lamina, env.stencil_mm);
    // Imitation begins with the first episode that ends, and with it minibatches grow.
    let ppo = PpoConfig {
        rollout_steps: ROLLOUT,
        imitation: None,
        ..PpoConfig::compact()
    };
    let failed = |error: TrainError| StudyError::Named("training", Box::new(error));
    let (flex, gpu) = (DeviceKind::Flex, DeviceKind::Gpu(number));
    let most = effort.pick(1, COUNTS.len());
    let mut rows = Vec::new();
    let devices = [
        (Device::Cpu, flex),
        (Device::Cpu, gpu),
        (gpu.of_cloth(), gpu),
    ];
    for (k, (cloth, networks)) in devices.into_iter().enumerate() {
        env.device = cloth;
        for &environments in &COUNTS[..most] {
            (context.progress)(0.7 + 0.1 * k as f64, "training");
            let tasks = Draping::new(scene.clone(), &env, environments)?.forgetting_ends();
            let policy = PolicyConfig::compact();
            let mut trainer =
                Trainer::new(ppo.clone(), &policy, tasks, 1, networks).map_err(failed)?;
            // Kernels are compiled and chosen in the first.
            trainer.iterate().map_err(failed)?;
            let mut row = Row {
                cloth,
                networks,
                environments,
                iterations: 0,
                seconds: [0.0; 3],
            };
            while row.total() < LEAST {
                let seconds = trainer.iterate().map_err(failed)?.seconds;
                let parts = [seconds.simulation, seconds.inference, seconds.update];
                row.seconds = std::array::from_fn(|k| row.seconds[k] + parts[k]);
                row.iterations += 1;
            }
            let iteration = row.total() / row.iterations as f64;
            rows.push(row);
            if iteration > patience {
                break;
            }
        }
    }
    let percent = |k: usize| move |row: &Row| 100.0 * row.seconds[k] / row.total();
    let title = format!("Training on a corner of the rib, {MESH} x {MESH} vertices");
    Ok(Table::of("training", title, &rows)
        .text("cloth", |row| row.cloth.to_string())
        .text("networks", |row| row.networks.to_string())
        .text("environments", |row| row.environments)
        .number("environment steps [1/s]", 0, |row| {
            row.env_steps() / row.total()
        })
        .number("samples of the update [1/s]", 0, |row| {
            row.env_steps() * ppo.epochs as f64 / row.seconds[2]
        })
        .number("simulation [%]", 0, percent(0))
        .number("inference [%]", 0, percent(1))
        .number("update [%]", 0, percent(2))
        .end())
}
