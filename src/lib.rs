//! Finds the order in which a robot with a small roller presses woven fabric on to a
//! curved tool: the commands ([`cli`]) and the folder that a training leaves ([`run`]).

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]
// They panic where nobody reads; `cli::terminal` does not.
#![deny(clippy::print_stderr, clippy::print_stdout)]

pub mod cli;
mod cluster;
pub mod run;
