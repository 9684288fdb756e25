//! Files with maps.

use crate::error::Error;
use crate::plugins::plugins;
use mapper_core::{CompressorMap, ReferenceState};
use mapper_session::{Existing, write_map_fitted_if_needed};
use std::path::Path;

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
