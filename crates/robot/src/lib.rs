//! A robot arm in its cell: where it reaches, what it would hit, how it moves along strokes, and the program that says
//! so to its controller (paper, Sections 6 and 7.4).
//!
//! Lengths are metres, angles radians, but for keys of files that say otherwise. The crate knows no cloth: a path is a
//! list of contact frames on a tool, and what stands in the way is triangles.

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

mod arm;
mod program;
mod roller;

pub use arm::{Arm, Joint, Joints, Pose};
pub use program::{Contact, Program, ProgramStroke, Speeds, Station};
pub use roller::Roller;
