//! The one place that names plug-ins, and files with maps in their formats.

use crate::error::Error;
use mapper_backends::BACKENDS;
use mapper_core::{Backend, BackendError, CompressorMap, ReferenceState};
use mapper_driver_host::{Driver, INCLUDED_DRIVERS, SearchPath};
use mapper_effects::ScriptEffect;
use mapper_formats::FORMATS;
use mapper_log_formats::LOG_FORMATS;
use mapper_physics::rig::effect::Effect;
use mapper_session::{Existing, Registry, SessionError, write_map_fitted_if_needed};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Every plug-in of this distribution: backends, drivers, effects, map formats, log formats.
///
/// Fields of the result can be replaced or extended, e.g. by a backend of your own:
///
/// ```
/// let mut plugins = mapper::plugins();
/// plugins.backends.retain(|backend| backend.name == "virtual_lab");
/// assert!(plugins.effects.iter().any(|effect| effect.info().id == "htc_scale"));
/// ```
pub fn plugins() -> Registry {
    Registry {
        backends: BACKENDS.to_vec(),
        driver: Some(Arc::new(start_driver)),
        effects: mapper_effects::catalogue(),
        read_effect,
        formats: FORMATS,
        logs: LOG_FORMATS,
        sentences: Some(mapper_report::sentence),
        ..Registry::empty()
    }
}

fn read_effect(path: &Path) -> Result<Arc<dyn Effect>, Box<dyn std::error::Error + Send + Sync>> {
    let text = mapper_campaign::read_text(path).map_err(|source| SessionError::File {
        action: "read",
        path: path.to_owned(),
        source,
    })?;
    Ok(Arc::new(ScriptEffect::new(&text, path)?))
}

/// Locations of drivers: first those that listen at a socket, then those next to this program, then those on `PATH`.
pub fn driver_locations() -> SearchPath {
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

fn start_driver(name: &str, settings: &Value) -> Result<Box<dyn Backend>, BackendError> {
    let built_in = BACKENDS.iter().map(|plugin| plugin.name).collect::<Vec<_>>().join(", ");
    let known = INCLUDED_DRIVERS.iter().find(|(known, ..)| *known == name);
    let hint =
        known.map_or_else(String::new, |(.., line)| format!("; `{line}` in the source of mapper builds it"));
    Ok(Box::new(Driver::find(&driver_locations(), name, settings, &built_in, &hint)?))
}

/// Reads a map file of any format, or the map of a run's directory. The extension selects the format. `reference`: state that the file's
/// corrected values refer to, if the file does not say so.
///
/// # Errors
/// If the file cannot be read, no format has its extension, or it has mistakes.
pub fn read_map(path: impl AsRef<Path>, reference: Option<ReferenceState>) -> Result<CompressorMap, Error> {
    Ok(plugins().read_map(path.as_ref(), reference)?)
}

/// Writes a map to a file, in the format of this name, or that of the file's extension. A format that tabulates the whole map gets a fitted
/// one.
///
/// # Errors
/// If there is no such format, it cannot represent the map, or the file cannot be written.
pub fn write_map(
    map: &CompressorMap,
    path: impl AsRef<Path>,
    format: Option<&str>,
    existing: Existing,
) -> Result<(), Error> {
    let format = plugins().format_of(path.as_ref(), format)?;
    write_map_fitted_if_needed(path.as_ref(), format, map.clone(), existing)?;
    Ok(())
}
