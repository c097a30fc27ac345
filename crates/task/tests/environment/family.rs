//! Scenes that are stepped together.

use drape_cloth::sim::Parameters;
use drape_task::cluster::{Cluster, threads};
use drape_task::env::{EpisodeState, Member};

use super::*;

/// The coarse rib as it is, with its blank moved, by another solver, and with another cloth and other
/// presses.
fn members() -> Vec<Member> {
    let mut config = COARSE.config.clone();
    config.placement.centre_mm = [20.0, 0.0];
    let moved = Arc::new(Scene::new(&config, |_| {}).unwrap());
    let mut members = [
        (&*COARSE, 2),
        (&moved, 1),
        (&*GAUSS_SEIDEL, 1),
        (&COARSE, 2),
    ]
    .map(|(scene, count)| Member {
        scene: scene.clone(),
        config: small_region(),
        count,
        worlds: None,
    });
    members[3].config.parameters = Parameters {
        shear: [1.3, 0.8],
        pressure: 0.9,
        offset_deviation_mm: 1.0,
        ..Parameters::default()
    };
    members.into()
}

fn together(members: Vec<Member>) -> Draping {
    Draping::on(members, &Cluster::default()).unwrap()
}

/// Each goes as it does alone, on any number of processes; going on from a saved state changes no bit.
#[test]
fn scenes_together_go_as_each_alone() {
    let play = |cluster: &Cluster| {
        let alone = |member| together(vec![member]);
        let mut alone: Vec<Draping> = members().into_iter().map(alone).collect();
        let mut all = Draping::on(members(), cluster).unwrap();
        // Of one topology first, each scene with its own terrain.
        let of = |scene| all.environments(scene).collect::<Vec<_>>();
        let places = [0, 1, 2, 3].map(of);
        assert_eq!(places, [vec![0, 1], vec![2], vec![5], vec![3, 4]]);
        let terrains = all.terrains();
        assert!(terrains[0] != terrains[1] && terrains[0] == terrains[3]);
        let mut player = Player::new(4, all.count());
        let mut ended = [0; 4];
        for step in 0..90 {
            if step == 20 {
                let saved = all.save();
                all = Draping::on(members(), cluster).unwrap();
                all.load(&saved).unwrap();
            }
            let actions = player.choose(&all);
            let found = all.step(&actions);
            for (scene, places) in places.iter().enumerate() {
                let own: Vec<u32> = places.iter().map(|&k| actions[k]).collect();
                let expected = alone[scene].step(&own);
                for (k, &place) in places.iter().enumerate() {
                    assert_eq!(found[place], expected[k], "step {step} of scene {scene}");
                    let (shown, own) = (all.last().row(place), alone[scene].last().row(k));
                    assert_eq!(usize::from(shown.view), scene);
                    assert!(shown.distance == own.distance && shown.marks == own.marks);
                    ended[scene] += usize::from(found[place].episode.is_some());
                }
            }
        }
        assert!(!ended.contains(&0), "{ended:?}");
        all.save()
    };
    let alone = play(&Cluster::default());
    std::thread::scope(|scope| {
        for one in threads(2) {
            let (play, alone) = (&play, &alone);
            scope.spawn(move || assert!(play(&Cluster::new(one)) == *alone));
        }
    });
}

#[test]
fn images_of_other_sizes_and_foreign_states_are_refused() {
    let mut all = members();
    all[2].config.region_mm = Some([-140.0, -150.0, -25.0, -55.0]);
    let error = Draping::on(all, &Cluster::default()).err().unwrap();
    assert!(error.to_string().contains("member 2"), "{error}");

    let mut all = together(members());
    let before = all.save();
    let mut states: Vec<EpisodeState> = postcard::from_bytes(&before).unwrap();
    states.swap(0, 2);
    assert!(all.load(&postcard::to_allocvec(&states).unwrap()).is_err());
    assert!(all.save() == before);
}
