//! The same bits for any number of threads, and for any company in the lanes.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::{Arc, LazyLock};

use drape_cloth::math::{Purpose, Stream};
use drape_cloth::scene::{Scene, SceneConfig};
use drape_task::env::{Draping, EnvConfig, Episode, Tasks};
use drape_task::search::{Arena, at_random};

static SCENE: LazyLock<Arc<Scene>> = LazyLock::new(|| Arc::new(rib()));

/// The rib under a blank of 33 x 33 vertices after a short fall.
fn rib() -> Scene {
    let mut config = SceneConfig::rib();
    config.blank.vertices = [33, 33];
    config.tool.grid.spacing_mm = Some(8.0);
    config.fall.fall_s = 0.5;
    config.fall.settle_s = 0.2;
    config.fall.substep_rate = 2400.0;
    Scene::new(&config, |_| {}).unwrap()
}

fn config() -> EnvConfig {
    EnvConfig {
        region_mm: Some([-120.0, -150.0, -25.0, -55.0]),
        ..EnvConfig::default()
    }
}

/// Random allowed actions in environments which draw from the streams `players`, over the end
/// of every first episode. Returns one hash an environment of all that it showed.
fn play(players: std::ops::Range<u32>) -> Vec<u64> {
    let count = players.len();
    let mut env = Draping::new(SCENE.clone(), &config(), count).unwrap();
    let mut streams: Vec<Stream> = players
        .map(|player| Stream::new(9, Purpose::Evaluation, player))
        .collect();
    let mut hashes = vec![DefaultHasher::new(); count];
    let mut ended = 0;
    // 81 vertices in the region, one at least a step.
    for _ in 0..90 {
        let choose = |(index, stream): (usize, &mut Stream)| {
            let allowed = env.observation(index).allowed();
            let chosen = stream.below(allowed.clone().count());
            allowed.clone().nth(chosen).unwrap()
        };
        let actions: Vec<u32> = streams.iter_mut().enumerate().map(choose).collect();
        let outcomes = env.step(&actions);
        for (index, hash) in hashes.iter_mut().enumerate() {
            actions[index].hash(hash);
            outcomes[index].reward.to_bits().hash(hash);
            ended += usize::from(outcomes[index].episode.is_some());
            let state = env.state(index);
            for x in state.position.iter().chain(&state.velocity).flatten() {
                x.to_bits().hash(hash);
            }
        }
    }
    assert!(ended >= count, "{ended} episodes of {count} environments");
    hashes.iter().map(Hasher::finish).collect()
}

fn in_threads<T: Send>(threads: usize, run: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap().install(run)
}

/// Forty environments are three groups even in the widest lanes.
#[test]
fn episodes_do_not_depend_on_the_number_of_threads() {
    let expected = in_threads(1, || play(0..40));
    let mut apart = expected.clone();
    apart.sort_unstable();
    apart.dedup();
    assert_eq!(apart.len(), 40, "environments with other actions differ");
    for threads in [2, 7, 16] {
        assert_eq!(
            in_threads(threads, || play(0..40)),
            expected,
            "{threads} threads"
        );
    }
}

#[test]
fn scene_does_not_depend_on_the_number_of_threads() {
    let [one, seven] = [1, 7].map(|threads| in_threads(threads, rib));
    assert!(one.tool.grid == seven.tool.grid);
    assert!(one.initial == seven.initial);
}

#[test]
fn search_does_not_depend_on_the_number_of_threads() {
    let search = || {
        let mut env = Draping::new(SCENE.clone(), &config(), 8).unwrap();
        let mut ended = Vec::new();
        let mut watch = |_: u64, episodes: &[Episode]| {
            ended.extend(episodes.iter().map(|episode| episode.actions.clone()));
            true
        };
        at_random(&mut Arena::new(&mut env, 3000, &mut watch), 3);
        ended
    };
    let [one, seven] = [1, 7].map(|threads| in_threads(threads, search));
    assert!(one.len() > 16 && one == seven);
}

/// One environment alone is computed with its lines side by side in the lanes.
#[test]
fn environment_alone_equals_itself_in_a_group() {
    let group = play(0..16);
    for player in [0, 5, 15] {
        assert_eq!(play(player..player + 1), [group[player as usize]]);
    }
}
