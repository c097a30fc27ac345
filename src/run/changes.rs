//! What may change in the configuration of a run when it is gone on with.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use toml::{Table, Value};

use drape_cloth::file::{ReadError, ValueError, parse_toml};

/// Keys that may change. Whatever else a configuration says decides what the files of its run mean.
const FREE: [&str; 23] = [
    "environments",
    "evaluation_interval",
    "polish",
    "ppo.adam_epsilon",
    "ppo.advantage_floor",
    "ppo.advantage_norm",
    "ppo.baseline",
    "ppo.clip_range",
    "ppo.entropy_coefficient",
    "ppo.epochs",
    "ppo.gae_lambda",
    "ppo.gamma",
    "ppo.imitation.coefficient",
    "ppo.imitation.samples",
    "ppo.learning_rate",
    "ppo.max_grad_norm",
    "ppo.minibatch_size",
    "ppo.normalise_entropy",
    "ppo.policy_coefficient",
    "ppo.rollout_steps",
    "ppo.value_coefficient",
    "proof_paths",
    "steps",
];

/// The configuration `text` of a run with `changes`, each as `KEY=VALUE` in TOML; none where it says so already.
///
/// # Errors
/// A change is no TOML, of a key that may not change, or of one that another sets otherwise.
pub fn changed(text: &str, changes: &[String]) -> Result<Option<String>> {
    let mut config = table(text)?;
    let (before, mut all, mut is_changed) = (values(&config), BTreeMap::new(), false);
    for change in changes {
        let given: Table = parse_toml(change, Path::new("--set")).map_err(|error| match error {
            ReadError::Fault { fault, .. } => ValueError::new("--set", change, fault).into(),
            error => anyhow::Error::from(error),
        })?;
        for (key, value) in values(&given) {
            if let Some(other) = all.insert(key.clone(), value.clone()) {
                let expected = format!("{other} as it is given too");
                ValueError::unless(other == value, &key, &value, expected)?;
            }
            if before.get(&key) == Some(&value) {
                continue;
            }
            let free = FREE.join(", ");
            let expected = match before.get(&key) {
                Some(found) => format!("{found} as in the run, where these may change: {free}"),
                None => format!("one of the keys that may change: {free}"),
            };
            let is_free = FREE.contains(&&*key);
            let is_put = is_free && put(&mut config, &key, value.clone());
            ValueError::unless(is_put, &key, value, expected)?;
            is_changed = true;
        }
    }
    Ok(is_changed.then(|| config.to_string()))
}

/// What of a configuration may not change, in an order of its own.
pub(super) fn fixed(text: &str, path: &Path) -> Result<String> {
    let mut fixed = values(&parse_toml(text, path)?);
    fixed.retain(|key, _| !FREE.contains(&&**key));
    let lines = fixed
        .iter()
        .map(|(key, value)| format!("{key} = {value}\n"));
    Ok(lines.collect())
}

fn table(text: &str) -> Result<Table> {
    Ok(parse_toml(text, Path::new("config.toml"))?)
}

/// Values by their keys with dots.
fn values(table: &Table) -> BTreeMap<String, Value> {
    let mut all = BTreeMap::new();
    for (key, value) in table {
        match value {
            Value::Table(inner) => {
                let inner = values(inner).into_iter();
                all.extend(inner.map(|(below, value)| (format!("{key}.{below}"), value)));
            }
            value => drop(all.insert(key.clone(), value.clone())),
        }
    }
    all
}

/// Puts a value where a key with dots stands; false below what is no table, as an imitation that is off.
fn put(table: &mut Table, key: &str, value: Value) -> bool {
    let Some((first, rest)) = key.split_once('.') else {
        table.insert(key.into(), value);
        return true;
    };
    let inner = table.entry(first).or_insert(Value::Table(Table::new()));
    inner
        .as_table_mut()
        .is_some_and(|inner| put(inner, rest, value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::RunConfig;

    const TEXT: &str = "steps = 9\n[env]\nstencil_mm = 18.0\n[ppo]\nlearning_rate = 1e-3\n";

    fn set(changes: &[&str]) -> Result<Option<String>> {
        let changes: Vec<String> = changes.iter().map(|&change| change.into()).collect();
        changed(TEXT, &changes)
    }

    #[test]
    fn free_keys_change_and_leave_what_is_fixed() {
        let text = set(&["ppo.learning_rate=1e-4", "ppo = { epochs = 3 }"]).unwrap();
        let text = text.unwrap();
        let ppo = &table(&text).unwrap()["ppo"];
        assert_eq!(ppo["learning_rate"].as_float(), Some(1e-4));
        assert_eq!(ppo["epochs"].as_integer(), Some(3));
        let fixed = |text| fixed(text, Path::new("config.toml")).unwrap();
        assert_eq!(fixed(&text), fixed(TEXT));
        assert_eq!(fixed(TEXT), "env.stencil_mm = 18.0\n");
        assert_eq!(set(&["steps = 9", "env.stencil_mm=18.0"]).unwrap(), None);
    }

    #[test]
    fn keys_that_may_not_change_are_named() {
        for (change, words) in [
            (
                "env.stencil_mm=20",
                "`env.stencil_mm` is 20, expected 18.0 as in the run, where these may",
            ),
            (
                "steqs=1",
                "`steqs` is 1, expected one of the keys that may change",
            ),
            ("ppo.scale_rewards=true", "`ppo.scale_rewards` is true"),
            ("steps", "`--set` is steps, expected"),
            ("steps=5", "`steps` is 9, expected 5 as it is given too"),
        ] {
            let error = set(&[change, "steps=9"]).unwrap_err().to_string();
            assert!(error.starts_with(words) || error.contains(words), "{error}");
        }
    }

    /// No name is misspelt: all are keys of a preset.
    #[test]
    fn free_keys_are_keys() {
        let known = values(&table(&RunConfig::quickstart().to_toml()).unwrap());
        for key in FREE {
            assert!(known.contains_key(key), "{key}");
        }
    }
}
