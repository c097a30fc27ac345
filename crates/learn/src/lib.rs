//! Learns a task of choosing among the pixels of an image: networks ([`policy`]) and proximal
//! policy optimisation of them ([`ppo`]).

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

pub mod benchmark;
pub mod policy;
pub mod ppo;
