use nalgebra::{IsometryMatrix3, Unit, Vector3};

/// A rigid motion, or the frame that it takes the base to.
pub type Pose = IsometryMatrix3<f64>;

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
