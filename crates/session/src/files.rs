//! Files: nothing that is there is replaced unless somebody says so, and never more of it read than a limit.

use crate::SessionError;
use serde::Serialize;
use std::io::{ErrorKind, Read, Write};
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

/// Reads a file without ever holding much more than `limit_bytes`, whatever the file claims to be.
///
/// # Errors
/// [`SessionError::File`] where it cannot be read, or is larger.
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
