//! Reads files from disk up to a size limit.

use crate::source::{Document, FindingKind, Findings, Source, closest};
use std::fs::{File, OpenOptions};
use std::io;
use std::io::{ErrorKind, Read, Seek};
use std::path::Path;

/// Opens a plain file: the one place where files that a user names are opened. A pipe or a device is not opened: reading it may hang or never end.
pub fn open_file(path: &Path) -> io::Result<File> {
    let refused = |why: &str| Err(io::Error::new(ErrorKind::InvalidInput, why));
    let mut options = OpenOptions::new();
    options.read(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        // Files of the kernel that wait for data, such as /proc/kmsg, look like plain ones. NONBLOCK: they and pipes fail at once.
        options.custom_flags(i32::try_from(rustix::fs::OFlags::NONBLOCK.bits()).unwrap_or_default());
    }
    // Opening a device may have an effect.
    let found = std::fs::metadata(path)?;
    if found.is_dir() {
        return refused("it is a directory; name a file in it");
    }
    let not_a_file = "it is a pipe or a device, not a file; write its content to a file first";
    if !found.is_file() {
        return refused(not_a_file);
    }
    let mut file = options.open(path)?;
    let found = file.metadata()?;
    if !found.is_file() {
        return refused(not_a_file);
    }
    // Files of the kernel have no size, with content or without. A file may just be written.
    if found.len() == 0 {
        match file.read(&mut [0]) {
            Ok(0) => {}
            Ok(_) if file.metadata()?.len() > 0 => file.rewind()?,
            _ => return refused(not_a_file),
        }
    }
    Ok(file)
}

/// Whether this is a descriptor that the caller has opened: `/dev/stdin`, or a shell's `<(command)`.
fn is_descriptor(path: &Path) -> bool {
    ["/dev/stdin", "/dev/fd", "/proc/self/fd"].iter().any(|place| path.starts_with(place))
}

/// Reads a file of at most `limit_bytes`. Memory is bounded even if the file reports a wrong size.
pub fn read_limited(path: &Path, limit_bytes: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let is_stream = is_descriptor(path) && !std::fs::metadata(path)?.is_file();
    let file = if is_stream { File::open(path)? } else { open_file(path)? };
    file.take(limit_bytes as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > limit_bytes {
        return Err(io::Error::new(
            ErrorKind::FileTooLarge,
            format!("it is larger than the {limit_bytes} bytes that are read"),
        ));
    }
    Ok(bytes)
}

/// That a file does not exist, with the file of the same directory that was probably meant.
fn not_found_text(path: &Path) -> String {
    let with_ending = path.with_extension("yaml");
    let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let names: Vec<String> = std::fs::read_dir(directory)
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| [".yaml", ".yml"].iter().any(|ending| name.ends_with(ending)))
        .collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let written = path.file_name().unwrap_or_default().to_string_lossy();
    let meant = match closest(&written, &names) {
        _ if with_ending.is_file() => Some(with_ending),
        name => name.map(|name| path.with_file_name(name)),
    };
    let guess = meant.map(|meant| format!("; did you mean `{}`?", meant.display()));
    format!("it does not exist{}", guess.unwrap_or_default())
}

/// Reads a file as text.
pub fn open(
    document: &'static Document,
    path: &Path,
    limit_bytes: usize,
) -> io::Result<Result<String, Findings>> {
    let bytes = read_limited(path, limit_bytes).map_err(|error| match error.kind() {
        ErrorKind::NotFound => io::Error::new(ErrorKind::NotFound, not_found_text(path)),
        _ => error,
    })?;
    Ok(String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let source = Source::new(document, path, &String::from_utf8_lossy(error.as_bytes()));
        let remedy = "save the file as UTF-8".to_owned();
        Findings::single(source, FindingKind::Syntax, at, "this is not UTF-8".to_owned(), remedy)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    /// Kernel files that wait for data look like plain ones; only root may open this one.
    #[cfg(target_os = "linux")]
    #[test]
    fn what_may_hang_or_has_no_end_is_not_opened() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name| folder.path().join(name);
        let made = std::process::Command::new("mkfifo").arg(at("fifo")).status().unwrap();
        assert!(made.success());
        let _listener = std::os::unix::net::UnixListener::bind(at("socket")).unwrap();
        std::os::unix::fs::symlink("/dev/zero", at("link")).unwrap();
        let mut special = vec![at("fifo"), at("socket"), at("link"), folder.path().to_owned()];
        special.extend(["/proc/kmsg", "/proc/self/limits"].map(PathBuf::from));
        for path in &special {
            let error = open_file(path).unwrap_err();
            let expected = [ErrorKind::InvalidInput, ErrorKind::PermissionDenied];
            assert!(expected.contains(&error.kind()), "{}: {error}", path.display());
            assert!(read_limited(path, 10).is_err(), "{}", path.display());
        }
        std::fs::write(at("empty"), "").unwrap();
        std::fs::write(at("full"), "content").unwrap();
        assert_eq!(read_limited(&at("empty"), 10).unwrap(), b"");
        assert_eq!(read_limited(&at("full"), 10).unwrap(), b"content");
    }
}
