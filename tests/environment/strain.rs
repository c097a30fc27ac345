//! Yarns under draping: what is stretched is not fixed, and random episodes leave little tension.

use drape::study::episodes::{Order, play};

use super::*;

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
    let played = play(&RIB, &quickstart(), Order::Random, 16, 5, |_| ()).unwrap();
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

/// A press brings a vertex to the tool with its yarns stretched: it is touched, but free.
#[test]
fn stretched_vertices_stay_free() {
    let draped = |drape_strain: f64| {
        let config = EnvConfig {
            drape_strain,
            ..small_region()
        };
        let mut env = Draping::new(COARSE.clone(), &config, 1).unwrap();
        let mut player = Player::new(3, 1);
        let mut refused = 0;
        for _ in 0..20 {
            let actions = player.choose(&env);
            env.step(&actions);
            let state = env.state(0);
            for v in env.touched(0).difference(env.draped(0)) {
                assert!(!state.fixed.contains(v));
                let near = COARSE.tool.distance(state.position[v]).0 <= 1e-3;
                refused += usize::from(near);
            }
        }
        (refused, env.draped(0).count_ones(..))
    };
    let (_, all) = draped(1e4);
    let (refused, some) = draped(1e-5);
    assert!(
        refused > 0 && some < all,
        "{refused} refused, {some} of {all}"
    );
}
