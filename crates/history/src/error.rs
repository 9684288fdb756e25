//! Errors of the history.

use std::path::PathBuf;

/// Errors when a history is read or written.
#[derive(Debug, thiserror::Error)]
pub enum HistoryError {
    /// The directory of the file cannot be created.
    #[error("failed to create {}: {}", .0.display(), .1)]
    Directory(PathBuf, #[source] std::io::Error),
    /// The file does not exist, and only reading was requested.
    #[error("there is no history at {}; run a nightly campaign to make one, or name another file", .0.display())]
    Missing(PathBuf),
    /// The file is a database of something else, or of a newer program.
    #[error("{} is not a history that this program can read: {reason}; name another file", .path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// The file, or its directory, cannot be written.
    #[error("the history {} cannot be written; check the permissions, or name another file", .0.display())]
    ReadOnly(PathBuf),
    /// Any other error of SQLite.
    #[error("the history {} cannot be used: {}", .0.display(), .1)]
    Sqlite(PathBuf, #[source] rusqlite::Error),
}
