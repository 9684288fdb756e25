//! Errors of the history.

use std::path::PathBuf;

/// Errors when a history is read or written.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum HistoryError {
    #[error("failed to create {}: {}", .0.display(), .1)]
    Directory(PathBuf, #[source] std::io::Error),
    #[error("there is no history at {}; run a nightly campaign to make one, or name another file", .0.display())]
    Missing(PathBuf),
    /// The file is a database of something else, or of a newer program.
    #[error("{} is not a history that this program can read: {reason}; name another file", .path.display())]
    Foreign { path: PathBuf, reason: String },
    #[error("the history {} cannot be written; check the permissions, or name another file", .0.display())]
    ReadOnly(PathBuf),
    #[error("the history {} cannot be used: {}", .0.display(), .1)]
    Sqlite(PathBuf, #[source] rusqlite::Error),
}
