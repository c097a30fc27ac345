//! What a 3-D scanner saw of a laid blank, and the state of the cloth that fits it.
//!
//! A [`Cloud`] is read from a file; [`kabsch`] puts it into the scene by marks and [`icp`] on to a
//! surface that it lies on. [`set_up`] sets a scene up whose blank starts from its scan: it falls, is pulled
//! on to the points by the solver itself, and let go. [`seen`] puts a scan on to a blank that was pressed.
//! [`repair`] makes the mesh of a scanned tool one that bounds a solid.

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

mod cloud;
mod decimate;
mod fit;
mod holes;
mod place;
mod repair;
mod rigid;
mod scan;
mod seen;
mod text;
mod twins;

pub use cloud::Cloud;
pub use repair::{Changes, repair};
pub use rigid::{AlignError, Rigid, icp, kabsch};
pub use scan::{MOST_OFF, ScanFit, set_up};
pub use seen::{Deviation, Seen, seen};
