use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use toml::Value;

use drape_cloth::fabric::Lamina;
use drape_cloth::file::ValueError;
use drape_cloth::math::{Purpose, Stream};
use drape_cloth::scene::SceneConfig;
use drape_task::env::{EnvConfig, check_memory};

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
    /// Least and greatest value of a number of the scene, by its key with dots; each member has its
    /// own, uniformly between them.
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
    /// The scenes, drawn under `seed` for the `number`th range of a run with the scene `base`.
    ///
    /// # Errors
    /// If a key is none of a number, or a drawn value is refused.
    pub fn draw(
        &self,
        base: &SceneConfig,
        (seed, number): (u64, usize),
    ) -> Result<Vec<SceneConfig>, ValueError> {
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
        let base = self.scene.as_ref().unwrap_or(base);
        let mut stream = Stream::new(seed, Purpose::Scenes, number as u32);
        let mut draw = || {
            let mut scene = Value::try_from(base).expect("a scene is a table");
            for (name, &[least, greatest]) in &self.vary {
                let value = least + (greatest - least) * stream.uniform();
                let place = place(&mut scene, name).ok_or_else(|| {
                    let expected =
                        "the key of a number in the scene that need not be whole, with dots";
                    ValueError::new(&key("vary"), name, expected)
                })?;
                *place = Value::Float(value);
            }
            let read = scene.try_into::<SceneConfig>();
            read.map_err(|error| ValueError::new(&key("vary"), error.message(), "a scene"))
        };
        (0..self.members).map(|_| draw()).collect()
    }
}

/// One of the scenes that a policy learns on.
#[derive(Clone, Debug)]
pub struct Member {
    pub scene: SceneConfig,
    pub env: EnvConfig,
    /// Environments on it.
    pub environments: usize,
}

impl Member {
    /// Refuses blanks of which `count` environments exhaust the memory, before their fall.
    pub fn check_memory(&self, count: usize) -> anyhow::Result<()> {
        let lamina = Lamina::new(&self.scene.blank, self.scene.read_material()?)?;
        Ok(check_memory(count, lamina.vertex_count())?)
    }
}

/// Where the number with a dotted `key` stands, its place in a list counted from 0.
fn place<'a>(value: &'a mut Value, key: &str) -> Option<&'a mut Value> {
    let place = key.split('.').try_fold(value, |value, part| match value {
        Value::Table(table) => table.get_mut(part),
        Value::Array(list) => list.get_mut(part.parse::<usize>().ok()?),
        _ => None,
    })?;
    place.is_float().then_some(place)
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

    #[test]
    fn members_differ_in_what_varies_and_repeat_under_a_seed() {
        let base = SceneConfig::rib();
        let drawn = |seed| range("placement.tilt_deg", [10.0, 20.0]).draw(&base, (seed, 0));
        let members = drawn(1).unwrap();
        let tilts: Vec<f64> = members.iter().map(|m| m.placement.tilt_deg).collect();
        assert!(tilts.iter().all(|tilt| (10.0..20.0).contains(tilt)));
        assert!(tilts[0] != tilts[1] && tilts[1] != tilts[2]);
        assert_eq!(drawn(1).unwrap(), members);
        assert_ne!(drawn(2).unwrap(), members);
        for mut member in members {
            member.placement.tilt_deg = base.placement.tilt_deg;
            assert_eq!(member, base);
        }
        // In lists and in the tool's own table.
        for (key, value) in [("clamps.0.move_mm.0", 12.0), ("blank.size_mm.1", 300.0)] {
            let member = range(key, [value; 2])
                .draw(&base, (1, 0))
                .unwrap()
                .remove(0);
            assert_ne!(member, base, "{key}");
        }
    }

    #[test]
    fn keys_and_ranges_that_cannot_be_are_named() {
        let base = SceneConfig::rib();
        let error = |key: &str, values| range(key, values).draw(&base, (1, 2)).unwrap_err();
        assert_eq!(
            error("placement.tilt", [0.0, 1.0]).to_string(),
            "`scenes.2.vary` is placement.tilt, expected the key of a number in the scene that need not \
             be whole, with dots"
        );
        assert!(
            error("blank.vertices.0", [9.0, 11.0])
                .to_string()
                .contains("whole")
        );
        let reversed = error("placement.tilt_deg", [2.0, 1.0]);
        assert_eq!(reversed.key, "scenes.2.vary.placement.tilt_deg");
        assert!(
            error("tool.grid", [0.0, 1.0])
                .to_string()
                .contains("tool.grid")
        );
    }
}
