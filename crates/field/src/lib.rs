//! What structural analysis needs to know of fabric that has been draped: in every element both yarn directions, how far
//! they are sheared, by how much that has thickened the fabric, and how much yarn there is too much.
//!
//! A [`Field`] is of the draped mesh, or has been mapped on to another; [`vtu`], [`elements_csv`], [`abaqus`], [`radioss`]
//! and [`composite_cae`] write it. A [`FlatPattern`] is what is cut before, and [`next_tool`]
//! what the next ply falls on.

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

mod abaqus;
mod composite_cae;
mod elements_csv;
mod field;
mod flat_pattern;
mod hdf5;
mod ply;
mod radioss;
mod vtu;

pub use abaqus::abaqus;
pub use composite_cae::composite_cae;
pub use elements_csv::elements_csv;
pub use field::{Fibre, Field, FieldSummary, OntoError};
pub use flat_pattern::FlatPattern;
pub use ply::{PlyGap, next_tool};
pub use radioss::radioss;
pub use vtu::vtu;
