//! Why a log cannot be read.

use std::io;
use std::path::PathBuf;

/// Why a log cannot be read.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum LogError {
    #[error("failed to read the log `{}`: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    /// `found`: what the file is instead, and what to do.
    #[error("failed to read `{}`: {found}; logs are read from {known}", path.display())]
    Unknown { path: PathBuf, found: String, known: String },
    #[error("failed to read `{}` as {format}: {message}", path.display())]
    Content { path: PathBuf, format: &'static str, message: String },
}
