//! Place of the locks and lockouts of rigs: one place for all users of a machine, wherever the results of a run go.

use std::path::{Path, PathBuf};

/// An administrator may put them here; kept over restarts and never cleaned.
const INSTALLED: &str = "/var/lib/mapper";

/// Every user may write here, and restarts leave files alone.
const SHARED: &str = "/var/tmp/mapper";

/// The directory that was given, or `$MAPPER_STATE_DIR`, `/var/lib/mapper` if there is one, `/var/tmp/mapper`; on systems without these
/// the directory for temporary files.
///
/// A rig may be driven by several users of a machine, so none of these is in a user's home.
pub fn directory(given: Option<&Path>) -> PathBuf {
    let variable = std::env::var_os("MAPPER_STATE_DIR").filter(|value| !value.is_empty());
    let usual = || {
        let shared = Path::new(SHARED);
        let exists = |path: &Path| path.parent().is_some_and(Path::is_dir);
        match Path::new(INSTALLED) {
            installed if installed.is_dir() => installed.to_owned(),
            _ if exists(shared) => shared.to_owned(),
            _ => std::env::temp_dir().join("mapper"),
        }
    };
    given.map(Path::to_owned).or(variable.map(PathBuf::from)).unwrap_or_else(usual)
}
