//! Finds the order in which a robot with a small roller presses woven fabric on to a
//! curved tool.
//!
//! The library simulates the fabric ([`fabric`], [`sim`]) on a rigid [`tool`], poses the
//! draping task on top of it ([`scene`], [`mod@env`]), learns to solve it ([`policy`],
//! [`ppo`]) and keeps what it learnt ([`run`], [`path`], [`report`]); [`study`] measures the
//! simulation itself, and [`mod@reference`] is a slow finite-element twin to hold it against.
//! Each module imports only from those below it; `tests/architecture.rs` holds the table.

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

pub mod cli;
pub mod env;
pub mod fabric;
pub mod file;
pub mod math;
pub mod mesh;
pub mod path;
pub mod policy;
pub mod ppo;
pub mod reference;
pub mod report;
pub mod run;
pub mod scene;
pub mod sim;
pub mod study;
pub mod tool;
