//! Reads and writes map files by format.

use crate::errors::MapWorkError;
use crate::recording::files::{Existing, write_file};
use crate::{Registry, SessionError};
use mapper_campaign::Campaign;
use mapper_core::{
    CompressorMap, ExportError, ImportedMap, ImportedTurbine, MAP_FILE_SIZE_LIMIT, MapDescription, MapFormat,
};
use mapper_maps::table::{read_description, set_key, text_of_lines, unpack};
use mapper_maps::{MapFitOptions, fit_map};
use std::io::{Error, ErrorKind, Read};
use std::path::{Path, PathBuf};

impl Registry {
    /// Reads a map file (also `.gz`), or the map of a run, by its extension; `user_description`: what the user states, e.g. the reference state.
    pub fn read_map(
        &self,
        path: &Path,
        user_description: impl Into<MapDescription>,
    ) -> Result<CompressorMap, SessionError> {
        Ok(self.inspect_map(path, user_description)?.map)
    }

    /// The same, with the columns and what the reader assumed.
    pub fn inspect_map(
        &self,
        path: &Path,
        user_description: impl Into<MapDescription>,
    ) -> Result<ImportedMap, SessionError> {
        self.inspect_map_of(&[path], user_description)
    }

    /// The same of a map in several files: one for each speed line or line of equal efficiency.
    pub(crate) fn inspect_map_of(
        &self,
        files: &[&Path],
        user_description: impl Into<MapDescription>,
    ) -> Result<ImportedMap, SessionError> {
        let (format, bytes) = self.map_bytes(files)?;
        format.read(&bytes, user_description).map_err(|source| SessionError::Import(name_of(files), source))
    }

    /// Reads the map of a turbine.
    pub fn inspect_turbine(
        &self,
        path: &Path,
        user_description: impl Into<MapDescription>,
    ) -> Result<ImportedTurbine, SessionError> {
        self.inspect_turbine_of(&[path], user_description)
    }

    pub(crate) fn inspect_turbine_of(
        &self,
        files: &[&Path],
        user_description: impl Into<MapDescription>,
    ) -> Result<ImportedTurbine, SessionError> {
        let (format, bytes) = self.map_bytes(files)?;
        let failed = |source| SessionError::Import(name_of(files), source);
        format.read_turbine(&bytes, user_description).map_err(failed)
    }

    fn map_bytes(&self, files: &[&Path]) -> Result<(&'static MapFormat, Vec<u8>), SessionError> {
        let of_lines = |files: Result<Vec<(String, Vec<u8>)>, Error>, path: PathBuf| {
            let files = files.map_err(SessionError::file("read", &path))?;
            let text = text_of_lines(&files).map_err(|source| SessionError::Import(path, source))?;
            Ok::<_, SessionError>(text.into_bytes())
        };
        let csv = self.formats.find("csv");
        let path = match (files, csv) {
            ([path], _) => *path,
            (_, Some(csv)) => {
                let lines = files.iter().map(|file| line_file(file)).collect();
                return Ok((csv, of_lines(lines, name_of(files))?));
            }
            (_, None) => return Err(self.unknown_extension(&name_of(files), "")),
        };
        if path == Path::new(STANDARD_INPUT) {
            let bytes = read_map_bytes(std::io::stdin().lock(), path)?;
            let format = self.formats.find(format_of_content(&bytes));
            return format.map(|format| (format, bytes)).ok_or_else(|| self.unknown_extension(path, ""));
        }
        let in_run = path.join("map.json");
        if path.is_dir() && !in_run.exists() {
            let lines = line_files(path);
            let has_lines = lines.as_ref().map_or(true, |lines| !lines.is_empty());
            if let Some(csv) = csv.filter(|_| has_lines) {
                return Ok((csv, of_lines(lines, path.to_owned())?));
            }
        }
        let path = if path.is_dir() { in_run.as_path() } else { path };
        if !path.exists() {
            let why = match path == in_run {
                true => {
                    "the directory has no map; name a map file, the directory of a run, or one with a file for each speed line (`45000.csv`)"
                }
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
        let format =
            self.formats.read_from(&extension).ok_or_else(|| self.unknown_extension(path, &extension))?;
        let file = mapper_yaml::open_file(path).map_err(SessionError::file("read", path))?;
        Ok((format, read_map_bytes(file, path)?))
    }

    fn unknown_extension(&self, path: &Path, extension: &str) -> SessionError {
        SessionError::UnknownExtension {
            path: path.to_owned(),
            extension: extension.to_owned(),
            known: self.formats.read_extensions().collect(),
        }
    }

    /// Finds the writable map format of this name.
    pub fn written_format(&self, name: &str) -> Result<&'static MapFormat, SessionError> {
        self.formats.written().find(|format| format.name == name).ok_or_else(|| SessionError::UnknownFormat {
            name: name.to_owned(),
            known: self.formats.written().map(|format| format.name).collect(),
        })
    }

    /// Checks before a run that every format in the campaign can be written.
    pub fn check_formats(&self, campaign: &Campaign) -> Result<(), SessionError> {
        campaign.outputs.formats.iter().try_for_each(|format| self.written_format(format.name()).map(drop))
    }

    /// The format of a new map file, by name or by the file's extension.
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

/// The name of standard input. Source: POSIX, utility conventions.
const STANDARD_INPUT: &str = "-";

fn read_map_bytes(file: impl Read, path: &Path) -> Result<Vec<u8>, SessionError> {
    let mut bytes = Vec::new();
    // One byte above the limit shows that the file is too large.
    let limit = MAP_FILE_SIZE_LIMIT as u64 + 1;
    file.take(limit).read_to_end(&mut bytes).map_err(SessionError::file("read", path))?;
    let unpacked = unpack(&bytes).map_err(|source| SessionError::Import(path.to_owned(), source))?;
    Ok(unpacked.into_owned())
}

fn format_of_content(bytes: &[u8]) -> &'static str {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    match text {
        [b'P', b'K', ..] | [0xd0, 0xcf, ..] => "xlsx",
        [b'{', ..] => "json",
        // The CSV of this program begins with a comment and has commas.
        _ if text.starts_with(b"# ") && text.windows(6).any(|part| part == b"\nline_") => "csv",
        _ => "sae",
    }
}

/// Extensions of files with one speed line. Source: programs that digitise figures.
const LINE_EXTENSIONS: [&str; 5] = ["csv", "txt", "dat", "tsv", "prn"];

/// Maximum number of such files in a directory. Bound: a map has some ten lines.
const MAX_LINE_FILES: usize = 100;

/// Names without extension and content of the files of a directory that may be speed lines.
fn line_files(directory: &Path) -> Result<Vec<(String, Vec<u8>)>, Error> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(directory)?.take(MAX_LINE_FILES) {
        let path = entry?.path();
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if path.is_file() && LINE_EXTENSIONS.contains(&extension.as_str()) {
            files.push(line_file(&path)?);
        }
    }
    Ok(files)
}

/// Name without extension and content of a file of one line.
fn line_file(path: &Path) -> Result<(String, Vec<u8>), Error> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut bytes = Vec::new();
    mapper_yaml::open_file(path)?.take(MAP_FILE_SIZE_LIMIT as u64).read_to_end(&mut bytes)?;
    Ok((name, bytes))
}

/// The files of a map in messages.
pub(crate) fn name_of(files: &[&Path]) -> PathBuf {
    let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    PathBuf::from(names.join(", "))
}

/// What the user states about a map file: a description, and statements that count before it.
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

/// Writes a map to a file, and what its format has no place for to a second one.
pub fn write_map(
    path: &Path,
    format: &MapFormat,
    map: &CompressorMap,
    existing: Existing,
) -> Result<(), SessionError> {
    let companion =
        format.companion.map(|(extension, write)| Ok::<_, SessionError>((extension, write(map)?)));
    let companion = companion.transpose()?;
    write_file(path, &format.write(map)?, existing)?;
    match companion {
        Some((extension, bytes)) => write_file(&path.with_extension(extension), &bytes, existing),
        None => Ok(()),
    }
}

/// Writes a map to a file. A format that tabulates the whole map gets a fitted one. Returns the written map and whether it was fitted here.
pub fn write_map_fitted_if_needed(
    path: &Path,
    format: &MapFormat,
    map: CompressorMap,
    existing: Existing,
) -> Result<(CompressorMap, bool), SessionError> {
    let (map, needs_fit) = fitted_if_needed(format, map)?;
    write_map(path, format, &map, existing)?;
    Ok((map, needs_fit))
}

/// The map, fitted if the format tabulates the whole map; whether it was fitted here.
pub(crate) fn fitted_if_needed(
    format: &MapFormat,
    map: CompressorMap,
) -> Result<(CompressorMap, bool), SessionError> {
    if map.fitted.is_some() || !matches!(format.write(&map), Err(ExportError::NeedsFit { .. })) {
        return Ok((map, false));
    }
    let options = MapFitOptions { leave_one_out: false, ..MapFitOptions::default() };
    fit_map(map, &options).map(|map| (map, true)).map_err(|source| SessionError::Fit(format.name, source))
}
