//! Errors are sentences: the file, the field and the value, and what to do about it.

use std::path::{Path, PathBuf};

/// What every fallible function of the library returns.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Everything that can go wrong on a user's input. The text is what the user reads.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused to read or write a file.
    #[error("{}: cannot {action}: {source}.", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried, as in "read" or "create".
        action: &'static str,
        /// Why it failed.
        source: std::io::Error,
    },
    /// A file was read, but what stands in it is wrong.
    #[error("{}: {message}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// A sentence with the field, the value, and what to do.
        message: String,
    },
    /// The arguments contradict each other or select nothing: exit code 2.
    #[error("{0}")]
    Argument(String),
    /// Another program could not be reached, or did not answer as it must.
    #[error("{0}")]
    Network(String),
    /// The data do not carry the answer.
    #[error("{0}")]
    Data(String),
    /// The data do not carry the answer: an estimation went on moving. What helps, the program that asked for it knows.
    #[error("the estimation of {unknowns} unknowns had not settled after {steps} steps.")]
    Unsettled {
        /// Unknowns that were estimated.
        unknowns: usize,
        /// Steps that were taken.
        steps: usize,
    },
}

impl Error {
    /// An operating-system error on `path`.
    pub fn io(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        Self::Io { path: path.to_owned(), action, source }
    }

    /// A sentence about what stands in `path`.
    pub fn file(path: &Path, message: impl Into<String>) -> Self {
        Self::File { path: path.to_owned(), message: message.into() }
    }
}
