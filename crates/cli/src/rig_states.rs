//! The directory of locks and lockouts, which all users of a computer share, independent of the directories of runs.

use mapper_session::shared_state_directory;
use std::path::{Path, PathBuf};

/// The given directory, or `$MAPPER_STATE_DIR`, or the default that all users of the computer share.
pub fn directory(argument: Option<&Path>) -> PathBuf {
    let variable = std::env::var_os("MAPPER_STATE_DIR").filter(|value| !value.is_empty());
    argument.map(Path::to_owned).or(variable.map(PathBuf::from)).unwrap_or_else(shared_state_directory)
}
