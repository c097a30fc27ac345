//! What a 3-D scanner saw of a laid blank, and the state of the cloth that fits it.
//!
//! A [`Cloud`] is read from a file; [`kabsch`] puts it into the scene by marks and [`icp`] on to a
//! surface that it lies on.

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

mod cloud;
mod rigid;
mod text;

pub use cloud::Cloud;
pub use rigid::{AlignError, Rigid, icp, kabsch};
