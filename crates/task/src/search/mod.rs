//! Search without learning: orders that anybody could think of, lookahead, and search over whole
//! sequences, within a number of environment steps.
//!
//! Everything random comes from streams of a seed, so that what is found depends on nothing else.
//! [`lookahead()`], [`anneal`] and [`drawn`] take how to go on as a [`Policy`]: [`uniform`], or one that has been
//! trained.

mod anneal;
mod arena;
mod cem;
mod draw;
mod family;
mod lookahead;
mod order;

pub use anneal::{Annealing, anneal};
pub use arena::Arena;
pub use cem::{CrossEntropy, cross_entropy};
pub use draw::{Policy, drawn, uniform};
pub use family::{in_order, outwards, rasters, spirals, sweeps};
pub use lookahead::{Lookahead, lookahead};
pub use order::{Order, choose};
