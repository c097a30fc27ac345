//! The interactive environment (paper, Section 3.2.4): one page in a browser, in which cloth is looked at and pressed.
//!
//! A [`Session`] owns the cloth and obeys commands; it publishes a [`Moment`] after each change. Every page asks for the
//! newest moment when it has drawn the last one, so that nothing queues up for a slow one. [`Server`] gives the page and
//! its socket to whoever has the token. What belongs to runs is asked of a [`Host`].
//!
//! All pages share one session: there are no users, and nothing is kept when it ends but what was saved.

// Units stand in brackets, as in "length [m]", which rustdoc takes for links to nowhere.
#![allow(rustdoc::broken_intra_doc_links)]

mod command;
mod door;
mod export;
mod fall;
mod host;
mod message;
mod moment;
mod past;
mod picture;
mod robot;
mod server;
mod session;
mod shade;
mod stage;

pub use command::{Change, Command};
pub use host::{Host, Offers, Rival, Spec, Watch};
pub use moment::{Moment, Numbers, Shared};
pub use robot::{RobotJob, RobotMoment, RobotPlace, ViewedRobot};
pub use server::Server;
pub use session::Session;
