//! The files of an FMU, and their archive.

use crate::description::{SOURCES, description};
use crate::header::{header, with_guid};
use crate::machine::{FmuError, FmuMachine};
use crate::variables::{switches, variables};
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::io::{Cursor, Write as _};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// Packs the files of an FMU.
///
/// # Errors
/// [`FmuError::Archive`] or [`FmuError::File`] if the archive cannot hold them.
pub fn archive(files: &[FmuFile]) -> Result<Vec<u8>, FmuError> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    // No time stamp, so that equal files give equal bytes.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    for file in files {
        zip.start_file(file.path.as_str(), options)?;
        zip.write_all(&file.bytes)?;
    }
    Ok(zip.finish()?.into_inner())
}

/// A file of an FMU.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FmuFile {
    /// Path in the archive, with `/`.
    pub path: String,
    /// Contents.
    pub bytes: Vec<u8>,
}

/// Generates all files of a machine's FMU: the description, then the sources. The GUID is a hash of both, so that equal machines give
/// equal FMUs.
///
/// # Errors
/// [`FmuError::NotFinite`] with the name of the number.
pub fn files(machine: &FmuMachine<'_>) -> Result<Vec<FmuFile>, FmuError> {
    let (variables, switches) = (variables(machine), switches(machine));
    let header = header(machine, &variables, &switches)?;
    let mut hash = Sha256::new();
    hash.update(description(machine, &variables, &switches, "")?);
    hash.update(&header);
    SOURCES.iter().for_each(|(_, text)| hash.update(text));
    let guid = guid(&hash.finalize());
    let description = description(machine, &variables, &switches, &guid)?;
    let source = |name: &str, text: &str| FmuFile { path: format!("sources/{name}"), bytes: text.into() };
    let mut files = vec![FmuFile { path: "modelDescription.xml".to_owned(), bytes: description.into() }];
    files.extend(SOURCES.iter().map(|(name, text)| source(name, text)));
    files.push(source("model_data.h", &with_guid(&header, &guid)));
    Ok(files)
}

/// The first 16 bytes of a hash as `{xxxxxxxx-xxxx-xxxx-xxxx-xxxxxxxxxxxx}`.
fn guid(hash: &[u8]) -> String {
    let mut text = String::from("{");
    for (index, byte) in hash.iter().take(16).enumerate() {
        if [4, 6, 8, 10].contains(&index) {
            text.push('-');
        }
        // Writing to a String cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text + "}"
}
