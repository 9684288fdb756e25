//! Files of a directory that many machines share: written completely or not at all, and read only up to a limit.

use crate::FleetError;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Identity and clocks of the worker; this crate reads no clock itself.
#[derive(Clone, Copy)]
pub struct Machine<'a> {
    /// Name of the machine and the process, for display; unique among concurrent workers.
    pub name: &'a str,
    /// Processor time of the calling thread, s: the cost of an item, whatever the load of the machine.
    pub thread_s: &'a (dyn Fn() -> f64 + Sync),
    /// Peak memory of this process so far, bytes; `None` if the system does not report it.
    pub peak_memory_bytes: &'a (dyn Fn() -> Option<u64> + Sync),
}

/// Whether a file is flushed to the disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Durability {
    /// Flushed before it gets its name: after a power cut, an existing file is complete.
    Synced,
    /// Flushed by the system at some time; the file can be created again.
    Unsynced,
}

/// Writes a file completely or not at all, even if a process is killed. `writer` separates concurrent writers.
pub(crate) fn write_whole(
    path: &Path,
    pieces: &[&[u8]],
    writer: &str,
    durability: Durability,
) -> Result<(), FleetError> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let new = folder.join(format!(".{name}.{}.new", file_name_safe(writer)));
    let write = || -> std::io::Result<()> {
        let mut file = File::create(&new)?;
        for piece in pieces {
            file.write_all(piece)?;
        }
        if durability == Durability::Synced {
            file.sync_all()?;
        }
        drop(file);
        std::fs::rename(&new, path)?;
        Ok(())
    };
    write().map_err(|source| {
        let _ = std::fs::remove_file(&new);
        FleetError::File { action: "write", path: path.to_owned(), source }
    })
}

pub(crate) fn read_at_most(path: &Path, limit_bytes: usize) -> Result<Vec<u8>, FleetError> {
    mapper_yaml::read_limited(path, limit_bytes).map_err(FleetError::file("read", path))
}

/// A name without characters that mean something in a path.
pub(crate) fn file_name_safe(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect()
}

/// Creates a directory and its parents.
pub(crate) fn make_directory(path: PathBuf) -> Result<PathBuf, FleetError> {
    std::fs::create_dir_all(&path).map_err(FleetError::file("create", &path))?;
    Ok(path)
}
