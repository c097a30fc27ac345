//! Whether a path holds: [proofs](prove()) in worlds that chose none of it, in the fast solver and in the
//! finite-element [twin](twin), [orders] that anybody could think of, which it has to beat, and drapes
//! [compared](compare()).

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

mod compare;
mod error;
pub mod orders;
pub mod presses;
mod prove;
pub mod twin;
mod watch;

pub use compare::{Comparison, Criteria, Inapplicable, Parts, Surveyed, compare, picture};
pub use error::ProofError;
pub use prove::{
    Best, Case, Choice, Figures, Method, Physics, Proof, Row, Sensitivity, choose, figures, prove,
    sensitivity,
};
pub use watch::Listener;
