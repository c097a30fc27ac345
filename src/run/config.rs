use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use drape_cloth::file::{ParseError, names_instead, parse_toml, plain};
use drape_cloth::scene::{SceneConfig, SceneError};
use drape_learn::policy::{DeviceKind, PolicyConfig};
use drape_learn::ppo::PpoConfig;
use drape_task::env::EnvConfig;

/// A set of defaults for task, network and learner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// The paper's network and Table 1.
    Paper,
    /// Cropped observation, small network, the best episodes imitated.
    #[default]
    Compact,
}

/// Everything that decides a training run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunConfig {
    pub preset: Preset,
    /// Decides initial weights, actions and the order of samples.
    pub seed: u64,
    /// Environment steps of the whole training, all environments counted.
    pub steps: u64,
    /// Environments stepped together.
    pub environments: usize,
    pub device: DeviceKind,
    /// Iterations between two evaluations of the greedy policy; each is one episode.
    pub evaluation_interval: u64,
    pub env: EnvConfig,
    pub policy: PolicyConfig,
    pub ppo: PpoConfig,
    pub scene: SceneConfig,
}

/// A configuration that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum RunConfigError {
    #[error("cannot read {path}", path = path.display())]
    Read {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error(transparent)]
    Parse(#[from] ParseError),
    #[error("{path}:{place} {message}", path = path.display())]
    Value {
        path: PathBuf,
        /// Line of the key, if it stands in the file.
        place: String,
        message: String,
    },
    #[error(transparent)]
    Scene(#[from] SceneError),
}

/// Keys that hold tables.
const SECTIONS: [&str; 4] = ["env", "policy", "ppo", "scene"];

/// The configuration that is used when none is given.
const QUICKSTART: &str = include_str!("../../configs/quickstart.toml");

impl RunConfig {
    /// Most steps of a training.
    pub const MOST_STEPS: u64 = 1 << 40;
    /// Most samples of a rollout, all environments counted.
    pub const MOST_SAMPLES: usize = 1 << 18;
    /// Greatest seed: TOML has signed numbers only.
    pub const MOST_SEED: u64 = i64::MAX as u64;

    /// The built-in configuration: one wrinkle of the rib, a few minutes on two cores.
    pub fn quickstart() -> Self {
        let path = Path::new("configs/quickstart.toml");
        Self::parse(QUICKSTART, path).expect("the built-in configuration is valid")
    }

    /// Reads a configuration. Paths in it count from its folder. Keys that are not given are
    /// those of its `preset`; an optional key is removed by `"off"`.
    pub fn read(path: &Path) -> Result<Self, RunConfigError> {
        let text = std::fs::read_to_string(path).map_err(|source| RunConfigError::Read {
            path: path.into(),
            source,
        })?;
        Self::parse(&text, path)
    }

    /// The defaults of a preset, on the built-in scene.
    pub fn preset(preset: Preset) -> Self {
        let (crop, policy, ppo) = match preset {
            Preset::Paper => (false, PolicyConfig::paper(), PpoConfig::paper()),
            Preset::Compact => (true, PolicyConfig::compact(), PpoConfig::compact()),
        };
        Self {
            preset,
            seed: 1,
            steps: 200_000,
            environments: 32,
            device: DeviceKind::Flex,
            evaluation_interval: 2,
            env: EnvConfig {
                crop,
                ..EnvConfig::default()
            },
            policy,
            ppo,
            scene: SceneConfig::rib(),
        }
    }

    /// Makes the paths in it independent of the current folder, so that a run can be gone on
    /// with from anywhere.
    ///
    /// # Errors
    /// The current folder is not known.
    pub fn make_paths_absolute(&mut self) -> std::io::Result<()> {
        self.scene.resolve(&std::env::current_dir()?);
        Ok(())
    }

    /// The configuration as TOML, complete: reading it gives the same again. A key that the
    /// preset has and this configuration lacks is written as `"off"`.
    pub fn to_toml(&self) -> String {
        let text = toml::to_string(self).expect("a configuration is representable in TOML");
        // Through the text: numbers of single precision keep their short form.
        let mut table: Table = toml::from_str(&text).expect("TOML reads back");
        let base = Table::try_from(Self::preset(self.preset)).expect("a preset is a table");
        let mut any = false;
        for section in OPTIONAL_SECTIONS {
            if let (Some(Value::Table(own)), Some(Value::Table(base))) =
                (table.get_mut(section), base.get(section))
            {
                any |= switch_off(own, base);
            }
        }
        match any {
            true => toml::to_string(&table).expect("what was read is representable"),
            false => text,
        }
    }

    fn parse(text: &str, path: &Path) -> Result<Self, RunConfigError> {
        let mut given: Table = parse_toml(text, path)?;
        let fail = |key: &str, message: String| RunConfigError::Value {
            path: path.into(),
            place: place(text, key),
            message,
        };
        let wrong = |(key, message): (String, String)| fail(&key, message);
        let folder = path.parent().unwrap_or(Path::new(""));
        for key in SECTIONS {
            // The parser would take the list for the values of the table, in their order.
            if let Some(Value::Array(_)) = given.get(key) {
                return Err(fail(key, format!("`{key}` is a list, expected a table")));
            }
        }

        let preset = match given.get("preset") {
            None => Preset::default(),
            Some(value) => section(value.clone(), "preset").map_err(wrong)?,
        };
        let scene = match (given.remove("scene_file"), given.remove("scene")) {
            (Some(_), Some(_)) => {
                let message = "`scene_file` and `scene` are both given, expected one";
                return Err(fail("scene_file", message.into()));
            }
            (Some(Value::String(file)), None) => {
                let path = folder.join(file);
                let scene = SceneConfig::read(&path)?;
                scene.check().map_err(|error| RunConfigError::Value {
                    path,
                    place: String::new(),
                    message: error.to_string(),
                })?;
                scene
            }
            (Some(value), None) => {
                let message = format!("`scene_file` is {value}, expected a path");
                return Err(fail("scene_file", message));
            }
            (None, Some(value)) => {
                let mut scene: SceneConfig = section(value, "scene").map_err(wrong)?;
                scene.resolve(folder);
                scene
            }
            (None, None) => SceneConfig::rib(),
        };

        let base = Table::try_from(Self::preset(preset)).expect("a preset is a table");
        let mut merged = base.clone();
        merged.remove("scene");
        merge(&mut merged, given);
        // Section by section, so that a message says where it belongs.
        let mut config = Self::preset(preset);
        let get = |merged: &mut Table, key: &str| merged.remove(key).expect("presets have all");
        macro_rules! take {
            ($($field:ident).+, $key:literal) => {
                config.$($field).+ = section(get(&mut merged, $key), $key).map_err(wrong)?;
            };
        }
        take!(preset, "preset");
        take!(seed, "seed");
        take!(steps, "steps");
        take!(environments, "environments");
        take!(device, "device");
        take!(evaluation_interval, "evaluation_interval");
        take!(env, "env");
        take!(policy, "policy");
        take!(ppo, "ppo");
        if let Some(key) = merged.keys().next() {
            let known: Vec<&str> = base.keys().map(String::as_str).collect();
            let message = format!(
                "unknown key `{key}`, expected one of {}, scene_file",
                known.join(", ")
            );
            return Err(fail(key, message));
        }
        config.scene = scene;
        config.check().map_err(wrong)?;
        Ok(config)
    }

    /// Checks what can be checked without setting up the scene.
    fn check(&self) -> Result<(), (String, String)> {
        let range = |key: &str, value: u64, most: u64| {
            if (1..=most).contains(&value) {
                return Ok(());
            }
            Err((
                key.into(),
                format!("`{key}` is {value}, expected a number from 1 to {most}"),
            ))
        };
        range("steps", self.steps, Self::MOST_STEPS)?;
        range("environments", self.environments as u64, 4096)?;
        range("evaluation_interval", self.evaluation_interval, 1 << 32)?;
        // A rollout is held in memory: 17 kB a sample on the whole standard blank.
        let most = (Self::MOST_SAMPLES / self.environments) as u64;
        range("ppo.rollout_steps", self.ppo.rollout_steps as u64, most)?;
        self.ppo
            .validate()
            .map_err(|e| (format!("ppo.{}", e.key), format!("ppo: {e}")))
    }
}

/// The value of `key`; the error is where it is wrong, as keys joined by dots, and a message.
fn section<T: DeserializeOwned>(value: Value, key: &str) -> Result<T, (String, String)> {
    let given = value.clone();
    T::deserialize(value).map_err(|error| {
        let text = plain(&error.to_string());
        // The parser names the keys below `key` last.
        let inner = text.strip_suffix('`').and_then(|t| t.rsplit_once(" in `"));
        let (message, below) = inner.unwrap_or((&text, ""));
        let names = || {
            let (found, emptied) = emptied(given, below)?;
            let nameless = T::deserialize(emptied).err()?;
            names_instead(message, &nameless.to_string(), &found.to_string())
        };
        let names = names();
        let message = names.as_deref().unwrap_or(message);
        let path = match below {
            "" => key.into(),
            below => format!("{key}.{below}"),
        };
        let message = format!("`{path}`: {message}");
        match message.split("unknown field `").nth(1) {
            Some(rest) => {
                let name = rest.split('`').next().unwrap_or_default();
                (format!("{path}.{name}"), message)
            }
            None => (path, message),
        }
    })
}

/// What is at this path of keys below `value`, and `value` with an empty name there.
fn emptied(mut value: Value, path: &str) -> Option<(Value, Value)> {
    let mut keys = path.split('.').filter(|key| !key.is_empty());
    let at = keys.try_fold(&mut value, |value, key| value.get_mut(key))?;
    let found = std::mem::replace(at, Value::String(String::new()));
    Some((found, value))
}

/// "7:" for line 7 that sets the key at `path` (keys joined by dots), or the nearest one
/// above it; else nothing.
fn place(text: &str, path: &str) -> String {
    let Ok(document) = DeTable::parse(text) else {
        return String::new();
    };
    let mut table = Some(document.get_ref());
    let mut start = None;
    for key in path.split('.') {
        let Some((found, below)) = table.and_then(|table| find(table, key)) else {
            break;
        };
        start = Some(found);
        table = below;
    }
    match start {
        Some(start) => format!("{}:", text[..start].matches('\n').count() + 1),
        None => String::new(),
    }
}

/// Where `key` stands in `table` or, as the parser leaves out the kinds of things, in a table
/// within it; and the table that it holds, if it does.
fn find<'t, 'i>(table: &'t DeTable<'i>, key: &str) -> Option<(usize, Option<&'t DeTable<'i>>)> {
    let below = |value: &'t Spanned<DeValue<'i>>| match value.get_ref() {
        DeValue::Table(table) => Some(table),
        _ => None,
    };
    let own = table.iter().find(|(name, _)| name.get_ref() == key);
    if let Some((name, value)) = own {
        return Some((name.span().start, below(value)));
    }
    let mut tables = table.values().filter_map(below);
    tables.find_map(|table| find(table, key))
}

/// Sections with keys that may be absent.
const OPTIONAL_SECTIONS: [&str; 2] = ["env", "ppo"];

/// Sets to `"off"` what `base` has and `table` has not, table by table; whether there was
/// anything.
fn switch_off(table: &mut Table, base: &Table) -> bool {
    let mut any = false;
    for (key, value) in base {
        match (table.get_mut(key), value) {
            (None, _) => {
                table.insert(key.clone(), "off".into());
                any = true;
            }
            (Some(Value::Table(table)), Value::Table(base)) => any |= switch_off(table, base),
            _ => {}
        }
    }
    any
}

/// Keys that may be absent, and so be switched off.
const OPTIONAL: [&str; 6] = [
    "region_mm",
    "substep_rate",
    "contact_rate",
    "max_steps",
    "max_grad_norm",
    "imitation",
];

/// Puts `over` on top of `base`, table by table. `"off"` removes an optional key.
fn merge(base: &mut Table, over: Table) {
    for (key, value) in over {
        match (base.get_mut(&key), value) {
            // Another kind of network replaces the preset's wholly.
            (Some(Value::Table(below)), Value::Table(above))
                if key != "network" || above.keys().any(|k| below.contains_key(k)) =>
            {
                merge(below, above);
            }
            (_, Value::String(text)) if text == "off" && OPTIONAL.contains(&key.as_str()) => {
                base.remove(&key);
            }
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<RunConfig, String> {
        RunConfig::parse(text, Path::new("c.toml")).map_err(|e| e.to_string())
    }

    #[test]
    fn a_preset_is_overridden_key_by_key() {
        let config = parse("preset = \"paper\"\n[ppo]\ngamma = 0.5").unwrap();
        let mut expected = RunConfig::preset(Preset::Paper);
        expected.ppo.gamma = 0.5;
        assert_eq!(config, expected);
    }

    #[test]
    fn an_optional_key_is_switched_off() {
        let config = parse("[ppo]\nimitation = \"off\"").unwrap();
        assert_eq!(config.ppo.imitation, None);
        assert!(RunConfig::preset(Preset::Compact).ppo.imitation.is_some());
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

    #[test]
    fn another_network_replaces_the_preset_s() {
        let paper = RunConfig::preset(Preset::Paper);
        let text = format!("[policy]\n{}", toml::to_string(&paper.policy).unwrap());
        let text = text.replace("[network", "[policy.network");
        assert_eq!(parse(&text).unwrap().policy, paper.policy);
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
    fn mistakes_are_located() {
        let cases = [
            (
                "seed = 1\nsteqs = 5",
                "c.toml:2: unknown key `steqs`, expected one of",
            ),
            (
                "\n[ppo]\ngama = 1.0",
                "c.toml:3: `ppo`: unknown field `gama`, expected one of",
            ),
            (
                "[env]\nstencil_mm = \"x\"",
                "c.toml:2: `env.stencil_mm`: invalid type: string \"x\", expected a number",
            ),
            (
                "[env]\naccuracy = \"acurate\"",
                "c.toml:2: `env.accuracy`: unknown variant `acurate`, expected one of `fast`, \
                 `balanced`, `accurate`",
            ),
            (
                "\n[env]\naccuracy = 600",
                "c.toml:3: `env.accuracy`: invalid type: `600`, expected one of `fast`, `balanced`, \
                 `accurate`",
            ),
            (
                "[[env]]\ncrop = true",
                "c.toml:1: `env` is a list, expected a table",
            ),
            (
                "[env]\nacuracy = \"fast\"",
                "c.toml:2: `env`: unknown field `acuracy`, expected one of `region_mm`, `crop`, \
                 `stencil_mm`, `drape_threshold_mm`, `drape_strain`, `press_s`, `descent`, \
                 `settle_s`, `accuracy`, `substep_rate`, `contact_rate`, `max_steps`, `precision`",
            ),
            (
                "[scene.tool]\n[scene.physics]\nself_collision = 3",
                "c.toml:3: `scene.physics.self_collision`: invalid type: `3`, expected one of \
                 `off`, `material`, `thickness_mm`",
            ),
            (
                "[scene.tool.source]\nshape = \"rib\"",
                "c.toml:1: `scene.tool.source`: invalid type: string \"rib\", expected a table",
            ),
            (
                "steps = 0",
                "c.toml:1: `steps` is 0, expected a number from 1 to",
            ),
            (
                "steps = -3",
                "c.toml:1: `steps`: invalid value: integer `-3`, expected a whole number >= 0",
            ),
            (
                "[ppo]\ngamma = 2.0",
                "c.toml:2: ppo: `gamma` is 2, expected",
            ),
            (
                "ppo.epochs = 1\nppo.gamma = 2.0",
                "c.toml:2: ppo: `gamma` is 2, expected",
            ),
            (
                "[ppo.imitation]\nsamples = 0",
                "c.toml:2: ppo: `imitation.samples` is 0, expected",
            ),
            (
                "[policy.network.compact]\nchanels = 1",
                "c.toml:2: `policy.network`: unknown field `chanels`, expected one of",
            ),
            (
                "[scene.fall]\nsubstep_rate = 1e3\n[env]\nsubstep_rate = \"x\"",
                "c.toml:1: `scene`: missing field `tool`",
            ),
            (
                "scene = 1",
                "c.toml:1: `scene`: invalid type: integer `1`, expected a table",
            ),
            ("[scene]\nfoo = 1", "c.toml:2: `scene`: unknown field `foo`"),
            (
                "scene_file = 3",
                "c.toml:1: `scene_file` is 3, expected a path",
            ),
            (
                "scene_file = \"a\"\n[scene]",
                "c.toml:1: `scene_file` and `scene` are both given",
            ),
        ];
        for (text, message) in cases {
            let found = parse(text).unwrap_err();
            assert!(found.starts_with(message), "{found}");
            assert!(!found.contains('\n'), "{found}");
        }
        assert!(parse("seed = ").unwrap_err().contains("c.toml"));
    }
}
