//! What can go wrong with a history.

use std::path::PathBuf;

/// Why a history cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum HistoryError {
    /// The directory of the file cannot be made.
    #[error("failed to create {}: {source}", .path.display())]
    Directory {
        /// The directory.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file does not exist, and only reading was requested.
    #[error("there is no history at {}; `mapper nightly` makes one, `--db FILE` names another", .path.display())]
    Missing {
        /// The file.
        path: PathBuf,
    },
    /// The file is a database of something else, or of a newer program.
    #[error("{} is not a history that this program can read: {reason}; name another file with `--db`", .path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What was found.
        reason: String,
    },
    /// The file, or its directory, cannot be written.
    #[error("the history {} cannot be written; name another one with `--db`", .path.display())]
    ReadOnly {
        /// The file.
        path: PathBuf,
    },
    /// SQLite's own word.
    #[error("the history {} cannot be used: {source}", .path.display())]
    Sqlite {
        /// The file.
        path: PathBuf,
        /// Why.
        source: rusqlite::Error,
    },
}
