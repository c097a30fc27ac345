use super::*;
use crate::run::{RunInfo, curve, read_metrics};
use drape_cloth::scene::SceneConfig;
use drape_task::env::{EnvConfig, Taken};

/// A training of a corner of a coarse rib, with the folder that it is in.
fn begun(reward: Reward, change: impl Fn(&mut RunConfig)) -> (Training, tempfile::TempDir) {
    let mut config = RunConfig::quickstart();
    config.env = EnvConfig {
        region_mm: Some([-120.0, -150.0, -25.0, -55.0]),
        crop: true,
        ..EnvConfig::default()
    };
    config.environments = 3;
    config.evaluation_interval = 1;
    // No vertex is pressed twice: every environment ends an episode in each rollout.
    (config.ppo.rollout_steps, config.ppo.epochs) = (120, 1);
    config.ppo.learning_rate = 1e-37;
    change(&mut config);
    let mut scene = SceneConfig::rib();
    scene.blank.vertices = [33; 2];
    scene.tool.grid.spacing_mm = Some(8.0);
    (scene.fall.fall_s, scene.fall.settle_s) = (0.5, 0.0);
    let scene = Arc::new(Scene::new(&scene, |_| {}).unwrap());
    let scenes = vec![(scene, None); 1 + config.scenes.len()];
    let root = tempfile::tempdir().unwrap();
    let info = RunInfo::new(config.seed, SystemTime::now());
    let folder = RunFolder::create(root.path(), Some("a"), &config.to_toml(), &[], &info).unwrap();
    let training = Training::set_up(config, scenes, folder, &Cluster::default(), reward);
    (training.unwrap().begin().unwrap(), root)
}

/// What two iterations with `reward` have led to, by a learner that stays as it is: scores,
/// best sequence and imitated episodes; and rewards.
fn trained(reward: Reward) -> ([String; 3], Vec<f32>) {
    let (mut training, _root) = begun(reward, |_| ());
    training.prepare(|_, _| true).unwrap();
    // Before any line of the metrics: a run without it begins anew.
    assert!(training.folder.last_checkpoint.is_file());
    let mut rewards = Vec::new();
    for _ in 0..2 {
        let episodes = training.advance().unwrap().iteration.episodes;
        assert!(
            episodes
                .iter()
                .all(|episode| episode.end == End::Terminated)
        );
        rewards.extend(episodes.iter().map(|episode| episode.total_reward));
    }
    assert!(rewards.len() > 3);
    let scores = ["mean_score", "greedy_score", "best_score"].map(|name| {
        let curve = curve(&read_metrics(&training.folder.metrics).unwrap(), name);
        assert!(curve.len() == 2 && curve.iter().all(|(_, score)| *score < 1.0));
        curve
    });
    let best = training.folder.read_best_sequence().unwrap();
    let imitated = &training.trainer.save()["imitation"];
    let judged = [
        format!("{scores:?}"),
        format!("{best:?}"),
        format!("{imitated:?}"),
    ];
    (judged, rewards)
}

/// A term that turns the order of episodes round: the longer, the better.
#[test]
fn shaped_reward_changes_what_is_learnt_from_and_nothing_that_is_judged() {
    let (judged, rewards) = trained(Reward::default());
    let each_step = |step: &Taken| if step.end.is_some() { 0.5 } else { 1.0 };
    let (still, shaped) = trained(Reward::default().with(each_step));
    assert!(judged == still);
    assert_eq!(rewards.len(), shaped.len());
    assert!(
        rewards
            .iter()
            .zip(shaped)
            .all(|(plain, shaped)| shaped > plain + 1.0)
    );
}

/// Two scenes are searched and what is found imitated. Stopped in either, nothing has changed, and it
/// comes to the same end from there; done once, nothing is done again.
#[test]
fn preparation_is_whole_or_not_at_all() {
    let change = |config: &mut RunConfig| {
        config.search = 1500;
        config.scenes = vec![toml::from_str("").unwrap()];
        config.ppo.learning_rate = 1e-3;
        config.ppo.imitation.as_mut().unwrap().pretraining = 5;
    };
    let (mut whole, _root) = begun(Reward::default(), change);
    let mut shares = Vec::new();
    let watch = |doing, share| {
        if matches!(doing, Preparation::Searching { .. }) {
            shares.push(share);
        }
        true
    };
    whole.prepare(watch).unwrap();
    assert!(shares.is_sorted() && shares[shares.len() - 1] > 0.5);
    let expected = whole.trainer.save();
    let (mut other, _root) = begun(Reward::default(), change);
    let before = other.trainer.save();
    assert!(before != expected);
    for (searching, most) in [(true, 4), (false, 3)] {
        let mut told = 0;
        let refuse = |doing, _| {
            told += usize::from(matches!(doing, Preparation::Searching { .. }) == searching);
            told < most
        };
        other.prepare(refuse).unwrap();
        assert_eq!(told, most);
        assert!(other.trainer.save() == before && other.best_score().is_none());
    }
    other.prepare(|_, _| true).unwrap();
    assert!(other.trainer.save() == expected);
    assert!(other.best_score().is_some() && other.best_score() == whole.best_score());
    other.prepare(|_, _| panic!("it has been done")).unwrap();
}
