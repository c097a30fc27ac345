use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, ensure};
use serde::de::Error as _;
use serde::{Deserialize, Serialize};
use toml::de::{DeTable, DeValue, Deserializer, ValueDeserializer};
use toml::{Spanned, Table, Value};

use super::folder::{Input, digest};
use super::robot::ReachMap;
use super::scenes::{FamilyMember, SceneRange};
use drape_cloth::file::{
    ReadError, ValueError, parse_toml_with, read_bytes, read_text, read_toml, refuse_lists,
};
use drape_cloth::scene::{Scene, SceneConfig};
use drape_learn::policy::{DeviceKind, NetworkConfig, PolicyConfig};
use drape_learn::ppo::PpoConfig;
use drape_robot::CellConfig;
use drape_task::env::{EnvConfig, ImageShape, MOST_MIB, Scatter};
use drape_task::path::Robot;

/// Most that a file which a run keeps may hold [MiB]: as much as a mesh.
const MAX_INPUT_MIB: u64 = 2048;

/// A set of defaults for task, network and learner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrainingPreset {
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
    pub preset: TrainingPreset,
    /// Decides initial weights, actions and the order of samples.
    pub seed: u64,
    /// Environment steps of the whole training, all environments counted.
    pub steps: u64,
    /// Presses of search before the training, over all scenes: its best sequences are the first to be imitated.
    pub search: u64,
    /// Presses of search after the training, from its best sequences on, see
    /// [`drape_task::search::moves`].
    pub polish: u64,
    /// Environments stepped together.
    pub environments: usize,
    pub device: DeviceKind,
    /// Iterations between two evaluations of the greedy policy; each is one episode.
    pub evaluation_interval: u64,
    /// Random orders that the best paths, twice as many, are proved against at the end, see
    /// [`drape_proof::prove()`].
    pub proof_paths: usize,
    pub env: EnvConfig,
    /// What varies from world to world: of every episode in training, and of those that paths are judged by.
    #[serde(default, skip_serializing_if = "is_none")]
    pub scatter: Scatter,
    pub policy: PolicyConfig,
    pub ppo: PpoConfig,
    #[serde(default = "SceneConfig::rib")]
    pub scene: SceneConfig,
    /// Further scenes that the policy learns on beside it; what is proved are paths on the first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scenes: Vec<SceneRange>,
    /// The robot that presses, and what stands around it: what it cannot press is neither learned nor found. None where
    /// anything can be pressed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cell: Option<CellConfig>,
    /// Where the cell is read from; not kept once it is.
    #[serde(default, skip_serializing)]
    cell_file: Option<PathBuf>,
    /// What a run keeps of its scene's files, see [`RunConfig::keep_inputs`]: their digests by
    /// their paths. A file that has changed is refused.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    inputs: BTreeMap<PathBuf, String>,
    /// Where the scene is read from; not kept once it is.
    #[serde(default, skip_serializing)]
    scene_file: Option<PathBuf>,
}

/// The configuration that is used when none is given.
const QUICKSTART: &str = include_str!("../../configs/quickstart.toml");

impl RunConfig {
    /// Greatest number of steps of a training.
    pub const MAX_STEPS: u64 = 1 << 40;
    /// Greatest number of samples of a rollout, all environments counted.
    pub const MAX_SAMPLES: usize = 1 << 18;
    /// Greatest seed: TOML has signed numbers only.
    pub const MAX_SEED: u64 = i64::MAX as u64;

    /// The built-in configuration: a quarter of a blank over a hemisphere, a few minutes on two
    /// cores.
    pub fn quickstart() -> Self {
        let path = Path::new("configs/quickstart.toml");
        Self::parse(QUICKSTART, path).expect("the built-in configuration is valid")
    }

    /// Reads a configuration. Paths in it count from its folder. Keys that are not given are
    /// those of its `preset`; an optional key is removed by `"off"`.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(&read_text(path)?, path)
    }

    /// Computes networks and cloth on `device`, if there is one.
    pub fn set_device(&mut self, device: Option<DeviceKind>) {
        if let Some(device) = device {
            (self.device, self.env.device) = (device, device.of_cloth());
        }
    }

    /// Refuses so many processes that one would have no part in a minibatch.
    pub fn check_processes(&self, processes: usize) -> Result<(), ValueError> {
        let members = self.members()?;
        let tasks = members.iter().map(|member| member.environments);
        let checked = self.ppo.check_processes(processes, tasks.sum());
        checked.map_err(|error| error.within("ppo"))
    }

    /// Where networks and cloth are on GPUs: on those that are `further` on.
    pub fn shift_device(&mut self, further: usize) {
        if let DeviceKind::Gpu(number) = &mut self.device {
            *number += further;
        }
        if let drape_cloth::sim::Device::Gpu(number) = &mut self.env.device {
            *number += further;
        }
    }

    /// The defaults of a preset, on the built-in scene.
    pub fn preset(preset: TrainingPreset) -> Self {
        let (paper, compact) = (EnvConfig::paper(), EnvConfig::compact());
        let (env, policy, ppo) = match preset {
            TrainingPreset::Paper => (paper, PolicyConfig::paper(), PpoConfig::paper()),
            TrainingPreset::Compact => (compact, PolicyConfig::compact(), PpoConfig::compact()),
        };
        Self {
            preset,
            seed: 1,
            steps: 200_000,
            search: 0,
            polish: 0,
            environments: 32,
            device: DeviceKind::default(),
            evaluation_interval: 2,
            proof_paths: 32,
            env,
            scatter: Scatter::default(),
            policy,
            ppo,
            scene: SceneConfig::rib(),
            scenes: Vec::new(),
            cell: None,
            cell_file: None,
            inputs: BTreeMap::new(),
            scene_file: None,
        }
    }

    /// This training of another task, whose scene is read from where its files are now.
    ///
    /// # Errors
    /// If there is no folder from which they count.
    pub fn with_task(&self, scene: &SceneConfig, env: &EnvConfig) -> std::io::Result<Self> {
        let (mut scene, mut config) = (scene.clone(), self.clone());
        for path in scene.files_mut() {
            *path = std::path::absolute(&path)?;
        }
        config.inputs.clear();
        config.scenes.clear();
        (config.scene, config.env) = (scene, env.clone());
        Ok(config)
    }

    /// Lets the scene be read from copies of its files in the folder of a run, so that it stays
    /// as it is wherever that goes. Gives these copies, whose paths count from there.
    pub fn keep_inputs(&mut self) -> Result<Vec<Input>, ReadError> {
        self.inputs.clear();
        let mut inputs = Vec::new();
        let further = self
            .scenes
            .iter_mut()
            .filter_map(|range| range.scene.as_mut());
        for path in std::iter::once(&mut self.scene)
            .chain(further)
            .flat_map(SceneConfig::files_mut)
        {
            let content = read_bytes(path, MAX_INPUT_MIB)?;
            let name = path.file_name().unwrap_or_default();
            let mut name = name.to_string_lossy().into_owned();
            let copy = |name: &str| PathBuf::from(format!("inputs/{name}"));
            while self.inputs.contains_key(&copy(&name)) {
                name.insert(0, '_');
            }
            *path = copy(&name);
            self.inputs.insert(path.clone(), digest(&content));
            inputs.push((path.clone(), content));
        }
        Ok(inputs)
    }

    /// The configuration as TOML, complete: reading it gives the same again. A key that the
    /// preset has and this configuration lacks is written as `"off"`.
    pub fn to_toml(&self) -> String {
        let text = toml::to_string(self).expect("a configuration is representable in TOML");
        // Through the text: numbers of single precision keep their short form.
        let mut table: Table = toml::from_str(&text).expect("TOML reads back");
        let base = Table::try_from(Self::preset(self.preset)).expect("a preset is a table");
        let mut any = false;
        for (section, key) in OPTIONAL {
            let own = table[section].as_table_mut().expect("a section is a table");
            if base[section].get(key).is_some() && !own.contains_key(key) {
                own.insert(key.into(), "off".into());
                any = true;
            }
        }
        match any {
            true => toml::to_string(&table).expect("what was read is representable"),
            false => text,
        }
    }

    /// Refuses what the blanks alone tell to be impossible, before their falls, which take long where they are large:
    /// members that cannot be, see [`FamilyMember::check`], images that differ in size, rollouts that exhaust the memory, and
    /// networks that do not fit the image.
    pub fn check_before_fall(&self) -> Result<()> {
        let members = self.members()?;
        let check = |member: &FamilyMember| member.check(self.environments);
        let shapes: Vec<ImageShape> = members.iter().map(check).collect::<Result<_>>()?;
        let size = |of: ImageShape| format!("{} x {} pixels", of.rows, of.columns);
        for (member, &shape) in members.iter().zip(&shapes) {
            let is_alike = shape == shapes[0];
            let alike = ValueError::unless(is_alike, "env.region_mm", size(shape), size(shapes[0]));
            member.located(alike.map_err(Into::into))?;
        }
        let ImageShape { rows, columns } = shapes[0];
        let pixels = rows * columns;
        let samples = self.environments * self.ppo.rollout_steps;
        let mib = samples as f64 * pixels as f64 * PIXEL_BYTES / f64::from(1 << 20);
        let found = format!("{samples} samples of {pixels} pixels, {mib:.0} MiB");
        let expected = format!("at most {MOST_MIB} MiB");
        ValueError::unless(mib <= MOST_MIB, "ppo.rollout_steps", found, expected)?;
        self.policy.validate(rows, columns).context("policy")
    }

    /// As [`RunConfig::read`] from the text of a file at `path`.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let mut config = parse_toml_with(text, path, Self::over_preset)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for (input, expected) in &config.inputs {
            let input = folder.join(input);
            let found = digest(read_bytes(&input, MAX_INPUT_MIB)?);
            if found != *expected {
                let fault = format!(
                    "digest is {found}, expected {expected}: it has changed since the run began"
                );
                return Err(ReadError::fault(&input, fault).into());
            }
        }
        match config.scene_file.take() {
            None => config.scene.resolve(folder),
            Some(file) => {
                let path = folder.join(file);
                config.scene = SceneConfig::read(&path)?;
                let checked = config.scene.check();
                checked.with_context(|| path.display().to_string())?;
            }
        }
        for (k, range) in config.scenes.iter_mut().enumerate() {
            match (range.scene_file.take(), &mut range.scene) {
                (Some(_), Some(_)) => {
                    let key = format!("scenes.{k}");
                    let found = "`scene_file` and `scene`";
                    let error = ValueError::new(&key, found, "one of them");
                    return Err(error).with_context(|| path.display().to_string());
                }
                (Some(file), _) => range.scene = Some(SceneConfig::read(&folder.join(file))?),
                (None, Some(scene)) => scene.resolve(folder),
                (None, None) => {}
            }
        }
        if let Some(file) = config.cell_file.take() {
            ensure!(
                config.cell.is_none(),
                "{}: `cell_file` and `cell` are both given, expected one",
                path.display()
            );
            let file = folder.join(file);
            let mut cell: CellConfig = read_toml(&file)?;
            let checked = cell.check();
            checked.with_context(|| file.display().to_string())?;
            cell.locate(file.parent().unwrap_or(Path::new("")))?;
            config.cell = Some(cell);
        } else if let Some(cell) = &mut config.cell {
            cell.locate(folder)?;
        }
        config.check().with_context(|| path.display().to_string())?;
        let [warp, weft] = config.scene.blank.cell();
        config.scatter.suit(warp.min(weft), &config.env);
        Ok(config)
    }

    /// Lets the robot of its cell, if there is one, press on a scene.
    ///
    /// # Errors
    /// If the cell describes none.
    pub fn equip(&mut self, scene: &Arc<Scene>) -> Result<()> {
        if let Some(cell) = &self.cell {
            self.env.robot = Robot(Some(Arc::new(ReachMap::new(cell, scene)?)));
        }
        Ok(())
    }

    /// What `text` gives, and for the rest its preset.
    fn over_preset(text: &str) -> Result<Self, toml::de::Error> {
        // Numbers that TOML does not have are refused, though some would fit.
        let all = Value::Table(toml::from_str(text)?);
        refuse_lists(&all, "", &TABLES).map_err(toml::de::Error::custom)?;
        if let Some(scene) = all.get("scene") {
            let lists = refuse_lists(scene, "", &SceneConfig::TABLES);
            lists.map_err(toml::de::Error::custom)?;
        }
        let given = DeTable::parse(text)?;
        let span = given.span();
        let given = given.into_inner();
        if given.contains_key("scene_file") && given.contains_key("scene") {
            let message = "`scene_file` and `scene` are both given, expected one";
            return Err(toml::de::Error::custom(message));
        }
        let preset = match given.get("preset") {
            None => TrainingPreset::default(),
            Some(value) => TrainingPreset::deserialize(ValueDeserializer::from(value.clone()))?,
        };
        let base = Self::preset(preset);
        let base = toml::to_string(&base).expect("a preset is representable in TOML");
        let mut base = DeTable::parse(&base).expect("TOML reads back").into_inner();
        base.make_owned();
        base.remove("scene");
        merge(&mut base, given, "");
        Self::deserialize(Deserializer::from(Spanned::new(span, base)))
    }

    /// All scenes that are learned on, the run's own first, each with the focus region on it and its
    /// number of environments.
    ///
    /// # Errors
    /// If a scene cannot be drawn, or there are fewer environments than scenes.
    pub fn members(&self) -> Result<Vec<FamilyMember>, ValueError> {
        let mut scenes = vec![(None, (self.scene.clone(), self.env.clone()))];
        for (number, range) in self.scenes.iter().enumerate() {
            let drawn = range.draw(&self.scene, &self.env, self.seed, number)?;
            let name = |member| Some(format!("`scenes.{number}`, member {member}"));
            scenes.extend(drawn.into_iter().enumerate().map(|(k, one)| (name(k), one)));
        }
        let (all, count) = (self.environments, scenes.len());
        let expected = format!("one at least for each of {count} scenes");
        ValueError::unless(all >= count, "environments", all, expected)?;
        let member = |(k, (name, (scene, env)))| FamilyMember {
            name,
            scene,
            env,
            environments: all * (k + 1) / count - all * k / count,
        };
        Ok(scenes.into_iter().enumerate().map(member).collect())
    }

    /// Checks what can be checked without setting up the scene.
    fn check(&self) -> Result<()> {
        let range = |key: &str, value: u64, max: u64| {
            let expected = format!("a number from 1 to {max}");
            ValueError::unless((1..=max).contains(&value), key, value, expected)
        };
        range("steps", self.steps, Self::MAX_STEPS)?;
        let expected = format!("a number from 0 to {}", Self::MAX_STEPS);
        for (key, steps) in [("search", self.search), ("polish", self.polish)] {
            ValueError::unless(steps <= Self::MAX_STEPS, key, steps, &expected)?;
        }
        let is_imitated = self.search == 0 || self.ppo.imitation.is_some();
        let expected = "0 where nothing is imitated";
        ValueError::unless(is_imitated, "search", self.search, expected)?;
        let scatter = self.scatter.check();
        scatter.map_err(|error| error.within("scatter"))?;
        range("environments", self.environments as u64, 8192)?;
        range("evaluation_interval", self.evaluation_interval, 1 << 32)?;
        range("proof_paths", self.proof_paths as u64, 4096)?;
        // A rollout is held in memory: 17 kB a sample on the whole standard blank.
        let max = (Self::MAX_SAMPLES / self.environments) as u64;
        range("ppo.rollout_steps", self.ppo.rollout_steps as u64, max)?;
        if let Some(cell) = &self.cell {
            cell.check().context("cell")?;
            let found = self.scenes.len();
            ValueError::unless(
                found == 0,
                "scenes",
                found,
                "none beside a cell, whose robot knows one tool",
            )?;
        }
        for member in &self.members()?[1..] {
            member.located(member.scene.check().map_err(Into::into))?;
        }
        let imitation = self.ppo.imitation.as_ref();
        let is_mirrored = imitation.is_some_and(|imitation| imitation.symmetries);
        let has_places = !matches!(self.policy.network, NetworkConfig::Unet(_));
        ValueError::unless(
            !(is_mirrored && has_places),
            "ppo.imitation.symmetries",
            is_mirrored,
            "false where the network is no `unet`",
        )?;
        self.ppo.validate().context("ppo")
    }
}

fn is_none(scatter: &Scatter) -> bool {
    *scatter == Scatter::default()
}

/// What a rollout keeps of a pixel of each sample, once more where episodes are imitated [bytes].
const PIXEL_BYTES: f64 = 9.0;

/// Sections, and keys in them that may be absent and so be switched off.
const OPTIONAL: [(&str, &str); 6] = [
    ("env", "region_mm"),
    ("env", "substep_rate"),
    ("env", "contact_rate"),
    ("env", "max_steps"),
    ("ppo", "max_grad_norm"),
    ("ppo", "imitation"),
];

/// Where a configuration has tables, beside those of its scene.
const TABLES: [&str; 12] = [
    "env",
    "env.costs",
    "env.parameters",
    "policy",
    "policy.network.compact",
    "policy.network.paper",
    "policy.network.unet",
    "ppo",
    "ppo.imitation",
    "scatter",
    "scene",
    "cell",
];

/// Puts `over` on top of `base`, the table `section`, table by table. `"off"` removes an optional
/// key.
fn merge<'i>(base: &mut DeTable<'i>, over: DeTable<'i>, section: &str) {
    for (key, value) in over {
        let name = key.get_ref().clone();
        let span = value.span();
        let below = base.remove(&*name).map(Spanned::into_inner);
        let value = match (below, value.into_inner()) {
            (Some(DeValue::Table(mut below)), DeValue::Table(above))
                // Another kind of network replaces the preset's wholly.
                if name != "network" || above.keys().any(|key| below.contains_key(key)) =>
            {
                merge(&mut below, above, &name);
                DeValue::Table(below)
            }
            (_, DeValue::String(text)) if text == "off" && OPTIONAL.contains(&(section, &name)) => {
                continue;
            }
            (_, value) => value,
        };
        base.insert(key, Spanned::new(span, value));
    }
}

#[cfg(test)]
mod tests;
