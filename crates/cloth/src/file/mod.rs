//! Files that are written whole or not at all, by [`write_atomic`], and configuration files that
//! say where they are wrong, by [`read_toml`]. Binary ones are [`Sealed`]. Logs that grow line by line are not written here.

mod read;
mod sealed;
mod toml;
mod value;
mod words;
mod write;

pub(crate) use read::unmarked;
pub use read::{ReadError, plain, read_bytes, read_json, read_text};
pub use sealed::Sealed;
pub use toml::{parse_toml, parse_toml_with, read_toml, refuse_lists};
pub use value::ValueError;
pub(crate) use value::is_default;
pub use words::in_words;
pub use write::{
    UNFINISHED, WriteError, check_name, check_writable, remove_temporaries, write_atomic,
};
