//! A robot arm in its cell: where it reaches, what it would hit, how it moves along strokes, and the program that says
//! so to its controller (paper, Sections 6 and 7.4).
//!
//! Lengths are metres, angles radians, but for keys of files that say otherwise. The crate knows no cloth: a path is a
//! list of points on a tool, and what stands in the way is triangles.

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

mod arm;
mod cell;
mod inverse;
mod kinematics;
mod obstacles;
mod path;
mod place;
mod plan;
mod program;
mod remedy;
mod roller;
mod soft;
mod strokes;
mod transfer;
mod urdf;
mod workcell;

pub use arm::{Arm, ArmError, Joint, Joints};
pub use cell::{
    BlockConfig, CapsuleConfig, CellConfig, CellError, LimitsConfig, MotionConfig, RollerConfig,
    TurntableConfig,
};
pub use inverse::InverseSolver;
/// A place [m].
pub type Point = nalgebra::Point3<f64>;
pub use obstacles::ObstacleSurface;
pub use path::{PathPoint, contact};
pub use place::{Place, Pose};
pub use plan::{FailedPoint, NoHome, Plan, Reached};
pub use program::{
    Contact, Motion, Program, ProgramError, ProgramMoment, ProgramStroke, Speeds, Station,
};
pub use remedy::BaseProposal;
pub use roller::RollerShape;
pub use soft::Pushed;
pub use workcell::{Cell, Check};
