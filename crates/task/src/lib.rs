//! Draping as a Markov decision process ([`mod@env`]), what a robot is given of a sequence of
//! presses ([`path`]), what they do ([`recording`]), and search among them ([`search`]).

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

pub mod cluster;
pub mod env;
pub mod path;
pub mod recording;
pub mod search;
