use super::*;
use drape_cloth::fabric::{Lamina, Material};

fn parse(text: &str) -> Result<RunConfig, String> {
    RunConfig::parse(text, Path::new("c.toml")).map_err(|e| format!("{e:#}"))
}

#[test]
fn a_preset_is_overridden_key_by_key() {
    let config = parse("preset = \"paper\"\n[ppo]\ngamma = 0.5").unwrap();
    let mut expected = RunConfig::preset(TrainingPreset::Paper);
    expected.ppo.gamma = 0.5;
    assert_eq!(config, expected);
}

#[test]
fn an_optional_key_is_switched_off() {
    let config = parse("[ppo]\nimitation = \"off\"").unwrap();
    assert_eq!(config.ppo.imitation, None);
    assert!(
        RunConfig::preset(TrainingPreset::Compact)
            .ppo
            .imitation
            .is_some()
    );
}

#[test]
fn accuracy_survives_its_text_and_explicit_rates_win() {
    let found = |text: &str| {
        let config = parse(text).unwrap();
        assert_eq!(parse(&config.to_toml()).as_ref(), Ok(&config));
        let stepping = config.env.stepping();
        (stepping.substep_rate, stepping.contact_rate)
    };
    assert_eq!(found(""), found("env.accuracy = \"balanced\""));
    let accurate = "env.accuracy = \"accurate\"\n";
    assert_eq!(found(accurate), (12_000.0, 1200.0));
    let explicit = format!("{accurate}env.substep_rate = 900");
    assert_eq!(found(&explicit), (900.0, 1200.0));
    let explicit = format!("{accurate}env.contact_rate = 300");
    assert_eq!(found(&explicit), (12_000.0, 300.0));
}

/// Where worlds differ, finer cells are judged in finer steps, unless it is said how fine.
#[test]
fn judging_is_as_fine_as_cells_take() {
    let rates = |cells: usize, scatter: &str| {
        let blank = format!("size_mm = [256, 256], vertices = [{}, 9]", cells + 1);
        let text =
            format!("scatter = {{ {scatter} }}\nscene = {{ tool = {{}}, blank = {{ {blank} }} }}");
        let config = parse(&text).unwrap();
        assert_eq!(parse(&config.to_toml()).as_ref(), Ok(&config));
        config.scatter.substep_rates
    };
    assert_eq!(rates(16, "friction = 0.1"), [1200.0, 2400.0]);
    assert_eq!(rates(32, "friction = 0.1"), [1200.0, 2400.0]);
    assert_eq!(rates(64, "friction = 0.1"), [4800.0, 9600.0]);
    assert_eq!(rates(1024, "friction = 0.1"), [480_000.0, 960_000.0]);
    assert_eq!(rates(64, "friction = 0.1, substep_rates = [600]"), [600.0]);
    assert!(rates(64, "risk = 0.5").is_empty());
    // Nor coarser than in training.
    let trained = "friction = 0.1 }\nenv = { substep_rate = 6000.0";
    assert_eq!(rates(64, trained), [6000.0, 9600.0]);
    assert_eq!(rates(32, trained), [6000.0]);
}

#[test]
fn another_network_replaces_the_preset_s() {
    let paper = RunConfig::preset(TrainingPreset::Paper);
    let text = format!("[policy]\n{}", toml::to_string(&paper.policy).unwrap());
    let text = text.replace("[network", "[policy.network");
    assert_eq!(parse(&text).unwrap().policy, paper.policy);
}

/// The quickstart has the scene of a file that other commands can be given, two are on the
/// built-in rib, and regions of tasks are on their blanks.
#[test]
fn shipped_configurations_are_what_they_say() {
    let file = |name| {
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("configs")
            .join(name)
    };
    for name in ["paper.toml", "corner.toml"] {
        let config = RunConfig::read(&file(name)).unwrap();
        assert_eq!(config.scene, SceneConfig::rib());
    }
    let tasks = std::fs::read_dir(file("tasks")).unwrap();
    let tasks: Vec<RunConfig> = tasks
        .map(|task| RunConfig::read(&task.unwrap().path()).unwrap())
        .collect();
    assert!(tasks.len() >= 5);
    for config in tasks {
        let lamina = Lamina::new(&config.scene.blank, Material::interglas_92125()).unwrap();
        assert!(config.env.region(&lamina).is_ok());
    }
    let hemisphere = SceneConfig::read(&file("scenes/hemisphere.toml")).unwrap();
    assert_eq!(RunConfig::quickstart().scene, hemisphere);
}

#[test]
fn resolved_configuration_reads_back() {
    let config = RunConfig::quickstart();
    assert_eq!(parse(&config.to_toml()), Ok(config));
    let text = "[ppo]\nimitation = \"off\"\nmax_grad_norm = \"off\"";
    let config = parse(text).unwrap();
    assert_eq!(config.ppo.imitation, None);
    assert_eq!(parse(&config.to_toml()), Ok(config));
}

#[test]
fn devices_are_those_of_the_machine() {
    let mut elsewhere = RunConfig::quickstart();
    elsewhere.set_device(Some(DeviceKind::Gpu(1)));
    assert_eq!(elsewhere.env.device.to_string(), "gpu:1");
    elsewhere.shift_device(2);
    assert_eq!(elsewhere.device, DeviceKind::Gpu(3));
    assert_eq!(elsewhere.env.device.to_string(), "gpu:3");
}

#[test]
fn mistakes_are_located() {
    let cases = [
        (
            "seed = 1\nsteqs = 5",
            "c.toml:2:1: unknown field `steqs`, expected one of",
        ),
        (
            "\n[ppo]\ngama = 1.0",
            "c.toml:3:1: unknown field `gama`, expected one of",
        ),
        (
            "[env]\nstencil_mm = \"x\"",
            "c.toml:2:14: invalid type: string \"x\", expected a number in `stencil_mm = \"x\"`",
        ),
        (
            "[env]\naccuracy = \"acurate\"",
            "c.toml:2:12: unknown name `acurate`, expected one of `fast`, \
             `balanced`, `accurate`",
        ),
        (
            "\n[env]\naccuracy = 600",
            "c.toml:3:12: invalid type: `600`, expected one of `fast`, `balanced`, \
             `accurate`",
        ),
        (
            "[[env]]\ncrop = true",
            "c.toml:1:1: `env` is a list, expected a table",
        ),
        (
            "preset = \"paper\"\n[[ppo.imitation]]\nsamples = 1",
            "c.toml:1:1: `ppo.imitation` is a list, expected a table",
        ),
        (
            "[scene]\nfall = [1.0]",
            "c.toml:1:1: `fall` is a list, expected a table",
        ),
        (
            "[scene.tool]\ngrid = [4.0, nan]",
            "c.toml:2:8: `tool.grid` is a list, expected a table",
        ),
        (
            "[policy.network]\npaper = [[8, 16, 32], [256, 256]]",
            "c.toml:2:9: `policy.network.paper` is a list, expected a table",
        ),
        (
            "imitation = \"off\"",
            "c.toml:1:1: unknown field `imitation`, expected one of",
        ),
        (
            "[env]\nacuracy = \"fast\"",
            "c.toml:2:1: unknown field `acuracy`, expected one of `region_mm`, `crop`, `mask`, \
             `objective`, `stencil_mm`, `drape_threshold_mm`, `drape_strain`, `press_s`, \
             `press_mpa`, `press_speed`, `settle_s`, `roller_turn_deg`, `accuracy`, `substep_rate`, \
             `contact_rate`, `max_steps`, `max_tension`, `max_depth_mm`, `precision`, \
             `device`, `costs`",
        ),
        (
            "[scene.tool]\n[scene.physics]\nself_collision = 3",
            "c.toml:3:18: invalid type: `3`, expected one of \
             `off`, `material`, `thickness_mm`",
        ),
        (
            "[scene.tool.source]\nshape = \"rib\"",
            "c.toml:2:9: invalid type: string \"rib\", expected a table",
        ),
        (
            "steps = 0",
            "c.toml: `steps` is 0, expected a number from 1 to",
        ),
        (
            "search = 1099511627777",
            "c.toml: `search` is 1099511627777, expected a number from 0 to",
        ),
        (
            "steps = -3",
            "c.toml:1:9: invalid value: integer `-3`, expected a whole number >= 0",
        ),
        (
            "ppo.epochs = 1\nppo.gamma = 2.0",
            "c.toml: ppo: `gamma` is 2, expected",
        ),
        (
            "[ppo.imitation]\nsamples = 0",
            "c.toml: ppo: `imitation.samples` is 0, expected",
        ),
        (
            "[ppo.imitation]\nsymmetries = true",
            "c.toml: `ppo.imitation.symmetries` is true, expected false where the network is no `unet`",
        ),
        (
            "[policy.network.compact]\nchanels = 1",
            "c.toml:2:1: unknown field `chanels`, expected one of",
        ),
        (
            "[scene.fall]\nsubstep_rate = 1e3\n[env]\nsubstep_rate = \"x\"",
            "c.toml:4:16: invalid type: string \"x\", expected a number",
        ),
        (
            "scene = 1",
            "c.toml:1:9: invalid type: integer `1`, expected a table",
        ),
        ("[scene]\nfoo = 1", "c.toml:2:1: unknown field `foo`"),
        (
            "scene_file = 3",
            "c.toml:1:14: invalid type: integer `3`, expected a path",
        ),
        (
            "scene_file = \"a\"\n[scene]",
            "c.toml:1:1: `scene_file` and `scene` are both given",
        ),
    ];
    for (text, message) in cases {
        let found = parse(text).unwrap_err();
        assert!(found.starts_with(message), "{found}");
        assert!(!found.contains('\n'), "{found}");
    }
    assert!(parse("seed = ").unwrap_err().contains("c.toml"));
}
