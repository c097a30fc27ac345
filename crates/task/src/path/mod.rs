//! From the order in which vertices are pressed to files a robot programme can be made of.
//!
//! Points near each other become one stroke, driven in contact; a longer way between two
//! points is a jump; a point on its own is pressed without travel (paper, Section 6.2).
//! Whether a robot can do that is asked of [`Feasibility`], if a task has one.
//!
//! # Frame
//!
//! What is computed is in the frame of the scene; what is written is in that or in the frame of the
//! tool's file, as its [`Frame`] says, and has the tool's pose with it. Normals point out of the tool. A robot's
//! roller frame at a point follows from them: z = −normal, **into** the surface; x = travel;
//! y = z × x, along the axis of the roller; its origin is on the roller's line of contact.

mod csv;
mod feasibility;
mod figures;
mod frame;
pub mod inp;
mod json;
mod strokes;

pub use csv::write_csv;
pub use feasibility::{Feasibility, Robot};
pub use figures::PathFigures;
pub use frame::Frame;
pub use json::{read_json, write_json};
pub use strokes::{
    DrapingPoint, PressKind, PressedPoint, Rolling, UnusablePoint, stroke_points, strokes,
};
