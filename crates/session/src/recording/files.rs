//! Files of results: written once, with the program that made them.

use crate::SessionError;
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Treatment of an existing file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Existing {
    /// Keep it and write nothing.
    #[default]
    Kept,
    /// Replace it once the new file is complete.
    Replaced,
}

impl Existing {
    /// Refuses a file that exists and must be kept, before the work for its content.
    pub fn check(self, path: &Path) -> Result<(), SessionError> {
        let is_kept = self == Existing::Kept && path.exists();
        if is_kept { Err(SessionError::Exists(path.to_owned())) } else { Ok(()) }
    }
}

/// Writes a file.
pub fn write_file(path: &Path, bytes: &[u8], existing: Existing) -> Result<(), SessionError> {
    if existing == Existing::Kept || !path.exists() {
        return write_new(path, bytes);
    }
    // A pipe or a device is written to and not replaced.
    if path.metadata().is_ok_and(|about| !about.is_file()) {
        return std::fs::write(path, bytes).map_err(SessionError::file("write", path));
    }
    write_temporary(path, bytes)
        .and_then(|file| file.persist(path).map_err(|error| error.error))
        .map(drop)
        .map_err(SessionError::file("write", path))
}

pub(crate) fn write_files(
    directory: &Path,
    contents: &[(&str, Vec<u8>)],
    existing: Existing,
) -> Result<Vec<PathBuf>, SessionError> {
    std::fs::create_dir_all(directory).map_err(SessionError::file("create", directory))?;
    let mut files = Vec::with_capacity(contents.len());
    for (name, bytes) in contents {
        let path = directory.join(name);
        write_file(&path, bytes, existing)?;
        files.push(path);
    }
    Ok(files)
}

/// Version of the keys of all diagnoses (gap, drift, log without steps). Version 1 had no number, and `where`, `laws`, `off_at_rest`, `since` and
/// `gap.shrink` for `locations`, `closure_terms`, `offsets_at_rest`, `baseline` and `gap.gap_reduction`. In version 2 no candidate had a closure term.
pub const DIAGNOSIS_FORMAT: u32 = 3;
/// Version of the keys of a points file.
pub(crate) const POINTS_FORMAT: u32 = 1;
/// Version of the keys of a sealed forecast.
pub(crate) const FORECAST_FORMAT: u32 = 1;

/// Content of a JSON file with the version of its keys.
#[derive(Debug, Serialize)]
pub struct Versioned<T> {
    /// Raised when a key changes its name or meaning.
    pub format_version: u32,
    /// The keys.
    #[serde(flatten)]
    pub content: T,
}

/// Writes a file under a temporary name in the same directory, so that the final name never belongs to an incomplete file.
fn write_temporary(path: &Path, bytes: &[u8]) -> std::io::Result<NamedTempFile> {
    let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".mapper-");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    // The library adds the path of the temporary file, which is of no use here.
    let mut file = builder.tempfile_in(directory).map_err(|error| std::io::Error::from(error.kind()))?;
    file.write_all(bytes)?;
    Ok(file)
}

/// Writes a new file.
pub fn write_new(path: &Path, bytes: &[u8]) -> Result<(), SessionError> {
    write_temporary(path, bytes)
        .and_then(|file| file.persist_noclobber(path).map_err(|error| error.error))
        .map(drop)
        .map_err(SessionError::file("write", path))
}

/// Returns indented JSON with a final line break.
pub fn json_text(value: &impl Serialize) -> Result<String, SessionError> {
    Ok(serde_json::to_string_pretty(value)? + "\n")
}

/// Reads a file of at most `limit_bytes`. Memory is bounded even if the file grows or reports a wrong size.
pub(crate) fn read_at_most(path: &Path, limit_bytes: u64) -> Result<Vec<u8>, SessionError> {
    let limit_bytes = usize::try_from(limit_bytes).unwrap_or(usize::MAX);
    mapper_yaml::read_limited(path, limit_bytes).map_err(SessionError::file("read", path))
}

/// Name and version of the program, as recordings carry it.
pub const PROGRAM: &str = concat!("mapper ", env!("CARGO_PKG_VERSION"));

/// Name, version and commit, for people. `commit`: empty if unknown.
pub fn program_and_commit(commit: &str) -> String {
    match commit {
        "" => PROGRAM.to_owned(),
        commit => format!("{PROGRAM}, commit {commit}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_existing_file_is_kept_or_replaced_as_a_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        write_file(&path, b"first", Existing::Kept).unwrap();
        assert!(matches!(write_file(&path, b"second", Existing::Kept), Err(SessionError::Exists(_))));
        assert_eq!(read_at_most(&path, 9).unwrap(), b"first");
        write_file(&path, b"third", Existing::Replaced).unwrap();
        assert_eq!(read_at_most(&path, 9).unwrap(), b"third");
        // No temporary file remains in the directory.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn no_more_is_read_than_allowed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        write_new(&path, b"12345").unwrap();
        assert_eq!(read_at_most(&path, 5).unwrap(), b"12345");
        assert!(read_at_most(&path, 4).is_err());
        // A device has no end.
        assert!(read_at_most(Path::new("/dev/zero"), 4096).is_err());
    }
}
