//! Map files: reading and writing by format.

use crate::files::{Existing, write_file};
use crate::{Registry, SessionError};
use mapper_assemble::{MapFitOptions, fit_map};
use mapper_campaign::Campaign;
use mapper_core::{CompressorMap, ExportError, MAP_FILE_SIZE_LIMIT, MapFormat, ReferenceState};
use std::io::Read;
use std::path::Path;

impl Registry {
    /// Reads a map; the extension says the format, `given` the reference state where the file does not.
    ///
    /// # Errors
    /// [`SessionError::UnknownExtension`], [`SessionError::File`], or [`SessionError::Import`] with the file's mistakes.
    pub fn read_map(
        &self,
        path: &Path,
        given: Option<ReferenceState>,
    ) -> Result<CompressorMap, SessionError> {
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        let format = self.formats.read_from(extension).ok_or_else(|| SessionError::UnknownExtension {
            path: path.to_owned(),
            extension: extension.to_owned(),
            known: self.formats.read_extensions().collect(),
        })?;
        let mut bytes = Vec::new();
        // One byte more than allowed tells a file that is too large from one that just fits.
        let limit = MAP_FILE_SIZE_LIMIT as u64 + 1;
        std::fs::File::open(path)
            .and_then(|file| file.take(limit).read_to_end(&mut bytes))
            .map_err(SessionError::file("read", path))?;
        format.read(&bytes, given).map_err(|source| SessionError::Import { path: path.to_owned(), source })
    }

    /// The format of a name, in which maps can be written.
    ///
    /// # Errors
    /// [`SessionError::UnknownFormat`] where there is none.
    pub fn written_format(&self, name: &str) -> Result<&'static MapFormat, SessionError> {
        self.formats.written().find(|format| format.name == name).ok_or_else(|| SessionError::UnknownFormat {
            name: name.to_owned(),
            known: self.formats.written().map(|format| format.name).collect(),
        })
    }

    /// Whether every format that the campaign names can be written: before a run, not after it.
    ///
    /// # Errors
    /// [`SessionError::UnknownFormat`] with the first that cannot.
    pub fn check_formats(&self, campaign: &Campaign) -> Result<(), SessionError> {
        campaign.outputs.formats.iter().try_for_each(|format| self.written_format(format.name()).map(drop))
    }

    /// The format of a new map file: by name, or else by the file's extension.
    ///
    /// # Errors
    /// [`SessionError::FormatUnsaid`] where neither says a format.
    pub fn format_of(&self, path: &Path, name: Option<&str>) -> Result<&'static MapFormat, SessionError> {
        let file = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let found = match name {
            Some(name) => self.written_format(name).ok(),
            None => self.formats.written_to(file),
        };
        found.ok_or_else(|| SessionError::FormatUnsaid {
            path: path.to_owned(),
            known: self
                .formats
                .written()
                .map(|format| format!("{} (.{})", format.name, format.extension))
                .collect(),
        })
    }
}

/// Writes a map into a file.
///
/// # Errors
/// [`SessionError::Export`] where the format cannot hold the map, and as [`write_file`].
pub fn write_map(
    path: &Path,
    format: &MapFormat,
    map: &CompressorMap,
    existing: Existing,
) -> Result<(), SessionError> {
    write_file(path, &format.write(map)?, existing)
}

/// Writes a map into a file; a format that is a table over the whole map gets a fitted one. Returns the map written, and
/// whether it was fitted for this.
///
/// # Errors
/// As [`write_map`], and [`SessionError::Fit`] where the map cannot be fitted.
pub fn write_map_fitted_if_needed(
    path: &Path,
    format: &MapFormat,
    map: CompressorMap,
    existing: Existing,
) -> Result<(CompressorMap, bool), SessionError> {
    let needs_fit = map.fitted.is_none() && matches!(format.write(&map), Err(ExportError::NeedsFit { .. }));
    let map = if needs_fit {
        let options = MapFitOptions { leave_one_out: false, ..MapFitOptions::default() };
        fit_map(map, &options).map_err(|source| SessionError::Fit { format: format.name, source })?
    } else {
        map
    };
    write_map(path, format, &map, existing)?;
    Ok((map, needs_fit))
}
