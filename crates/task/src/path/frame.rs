use nalgebra::{IsometryMatrix3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::DrapingPoint;
use drape_cloth::math::Vec3;
use drape_cloth::tool::Pose;

/// What the coordinates of an export count from, and where the tool stands in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    axes: Axes,
    /// From the tool's frame to the scene's.
    pose: IsometryMatrix3<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Axes {
    Tool,
    Scene,
}

/// The pose of the tool as files have it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ToolPose {
    /// Row by row, homogeneous; the last column is the translation.
    pub matrix: [[f64; 4]; 4],
    /// w, x, y, z.
    pub quaternion: [f64; 4],
}

impl Axes {
    /// As files call them.
    pub fn words(self) -> &'static str {
        match self {
            Self::Tool => "tool: origin and axes of the tool's file, before tool.pose",
            Self::Scene => "scene: z up, the tool where tool.pose has put it",
        }
    }
}

impl Frame {
    /// What a tool's pose does, in the words of all files.
    pub(super) const POSE: &'static str = "from the tool's frame to the scene's: x_scene = matrix \
                                           x_tool; quaternion is w, x, y, z";

    /// That of the tool's file, or of its formula, which `pose` moves into the scene.
    pub fn tool(pose: &Pose) -> Self {
        let (axes, pose) = (Axes::Tool, pose.isometry());
        Self { axes, pose }
    }

    /// That in which everything was computed.
    pub fn scene(pose: &Pose) -> Self {
        let (axes, pose) = (Axes::Scene, pose.isometry());
        Self { axes, pose }
    }

    pub(super) fn axes(&self) -> Axes {
        self.axes
    }

    /// A point of the scene [m] in this frame, to rounding.
    pub fn point(&self, x: &Vec3) -> Vec3 {
        match self.axes {
            Axes::Tool => self.pose.inverse_transform_point(&(*x).into()).coords,
            Axes::Scene => *x,
        }
    }

    /// A direction of the scene in this frame.
    pub fn direction(&self, v: &Vec3) -> Vec3 {
        match self.axes {
            Axes::Tool => self.pose.inverse_transform_vector(v),
            Axes::Scene => *v,
        }
    }

    /// A path of the scene in this frame.
    pub(super) fn path(&self, points: &[DrapingPoint]) -> Vec<DrapingPoint> {
        let moved = |point: &DrapingPoint| DrapingPoint {
            position: self.point(&point.position),
            normal: self.direction(&point.normal),
            travel: point.travel.map(|travel| self.direction(&travel)),
            ..*point
        };
        points.iter().map(moved).collect()
    }

    /// The tool's pose; lengths `per_metre` to a metre.
    pub(super) fn tool_pose(&self, per_metre: f64) -> ToolPose {
        let [x, y, z, w] = UnitQuaternion::from(self.pose.rotation).coords.into();
        let mut matrix = self.pose.to_homogeneous();
        matrix.fixed_view_mut::<3, 1>(0, 3).scale_mut(per_metre);
        // No sign on zero.
        ToolPose {
            matrix: std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)] + 0.0)),
            quaternion: [w, x, y, z].map(|q| q + 0.0),
        }
    }

    /// Frame and pose [mm] as remarks of a text file, a line each.
    pub fn remarks(&self) -> Vec<String> {
        let pose = self.tool_pose(1e3);
        let row = |numbers: &[f64; 4]| numbers.map(|x| format!("{x:?}")).join(", ");
        let rows = pose.matrix.iter().map(|r| format!("matrix: {}", row(r)));
        [
            format!("frame: {}", self.axes.words()),
            format!("tool_pose [mm]: {}", Self::POSE),
        ]
        .into_iter()
        .chain(rows)
        .chain([format!("quaternion: {}", row(&pose.quaternion))])
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::path::inp::{Dialect, DrapingDeck, FabricCard};
    use crate::path::{PressedPoint, Rolling, strokes, write_csv, write_json};
    use drape_cloth::mesh::TriMesh;

    /// A quarter turn about z, and a move.
    fn pose() -> Pose {
        Pose {
            translation_mm: [10.0, 20.0, 500.0],
            rotation_deg: [0.0, 0.0, 90.0],
        }
    }

    const PLACES: [[f64; 3]; 4] = [
        [0.0, 0.0, 0.25],
        [0.004, 0.003, 0.25],
        [0.1, -0.3, 0.75],
        [1e-3, 0.123456, 0.5],
    ];

    fn points() -> Vec<DrapingPoint> {
        let point = |position: [f64; 3]| PressedPoint {
            vertex: 0,
            position: position.into(),
            normal: Vec3::new(0.6, 0.0, 0.8),
        };
        strokes(&PLACES.map(point), Rolling::joining(0.01)).unwrap()
    }

    /// Places [m], matrix [m] and quaternion of what a format says of these points.
    type Said = (Vec<Vec3>, [[f64; 4]; 4], [f64; 4]);

    fn json(frame: &Frame) -> Said {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("path.json");
        write_json(&file, &points(), frame).unwrap();
        let text = fs::read_to_string(&file).unwrap();
        let document: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(document["conventions"]["frame"], frame.axes().words());
        let pose: ToolPose = serde_json::from_value(document["tool_pose"].clone()).unwrap();
        let read = crate::path::read_json(&file).unwrap();
        let places = read.iter().map(|point| point.position);
        (places.collect(), pose.matrix, pose.quaternion)
    }

    /// Of lines that begin with `remark`, and rows whose columns from `first` on are millimetres.
    fn in_text(text: &str, remark: &str, first: usize, frame: &Frame) -> Said {
        let numbers = |line: &str| -> Vec<f64> {
            line.split(',')
                .map(|x| x.trim().parse().unwrap_or(0.0))
                .collect()
        };
        let after = |key: &str| {
            let key = format!("{remark} {key}: ");
            let lines = text
                .lines()
                .filter_map(move |line| line.strip_prefix(key.as_str()).map(String::from));
            lines.collect::<Vec<_>>()
        };
        assert_eq!(after("frame"), [frame.axes().words()]);
        let rows: Vec<[f64; 4]> = after("matrix")
            .iter()
            .map(|r| numbers(r).try_into().unwrap())
            .collect();
        let mut matrix: [[f64; 4]; 4] = rows.try_into().unwrap();
        matrix[..3].iter_mut().for_each(|row| row[3] *= 1e-3);
        let places = text
            .lines()
            .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()))
            .take(PLACES.len());
        let place = |line: &str| Vec3::from_row_slice(&numbers(line)[first..first + 3]) * 1e-3;
        let quaternion = numbers(&after("quaternion")[0]).try_into().unwrap();
        (places.map(place).collect(), matrix, quaternion)
    }

    fn csv(frame: &Frame) -> Said {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("path.csv");
        write_csv(&file, &points(), frame).unwrap();
        in_text(&fs::read_to_string(&file).unwrap(), "#", 2, frame)
    }

    fn deck(frame: &Frame, dialect: Dialect) -> Said {
        let line = || vec![[0.0, 0.0], [0.1, 1.0]];
        let fabric = FabricCard {
            thickness: 1e-3,
            areal_mass: 1.0,
            tension: [line(), line()],
            compression: [line(), line()],
            shear: [line(), line()],
            bending: [1e-4; 2],
            friction: [0.0; 2],
        };
        let lamina = TriMesh {
            vertices: PLACES.map(Vec3::from).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        let deck = DrapingDeck {
            title: "test",
            lamina: &lamina,
            yarns: &[[Vec3::x(), Vec3::y()]; 2],
            clamped: &[],
            tool: &lamina,
            fabric: &fabric,
            presses: &[],
            step_s: 0.1,
            pressure: 1e6,
            gravity: 1.0,
            frame: *frame,
        };
        in_text(deck.deck(dialect).text(), "**", 1, frame)
    }

    /// What a file says of its points, brought to the scene by its matrix or by its quaternion, are the
    /// points of the scene; in the frame of the tool they are those counted by hand.
    #[test]
    fn every_format_says_its_frame_and_comes_back_to_the_scene() {
        for frame in [Frame::tool(&pose()), Frame::scene(&pose())] {
            for (name, tolerance, (places, m, [w, x, y, z])) in [
                ("json", 1e-15, json(&frame)),
                ("csv", 0.6e-9, csv(&frame)),
                ("calculix", 4e-9, deck(&frame, Dialect::Calculix)),
                ("abaqus", 4e-9, deck(&frame, Dialect::Abaqus)),
            ] {
                assert_eq!(places.len(), PLACES.len(), "{name}");
                let turn = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
                let moved = Vec3::new(m[0][3], m[1][3], m[2][3]);
                assert_eq!(
                    (moved, m[3]),
                    (Vec3::new(0.01, 0.02, 0.5), [0.0, 0.0, 0.0, 1.0])
                );
                for (place, scene) in places.iter().zip(PLACES.map(Vec3::from)) {
                    let by_matrix =
                        Vec3::from_fn(|i, _| Vec3::from_row_slice(&m[i][..3]).dot(place));
                    let (hand, back) = match frame.axes() {
                        Axes::Scene => (scene, [scene; 2]),
                        Axes::Tool => {
                            let [x, y, z] = (scene - moved).into();
                            let back = [by_matrix + moved, turn * place + moved];
                            (Vec3::new(y, -x, z), back)
                        }
                    };
                    for (found, expected) in [(*place, hand), (back[0], scene), (back[1], scene)] {
                        let off = (found - expected).amax();
                        assert!(off <= tolerance, "{name}: {found:?}, not {expected:?}");
                    }
                }
            }
        }
        let frame = Frame::tool(&pose());
        let path = frame.path(&points());
        assert!((path[0].normal - Vec3::new(0.0, -0.6, 0.8)).amax() < 1e-15);
        assert!((frame.direction(&-Vec3::z()) + Vec3::z()).amax() < 1e-15);
    }
}
