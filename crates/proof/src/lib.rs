//! Whether a path holds: [proofs](prove()) in worlds that chose none of it, in the fast solver and in the
//! finite-element [twin], [orders] that anybody could think of, which it has to beat, and drapes
//! [compared](compare()).

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

mod case;
mod compare;
mod error;
mod listener;
pub mod orders;
pub mod presses;
mod prove;
pub mod twin;

pub use case::{Case, Figures};
pub use compare::{Comparison, Criteria, Inapplicable, Parts, Surveyed, compare, picture};
pub use error::ProofError;
pub use listener::Listener;
pub use prove::{
    Best, Choice, Method, Physics, Proof, Row, Sensitivity, choose, figures, looked, prove,
    sensitivity,
};
