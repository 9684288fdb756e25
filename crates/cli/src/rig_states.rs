//! Where locks and lockouts of rigs are: one place for all users of a machine, wherever the results of a run go.

use std::path::{Path, PathBuf};

/// The directory that was given, or `$MAPPER_STATE_DIR`, or the one that all users of the machine share.
pub fn directory(given: Option<&Path>) -> PathBuf {
    let variable = std::env::var_os("MAPPER_STATE_DIR").filter(|value| !value.is_empty());
    given.map(Path::to_owned).or(variable.map(PathBuf::from)).unwrap_or_else(mapper_session::shared_state)
}
