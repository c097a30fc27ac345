use std::fmt;
use std::path::{Path, PathBuf};

use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use super::scan::{Mark, ScanFrame, Unit};
use crate::fabric::{BlankConfig, BlankError, Material};
use crate::file::{ReadError, ValueError, is_default, read_toml, refuse_lists};
use crate::sim::{PhysicsConfig, Stepping};
use crate::tool::{Source, ToolConfig, ToolError};

/// Duration of a control step of the fall [s].
pub(super) const FRAME: f64 = 1.0 / 60.0;

/// Farthest that a blank hangs from the origin and a clamp moves [mm]: beyond 100 m a state counts
/// as diverged.
const FAR_MM: [f64; 2] = [-10_000.0, 10_000.0];

/// What a blank is placed over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Over {
    /// The origin: lengths are coordinates.
    #[default]
    Origin,
    /// The tool, wherever it stands: from the middle of its box in x and y, and from the height
    /// at which the blank would touch it if it was let down.
    Tool,
}

/// Directions of an axis [degrees].
const TURN_DEG: [f64; 2] = [-360.0, 360.0];

/// Where the flat blank hangs before it falls.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Placement {
    #[serde(skip_serializing_if = "is_default")]
    pub over: Over,
    /// Centre of the untilted blank, or origin of its outline, in x and y [mm].
    pub centre_mm: [f64; 2],
    /// Height of its lowest edge over z = 0, or of the blank over the tool [mm].
    pub height_mm: f64,
    /// Rotation about an axis through the lowest edge: about x the edge at the lowest y stays low,
    /// that at the highest y rises.
    pub tilt_deg: f64,
    /// Direction of that axis, counter-clockwise from x.
    #[serde(skip_serializing_if = "is_default")]
    pub tilt_axis_deg: f64,
    /// File of what a scanner saw of the laid blank, to which the fallen one is to be fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scan: Option<PathBuf>,
    /// Unit of that file, which has to be known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scan_unit: Option<Unit>,
    #[serde(skip_serializing_if = "is_default")]
    pub scan_frame: ScanFrame,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub scan_marks: Vec<Mark>,
}

impl Default for Placement {
    fn default() -> Self {
        Self {
            over: Over::Origin,
            centre_mm: [0.0, 0.0],
            height_mm: 2.0,
            tilt_deg: 25.0,
            tilt_axis_deg: 0.0,
            scan: None,
            scan_unit: None,
            scan_frame: ScanFrame::default(),
            scan_marks: Vec::new(),
        }
    }
}

impl Placement {
    /// Refuses a scan, from where a fall is all that a blank starts from.
    pub(super) fn check_falls(&self) -> Result<(), ValueError> {
        let Some(scan) = &self.scan else {
            return Ok(());
        };
        let expected = "none here, where blanks start from their own fall";
        Err(ValueError::new("placement.scan", scan.display(), expected))
    }

    /// Checks what is said of a scan.
    fn check_scan(&self) -> Result<(), ValueError> {
        let is_alone = self.scan_unit.is_some()
            || self.scan_frame != ScanFrame::default()
            || !self.scan_marks.is_empty();
        let expected = "a file, as the other keys of a scan are given";
        let is_whole = self.scan.is_some() || !is_alone;
        ValueError::unless(is_whole, "placement.scan", "missing", expected)?;
        for (index, mark) in self.scan_marks.iter().enumerate() {
            let key = format!("placement.scan_marks[{index}]");
            mark.check().map_err(|error| error.within(&key))?;
        }
        Ok(())
    }
}

/// A clamp that holds some vertices and moves with them during the fall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clamp {
    /// Place on the flat blank, from its centre or in the frame of its outline [mm].
    pub at_mm: [f64; 2],
    /// Vertices up to this far along x and y are held [mm]; always the nearest one.
    #[serde(default)]
    pub radius_mm: f64,
    /// Displacement of the clamp during the fall [mm].
    #[serde(default)]
    pub move_mm: [f64; 3],
}

impl Clamp {
    /// The error of clamp number `index` where there is no blank.
    pub(super) fn off_the_blank(&self, index: usize) -> SceneError {
        let expected = "a place on the blank, in its own frame";
        let key = format!("clamps[{index}].at_mm");
        ValueError::new(&key, format!("{:?}", self.at_mm), expected).into()
    }
}

/// How the fall is simulated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Fall {
    /// Duration of the fall, in which the clamps move as well [s].
    pub fall_s: f64,
    /// Duration of settling after it [s].
    pub settle_s: f64,
    /// Damping while settling [1/s].
    pub settle_damping: f64,
    /// Substeps [1/s].
    pub substep_rate: f64,
    /// Refreshes of the tool's tangent planes [1/s].
    pub contact_rate: f64,
}

impl Default for Fall {
    fn default() -> Self {
        Self {
            fall_s: 1.0,
            settle_s: 1.0,
            settle_damping: 20.0,
            substep_rate: 6000.0,
            contact_rate: 1200.0,
        }
    }
}

impl Fall {
    /// Control steps of the fall and of settling after it.
    pub(super) fn frames(&self) -> [usize; 2] {
        [self.fall_s, self.settle_s].map(|seconds| (seconds / FRAME).round() as usize)
    }

    /// Duration of the fall [s], in whole control steps, and of settling after it.
    pub fn durations(&self) -> [f64; 2] {
        self.frames().map(|frames| frames as f64 * FRAME)
    }

    /// How finely the fall is stepped.
    pub fn stepping(&self) -> Stepping {
        Stepping {
            substep_rate: self.substep_rate,
            contact_rate: self.contact_rate,
        }
    }

    /// Steps it at other rates.
    pub fn set_stepping(&mut self, stepping: Stepping) {
        self.substep_rate = stepping.substep_rate;
        self.contact_rate = stepping.contact_rate;
    }
}

/// A material, by its file or as a table of its own.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Fabric {
    File(PathBuf),
    Here(Box<Material>),
}

/// Not derived: what is wrong with a table is to be told by its key.
impl<'de> Deserialize<'de> for Fabric {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Fabric;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("the path of a material file, or its content as a table")
            }

            fn visit_str<E>(self, path: &str) -> Result<Fabric, E> {
                Ok(Fabric::File(path.into()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Fabric, A::Error> {
                let material = Material::deserialize(MapAccessDeserializer::new(map));
                material.map(Fabric::from)
            }
        }
        deserializer.deserialize_any(Either)
    }
}

impl From<Material> for Fabric {
    fn from(material: Material) -> Self {
        Self::Here(material.into())
    }
}

/// A scene: tool, blank, physics, and how the blank comes to lie on the tool.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneConfig {
    pub tool: ToolConfig,
    /// Material, or its file; the built-in Interglas 92125 if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<Fabric>,
    #[serde(default)]
    pub blank: BlankConfig,
    #[serde(default)]
    pub placement: Placement,
    #[serde(default)]
    pub fall: Fall,
    #[serde(default)]
    pub clamps: Vec<Clamp>,
    #[serde(default)]
    pub physics: PhysicsConfig,
}

/// A scene that cannot be set up.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error(transparent)]
    Value(#[from] ValueError),
    #[error(transparent)]
    Blank(#[from] BlankError),
    #[error(transparent)]
    Tool(#[from] ToolError),
    /// `min_mm` is the height at which it would be above the tool.
    #[error(
        "`placement.height_mm` is {height_mm}, expected at least {min_mm:.1}: the blank starts {depth_mm:.1} mm inside the tool"
    )]
    InTool {
        height_mm: f64,
        min_mm: f64,
        depth_mm: f64,
    },
    /// No height brings it on to the tool.
    #[error(
        "`placement.centre_mm` is {centre_mm:?}, expected one at which the blank is over the tool, whose middle is at {middle_mm:.1?}"
    )]
    Beside {
        centre_mm: [f64; 2],
        middle_mm: [f64; 2],
    },
    #[error(
        "the fall diverged after {time_s:.3} s: raise `fall.substep_rate`, or reduce `physics.speed_cap`, `physics.gravity` or `physics.bending_stiffness` if one of them is larger than a fabric's"
    )]
    Diverged { time_s: f64 },
}

/// The scene file of the rib with two wrinkles.
const RIB: &str = include_str!("../../../../configs/scenes/rib.toml");

impl SceneConfig {
    /// Where a scene file has tables, for [`refuse_lists`].
    pub const TABLES: [&str; 13] = [
        "material",
        "tool",
        "tool.source.shape",
        "tool.source.mesh",
        "tool.source.stl",
        "tool.pose",
        "tool.grid",
        "blank",
        "placement",
        "placement.scan_marks[]",
        "fall",
        "clamps[]",
        "physics",
    ];

    /// The built-in scene: the paper's rib with two wrinkles.
    pub fn rib() -> Self {
        toml::from_str(RIB).expect("the built-in scene is valid")
    }

    /// Reads a scene file. Paths in it count from the folder of the file.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        refuse_lists(&read_toml(path)?, "", &Self::TABLES)
            .map_err(|fault| ReadError::fault(path, fault))?;
        let mut scene: Self = read_toml(path)?;
        scene.resolve(path.parent().unwrap_or(Path::new("")));
        Ok(scene)
    }

    /// The paths of all files that the scene is read from.
    pub fn files_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let tool = match &mut self.tool.source {
            Source::Mesh(file) => Some(&mut file.path),
            Source::Shape(_) => None,
        };
        let material = match &mut self.material {
            Some(Fabric::File(path)) => Some(path),
            _ => None,
        };
        let (outline, scan) = (self.blank.outline.as_mut(), self.placement.scan.as_mut());
        [material, tool, outline, scan].into_iter().flatten()
    }

    /// As [`files_mut`](Self::files_mut), to look at.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut own = self.clone();
        own.files_mut().map(std::mem::take).collect()
    }

    /// Makes the paths in the scene count from `folder`.
    pub fn resolve(&mut self, folder: &Path) {
        for path in self.files_mut() {
            *path = folder.join(&path);
        }
    }

    /// The material, read from its file if it has one.
    pub fn read_material(&self) -> Result<Material, SceneError> {
        Ok(match &self.material {
            Some(Fabric::File(path)) => Material::read(path)?,
            Some(Fabric::Here(material)) => {
                material.check().map_err(|error| error.within("material"))?;
                Material::clone(material)
            }
            None => Material::interglas_92125(),
        })
    }

    /// Checks all values that are not checked by the parts they belong to.
    pub fn check(&self) -> Result<(), SceneError> {
        self.tool.check().map_err(|error| error.within("tool"))?;
        self.physics.check()?;
        self.blank.check()?;
        let (fall, placement) = (&self.fall, &self.placement);
        for (key, value, range) in [
            ("fall.fall_s", fall.fall_s, [0.0, 600.0]),
            ("fall.settle_s", fall.settle_s, [0.0, 600.0]),
            // Where it is greater, cloth that has not come down hardly moves, and seems to be at rest.
            ("fall.settle_damping", fall.settle_damping, [0.0, 200.0]),
            ("placement.centre_mm", placement.centre_mm[0], FAR_MM),
            ("placement.centre_mm", placement.centre_mm[1], FAR_MM),
            ("placement.height_mm", placement.height_mm, FAR_MM),
            ("placement.tilt_axis_deg", placement.tilt_axis_deg, TURN_DEG),
        ] {
            ValueError::unless_within(key, value, range)?;
        }
        let stepping = fall.stepping().check();
        stepping.map_err(|error| error.within("fall"))?;
        let tilt = placement.tilt_deg;
        let expected = "an angle between -90 and 90 degrees, without these";
        ValueError::unless(tilt.abs() < 90.0, "placement.tilt_deg", tilt, expected)?;
        placement.check_scan()?;
        for (index, clamp) in self.clamps.iter().enumerate() {
            let half = self.blank.size_mm.map(|s| 0.5 * s);
            let is_on = |k: usize| clamp.at_mm[k].abs() <= half[k] + 1e-6;
            // What an outline encloses is known when the blank is cut.
            if self.blank.outline.is_none() && !(is_on(0) && is_on(1)) {
                return Err(clamp.off_the_blank(index));
            }
            let key = |key| format!("clamps[{index}].{key}");
            ValueError::unless_within(&key("radius_mm"), clamp.radius_mm, [0.0, 1e5])?;
            for moved in clamp.move_mm {
                ValueError::unless_within(&key("move_mm"), moved, FAR_MM)?;
            }
            let has_time = fall.frames()[0] > 0 || clamp.move_mm == [0.0; 3];
            let found = format!("{:?}", clamp.move_mm);
            let expected = "no displacement where `fall.fall_s` is less than half of 1/60 s";
            ValueError::unless(has_time, &key("move_mm"), found, expected)?;
        }
        Ok(())
    }
}
