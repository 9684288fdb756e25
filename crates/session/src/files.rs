//! Files: nothing that is there is replaced unless somebody says so.

use crate::SessionError;
use serde::Serialize;
use std::io::Write;
use std::path::Path;

/// What becomes of a file that is there already.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Existing {
    /// It stays, and nothing is written.
    #[default]
    Kept,
    /// It is replaced, once the new one is whole.
    Replaced,
}

/// Writes a file.
///
/// # Errors
/// [`SessionError::Exists`] where it is there and is to be kept, [`SessionError::File`] where it cannot be written.
pub fn write_file(path: &Path, bytes: &[u8], existing: Existing) -> Result<(), SessionError> {
    if existing == Existing::Kept || !path.exists() {
        return write_new(path, bytes);
    }
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".new");
    let new = path.with_file_name(name);
    std::fs::write(&new, bytes)
        .and_then(|()| std::fs::rename(&new, path))
        .map_err(SessionError::file("write", path))
}

/// Writes a file that is not there yet.
///
/// # Errors
/// [`SessionError::Exists`] where it is there, [`SessionError::File`] where it cannot be written.
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
