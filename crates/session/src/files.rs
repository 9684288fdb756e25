//! New files: nothing that is there is ever replaced.

use crate::SessionError;
use serde::Serialize;
use std::io::Write;
use std::path::Path;

/// Writes a file that is not there yet.
///
/// # Errors
/// [`SessionError::File`] where the file exists or cannot be written.
pub fn write_new(path: &Path, bytes: &[u8]) -> Result<(), SessionError> {
    std::fs::File::create_new(path)
        .and_then(|mut file| file.write_all(bytes))
        .map_err(SessionError::file("write", path))
}

/// Indented JSON with a line end behind it.
///
/// # Errors
/// [`SessionError::Json`] where the value cannot be written as JSON.
pub fn json_text(value: &impl Serialize) -> Result<String, SessionError> {
    Ok(serde_json::to_string_pretty(value)? + "\n")
}
