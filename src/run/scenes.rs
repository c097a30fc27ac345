use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{Context as _, Result};
use serde::{Deserialize, Serialize};
use toml::Value;

use drape_cloth::fabric::Lamina;
use drape_cloth::file::ValueError;
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::scene::{SceneConfig, SceneError};
use drape_task::env::{EnvConfig, ImageShape, check_memory};

/// Further scenes to be learned on: one with other numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneRange {
    /// How many are drawn.
    #[serde(default = "one")]
    pub members: usize,
    /// Focus region; that of `[env]` if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region_mm: Option<[f64; 4]>,
    /// Least and greatest value of a number of the scene, of its `material` or of `env`, by its key with
    /// dots; each member has its own, uniformly between them.
    #[serde(default)]
    pub vary: BTreeMap<String, [f64; 2]>,
    /// The scene; that of the run if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<SceneConfig>,
    /// Where it is read from; not kept once it is.
    #[serde(default, skip_serializing)]
    pub(super) scene_file: Option<PathBuf>,
}

fn one() -> usize {
    1
}

/// Most members of a [`SceneRange`].
const MOST: usize = 256;

impl SceneRange {
    /// The scenes with their tasks, drawn under `seed` for the `number`th range of a run with this scene
    /// and this task.
    ///
    /// # Errors
    /// If a key is none of a number, or a drawn value is refused.
    pub fn draw(
        &self,
        scene: &SceneConfig,
        env: &EnvConfig,
        seed: u64,
        number: usize,
    ) -> Result<Vec<(SceneConfig, EnvConfig)>, ValueError> {
        let key = |key: &str| format!("scenes.{number}.{key}");
        let expected = format!("a number from 1 to {MOST}");
        let is_valid = (1..=MOST).contains(&self.members);
        ValueError::unless(is_valid, &key("members"), self.members, expected)?;
        for (name, [least, greatest]) in &self.vary {
            let is_valid = least.is_finite() && greatest.is_finite() && least <= greatest;
            let found = format!("[{least}, {greatest}]");
            let expected = "the least and the greatest value";
            ValueError::unless(is_valid, &key(&format!("vary.{name}")), found, expected)?;
        }
        let mut base = Both {
            scene: self.scene.as_ref().unwrap_or(scene).clone(),
            env: env.clone(),
        };
        base.env.region_mm = self.region_mm.or(env.region_mm);
        if self.vary.keys().any(|name| name.starts_with("material.")) {
            // In place of its file.
            let material = base.scene.read_material();
            let refused = |error: SceneError| ValueError::new(&key("vary"), error, "a material");
            base.scene.material = Some(material.map_err(refused)?.into());
        }
        let mut stream = Stream::new(seed, Purpose::Scenes, number as u32);
        let mut draw = || {
            // Nothing else in a scene has no place in TOML.
            let drawn = Value::try_from(&base);
            let (found, expected) = ("of a scene with paths that are no Unicode", "other names");
            let mut drawn = drawn.map_err(|_| ValueError::new(&key("vary"), found, expected))?;
            let own = Value::try_from(&base.env.parameters).expect("they are a table");
            drawn["env"]
                .as_table_mut()
                .expect("it is a table")
                .entry("parameters")
                .or_insert(own);
            for (name, &range) in &self.vary {
                let share = stream.uniform();
                let is_put = name.contains('.') && put(&mut drawn, name, range, share);
                // Some keys are absent where they have their default; others are none.
                let is_number = is_put && drawn.clone().try_into::<Both>().is_ok();
                let expected =
                    "the key of a number in the scene, its `material` or `env`, with dots";
                ValueError::unless(is_number, &key("vary"), name, expected)?;
            }
            let Both { scene, env } = drawn.try_into().expect("it has been read");
            Ok((scene, env))
        };
        (0..self.members).map(|_| draw()).collect()
    }
}

/// What varies.
#[derive(Serialize, Deserialize)]
struct Both {
    #[serde(flatten)]
    scene: SceneConfig,
    env: EnvConfig,
}

/// One of the scenes that a policy learns on.
#[derive(Clone, Debug)]
pub struct FamilyMember {
    /// What messages call it, as in "`scenes.0`, member 2", which counts from 0; none of the run's own scene.
    pub name: Option<String>,
    pub scene: SceneConfig,
    pub env: EnvConfig,
    /// Environments on it.
    pub environments: usize,
}

impl FamilyMember {
    /// Refuses what needs no fall to be refused: values that cannot be, blanks of which `count` environments exhaust the
    /// memory, and regions off them. Gives the size of the images.
    pub fn check(&self, count: usize) -> Result<ImageShape> {
        self.located(self.checked(count))
    }

    fn checked(&self, count: usize) -> Result<ImageShape> {
        self.scene.check()?;
        let lamina = Lamina::new(&self.scene.blank, self.scene.read_material()?)?;
        check_memory(count, lamina.vertex_count())?;
        let region = self.env.region(&lamina)?;
        let [rows, columns] = match self.env.crop {
            true => [region.rows.len(), region.columns.len()],
            false => [lamina.rows, lamina.columns],
        };
        Ok(ImageShape { rows, columns })
    }

    /// What an error is about, beside the configuration.
    pub fn located<T>(&self, result: Result<T>) -> Result<T> {
        match &self.name {
            Some(name) => result.with_context(|| name.clone()),
            None => result,
        }
    }
}

/// Puts a number between two others where a dotted `key` stands or would, the place in a list counted from 0;
/// a list gets it in all places. False where no number can stand.
fn put(value: &mut Value, key: &str, range: [f64; 2], share: f64) -> bool {
    let [least, greatest] = range;
    let drawn = least + (greatest - least) * share;
    let (first, rest) = key.split_once('.').unwrap_or((key, ""));
    match value {
        Value::Float(number) if key.is_empty() => *number = drawn,
        Value::Integer(number) if key.is_empty() => {
            *number = (drawn + share).floor() as i64;
        }
        Value::Array(all) if key.is_empty() => {
            return all.iter_mut().all(|inner| put(inner, "", range, share));
        }
        Value::Table(table) => match table.get_mut(first) {
            Some(inner) => return put(inner, rest, range, share),
            None if rest.is_empty() => drop(table.insert(first.into(), drawn.into())),
            None => return false,
        },
        Value::Array(list) => {
            let inner = first.parse().ok().and_then(|at: usize| list.get_mut(at));
            return inner.is_some_and(|inner| put(inner, rest, range, share));
        }
        _ => return false,
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range(key: &str, values: [f64; 2]) -> SceneRange {
        SceneRange {
            members: 3,
            region_mm: None,
            vary: BTreeMap::from([(key.into(), values)]),
            scene: None,
            scene_file: None,
        }
    }

    fn base() -> (SceneConfig, EnvConfig) {
        (SceneConfig::rib(), EnvConfig::default())
    }

    fn draw(
        range: &SceneRange,
        seed: u64,
        number: usize,
    ) -> Result<Vec<(SceneConfig, EnvConfig)>, ValueError> {
        let (scene, env) = base();
        range.draw(&scene, &env, seed, number)
    }

    #[test]
    fn members_differ_in_what_varies_and_repeat_under_a_seed() {
        let (base, task) = base();
        let drawn = |seed| draw(&range("placement.tilt_deg", [10.0, 20.0]), seed, 0);
        let members = drawn(1).unwrap();
        let tilts: Vec<f64> = members.iter().map(|m| m.0.placement.tilt_deg).collect();
        assert!(tilts.iter().all(|tilt| (10.0..20.0).contains(tilt)));
        assert!(tilts[0] != tilts[1] && tilts[1] != tilts[2]);
        assert_eq!(drawn(1).unwrap(), members);
        assert_ne!(drawn(2).unwrap(), members);
        for (mut scene, env) in members {
            scene.placement.tilt_deg = base.placement.tilt_deg;
            assert!(scene == base && env == task);
        }
    }

    /// In lists and the tool's own table, of the material, the task, and what environments have of their
    /// own; whole ones too.
    #[test]
    fn all_numbers_vary() {
        let one = |key: &str, value: f64| {
            let (scene, env) = draw(&range(key, [value; 2]), 1, 0).unwrap().remove(0);
            assert_ne!((&scene, &env), (&base().0, &base().1), "{key}");
            (scene, env)
        };
        one("clamps.0.move_mm.0", 12.0);
        one("blank.size_mm.1", 300.0);
        one("tool.source.shape.height_mm", 50.0);
        let material = |scene: &SceneConfig| scene.read_material().unwrap();
        let (scene, _) = one("material.areal_mass_g_m2.datasheet", 250.0);
        assert_eq!(material(&scene).areal_mass_g_m2.datasheet, 250.0);
        let (scene, _) = one("material.warp.tension.1.1", 8.0);
        assert_eq!(material(&scene).warp.tension.points()[1][1], 8.0);
        assert_eq!(one("env.press_mpa", 0.5).1.press_mpa, 0.5);
        assert_eq!(one("env.parameters.seed", 9.0).1.parameters.seed, 9);
        // A list in all places.
        let (_, env) = one("env.parameters.tension", 1.5);
        assert_eq!(env.parameters.tension, [1.5; 2]);
        // And where a default is not written.
        assert_eq!(one("env.substep_rate", 2400.0).1.substep_rate, Some(2400.0));
        assert_eq!(
            one("placement.tilt_axis_deg", 90.0)
                .0
                .placement
                .tilt_axis_deg,
            90.0
        );
        let seeds = draw(&range("env.parameters.seed", [0.0, 1e6]), 1, 0).unwrap();
        assert!(seeds[0].1 != seeds[1].1);
    }

    #[test]
    fn keys_and_ranges_that_cannot_be_are_named() {
        let error = |key: &str, values| draw(&range(key, values), 1, 2).unwrap_err();
        assert_eq!(
            error("placement.tilt", [0.0, 1.0]).to_string(),
            "`scenes.2.vary` is placement.tilt, expected the key of a number in the scene, its `material` or \
             `env`, with dots"
        );
        let reversed = error("placement.tilt_deg", [2.0, 1.0]);
        assert_eq!(reversed.key, "scenes.2.vary.placement.tilt_deg");
        assert!(
            error("tool.grid", [0.0, 1.0])
                .to_string()
                .contains("tool.grid")
        );
        assert!(
            error("env.parameters", [0.0, 1.0])
                .to_string()
                .contains("env.parameters")
        );
    }
}
