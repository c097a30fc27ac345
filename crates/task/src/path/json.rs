use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::DrapingPoint;
use drape_cloth::file::{WriteError, write_atomic};
use drape_cloth::math::Vec3;

/// Largest deviation of a unit vector's length from 1, and of the cosine between two
/// perpendicular ones from 0, that a file may have: what six decimals give.
const DIRECTION_TOLERANCE: f64 = 2e-6;

/// What the file says about itself. A reader refuses files that say anything else.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    format: String,
    units: String,
    frame: String,
    normal: String,
    travel: String,
    robot_frame: String,
    kind: String,
}

impl Header {
    fn new() -> Self {
        Self {
            format: "drape path 1".into(),
            units: "position in metres; normal and travel are unit vectors".into(),
            frame: "the tool's mesh".into(),
            normal: "out of the tool".into(),
            travel: "along the surface towards the next point of the stroke, at its last \
                     point from the one before; null where there is none"
                .into(),
            robot_frame: "z = -normal, into the surface; x = travel; y = z cross x, along \
                          the axis of the roller; origin on the roller's line of contact"
                .into(),
            kind: "stroke: travel in contact; press: no travel; a point with starts_stroke \
                   is reached by a jump"
                .into(),
        }
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    conventions: Header,
    points: Vec<DrapingPoint>,
}

/// Why a path file could not be read.
#[derive(Debug, thiserror::Error)]
pub enum PathFileError {
    #[error("cannot read {}", path.display())]
    Read {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    #[error("{} is not a draping path", path.display())]
    Json {
        path: PathBuf,
        #[source]
        source: serde_json::Error,
    },
    #[error("{}: conventions differ from those of this drape", path.display())]
    Conventions { path: PathBuf },
    #[error("{}: point {index}: {field} is {found}, expected {expected}", path.display())]
    Point {
        path: PathBuf,
        /// Place in the file, from 0.
        index: usize,
        field: &'static str,
        found: String,
        expected: String,
    },
}

/// Writes the path with all its conventions, in SI units: the form other tools should read.
pub fn write_json(path: &Path, points: &[DrapingPoint]) -> Result<(), WriteError> {
    let document = Document {
        conventions: Header::new(),
        points: points.to_vec(),
    };
    write_atomic(path, |file| {
        serde_json::to_writer_pretty(&mut *file, &document)?;
        file.write_all(b"\n")
    })
}

/// Reads what [`write_json`] wrote and checks numbering and directions.
pub fn read_json(path: &Path) -> Result<Vec<DrapingPoint>, PathFileError> {
    let text = fs::read_to_string(path).map_err(|source| PathFileError::Read {
        path: path.into(),
        source,
    })?;
    let document: Document = serde_json::from_str(&text).map_err(|source| PathFileError::Json {
        path: path.into(),
        source,
    })?;
    if document.conventions != Header::new() {
        return Err(PathFileError::Conventions { path: path.into() });
    }
    for (index, point) in document.points.iter().enumerate() {
        if let Some((field, found, expected)) = inconsistency(index, point) {
            return Err(PathFileError::Point {
                path: path.into(),
                index,
                field,
                found,
                expected,
            });
        }
    }
    Ok(document.points)
}

/// The first field of `point` that contradicts the conventions: its name, what was found
/// and what was expected.
fn inconsistency(index: usize, point: &DrapingPoint) -> Option<(&'static str, String, String)> {
    if point.index != index {
        return Some(("index", point.index.to_string(), index.to_string()));
    }
    let unit = |v: &Vec3| (v.norm() - 1.0).abs() <= DIRECTION_TOLERANCE;
    let shown = |v: &Vec3| format!("{:?}", v.as_slice());
    if !unit(&point.normal) {
        return Some(("normal", shown(&point.normal), "a unit vector".into()));
    }
    let travel = point.travel.as_ref()?;
    if !unit(travel) || travel.dot(&point.normal).abs() > DIRECTION_TOLERANCE {
        return Some(("travel", shown(travel), "a unit tangent".into()));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::{PressedPoint, strokes};
    use serde_json::json;

    fn sample() -> Vec<DrapingPoint> {
        let point = |vertex, position: [f64; 3], normal: [f64; 3]| PressedPoint {
            vertex,
            position: position.into(),
            normal: normal.into(),
        };
        // Binary fractions: exact as decimals too.
        let points = [
            point(5, [0.0, 0.0, 0.25], [0.0, 0.0, 1.0]),
            point(6, [0.5, 0.0, 0.25], [0.0, 0.0, 1.0]),
            point(9, [8.0, 0.0, 0.25], [0.0, -1.0, 0.0]),
        ];
        strokes(&points, 1.0).unwrap()
    }

    /// The sample's file with the string `from` replaced by `to`, read back.
    fn read_edited(from: &str, to: &str) -> Result<Vec<DrapingPoint>, PathFileError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("path.json");
        write_json(&path, &sample()).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{text}");
        fs::write(&path, text.replacen(from, to, 1)).unwrap();
        read_json(&path)
    }

    #[test]
    fn points_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("path.json");
        for points in [sample(), vec![]] {
            write_json(&path, &points).unwrap();
            assert_eq!(read_json(&path).unwrap(), points);
        }
    }

    #[test]
    fn file_holds_what_other_tools_expect() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("path.json");
        write_json(&path, &sample()).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        let file: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert!(
            file["conventions"]["units"]
                .as_str()
                .unwrap()
                .contains("metres")
        );
        assert_eq!(
            file["points"][1],
            json!({
                "index": 1, "vertex": 6, "position": [0.5, 0.0, 0.25],
                "normal": [0.0, 0.0, 1.0], "travel": [1.0, 0.0, 0.0],
                "stroke": 0, "starts_stroke": false, "kind": "stroke",
            })
        );
        assert_eq!(
            file["points"][2],
            json!({
                "index": 2, "vertex": 9, "position": [8.0, 0.0, 0.25],
                "normal": [0.0, -1.0, 0.0], "travel": null,
                "stroke": 1, "starts_stroke": true, "kind": "press",
            })
        );
    }

    #[test]
    fn files_in_other_conventions_are_refused() {
        let error = read_edited("in metres", "in millimetres").unwrap_err();
        assert!(
            matches!(error, PathFileError::Conventions { .. }),
            "{error}"
        );
        let error = read_edited("\"vertex\"", "\"node\"").unwrap_err();
        assert!(matches!(error, PathFileError::Json { .. }), "{error}");
    }

    #[test]
    fn inconsistent_points_are_located() {
        let message = |from, to| read_edited(from, to).unwrap_err().to_string();
        let error = message("\"index\": 1", "\"index\": 4");
        assert!(
            error.ends_with("point 1: index is 4, expected 1"),
            "{error}"
        );
        let error = message("-1.0", "-1.1");
        assert!(
            error.ends_with("point 2: normal is [0.0, -1.1, 0.0], expected a unit vector"),
            "{error}"
        );
        let error = message("1.0,\n        0.0,\n        0.0\n", "0.0, 0.0, 1.0\n");
        assert!(
            error.ends_with("point 0: travel is [0.0, 0.0, 1.0], expected a unit tangent"),
            "{error}"
        );
    }
}
