use super::*;
use drape_cloth::math::mean_and_deviation;
use drape_cloth::scene::SceneConfig;

fn read(text: &str) -> Scatter {
    toml::from_str(text).unwrap()
}

#[test]
fn what_is_written_reads_back_and_unknown_quantities_are_named() {
    let text = "risk = 0.5\nsubstep_rates = [2400.0]\ntraining = true\nshift_mm = [-2.0, 2.0]\nfriction = 0.1\n";
    let scatter = read(text);
    assert_eq!(toml::to_string(&scatter).unwrap(), text);
    assert_eq!(scatter.spreads[&Quantity::Friction], Spread::Deviation(0.1));
    let error = toml::from_str::<Scatter>("frictoin = 0.1").unwrap_err();
    assert!(error.to_string().contains("frictoin"), "{error}");
    let only = scatter.only(Quantity::Friction);
    assert_eq!(
        only,
        read("risk = 0.5\nsubstep_rates = [2400.0]\ntraining = true\nfriction = 0.1")
    );
}

#[test]
fn values_out_of_range_are_named() {
    for (text, message) in [
        (
            "friction = 1.5",
            "`friction` is 1.5, expected a standard deviation from 0 to 1, or two ends of a range from 0.01 to 100",
        ),
        (
            "friction = [1.2, 0.8]",
            "`friction` is [1.2, 0.8], expected",
        ),
        ("shift_mm = nan", "`shift_mm` is NaN, expected"),
        (
            "tilt_deg = [-30.0, 0.0]",
            "`tilt_deg` is [-30, 0], expected",
        ),
        (
            "press_offset_mm = [0.0, 1.0]",
            "`press_offset_mm` is [0, 1], expected a standard deviation from 0 to 25",
        ),
        (
            "press_misses = 0.7",
            "`press_misses` is 0.7, expected a share from 0 to 0.5",
        ),
        ("risk = 2.0", "`risk` is 2, expected"),
        ("substep_rates = [0.0]", "`substep_rates` is 0, expected"),
        (
            "substep_rates = [2400.0, 1200.0]",
            "`substep_rates` is [2400.0, 1200.0], expected each rate above the one before",
        ),
    ] {
        let error = read(text).check().unwrap_err().to_string();
        assert!(error.starts_with(message), "{error}");
    }
}

/// The mean and the deviation of what is drawn are those of the distribution: uniform, or normal and cut
/// off at two deviations, which takes 0.88 of its spread.
#[test]
fn draws_follow_their_spreads() {
    let scatter =
        read("pressure = 0.1\nstencil = [0.9, 1.1]\noffset_mm = 2.0\npress_offset_mm = 0.5");
    let all: Vec<Parameters> = (0..20_000)
        .map(|k| scatter.presses(Stream::new(1, Purpose::Worlds, k)))
        .collect();
    for (of, mean, deviation, most) in [
        (
            (|p: &Parameters| p.pressure.ln()) as fn(&Parameters) -> f64,
            0.0,
            0.088,
            0.2,
        ),
        (|p| p.stencil, 1.0, 0.2 / 12f64.sqrt(), 1.1),
        (|p| p.offset_mm[0], 0.0, 1.76, 4.0),
        (|p| p.offset_mm[1], 0.0, 1.76, 4.0),
    ] {
        let drawn: Vec<f64> = all.iter().map(of).collect();
        let [found, spread] = mean_and_deviation(&drawn);
        assert!((found - mean).abs() < 0.03 * deviation, "{found}");
        assert!(
            (spread / deviation - 1.0).abs() < 0.02,
            "{spread} {deviation}"
        );
        assert!(drawn.iter().all(|&value| value <= most * (1.0 + 1e-12)));
    }
    assert!(
        all.iter()
            .all(|p| p.offset_deviation_mm == 0.5 && p.friction == [1.0; 2])
    );
    assert_ne!(all[0].seed, all[1].seed);
}

#[test]
fn worst_quarters_are_rounded_up() {
    assert_eq!(mean_and_worst_quarter(&[1.0, 0.0, 0.5, 0.5]), [0.5, 0.0]);
    assert_eq!(
        mean_and_worst_quarter(&[1.0, 0.0, 0.5, 0.5, 0.5]),
        [0.5, 0.25]
    );
    let judged = |risk| {
        Scatter {
            risk,
            ..Scatter::default()
        }
        .judge(&[1.0, 0.0, 0.5, 0.5])
    };
    assert_eq!([0.0, 0.5, 1.0].map(judged), [0.5, 0.25, 0.0]);
}

/// Without what changes the fall there is one lie, the scene's own; with it as many as asked for, and worlds
/// take them in turn, one later each time, always the same.
#[test]
fn worlds_fall_only_where_they_have_to() {
    let mut config = SceneConfig::rib();
    config.blank.vertices = [17; 2];
    config.tool.grid.spacing_mm = Some(8.0);
    (config.fall.fall_s, config.fall.settle_s) = (0.3, 0.05);
    config.fall.substep_rate = 2400.0;
    let scene = Arc::new(Scene::new(&config, |_| ()).unwrap());
    let worlds = |text: &str| Worlds::new(&scene, &read(text), 3, 7, |_| ()).unwrap();
    let pressed = worlds("pressure = 0.1\nsubstep_rates = [600.0]");
    assert!(pressed.differ() && pressed.scenes().all(|own| Arc::ptr_eq(own, &scene)));
    assert!(!Worlds::nominal(&scene).differ());
    let laid = worlds("shift_mm = 1.0\nfriction = 0.2");
    let starts: Vec<_> = laid.scenes().map(|scene| &scene.initial.position).collect();
    assert!(starts.len() == 3 && starts[0] != starts[1] && starts[1] != starts[2]);
    assert_eq!(laid.world(1), laid.world(1));
    assert_eq!([0, 1, 2, 3, 4].map(|k| laid.world(k).lie), [0, 1, 2, 1, 2]);
    assert_ne!(
        laid.world(0).parameters.friction,
        laid.world(1).parameters.friction
    );
    assert_eq!(
        worlds("shift_mm = 1.0\nfriction = 0.2").world(5),
        laid.world(5)
    );
}
