use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::DrapingPoint;
use super::frame::{Axes, Frame, ToolPose};
use drape_cloth::file::{self, ReadError, ValueError, WriteError, write_atomic};
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
    tool_pose: String,
    normal: String,
    travel: String,
    robot_frame: String,
    kind: String,
}

impl Header {
    fn new(axes: Axes) -> Self {
        Self {
            format: "drape path 2".into(),
            units: "position in metres; normal and travel are unit vectors".into(),
            frame: axes.words().into(),
            tool_pose: Frame::POSE.into(),
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
    tool_pose: ToolPose,
    points: Vec<DrapingPoint>,
}

/// Writes a path of the scene in `frame` with all its conventions, in SI units: the form other
/// tools should read.
pub fn write_json(path: &Path, points: &[DrapingPoint], frame: &Frame) -> Result<(), WriteError> {
    let document = Document {
        conventions: Header::new(frame.axes()),
        tool_pose: frame.tool_pose(1.0),
        points: frame.path(points),
    };
    write_atomic(path, |file| {
        serde_json::to_writer_pretty(&mut *file, &document)?;
        file.write_all(b"\n")
    })
}

/// Reads what [`write_json`] wrote, in either frame, and checks numbering and directions.
pub fn read_json(path: &Path) -> Result<Vec<DrapingPoint>, ReadError> {
    let fault = |fault: String| ReadError::fault(path, fault);
    let document: Document = file::read_json(path, "a draping path")?;
    let known = [Axes::Tool, Axes::Scene].map(Header::new);
    if !known.contains(&document.conventions) {
        return Err(fault("conventions differ from those of this drape".into()));
    }
    for (index, point) in document.points.iter().enumerate() {
        check(index, point).map_err(|wrong| fault(format!("point {index}: {wrong}")))?;
    }
    Ok(document.points)
}

/// Refuses a point that contradicts the conventions.
fn check(index: usize, point: &DrapingPoint) -> Result<(), ValueError> {
    let (found, expected) = (point.index, index.to_string());
    ValueError::unless(found == index, "index", found, expected)?;
    let is_unit = |v: &Vec3| (v.norm() - 1.0).abs() <= DIRECTION_TOLERANCE;
    let shown = |v: &Vec3| format!("{:?}", v.as_slice());
    let normal = &point.normal;
    ValueError::unless(is_unit(normal), "normal", shown(normal), "a unit vector")?;
    if let Some(travel) = &point.travel {
        let is_tangent = is_unit(travel) && travel.dot(normal).abs() <= DIRECTION_TOLERANCE;
        ValueError::unless(is_tangent, "travel", shown(travel), "a unit tangent")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::path::{PressedPoint, Rolling, strokes};
    use drape_cloth::tool::Pose;
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
        strokes(&points, Rolling::joining(1.0)).unwrap()
    }

    /// The sample's file with the string `from` replaced by `to`, read back.
    fn read_edited(from: &str, to: &str) -> Result<Vec<DrapingPoint>, ReadError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("path.json");
        write_json(&path, &sample(), &Frame::tool(&Pose::default())).unwrap();
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
            write_json(&path, &points, &Frame::tool(&Pose::default())).unwrap();
            assert_eq!(read_json(&path).unwrap(), points);
        }
    }

    #[test]
    fn file_holds_what_other_tools_expect() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("path.json");
        write_json(&path, &sample(), &Frame::tool(&Pose::default())).unwrap();
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
        assert!(error.to_string().contains("conventions differ"), "{error}");
        let error = read_edited("\"vertex\"", "\"node\"").unwrap_err();
        assert!(error.to_string().contains("not a draping path"), "{error}");
    }

    #[test]
    fn inconsistent_points_are_located() {
        let message = |from, to| read_edited(from, to).unwrap_err().to_string();
        let error = message("\"index\": 1", "\"index\": 4");
        assert!(
            error.ends_with("point 1: `index` is 4, expected 1"),
            "{error}"
        );
        let error = message("-1.0", "-1.1");
        assert!(
            error.ends_with("point 2: `normal` is [0.0, -1.1, 0.0], expected a unit vector"),
            "{error}"
        );
        let error = message(
            "\"travel\": [\n        1.0,\n        0.0,\n        0.0\n",
            "\"travel\": [0.0, 0.0, 1.0\n",
        );
        assert!(
            error.ends_with("point 0: `travel` is [0.0, 0.0, 1.0], expected a unit tangent"),
            "{error}"
        );
    }
}
