//! Episodes whose simulation is lost are counted where a training and its baseline report.

use std::sync::Arc;
use std::time::SystemTime;

use drape::run::{
    RolloutError, RunConfig, RunFolder, RunInfo, Training, play, random_episodes, read_metrics,
};
use drape_task::cluster::Cluster;
use drape_task::env::End;

use drape_cloth::scene::{Scene, SceneConfig};
use drape_task::env::{Draping, EnvConfig, Tasks};

/// A region of 9 x 9 vertices of the coarse blank.
fn small_region() -> EnvConfig {
    EnvConfig {
        region_mm: Some([-120.0, -150.0, -25.0, -55.0]),
        crop: true,
        ..EnvConfig::default()
    }
}

/// A scene in which one vertex is thrown out of every episode.
fn lost() -> Arc<Scene> {
    let mut config = SceneConfig::rib();
    config.blank.vertices = [33; 2];
    config.tool.grid.spacing_mm = Some(8.0);
    config.fall.fall_s = 0.05;
    config.fall.settle_s = 0.0;
    let mut scene = Scene::new(&config, |_| {}).unwrap();
    Arc::make_mut(&mut scene.initial).velocity[0] = [1e12, 0.0, 0.0];
    Arc::new(scene)
}

#[test]
fn training_counts_diverged_episodes_and_goes_on() {
    let mut config = RunConfig::quickstart();
    config.env = small_region();
    config.environments = 3;
    config.ppo.rollout_steps = 4;
    config.ppo.epochs = 1;
    let root = tempfile::tempdir().unwrap();
    let info = RunInfo::new(config.seed, SystemTime::now());
    let folder = RunFolder::create(root.path(), Some("a"), &config.to_toml(), &[], &info).unwrap();
    let metrics = folder.metrics.clone();
    let mut training = Training::new(
        config,
        vec![(lost(), None)],
        folder,
        &Cluster::default(),
        None,
    )
    .unwrap();
    for _ in 0..2 {
        let report = training.advance().unwrap();
        // Every step of every environment ends an episode.
        let episodes = &report.iteration.episodes;
        assert_eq!(episodes.len(), 12);
        assert!(episodes.iter().all(|episode| episode.end == End::Diverged));
        // What is lost is no score.
        assert_eq!((report.mean_score, report.greedy_score), (None, None));
    }
    for line in read_metrics(&metrics).unwrap() {
        for name in ["episodes", "truncated", "diverged"] {
            assert_eq!(line.values[name], Some(12.0), "{name}");
        }
    }
}

#[test]
fn diverged_episodes_are_left_out_of_the_baseline() {
    let scene = lost();
    assert!(
        random_episodes(&scene, &small_region(), 3, |_| ())
            .unwrap()
            .is_empty()
    );
    let mut draping = Draping::new(scene, &small_region(), 1).unwrap();
    let first = |draping: &Draping| draping.observation(0).allowed().next().unwrap();
    let error = play(&mut draping, first, |_| ()).unwrap_err();
    let message = error.to_string();
    assert!(
        message.starts_with("the simulation diverged after 1 presses: "),
        "{message}"
    );
    assert!(matches!(error, RolloutError::Diverged(_)));
}
