//! Yarns under draping: random episodes leave little tension.

use std::sync::Arc;

use drape_cloth::scene::{Scene, SceneConfig};
use drape_study::episodes::{Order, play};
use drape_task::env::EnvConfig;

fn quickstart() -> EnvConfig {
    EnvConfig {
        region_mm: Some([-186.0, -186.0, -60.0, -60.0]),
        crop: true,
        ..EnvConfig::default()
    }
}

/// Random episodes, and a quarter of a second: yarns are stretched by 3 % at most and 95 of 100
/// by less than 0.5 %, nothing lies in the tool, and the cloth rests. What surplus is crushed
/// (compression, tens of percent on single edges) is counted apart.
#[test]
fn random_episodes_stretch_no_yarn() {
    let rib = Arc::new(Scene::new(&SceneConfig::rib(), |_| {}).unwrap());
    let played = play(&rib, &quickstart(), Order::Random, 16, 5, |_| ()).unwrap();
    assert_eq!(played.episodes.len(), 16);
    for ended in &played.episodes {
        let summary = &ended.summary;
        assert!(!ended.diverged);
        assert!(summary.tension_p95 <= 0.005, "{ended:?}");
        assert!(summary.compression_p95 <= 0.005, "{ended:?}");
        assert!(ended.rest_tension_max <= 0.03, "{ended:?}");
        assert!(ended.rest_v_rms_mm_s <= 2.0, "{ended:?}");
        assert!(summary.penetration_mm <= 0.2, "{ended:?}");
        let apart = summary.tension_max.max(summary.compression_max);
        assert_eq!(summary.strain_max, apart);
    }
}
