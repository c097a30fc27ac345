//! Environment steps a second, as training takes them.

use std::sync::Arc;
use std::time::Instant;

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use super::{Effort, Samples};
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::scene::Scene;
use drape_task::env::{Draping, EnvConfig, Tasks};

/// Environments stepped together, as the presets do.
pub const ENVIRONMENTS: usize = 32;

/// Numbers of threads that are compared.
pub const THREADS: [usize; 2] = [1, 2];

/// Draping tasks on a number of threads of their own, played by a seeded masked random policy.
pub struct Player {
    pool: ThreadPool,
    env: Draping,
    stream: Stream,
}

impl Player {
    /// `environments` tasks on the wrinkle of the quickstart, at their start.
    pub fn new(
        scene: &Arc<Scene>,
        environments: usize,
        threads: usize,
    ) -> Result<Self, ThreadPoolBuildError> {
        let config = EnvConfig {
            region_mm: Some([-186.0, -186.0, -60.0, -60.0]),
            crop: true,
            ..EnvConfig::default()
        };
        Ok(Self {
            pool: ThreadPoolBuilder::new().num_threads(threads).build()?,
            env: Draping::new(scene.clone(), &config, environments)
                .expect("the region lies on the standard sheet"),
            stream: Stream::new(1, Purpose::Evaluation, 0),
        })
    }

    /// One allowed action in every environment: a press and the observation.
    pub fn step(&mut self) {
        let actions: Vec<u32> = (0..self.env.count())
            .map(|index| {
                let mask = &self.env.observation(index).mask;
                let chosen = self.stream.below(mask.count_ones(..));
                mask.ones().nth(chosen).expect("a mask is never empty") as u32
            })
            .collect();
        self.pool.install(|| self.env.step(&actions));
    }
}

/// Environment steps a second of wall time for each of [`THREADS`]. The same actions are played
/// by all, in turns.
pub(super) fn throughput(
    scene: &Arc<Scene>,
    effort: &Effort,
    mut progress: impl FnMut(f64),
) -> Result<Vec<Samples>, ThreadPoolBuildError> {
    let mut players = Vec::new();
    for threads in THREADS {
        players.push(Player::new(scene, ENVIRONMENTS, threads)?);
    }
    let mut rates = vec![Samples::default(); players.len()];
    for repeat in 0..effort.repeats {
        for (player, rates) in players.iter_mut().zip(&mut rates) {
            let start = Instant::now();
            for _ in 0..effort.actions {
                player.step();
            }
            let steps = effort.actions * ENVIRONMENTS;
            rates.0.push(steps as f64 / start.elapsed().as_secs_f64());
        }
        progress((repeat + 1) as f64 / effort.repeats as f64);
    }
    Ok(rates)
}
