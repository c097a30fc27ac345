use std::ffi::c_int;
use std::fmt;
use std::path::Path;

use anyhow::{Context, Error};

use super::terminal::tell;
use crate::run::RunError;
use drape_cloth::file::{ValueError, WriteError};
use drape_cloth::scene::SceneError;
use drape_proof::ProofError;
use drape_study::study::StudyError;

/// What a command ends with that a signal has stopped before its work was done.
#[derive(Debug, thiserror::Error)]
#[error("interrupted")]
pub(super) struct Interrupted(pub c_int);

impl Interrupted {
    /// As shells have it: 129 for SIGHUP, 130 for SIGINT, 143 for SIGTERM.
    pub fn exit_code(&self) -> u8 {
        128 + self.0 as u8
    }
}

/// Why a command ended early, and whose turn it is.
///
/// `?` makes any error a failure at work (exit code 1), unless it is of a kind that the user can
/// mend. What else the user got wrong becomes a failure of the input (exit code 2) by `or_invalid`.
#[derive(Debug)]
pub struct Failure {
    pub(super) error: Error,
    /// Whether the user can mend it.
    pub is_input: bool,
}

impl Failure {
    /// Wrong usage or configuration.
    pub fn invalid(error: impl Into<Error>) -> Self {
        let error = error.into();
        Self {
            error,
            is_input: true,
        }
    }

    /// Names a file that could not be written as one of `folder`, for which it was meant.
    pub(super) fn moved_to(mut self, folder: &Path) -> Self {
        if let Some(WriteError::Io { path, .. }) = self.error.downcast_mut() {
            *path = folder.join(path.file_name().unwrap_or_default());
        }
        self
    }

    /// Prints the chain of causes as one line on stderr and gives the exit code. What was interrupted has been
    /// told already.
    pub fn report(&self) -> u8 {
        if let Some(interrupted) = self.error.downcast_ref::<Interrupted>() {
            return interrupted.exit_code();
        }
        tell(format_args!("error: {self}"));
        if self.is_input { 2 } else { 1 }
    }
}

/// The chain of causes, outermost first, as one line.
impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let chain = format!("{:#}", self.error);
        let lines = chain.lines().map(str::trim).filter(|line| !line.is_empty());
        f.write_str(&lines.collect::<Vec<_>>().join(" "))
    }
}

impl<E: Into<Error>> From<E> for Failure {
    /// The user can mend a name that is taken or of what is unfinished, a run in use, another configuration, a value or
    /// a scene that cannot be, but no full disk.
    fn from(error: E) -> Self {
        let error = error.into();
        let is_input = match error.downcast_ref() {
            Some(scene) => !matches!(scene, SceneError::Diverged { .. }),
            None => match error.downcast_ref() {
                Some(written) => matches!(written, WriteError::Name { .. }),
                None => error.is::<RunError>() || error.is::<ValueError>(),
            },
        };
        Self { error, is_input }
    }
}

/// Marks errors that the user can mend.
pub(super) trait OrInvalid<T> {
    /// Fails with exit code 2.
    fn or_invalid(self) -> Result<T, Failure>;

    /// Fails with exit code 2; `place`, such as the name of the file, leads the message.
    fn or_invalid_in(self, place: impl ToString) -> Result<T, Failure>;
}

impl<T, E: Into<Error>> OrInvalid<T> for Result<T, E> {
    fn or_invalid(self) -> Result<T, Failure> {
        self.map_err(Failure::invalid)
    }

    fn or_invalid_in(self, place: impl ToString) -> Result<T, Failure> {
        let result = self.map_err(Into::into).with_context(|| place.to_string());
        result.map_err(Failure::invalid)
    }
}

/// Names what the error of a study is about, where it has a scene.
pub(super) fn study_failure(error: StudyError, place: Option<String>) -> Failure {
    use StudyError::{Damaged, Invalid, Read};
    let is_input = error.is_input();
    let error = match place {
        Some(place) if !matches!(error, Invalid(_) | Read(_) | Damaged(_)) => {
            Error::new(error).context(place)
        }
        _ => error.into(),
    };
    Failure { error, is_input }
}

/// Names the scene that the error of a proof is about, if it is told.
pub(super) fn proof_failure(error: ProofError, place: Option<String>) -> Failure {
    let is_input = error.is_input();
    let error = Error::new(error);
    let error = match place {
        Some(place) => error.context(place),
        None => error,
    };
    Failure { error, is_input }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chain_becomes_one_line() {
        let error = anyhow::anyhow!("cause\n  in two lines\n");
        let failure = Failure::from(error.context("attempt"));
        assert_eq!(failure.to_string(), "attempt: cause in two lines");
    }

    #[test]
    fn only_marked_errors_are_the_user_s() {
        let fail = || Err::<(), _>(anyhow::anyhow!("cause"));
        assert!(fail().or_invalid().unwrap_err().is_input);
        let failure = fail().or_invalid_in("a.toml").unwrap_err();
        assert!(failure.is_input);
        assert_eq!(failure.to_string(), "a.toml: cause");
        assert!(!Failure::from(fail().unwrap_err()).is_input);
        assert!(!Failure::from(SceneError::Diverged { time_s: 0.5 }).is_input);
    }
}
