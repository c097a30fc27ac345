//! What presses do to a blank, press by press, in one file: what pictures, films and whoever looks at an
//! episode later need, and all that it takes to press it again.

use std::path::Path;

use fixedbitset::FixedBitSet;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::env::{EnvConfig, EpisodeState, Task};
use crate::path::{PressedPoint, stroke_points};
use drape_cloth::file::{ReadError, Sealed, WriteError};
use drape_cloth::math::{Vec3, bits};
use drape_cloth::mesh::TriMesh;
use drape_cloth::sim::Snapshot;

/// Its files. Checkpoints are of kind 0.
const FILE: Sealed = Sealed {
    name: "a recording",
    kind: 1,
    format: 3,
};

/// An episode, or any list of presses, as either physics has gone through it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recording {
    /// By the finite-element twin, not the fast solver.
    pub by_twin: bool,
    /// The task, as whose configuration says.
    #[serde(with = "as_text")]
    pub env: EnvConfig,
    /// The flat blank: a place a vertex [m].
    pub rest: Vec<[f64; 2]>,
    /// Its triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Where in the scene the frame lies in which tool, start and frames are [m]: see `Tool::origin`.
    pub origin: Vec3,
    /// The tool.
    pub tool: TriMesh,
    /// State before the first press, with what the environment has of its own.
    pub start: Snapshot,
    /// Where in the scene it was pressed, in order.
    pub presses: Vec<PressedPoint>,
    /// What there was before the first press, and after each.
    pub frames: Vec<RecordedFrame>,
}

/// A moment of a [`Recording`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordedFrame {
    /// Where every vertex is [m].
    #[serde(with = "as_short")]
    pub position: Vec<[f64; 3]>,
    /// Vertices that have been under the stencil.
    #[serde(with = "bits")]
    pub touched: FixedBitSet,
    /// Those that stay on the tool.
    #[serde(with = "bits")]
    pub draped: FixedBitSet,
    /// Summed distance of the region to the tool [m].
    pub distance: f64,
    /// Mean surplus of its yarns [m].
    pub surplus: f64,
    /// See [`score`](crate::env::score), without costs.
    pub score: f64,
}

impl Recording {
    /// One by the fast solver that nothing has been seen of yet.
    pub fn new(task: &Task) -> Self {
        let scene = &task.scene;
        Self {
            by_twin: false,
            env: task.config.clone(),
            rest: scene.lamina.rest.clone(),
            triangles: scene.lamina.triangles.clone(),
            origin: scene.tool.origin,
            tool: scene.tool.mesh.clone(),
            start: Snapshot::default(),
            presses: Vec::new(),
            frames: Vec::new(),
        }
    }

    /// Sees where `episode` of `task` has come to: to be called at its start and after each press.
    pub fn see(&mut self, task: &Task, episode: &EpisodeState) {
        let cloth = episode.cloth();
        if self.frames.is_empty() {
            self.start = cloth.clone();
        }
        let pressed = task.points(&episode.presses()[self.presses.len()..]);
        self.presses.extend(pressed);
        self.frames.push(RecordedFrame {
            position: cloth.position.clone(),
            touched: cloth.pressed.touched.clone(),
            draped: cloth.pressed.draped.clone(),
            distance: task.distance(cloth),
            surplus: task.surplus(cloth),
            score: task.score(cloth),
        });
    }

    /// Vertices that were pressed, in order.
    pub fn vertices(&self) -> Vec<u32> {
        self.presses.iter().map(|point| point.vertex).collect()
    }

    /// Where every vertex is after the last press [m].
    ///
    /// # Panics
    /// If nothing has been seen yet.
    pub fn end(&self) -> &[[f64; 3]] {
        &self.frames.last().expect("it has been seen").position
    }

    /// The vertices of each stroke until a frame.
    pub fn strokes(&self, frame: usize) -> impl Iterator<Item = impl Iterator<Item = u32>> {
        let points = &self.presses[..frame.min(self.presses.len())];
        let strokes = stroke_points(points, self.env.rolling());
        strokes.map(|stroke| stroke.iter().map(|point| point.vertex))
    }

    /// Greatest distance between the same vertices in the same frames [m], where these are alike in number.
    pub fn apart(&self, other: &Self) -> f64 {
        let frames = self.frames.iter().zip(&other.frames);
        let places = frames.flat_map(|(a, b)| a.position.iter().zip(&b.position));
        let apart = places.map(|(a, b)| (Vec3::from(*a) - Vec3::from(*b)).norm());
        apart.fold(0.0, f64::max)
    }

    /// Writes it whole or not at all.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        FILE.write(path, self)
    }

    /// Reads one, and checks that its parts are of one blank.
    ///
    /// # Errors
    /// If the file is none, or damaged.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let read: Self = FILE.read(path)?;
        let count = read.rest.len();
        let (mut corners, mut frames) = (read.triangles.iter().flatten(), read.frames.iter());
        let mut presses = read.presses.iter().map(|press| &press.vertex);
        let is_whole = read.frames.len() == read.presses.len() + 1
            && read.start.position.len() == count
            && frames.all(|frame| {
                let RecordedFrame {
                    touched, draped, ..
                } = frame;
                [frame.position.len(), touched.len(), draped.len()] == [count; 3]
            })
            && corners.all(|&v| (v as usize) < count)
            && presses.all(|&v| (v as usize) < count);
        match is_whole {
            true => Ok(read),
            false => Err(ReadError::fault(path, "its parts are not of one blank")),
        }
    }
}

/// Positions in single precision where that is exact, as the fast solver's are.
mod as_short {
    use super::*;

    #[derive(Serialize, Deserialize)]
    enum Positions {
        Single(Vec<[f32; 3]>),
        Double(Vec<[f64; 3]>),
    }

    pub fn serialize<S: Serializer>(all: &[[f64; 3]], serializer: S) -> Result<S::Ok, S::Error> {
        let short: Vec<[f32; 3]> = all.iter().map(|x| x.map(|x| x as f32)).collect();
        let is_exact = |(long, short): (&f64, &f32)| long.to_bits() == f64::from(*short).to_bits();
        let mut pairs = all.as_flattened().iter().zip(short.as_flattened());
        match pairs.all(is_exact) {
            true => Positions::Single(short).serialize(serializer),
            false => Positions::Double(all.to_vec()).serialize(serializer),
        }
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<[f64; 3]>, D::Error> {
        Ok(match Positions::deserialize(from)? {
            Positions::Single(all) => all.into_iter().map(|x| x.map(f64::from)).collect(),
            Positions::Double(all) => all,
        })
    }
}

/// A configuration as the text of its file, whose keys may be absent.
mod as_text {
    use super::*;
    use serde::de::Error as _;
    use serde::ser::Error as _;

    pub fn serialize<S: Serializer>(env: &EnvConfig, serializer: S) -> Result<S::Ok, S::Error> {
        toml::to_string(env)
            .map_err(S::Error::custom)?
            .serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<EnvConfig, D::Error> {
        toml::from_str(&String::deserialize(from)?).map_err(D::Error::custom)
    }
}
