//! Where locks and latches of rigs are: one place for all runs of a user, wherever their results go.

use std::path::{Path, PathBuf};

/// The directory that was given, or `$MAPPER_STATE_DIR`, `$XDG_STATE_HOME/mapper`, `~/.local/state/mapper`, the directory for
/// temporary files, whichever there is first.
pub fn directory(given: Option<&Path>) -> PathBuf {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    given
        .map(Path::to_owned)
        .or_else(|| variable("MAPPER_STATE_DIR"))
        .or_else(|| variable("XDG_STATE_HOME").map(|state| state.join("mapper")))
        .or_else(|| variable("HOME").map(|home| home.join(".local/state/mapper")))
        .unwrap_or_else(|| std::env::temp_dir().join("mapper"))
}
