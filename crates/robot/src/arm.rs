use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Unit, Vector3};
use serde::Deserialize;

use super::place::{Place, Pose};

/// Angles of the six joints [rad], from the base on.
pub type Joints = [f64; 6];

/// An arm of six revolute joints, one behind the other.
#[derive(Clone, Debug)]
pub struct Arm {
    pub name: String,
    /// From the base on.
    pub joints: [Joint; 6],
    /// The flange in the frame of the last link; its z points out of it.
    pub flange: Pose,
    /// Corners of the convex hull of each link in its own frame [m], the base first: what collides. None where a link has
    /// no shape.
    pub hulls: [Vec<Vector3<f64>>; 7],
}

/// A revolute joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Its frame in that of the link before it, at angle 0.
    pub origin: Pose,
    /// In its own frame.
    pub axis: Unit<Vector3<f64>>,
    /// Least and greatest angle [rad].
    pub limits: [f64; 2],
    /// At most [rad/s].
    pub speed: f64,
}

/// Why a file describes no arm.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{file}{place}: {fault}", file = .file.display())]
pub struct ArmError {
    pub(crate) file: PathBuf,
    /// Line and column, each after a colon, or nothing.
    pub(crate) place: String,
    pub(crate) fault: String,
}

/// Thickness below which a shape is none [m].
const FLAT: f64 = 1e-5;

/// Robots that need no file: what cells call them, and what describes them.
const SHIPPED: [(&str, &str); 2] = [
    ("crb15000-5", include_str!("../robots/crb15000-5.toml")),
    ("ur5e", include_str!("../robots/ur5e.toml")),
];

/// An arm as TOML has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ArmFile {
    name: String,
    flange: Place,
    joints: Vec<JointFile>,
    #[serde(default)]
    links: Vec<LinkFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JointFile {
    at_mm: [f64; 3],
    #[serde(default)]
    rotation_deg: [f64; 3],
    axis: [f64; 3],
    limits_deg: [f64; 2],
    speed_deg_s: f64,
}

/// Shape of a link, from the base on.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LinkFile {
    hull_mm: Vec<[f64; 3]>,
}

impl Arm {
    /// What [`Arm::shipped`] knows.
    pub fn names() -> impl Iterator<Item = &'static str> {
        SHIPPED.iter().map(|(name, _)| *name)
    }

    /// A robot by its name.
    pub fn shipped(name: &str) -> Option<Self> {
        let (_, text) = SHIPPED.iter().find(|(known, _)| *known == name)?;
        Some(Self::from_toml(text, Path::new(name)).expect("what is shipped is valid"))
    }

    /// Reads an arm from the text of the TOML file at `file`.
    ///
    /// # Errors
    /// If it is none: with the place, what was found and what was expected, in a line.
    pub fn from_toml(text: &str, file: &Path) -> Result<Self, ArmError> {
        let fail = |place: String, fault: String| ArmError {
            file: file.into(),
            place,
            fault,
        };
        let read: ArmFile = toml::from_str(text).map_err(|error| {
            let before = &text[..error.span().map_or(0, |span| span.start).min(text.len())];
            let line = before.matches('\n').count() + 1;
            fail(
                format!(":{line}"),
                error.message().escape_debug().to_string(),
            )
        })?;
        let found = read.joints.len();
        let joints: [JointFile; 6] = (read.joints.try_into())
            .map_err(|_| fail(String::new(), format!("`joints` has {found}, expected 6")))?;
        if read.links.len() > 7 {
            let fault = format!(
                "`links` has {}, expected at most 7: the base first",
                read.links.len()
            );
            return Err(fail(String::new(), fault));
        }
        let mut hulls: [Vec<Vector3<f64>>; 7] = Default::default();
        for (hull, link) in hulls.iter_mut().zip(&read.links) {
            *hull = link
                .hull_mm
                .iter()
                .map(|&corner| 1e-3 * Vector3::from(corner))
                .collect();
        }
        let place = |at_mm, rotation_deg| {
            Place {
                at_mm,
                rotation_deg,
            }
            .pose()
        };
        let arm = Self {
            name: read.name,
            flange: read.flange.pose(),
            joints: joints.map(|joint| Joint {
                origin: place(joint.at_mm, joint.rotation_deg),
                axis: Unit::new_unchecked(Vector3::from(joint.axis)),
                limits: joint.limits_deg.map(f64::to_radians),
                speed: joint.speed_deg_s.to_radians(),
            }),
            hulls,
        };
        arm.checked().map_err(|fault| fail(String::new(), fault))
    }

    /// With axes at unit length, or what is wrong with it.
    pub(crate) fn checked(mut self) -> Result<Self, String> {
        let finite = |pose: &Pose| pose.to_homogeneous().iter().all(|x| x.is_finite());
        let far = |v: &Vector3<f64>| v.norm() > 100.0;
        for (k, joint) in self.joints.iter_mut().enumerate() {
            let wrong = |what: &str, found: String, expected: &str| {
                Err(format!(
                    "joint {}: {what} is {found}, expected {expected}",
                    k + 1
                ))
            };
            if !finite(&joint.origin) || far(&joint.origin.translation.vector) {
                let found = format!("{:?}", joint.origin.translation.vector.as_slice());
                return wrong("the origin [m]", found, "finite numbers up to 100");
            }
            let length = joint.axis.norm();
            if !(1e-6..=1e6).contains(&length) {
                let found = format!("{:?}", joint.axis.as_slice());
                return wrong("the axis", found, "a direction");
            }
            joint.axis = Unit::new_normalize(joint.axis.into_inner());
            let [min, max] = joint.limits;
            if !(min < max && max - min <= 16.0 * std::f64::consts::PI) {
                let found = format!("{min} to {max} rad");
                return wrong(
                    "the range",
                    found,
                    "a lower limit below an upper one, eight turns at most",
                );
            }
            if !(joint.speed > 0.0 && joint.speed < 1e3) {
                return wrong(
                    "the speed",
                    format!("{} rad/s", joint.speed),
                    "a number above 0",
                );
            }
        }
        if !finite(&self.flange) || far(&self.flange.translation.vector) {
            return Err(
                "the flange has numbers that are not finite, expected a place within 100 m".into(),
            );
        }
        for (k, hull) in self.hulls.iter().enumerate() {
            if hull
                .iter()
                .any(|corner| !corner.iter().all(|x| x.is_finite()) || far(corner))
            {
                return Err(format!(
                    "link {k}: its shape has corners beyond 100 m, expected some within"
                ));
            }
            let around = |v: &Vector3<f64>| v - hull[0];
            let spread: Matrix3<f64> = hull.iter().map(|p| around(p) * around(p).transpose()).sum();
            let least = spread.symmetric_eigenvalues().min();
            if !hull.is_empty() && least < FLAT * FLAT {
                let found = hull.len();
                return Err(format!(
                    "link {k}: its shape has {found} corners in a plane, expected a body"
                ));
            }
        }
        Ok(self)
    }
}
