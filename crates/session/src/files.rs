//! File access: existing files are replaced only on request, and reads have a size limit.

use crate::SessionError;
use serde::Serialize;
use std::io::{ErrorKind, Read, Write};
use std::path::Path;

/// Treatment of an existing file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Existing {
    /// Keep it and write nothing.
    #[default]
    Kept,
    /// Replace it once the new file is complete.
    Replaced,
}

/// Writes a file.
///
/// # Errors
/// [`SessionError::Exists`] if it exists and must be kept, [`SessionError::File`] if it cannot be written.
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

/// Writes a new file.
///
/// # Errors
/// [`SessionError::Exists`] if it already exists, [`SessionError::File`] if it cannot be written.
pub fn write_new(path: &Path, bytes: &[u8]) -> Result<(), SessionError> {
    std::fs::File::create_new(path)
        .and_then(|mut file| file.write_all(bytes))
        .map_err(SessionError::file("write", path))
}

/// Returns indented JSON with a final line break.
///
/// # Errors
/// [`SessionError::Json`] if the value cannot be written as JSON.
pub fn json_text(value: &impl Serialize) -> Result<String, SessionError> {
    Ok(serde_json::to_string_pretty(value)? + "\n")
}

/// Reads a file without holding much more than `limit_bytes` in memory, whatever size the file reports.
///
/// # Errors
/// [`SessionError::File`] if it cannot be read or is too large.
pub(crate) fn read_at_most(path: &Path, limit_bytes: u64) -> Result<Vec<u8>, SessionError> {
    let failed = SessionError::file("read", path);
    let mut bytes = Vec::new();
    let file = match std::fs::File::open(path) {
        Ok(file) => file,
        Err(error) => return Err(failed(error)),
    };
    match file.take(limit_bytes + 1).read_to_end(&mut bytes) {
        Err(error) => Err(failed(error)),
        Ok(_) if bytes.len() as u64 > limit_bytes => {
            let larger = format!("it is larger than the {limit_bytes} bytes that are read");
            Err(failed(std::io::Error::new(ErrorKind::FileTooLarge, larger)))
        }
        Ok(_) => Ok(bytes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_is_read_than_allowed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        write_new(&path, b"12345").unwrap();
        assert_eq!(read_at_most(&path, 5).unwrap(), b"12345");
        for (path, limit_bytes) in [(path.as_path(), 4), (Path::new("/dev/zero"), 4096)] {
            let error = read_at_most(path, limit_bytes).unwrap_err().to_string();
            assert!(error.contains(&format!("larger than the {limit_bytes} bytes")), "{error}");
        }
    }
}
