//! Episodes gone on with from the middle, in their own environment and in others.

use super::*;

/// Every environment plays to the middle, then on; a second set of environments, in the middle of
/// other episodes, goes on from these middles in other lanes and another group, with the same
/// actions: all that is shown and earned is the same, to the bit.
#[test]
fn going_on_from_a_branch_is_the_uninterrupted_episode_in_any_environment() {
    for scene in [&*COARSE, &*GAUSS_SEIDEL] {
        let config = EnvConfig {
            settle_s: 0.005,
            ..small_region()
        };
        let [mut played, mut other] =
            [3, 20].map(|count| Draping::new(scene.clone(), &config, count).unwrap());
        play(&mut other, &mut Player::new(7, 20), 5);
        let mut player = Player::new(1, 3);
        play(&mut played, &mut player, 6);
        let branches = [0, 1, 2].map(|index| (played.episode(index), seen(&played, index)));
        // Another lane of the same group, and one of the next.
        let places = [2, 11, 19];
        for (place, (branch, shown)) in places.iter().zip(&branches) {
            other.go_on(*place, branch);
            assert_eq!(seen(&other, *place), *shown);
        }
        let mut ended = 0;
        while ended == 0 {
            let actions = player.choose(&played);
            let idle = |index: usize| other.observation(index).allowed().next().unwrap();
            let mut others: Vec<u32> = (0..20).map(idle).collect();
            places
                .iter()
                .zip(&actions)
                .for_each(|(&p, &a)| others[p] = a);
            let outcomes = played.step(&actions);
            let mut found = other.step(&others);
            for (k, &place) in places.iter().enumerate() {
                assert!(outcomes[k] == std::mem::replace(&mut found[place], outcomes[k].clone()));
                assert!(played.state(k) == other.state(place));
                assert_eq!(played.observation(k), other.observation(place));
                ended += usize::from(outcomes[k].episode.is_some());
            }
        }
        // What has ended begins anew, and the branch is as it was.
        let mut alone = Draping::new(scene.clone(), &config, 1).unwrap();
        alone.go_on(0, &branches[1].0);
        played.go_on(0, &branches[1].0);
        assert!(alone.state(0) == played.state(0));
    }
}
