use super::*;
use drape_cloth::fabric::{BlankConfig, Material};

fn lamina() -> Lamina {
    Lamina::new(&BlankConfig::default(), Material::interglas_92125()).unwrap()
}

fn region(region_mm: [f64; 4]) -> Result<Region, ValueError> {
    let config = EnvConfig {
        region_mm: Some(region_mm),
        ..EnvConfig::default()
    };
    config.region(&lamina())
}

#[test]
fn region_takes_in_the_vertices_on_its_border() {
    // 5.78125 mm a cell, vertex 32 in the middle.
    let cell = 5.78125;
    let found = region([-2.0 * cell, 0.0, cell, 3.0 * cell]).unwrap();
    assert_eq!((found.columns, found.rows), (30..34, 32..36));
    let found = region([-2.0 * cell + 0.01, 0.01, cell - 0.01, 3.0 * cell + 0.01]).unwrap();
    assert_eq!((found.columns, found.rows), (31..33, 33..36));
    let found = EnvConfig::default().region(&lamina()).unwrap();
    assert_eq!((found.columns, found.rows), (0..65, 0..65));
}

#[test]
fn regions_without_vertices_are_refused() {
    let error = region([200.0, 0.0, 210.0, 10.0]).unwrap_err().to_string();
    assert_eq!(
        error,
        "`env.region_mm` is [200.0, 0.0, 210.0, 10.0], expected [least x, least y, greatest x, \
         greatest y] with vertices of the blank inside"
    );
    // The wrong way round, and between two vertices.
    assert!(region([10.0, 0.0, -10.0, 10.0]).is_err());
    assert!(region([1.0, 0.0, 2.0, 10.0]).is_err());
    assert!(region([f64::NAN, 0.0, 2.0, 10.0]).is_err());
}

#[test]
fn impossible_values_are_refused_with_key_found_and_expected() {
    let message = |change: fn(&mut EnvConfig)| {
        let mut config = EnvConfig::default();
        change(&mut config);
        config.region(&lamina()).unwrap_err().to_string()
    };
    assert_eq!(
        message(|c| c.press_mpa = 0.0),
        "`env.press_mpa` is 0, expected a number from 0.000001 to 1000"
    );
    assert_eq!(
        message(|c| (c.settle_s, c.substep_rate) = (1e-3, Some(500.0))),
        "`env.settle_s` is 0.001, expected 0, or a time from one substep, 0.002 s, to 10 s"
    );
    assert_eq!(
        message(|c| c.max_steps = Some(0)),
        "`env.max_steps` is 0, expected a number > 0"
    );
    assert_eq!(
        message(|c| c.contact_rate = Some(0.0)),
        "`env.contact_rate` is 0, expected a number from 1 to 1000000"
    );
    assert_eq!(
        message(|c| c.substep_rate = Some(f64::NAN)),
        "`env.substep_rate` is NaN, expected a number from 60 to 1000000"
    );
    for (key, change) in [
        ("stencil_mm", (|c| c.stencil_mm = 0.0) as fn(&mut EnvConfig)),
        ("drape_threshold_mm", |c| c.drape_threshold_mm = f64::NAN),
        ("press_speed", |c| c.press_speed = 0.0),
        ("settle_s", |c| c.settle_s = -1.0),
        ("roller_turn_deg", |c| c.roller_turn_deg = 91.0),
        ("press_s", |c| c.press_s = 11.0),
        ("press_s", |c| c.press_s = 1e-6),
    ] {
        let message = message(change);
        assert!(
            message.starts_with(&format!("`env.{key}` is ")),
            "{message}"
        );
    }
}

#[test]
fn a_given_rate_wins_over_the_accuracy_and_setting_one_over_both() {
    let mut config = EnvConfig {
        accuracy: Accuracy::Accurate,
        substep_rate: Some(900.0),
        ..EnvConfig::default()
    };
    let expected = Stepping {
        substep_rate: 900.0,
        contact_rate: 1200.0,
    };
    assert_eq!(config.stepping(), expected);
    config.set_accuracy(Accuracy::Fast);
    assert_eq!(config.stepping(), Accuracy::Fast.stepping());
    config.set_stepping(expected);
    assert_eq!(config.stepping(), expected);
}

#[test]
fn keys_are_checked_and_have_defaults() {
    let config: EnvConfig = toml::from_str("stencil_mm = 20\nprecision = \"f64\"").unwrap();
    assert_eq!(
        (config.stencil_mm, config.precision),
        (20.0, Precision::F64)
    );
    assert_eq!(config.max_steps, None);
    let error = toml::from_str::<EnvConfig>("stencil = 20").unwrap_err();
    assert!(
        error.message().contains("unknown field `stencil`"),
        "{error}"
    );
}
