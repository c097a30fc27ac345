use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Result, anyhow, bail};
use serde_json::Value;

use drape_cloth::file::{in_words, read_bytes};

/// A line of `metrics.jsonl`: one JSON object of the `values` (name, value) in the given order,
/// `step` first. Numbers that are not finite become `null`.
pub fn metrics_line(step: u64, values: &[(&str, f64)]) -> String {
    let mut line = format!("{{\"step\":{step}");
    for &(name, value) in values {
        line += &format!(",\"{name}\":{}", Value::from(value));
    }
    line + "}\n"
}

/// One line of a metrics file.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
pub struct MetricsLine {
    pub step: u64,
    /// Values by name; `None` where the number was not finite.
    #[serde(flatten)]
    pub values: BTreeMap<String, Option<f64>>,
}

/// The first lines of the metrics file at `path`, `most` of them, in order, each with its length
/// [bytes]. A last line without its line break is still being written and is left out.
fn read_lines(path: &Path, most: usize) -> Result<Vec<(MetricsLine, u64)>> {
    let bytes = read_bytes(path, 1024)?;
    let lines = bytes.split_inclusive(|&byte| byte == b'\n');
    let whole = lines.filter(|line| line.ends_with(b"\n")).take(most);
    let parse = |(i, line): (usize, &[u8])| {
        let parsed = serde_json::from_slice(line).map_err(|error| {
            let (place, line, why) = (path.display(), i + 1, in_words(error));
            anyhow!("{place}, line {line}: not a line of metrics: {why}")
        })?;
        Ok((parsed, line.len() as u64))
    };
    whole.enumerate().map(parse).collect()
}

/// The first `lines` of the metrics file at `path`, which has them, each with its length [bytes].
pub(super) fn kept_lines(path: &Path, lines: u64) -> Result<Vec<(MetricsLine, u64)>> {
    let kept = read_lines(path, lines as usize)?;
    let found = kept.len();
    if (found as u64) < lines {
        let place = path.display();
        bail!("{place} has {found} lines, expected {lines} at least");
    }
    Ok(kept)
}

/// All whole lines of the metrics file at `path`, in order.
pub fn read_metrics(path: &Path) -> Result<Vec<MetricsLine>> {
    let lines = read_lines(path, usize::MAX)?;
    Ok(lines.into_iter().map(|(line, _)| line).collect())
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
    use super::super::log::Log;
    use super::*;
    use std::fs;

    fn append(log: &mut Log, step: u64, values: &[(&str, f64)]) {
        log.append(metrics_line(step, values).as_bytes()).unwrap();
    }

    #[test]
    fn lines_keep_their_order_and_lose_what_is_not_finite() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.jsonl");
        let mut metrics = Log::create(&path).unwrap();
        append(&mut metrics, 10, &[("score", 0.1), ("kl", f64::NAN)]);
        append(&mut metrics, 20, &[("score", -2.5e-9), ("kl", 3.0)]);
        append(&mut metrics, 30, &[("kl", f64::INFINITY)]);
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
        let mut metrics = Log::create(&whole).unwrap();
        for step in 0..9 {
            append(&mut metrics, step, &[("a", value(step))]);
        }

        let mut metrics = Log::create(&broken).unwrap();
        for step in 0..4 {
            append(&mut metrics, step, &[("a", value(step))]);
        }
        metrics.sync().unwrap();
        let known = fs::metadata(&broken).unwrap().len();
        append(&mut metrics, 4, &[("a", 99.0)]);
        let mut metrics = Log::resume(&broken, known).unwrap();
        for step in 4..9 {
            append(&mut metrics, step, &[("a", value(step))]);
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
            error.contains("metrics.jsonl, line 2: not a line of metrics: "),
            "{error}"
        );
    }
}
