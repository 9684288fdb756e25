//! Reads and writes map files by format.

use crate::errors::MapWorkError;
use crate::recording::files::{Existing, write_file};
use crate::{Registry, SessionError};
use mapper_campaign::Campaign;
use mapper_core::{
    CompressorMap, ExportError, ImportedMap, ImportedTurbine, MAP_FILE_SIZE_LIMIT, MapDescription, MapFormat,
};
use mapper_maps::table::{read_description, set_key, unpack};
use mapper_maps::{MapFitOptions, fit_map};
use std::io::{Error, ErrorKind, Read};
use std::path::Path;

impl Registry {
    /// Reads a map file, or the map of a run directory. The extension selects the format; `user_description` is what the user states about it, or the
    /// reference state alone. A compressed file has the extension of its format before `.gz`.
    ///
    /// # Errors
    /// [`SessionError::UnknownExtension`], [`SessionError::File`], or [`SessionError::Import`] with the file's mistakes.
    pub fn read_map(
        &self,
        path: &Path,
        user_description: impl Into<MapDescription>,
    ) -> Result<CompressorMap, SessionError> {
        Ok(self.inspect_map(path, user_description)?.map)
    }

    /// The same, with the columns and what the reader assumed.
    ///
    /// # Errors
    /// As [`Registry::read_map`].
    pub fn inspect_map(
        &self,
        path: &Path,
        user_description: impl Into<MapDescription>,
    ) -> Result<ImportedMap, SessionError> {
        let (format, bytes) = self.map_bytes(path)?;
        format.read(&bytes, user_description).map_err(|source| SessionError::Import(path.to_owned(), source))
    }

    /// Reads the map of a turbine.
    ///
    /// # Errors
    /// As [`Registry::read_map`].
    pub fn inspect_turbine(
        &self,
        path: &Path,
        user_description: impl Into<MapDescription>,
    ) -> Result<ImportedTurbine, SessionError> {
        let (format, bytes) = self.map_bytes(path)?;
        format
            .read_turbine(&bytes, user_description)
            .map_err(|source| SessionError::Import(path.to_owned(), source))
    }

    /// Format and content of a map file.
    fn map_bytes(&self, path: &Path) -> Result<(&'static MapFormat, Vec<u8>), SessionError> {
        let in_run = path.join("map.json");
        let path = if path.is_dir() { in_run.as_path() } else { path };
        if !path.exists() {
            let why = match path == in_run {
                true => "the directory has no map; name a map file or the directory of a run",
                false => "the file does not exist",
            };
            return Err(SessionError::file("read", path)(Error::new(ErrorKind::NotFound, why)));
        }
        let extension_of =
            |path: &Path| path.extension().map(|extension| extension.to_string_lossy().into_owned());
        let extension = match extension_of(path).unwrap_or_default() {
            packed if packed.eq_ignore_ascii_case("gz") => {
                extension_of(&path.with_extension("")).unwrap_or_default()
            }
            extension => extension,
        };
        let format = self.formats.read_from(&extension).ok_or_else(|| SessionError::UnknownExtension {
            path: path.to_owned(),
            extension: extension.clone(),
            known: self.formats.read_extensions().collect(),
        })?;
        let mut bytes = Vec::new();
        // One byte above the limit shows that the file is too large.
        let limit = MAP_FILE_SIZE_LIMIT as u64 + 1;
        mapper_yaml::open_file(path)
            .and_then(|file| file.take(limit).read_to_end(&mut bytes))
            .map_err(SessionError::file("read", path))?;
        let bytes = unpack(&bytes)
            .map(std::borrow::Cow::into_owned)
            .map_err(|source| SessionError::Import(path.to_owned(), source))?;
        Ok((format, bytes))
    }

    /// Finds the writable map format of this name.
    ///
    /// # Errors
    /// [`SessionError::UnknownFormat`] if there is none.
    pub fn written_format(&self, name: &str) -> Result<&'static MapFormat, SessionError> {
        self.formats.written().find(|format| format.name == name).ok_or_else(|| SessionError::UnknownFormat {
            name: name.to_owned(),
            known: self.formats.written().map(|format| format.name).collect(),
        })
    }

    /// Checks before a run that every format in the campaign can be written.
    ///
    /// # Errors
    /// [`SessionError::UnknownFormat`] with the first format that cannot be written.
    pub fn check_formats(&self, campaign: &Campaign) -> Result<(), SessionError> {
        campaign.outputs.formats.iter().try_for_each(|format| self.written_format(format.name()).map(drop))
    }

    /// The format of a new map file, by name or by the file's extension.
    ///
    /// # Errors
    /// [`SessionError::UnknownOutputFormat`] if neither gives a format.
    pub fn format_of(&self, path: &Path, name: Option<&str>) -> Result<&'static MapFormat, SessionError> {
        let file = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let known_format = match name {
            Some(name) => self.written_format(name).ok(),
            None => self.formats.written_to(file),
        };
        known_format.ok_or_else(|| SessionError::UnknownOutputFormat {
            path: path.to_owned(),
            known: self
                .formats
                .written()
                .map(|format| format!("{} (.{})", format.name, format.extension))
                .collect(),
        })
    }
}

/// What the user states about a map file: a description, and statements that count before it.
///
/// # Errors
/// [`MapWorkError::Description`] and [`MapWorkError::Key`].
pub fn map_description<'a>(
    file: Option<&Path>,
    statements: impl IntoIterator<Item = (&'a str, &'a str)>,
) -> Result<MapDescription, SessionError> {
    let mut description =
        file.map(read_description).transpose().map_err(MapWorkError::from)?.unwrap_or_default();
    for (key, value) in statements {
        set_key(&mut description, key, value).map_err(MapWorkError::from)?;
    }
    Ok(description)
}

/// Writes a map to a file.
///
/// # Errors
/// [`SessionError::Export`] if the format cannot represent the map; otherwise as [`write_file`].
pub fn write_map(
    path: &Path,
    format: &MapFormat,
    map: &CompressorMap,
    existing: Existing,
) -> Result<(), SessionError> {
    write_file(path, &format.write(map)?, existing)
}

/// Writes a map to a file. A format that tabulates the whole map gets a fitted one. Returns the written map and whether it was fitted here.
///
/// # Errors
/// As [`write_map`], and [`SessionError::Fit`] if the map cannot be fitted.
pub fn write_map_fitted_if_needed(
    path: &Path,
    format: &MapFormat,
    map: CompressorMap,
    existing: Existing,
) -> Result<(CompressorMap, bool), SessionError> {
    let needs_fit = map.fitted.is_none() && matches!(format.write(&map), Err(ExportError::NeedsFit { .. }));
    let map = if needs_fit {
        let options = MapFitOptions { leave_one_out: false, ..MapFitOptions::default() };
        fit_map(map, &options).map_err(|source| SessionError::Fit(format.name, source))?
    } else {
        map
    };
    write_map(path, format, &map, existing)?;
    Ok((map, needs_fit))
}
