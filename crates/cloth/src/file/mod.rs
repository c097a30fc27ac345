//! Files that are written whole or not at all, and configuration files that say where they
//! are wrong.
//!
//! Everything that replaces a file goes through [`write_atomic`], so that a crash, a full
//! disk or a pulled plug leaves either the old content or the new, never half of it. Logs
//! that grow line by line are not written here. Whatever reads TOML does so through
//! [`read_toml`].

mod read;
mod toml;
mod value;
mod write;

pub use read::{ReadError, read_bytes};
pub use toml::{parse_toml, parse_toml_with, read_toml, refuse_lists};
pub use value::ValueError;
pub use write::{WriteError, check_writable, write_atomic};
