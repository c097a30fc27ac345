//! Studies of the simulator itself: what it gets right, how fast, and where it fails.
//!
//! A study runs the simulator over cases whose answer is known beforehand and returns what it
//! found as plain data; drawing and printing are left to the command that asked.

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

pub mod bench;
pub mod compare;
pub mod episodes;
mod points;
pub mod ranking;
pub mod stability;
pub mod tradeoff;
pub mod transfer;
pub mod twin;
pub mod verify;

pub use points::nearest;
