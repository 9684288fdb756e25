//! Reads files from disk up to a size limit.

use crate::mistakes::finding::FindingKind;
use crate::mistakes::findings::Findings;
use crate::mistakes::source::{Document, Source};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Opens a plain file. A pipe or a device is not opened: reading it may hang or never end.
///
/// # Errors
/// The system's error; [`io::ErrorKind::InvalidInput`] with a remedy if it is not a file.
pub fn open_file(path: &Path) -> io::Result<File> {
    let found = std::fs::metadata(path)?;
    let refused = |why: &str| Err(io::Error::new(io::ErrorKind::InvalidInput, why));
    match found {
        found if found.is_file() => File::open(path),
        found if found.is_dir() => refused("it is a directory; name a file in it"),
        _ => refused("it is a pipe or a device, not a file; write its content to a file first"),
    }
}

/// Whether this is a descriptor that the caller has opened: `/dev/stdin`, or a shell's `<(command)`.
fn is_descriptor(path: &Path) -> bool {
    ["/dev/stdin", "/dev/fd", "/proc/self/fd"].iter().any(|place| path.starts_with(place))
}

/// Reads a file of at most `limit_bytes`. Memory is bounded even if the file reports a wrong size.
///
/// # Errors
/// The system's error; [`io::ErrorKind::FileTooLarge`] for a larger file.
pub fn read_limited(path: &Path, limit_bytes: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let file = if is_descriptor(path) { File::open(path)? } else { open_file(path)? };
    file.take(limit_bytes as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > limit_bytes {
        return Err(io::Error::new(
            io::ErrorKind::FileTooLarge,
            format!("it is larger than the {limit_bytes} bytes that are read"),
        ));
    }
    Ok(bytes)
}

/// Reads a file as text.
///
/// # Errors
/// As [`read_limited`]. The inner error is the mistake of a file that is not UTF-8.
pub fn open(
    document: &'static Document,
    path: &Path,
    limit_bytes: usize,
) -> io::Result<Result<String, Findings>> {
    let bytes = read_limited(path, limit_bytes)?;
    Ok(String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let source = Source::new(document, path, &String::from_utf8_lossy(error.as_bytes()));
        let remedy = "save the file as UTF-8".to_owned();
        Findings::single(source, FindingKind::Syntax, at, "this is not UTF-8".to_owned(), remedy)
    }))
}
