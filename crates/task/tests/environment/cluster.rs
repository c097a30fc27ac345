//! Environments that several processes simulate together.

use drape_task::cluster::{Cluster, threads};
use drape_task::env::Member;

use super::*;

/// Whatever the number of processes, and also where it is larger than that of environments, every process sees
/// and saves the same bits as one that does it all.
#[test]
fn processes_see_what_one_does() {
    let (scene, config) = (&*COARSE, small_region());
    let play = |count: usize, cluster: &Cluster| {
        let member = Member {
            scene: scene.clone(),
            config: config.clone(),
            count,
            worlds: None,
        };
        let mut env = Draping::on(vec![member], cluster).unwrap();
        let mut player = Player::new(4, count);
        let mut outcomes = Vec::new();
        for step in 0..12 {
            let actions = player.choose(&env);
            outcomes.push(env.step(&actions));
            if step == 5 {
                env.reset(0);
                let branch = env.episode(count - 1);
                env.go_on(0, &branch);
            }
        }
        let saved = env.save();
        env.load(&saved).unwrap();
        let views: Vec<_> = (0..count).map(|i| seen(&env, i)).collect();
        (outcomes, views, env.scores(), saved)
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
