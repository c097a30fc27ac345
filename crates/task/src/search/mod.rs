//! Search without learning: orders that anybody could think of, and moves of the order in scattered worlds.
//!
//! Everything random comes from streams of a seed, so that what is found depends on nothing else.

mod arena;
mod board;
mod family;
mod inwards;
mod judge;
mod moves;
mod order;

pub use arena::Arena;
pub use family::{at_random, in_order, outwards, sweeps};
pub use inwards::{Inwards, Way, inwards};
pub use judge::{Ended, Job, Judge};
pub use moves::{Found, Moves, Searching, moves};
pub use order::{Order, choose};
