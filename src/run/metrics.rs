use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result};
use serde_json::Value;

use super::folder::read_text;
use super::log::Log;

/// Appends to `metrics.jsonl`: one JSON object a line, `step` first.
///
/// A run that is resumed leaves the same file as one that was never interrupted, provided
/// the values themselves repeat; times do not.
#[derive(Debug)]
pub struct MetricsWriter(Log);

impl MetricsWriter {
    /// Starts a file. Fails if `path` exists.
    pub fn create(path: &Path) -> Result<Self> {
        Ok(Self(Log::create(path)?))
    }

    /// Goes on with the file at `path` after its first `length` bytes; what came later is
    /// dropped.
    pub fn resume(path: &Path, length: u64) -> Result<Self> {
        Ok(Self(Log::resume(path, length)?))
    }

    /// Appends the `values` (name, value) of `step` in the given order. Numbers that are
    /// not finite become `null`.
    pub fn append(&mut self, step: u64, values: &[(&str, f64)]) -> Result<()> {
        let mut line = format!("{{\"step\":{step}");
        for &(name, value) in values {
            line += &format!(",\"{name}\":{}", Value::from(value));
        }
        line += "}\n";
        self.0.append(line.as_bytes())
    }

    /// Makes the file survive a power failure.
    pub fn sync(&self) -> Result<()> {
        self.0.sync()
    }
}

/// One line of a metrics file.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
pub struct MetricsLine {
    pub step: u64,
    /// Values by name; `None` where the number was not finite.
    #[serde(flatten)]
    pub values: BTreeMap<String, Option<f64>>,
}

/// All lines of the metrics file at `path`, in order. A last line without its line break is
/// still being written and is left out.
pub fn read_metrics(path: &Path) -> Result<Vec<MetricsLine>> {
    let text = read_text(path)?;
    let whole = text
        .split_inclusive('\n')
        .filter(|line| line.ends_with('\n'));
    let parse = |(i, line)| {
        let place = || format!("{}, line {}: not a line of metrics", path.display(), i + 1);
        serde_json::from_str(line).with_context(place)
    };
    whole.enumerate().map(parse).collect()
}

/// The finite values called `name`, as (step, value): one curve.
pub fn curve(metrics: &[MetricsLine], name: &str) -> Vec<(u64, f64)> {
    metrics
        .iter()
        .filter_map(|line| Some((line.step, (*line.values.get(name)?)?)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn lines_keep_their_order_and_lose_what_is_not_finite() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.jsonl");
        let mut metrics = MetricsWriter::create(&path).unwrap();
        metrics
            .append(10, &[("score", 0.1), ("kl", f64::NAN)])
            .unwrap();
        metrics
            .append(20, &[("score", -2.5e-9), ("kl", 3.0)])
            .unwrap();
        metrics.append(30, &[("kl", f64::INFINITY)]).unwrap();
        assert_eq!(
            fs::read_to_string(&path).unwrap(),
            "{\"step\":10,\"score\":0.1,\"kl\":null}\n\
             {\"step\":20,\"score\":-2.5e-9,\"kl\":3.0}\n\
             {\"step\":30,\"kl\":null}\n"
        );
        let lines = read_metrics(&path).unwrap();
        assert_eq!(curve(&lines, "score"), [(10, 0.1), (20, -2.5e-9)]);
        assert_eq!(curve(&lines, "kl"), [(20, 3.0)]);
        assert_eq!(curve(&lines, "other"), []);
    }

    #[test]
    fn resumed_file_equals_an_uninterrupted_one() {
        let folder = tempfile::tempdir().unwrap();
        let [whole, broken] = ["whole", "broken"].map(|name| folder.path().join(name));
        let value = |step: u64| 1.0 / (1.0 + step as f64);
        let mut metrics = MetricsWriter::create(&whole).unwrap();
        for step in 0..9 {
            metrics.append(step, &[("a", value(step))]).unwrap();
        }

        let mut metrics = MetricsWriter::create(&broken).unwrap();
        for step in 0..4 {
            metrics.append(step, &[("a", value(step))]).unwrap();
        }
        metrics.sync().unwrap();
        let known = fs::metadata(&broken).unwrap().len();
        metrics.append(4, &[("a", 99.0)]).unwrap();
        let mut metrics = MetricsWriter::resume(&broken, known).unwrap();
        for step in 4..9 {
            metrics.append(step, &[("a", value(step))]).unwrap();
        }
        assert_eq!(fs::read(&broken).unwrap(), fs::read(&whole).unwrap());
    }

    #[test]
    fn damaged_line_is_located_and_unfinished_one_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.jsonl");
        fs::write(&path, "{\"step\":1,\"a\":1.0}\n{\"step\":2,\"a\":").unwrap();
        assert_eq!(read_metrics(&path).unwrap().len(), 1);
        fs::write(&path, "{\"step\":1,\"a\":1.0}\n{\"step\":2,\"a\":\n").unwrap();
        let error = read_metrics(&path).unwrap_err().to_string();
        assert!(
            error.ends_with("metrics.jsonl, line 2: not a line of metrics"),
            "{error}"
        );
    }
}
