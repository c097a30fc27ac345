//! Environments that several processes simulate together.

use drape_task::cluster::{Cluster, threads};

use super::*;

/// Whatever the number of processes, and also where it is larger than that of environments, every process sees
/// and saves the same bits as one that does it all.
#[test]
fn processes_see_what_one_does() {
    let (scene, config) = (&*COARSE, small_region());
    let play = |count: usize, cluster: &Cluster| {
        let mut env = Draping::shared(scene.clone(), &config, count, cluster).unwrap();
        let mut player = Player::new(4, count);
        let mut seen = Vec::new();
        for step in 0..12 {
            let actions = player.choose(&env);
            seen.push(env.step(&actions));
            if step == 5 {
                env.reset(0);
                let branch = env.branch(count - 1);
                env.go_on(0, &branch);
            }
        }
        let saved = env.save();
        env.load(&saved).unwrap();
        let views: Vec<_> = (0..count).map(|i| env.observation(i).clone()).collect();
        (seen, views, env.scores(), saved)
    };
    for (count, size) in [(5, 2), (2, 3)] {
        let alone = play(count, &Cluster::default());
        std::thread::scope(|scope| {
            for one in threads(size) {
                let (play, alone) = (&play, &alone);
                scope.spawn(move || assert!(play(count, &Cluster::new(one)) == *alone));
            }
        });
    }
}
