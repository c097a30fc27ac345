//! Studies of the simulator itself: what it gets right, how fast, and where it fails.
//!
//! A study is one module and one [`Study`](study::Study): its options, its cases, and a run that
//! gives [tables](drape_report::Table) and pictures. It prints and writes nothing; the command line does
//! that, for all studies alike. A new one is its module and one variant of the command.

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

pub mod bench;
pub mod cloth;
pub mod episodes;
pub mod judge;
pub mod learning;
mod points;
pub mod stability;
mod statistics;
pub mod study;
pub mod tradeoff;
pub mod trainings;
pub mod truth;
pub mod twin;
pub mod verify;
