use std::fmt::Write as _;

use serde_json::Value;

use super::Point;

/// Columns of the table: the fields of [`Point`].
const COLUMNS: [&str; 29] = [
    "axis",
    "value",
    "kind",
    "solver",
    "precision",
    "substep_rate",
    "contact_interval",
    "vertices",
    "microseconds",
    "initial_seconds",
    "initial_mean_mm",
    "initial_max_mm",
    "initial_distance_m",
    "initial_distance_error_m",
    "early_mean_mm",
    "region_mean_mm",
    "region_max_mm",
    "sheet_mean_mm",
    "sheet_max_mm",
    "region_distance_m",
    "sheet_distance_m",
    "removed_error",
    "tension_p95",
    "tension_max",
    "sequences_distance_m",
    "sequences_deviation_m",
    "sequences_bias_m",
    "sequences_rms_m",
    "sequences_mean_mm",
];

/// One row a point; numbers that do not exist are empty.
pub fn csv(points: &[Point]) -> String {
    let mut text = COLUMNS.join(",") + "\n";
    for point in points {
        let fields = serde_json::to_value(point).expect("points are plain data");
        let cells = COLUMNS.map(|name| match &fields[name] {
            Value::Null => String::new(),
            Value::String(text) => text.clone(),
            number => number.to_string(),
        });
        let _ = writeln!(text, "{}", cells.join(","));
    }
    text
}
