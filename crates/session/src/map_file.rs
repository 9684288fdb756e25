//! Map files: reading and writing by format.

use crate::SessionError;
use crate::files::write_new;
use mapper_assemble::{MapFitOptions, fit_map};
use mapper_core::{CompressorMap, ReferenceState};
use mapper_exporters::{EXPORTERS, ExportError, ExporterEntry};
use mapper_importers::{IMPORTERS, MOST_BYTES, parse_reference};
use std::io::Read;
use std::path::Path;

/// A reference state as people write it: SAE, Garrett, BorgWarner or "T, P".
///
/// # Errors
/// [`SessionError::Reference`] where it is none of these.
pub fn reference(text: Option<&str>) -> Result<Option<ReferenceState>, SessionError> {
    text.map(|text| parse_reference(text).map_err(SessionError::Reference)).transpose()
}

/// Reads a map; the extension says the format.
///
/// # Errors
/// [`SessionError::UnknownExtension`], [`SessionError::File`], or [`SessionError::Import`] with the file's mistakes.
pub fn read_map(path: &Path, given: Option<ReferenceState>) -> Result<CompressorMap, SessionError> {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let importer =
        mapper_importers::of_extension(extension).ok_or_else(|| SessionError::UnknownExtension {
            path: path.to_owned(),
            extension: extension.to_owned(),
            known: IMPORTERS.iter().flat_map(|entry| entry.extensions).copied().collect(),
        })?;
    let mut bytes = Vec::new();
    // One byte more than allowed tells a file that is too large from one that just fits.
    let limit = MOST_BYTES as u64 + 1;
    std::fs::File::open(path)
        .and_then(|file| file.take(limit).read_to_end(&mut bytes))
        .map_err(SessionError::file("read", path))?;
    mapper_importers::read(importer, &bytes, given)
        .map_err(|source| SessionError::Import { path: path.to_owned(), source })
}

/// The exporter of a name, or of a file's extension.
///
/// # Errors
/// [`SessionError::FormatUnsaid`] where neither says a format.
pub fn exporter(path: &Path, name: Option<&str>) -> Result<&'static ExporterEntry, SessionError> {
    let file = path.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_ascii_lowercase();
    let found = match name {
        Some(name) => mapper_exporters::find(name),
        // The longest extension counts: `map.fitted.csv` is no plain CSV.
        None => EXPORTERS
            .iter()
            .filter(|entry| file.ends_with(&format!(".{}", entry.extension)))
            .max_by_key(|entry| entry.extension.len()),
    };
    found.ok_or_else(|| SessionError::FormatUnsaid {
        path: path.to_owned(),
        known: EXPORTERS.iter().map(|entry| format!("{} (.{})", entry.name, entry.extension)).collect(),
    })
}

/// Writes a map into a new file.
///
/// # Errors
/// [`SessionError::Export`] where the format cannot hold the map, [`SessionError::File`].
pub fn write_map(path: &Path, exporter: &ExporterEntry, map: &CompressorMap) -> Result<(), SessionError> {
    write_new(path, &(exporter.export)(map)?)
}

/// Writes a map into a new file; a format that is a table over the whole map gets a fitted one. Returns the map written, and
/// whether it was fitted for this.
///
/// # Errors
/// As [`write_map`], and [`SessionError::Fit`] where the map cannot be fitted.
pub fn write_map_fitted_if_needed(
    path: &Path,
    exporter: &ExporterEntry,
    map: CompressorMap,
) -> Result<(CompressorMap, bool), SessionError> {
    let needs_fit =
        map.fitted.is_none() && matches!((exporter.export)(&map), Err(ExportError::NeedsFit { .. }));
    let map = if needs_fit {
        let options = MapFitOptions { leave_one_out: false, ..MapFitOptions::default() };
        fit_map(map, &options).map_err(|source| SessionError::Fit { format: exporter.name, source })?
    } else {
        map
    };
    write_map(path, exporter, &map)?;
    Ok((map, needs_fit))
}
