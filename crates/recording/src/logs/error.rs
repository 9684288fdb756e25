//! Why a log cannot be read.

use std::io;
use std::path::PathBuf;

/// Why a log cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file could not be opened or read.
    #[error("failed to read the log `{}`: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// No format recognises the file.
    #[error("failed to read `{}`: {found}; logs are read from {known}", path.display())]
    Unknown {
        /// The file.
        path: PathBuf,
        /// What the file is instead, and what to do.
        found: String,
        /// The formats that are read.
        known: String,
    },
    /// The file is of the format, but cannot be used.
    #[error("failed to read `{}` as {format}: {message}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Name of the format.
        format: &'static str,
        /// What is wrong, and what to do.
        message: String,
    },
}
