//! The zip archive of an FMU. Its bytes depend only on its files.

use crate::files::FmuFile;
use crate::machine::FmuError;
use std::io::{Cursor, Write};
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
