//! Drivers: rigs behind separate programs.

use mapper_backends::BACKENDS;
use mapper_core::{Backend, BackendError};
use mapper_driver_host::{Driver, INCLUDED_DRIVERS, SearchPath};
use serde_json::Value;
use std::path::PathBuf;

/// Locations of drivers: first those that listen at a socket, then those next to this program, then those on `PATH`.
pub fn locations() -> SearchPath {
    let sockets = private_state_directory().map(|state| state.join("drivers"));
    SearchPath::new(std::env::current_exe().ok().as_deref(), std::env::var_os("PATH").as_deref(), sockets)
}

/// `$MAPPER_STATE_DIR`, `$XDG_STATE_HOME/mapper` or `~/.local/state/mapper`: a directory that other users cannot write to, because a
/// program that listens at a socket in it controls the rig.
fn private_state_directory() -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    variable("MAPPER_STATE_DIR")
        .or_else(|| variable("XDG_STATE_HOME").map(|state| state.join("mapper")))
        .or_else(|| variable("HOME").map(|home| home.join(".local/state/mapper")))
}

/// Starts the driver of a campaign.
pub fn driver(name: &str, settings: &Value) -> Result<Box<dyn Backend>, BackendError> {
    let built_in = BACKENDS.iter().map(|plugin| plugin.name).collect::<Vec<_>>().join(", ");
    let known = INCLUDED_DRIVERS.iter().find(|(known, ..)| *known == name);
    let hint =
        known.map_or_else(String::new, |(.., line)| format!("; `{line}` in the source of mapper builds it"));
    Ok(Box::new(Driver::find(&locations(), name, settings, &built_in, &hint)?))
}
