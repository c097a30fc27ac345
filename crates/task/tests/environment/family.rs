use super::*;
use drape_task::env::Family;

fn members() -> Vec<Draping> {
    let mut config = COARSE.config.clone();
    config.placement.centre_mm = [20.0, 0.0];
    let moved = Arc::new(Scene::new(&config, |_| {}).unwrap());
    [(&*COARSE, 2), (&moved, 1)]
        .map(|(scene, count)| Draping::new(scene.clone(), &small_region(), count).unwrap())
        .into()
}

/// Each task of a family goes as it does alone, and going on from a saved state changes no bit.
#[test]
fn tasks_of_a_family_go_as_alone() {
    let mut alone = members();
    let mut family = Family::new(members()).unwrap();
    assert_eq!(family.count(), 3);
    assert_eq!([0, 1, 2].map(|k| family.observation(k).scene), [0, 0, 1]);
    let [a, b] = family.terrains()[..] else {
        panic!("a terrain a scene")
    };
    assert_ne!(a, b);
    let mut player = Player::new(4, 3);
    for step in 0..60 {
        if step == 20 {
            let mut fresh = Family::new(members()).unwrap();
            fresh.load(&family.save()).unwrap();
            family = fresh;
        }
        let seen = |k: usize| family.observation(k).mask.clone();
        let actions: Vec<u32> = (0..3)
            .map(|k| {
                let mask = seen(k);
                let chosen = player.0[k].below(mask.count_ones(..));
                mask.ones().nth(chosen).unwrap() as u32
            })
            .collect();
        let mut expected = alone[0].step(&actions[..2]);
        expected.extend(alone[1].step(&actions[2..]));
        let found = family.step(&actions);
        assert_eq!(found, expected, "step {step}");
        for k in (0..3).filter(|&k| found[k].episode.is_some()) {
            let (member, index) = family.place(k);
            assert_eq!(family.last(k), member.last(index));
            assert_eq!(family.last(k).distance, alone[k / 2].last(k % 2).distance);
        }
    }
}

#[test]
fn images_of_other_sizes_and_foreign_states_are_refused() {
    let mut all = members();
    let wider = EnvConfig {
        region_mm: Some([-140.0, -150.0, -25.0, -55.0]),
        ..small_region()
    };
    all.push(Draping::new(COARSE.clone(), &wider, 1).unwrap());
    let error = Family::new(all).err().unwrap().to_string();
    assert!(error.contains("member 2"), "{error}");

    let mut family = Family::new(members()).unwrap();
    let before = family.save();
    let mut states: Vec<Vec<u8>> = postcard::from_bytes(&before).unwrap();
    states.swap(0, 1);
    assert!(
        family
            .load(&postcard::to_allocvec(&states).unwrap())
            .is_err()
    );
    assert!(family.save() == before);
}
