//! Map files: reading and writing by format.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::output;
use mapper_core::{CompressorMap, ExportError, MAP_FILE_SIZE_LIMIT, MapFormat, ReferenceState};
use mapper_formats::{FORMATS, parse_reference};
use std::io::Read;
use std::path::Path;

/// A reference state as given on the command line.
pub fn reference(text: Option<&str>) -> Result<Option<ReferenceState>, Failure> {
    text.map(|text| parse_reference(text).map_err(|error| Failure::new(Code::BadInput, error))).transpose()
}

/// Reads a map; the extension says the format, SAE text where it says nothing known.
pub fn read(path: &Path, given: Option<ReferenceState>) -> Result<CompressorMap, Failure> {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let format = FORMATS.read_from(extension).ok_or_else(|| {
        let known: Vec<&str> = FORMATS.read_extensions().collect();
        let message = format!(
            "{}: maps are read from files with the extension {}; this one has `{extension}`",
            path.display(),
            known.join(", ")
        );
        Failure::new(Code::BadInput, message)
    })?;
    let unreadable = |error: std::io::Error| {
        Failure::new(Code::Failure, format!("failed to read {}: {error}", path.display()))
    };
    let mut bytes = Vec::new();
    // One byte more than allowed tells a file that is too large from one that just fits.
    let limit = MAP_FILE_SIZE_LIMIT as u64 + 1;
    std::fs::File::open(path)
        .and_then(|file| file.take(limit).read_to_end(&mut bytes))
        .map_err(unreadable)?;
    format
        .read(&bytes, given)
        .map_err(|error| Failure::new(Code::BadInput, format!("{}: {error}", path.display())))
}

/// The format of a name, or of a file's extension, in which a map is written.
pub fn format(path: &Path, name: Option<&str>) -> Result<&'static MapFormat, Failure> {
    let file = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let found = match name {
        Some(name) => FORMATS.find(name).filter(|format| format.write.is_some()),
        None => FORMATS.written_to(file),
    };
    found.ok_or_else(|| {
        let known: Vec<String> =
            FORMATS.written().map(|format| format!("{} (.{})", format.name, format.extension)).collect();
        let message =
            format!("{}: say the format by extension or `--to`: {}", path.display(), known.join(", "));
        Failure::new(Code::BadInput, message)
    })
}

/// Writes a map into a new file.
pub fn write(path: &Path, format: &MapFormat, map: &CompressorMap) -> Result<(), Failure> {
    let bytes = format.write(map).map_err(|error| {
        let code = if matches!(error, ExportError::NeedsFit { .. }) { Code::BadInput } else { Code::Failure };
        Failure::new(code, error)
    })?;
    output::write_new(path, &bytes)
}
