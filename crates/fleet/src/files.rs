//! The files of a fleet: their names by SHA-256, how they are read and written, and what may be wrong with them.

use mapper_yaml::Findings;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fmt;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::str::FromStr;

#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum StudyFileError {
    #[error("failed to read the study {}: {}", .0.display(), .1)]
    Read(PathBuf, #[source] std::io::Error),
    #[error("{0}")]
    Mistakes(Box<Findings>),
}

#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum FleetError {
    #[error(transparent)]
    StudyFile(#[from] StudyFileError),
    #[error("failed to {action} {}: {source}", .path.display())]
    File { action: &'static str, path: PathBuf, source: std::io::Error },
    #[error("{} is not {what}: {source}", .path.display())]
    Content { path: PathBuf, what: &'static str, source: serde_json::Error },
    #[error("there is no study in {}; make one", .0.display())]
    NoStudy(PathBuf),
    #[error("{} has layout {found}; this program reads {known}", .path.display())]
    Layout { path: PathBuf, found: u32, known: u32 },
    #[error("{} already contains the study `{found}` ({kind}); choose another directory", .directory.display())]
    OtherStudy { directory: PathBuf, found: String, kind: String },
    #[error(
        "{} was made by {made_by}, but this is {program}, and results of two versions are never mixed; use {made_by}, or make a new study in \
         another directory", .directory.display()
    )]
    OtherProgram { directory: PathBuf, made_by: String, program: String },
    #[error("`{kind}` is not a kind of study; the kinds are {known}")]
    UnknownKind { kind: String, known: String },
    #[error("the study has {items} items; 1 to {most} are allowed")]
    Items { items: usize, most: usize },
    #[error("the items {first} and {second} are identical; list each once")]
    DuplicateItem { first: String, second: String },
    #[error("{} has been changed: its hash differs from its name; make the study again", .0.display())]
    Changed(PathBuf),
    #[error("the study has no item {0}; choose one from its list of items")]
    NoItem(Hash),
    #[error("the cost is unknown, because every item so far has failed; the first failed with: {0}")]
    UnknownCost(String),
    /// What does not fit, with numbers and the remedy.
    #[error("not submitted: {0}")]
    DoesNotFit(String),
    #[error("all {items} items are done; merge the study {}", .directory.display())]
    NothingLeft { items: usize, directory: PathBuf },
    #[error("{} has not been submitted yet; submit it", .0.display())]
    NotSubmitted(PathBuf),
    #[error(
        "{} is already in the queue: job {job} has {tasks} waiting or running tasks; wait until they end, or cancel the job, and then retry",
        .directory.display()
    )]
    StillQueued { directory: PathBuf, job: String, tasks: usize },
    /// `answer`: its output.
    #[error("the queue rejected {}: {answer}; check the template {template}", .script.display())]
    Queue { script: PathBuf, answer: String, template: String },
    /// Making or merging a study failed, in the words of its kind.
    #[error(transparent)]
    Kind(Box<dyn std::error::Error + Send + Sync>),
    #[error(
        "stopped by the operator; finished items are kept, and the same command continues with the others"
    )]
    Interrupted,
}

impl FleetError {
    pub(crate) fn file(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| FleetError::File { action, path, source }
    }

    pub(crate) fn content(path: &Path, what: &'static str) -> impl FnOnce(serde_json::Error) -> Self {
        let path = path.to_owned();
        move |source| FleetError::Content { path, what, source }
    }

    /// The error of a kind.
    pub fn kind(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        FleetError::Kind(error.into())
    }
}

/// SHA-256, as 64 lower-case hexadecimal digits, so that a name can never lead out of a directory.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Hash([u8; 32]);

impl Hash {
    /// The hash of these bytes.
    pub fn of(bytes: &[u8]) -> Hash {
        Hash(Sha256::digest(bytes).into())
    }

    /// The first eight bytes as a uniformly distributed number; items are assigned to shards by it.
    pub(crate) fn number(&self) -> u64 {
        self.0.iter().take(8).fold(0, |number, byte| (number << 8) | u64::from(*byte))
    }

    /// The first twelve digits, for display.
    pub fn short(&self) -> String {
        self.to_string().chars().take(12).collect()
    }
}

impl fmt::Display for Hash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for Hash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl FromStr for Hash {
    type Err = String;

    fn from_str(text: &str) -> Result<Hash, String> {
        let wrong = || format!("`{text}` is not a hash: 64 digits 0-9 and a-f");
        if text.len() != 64 || !text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f')) {
            return Err(wrong());
        }
        let mut bytes = [0; 32];
        for (byte, pair) in bytes.iter_mut().zip(text.as_bytes().chunks(2)) {
            let pair = std::str::from_utf8(pair).map_err(|_| wrong())?;
            *byte = u8::from_str_radix(pair, 16).map_err(|_| wrong())?;
        }
        Ok(Hash(bytes))
    }
}

impl TryFrom<String> for Hash {
    type Error = String;

    fn try_from(text: String) -> Result<Hash, String> {
        text.parse()
    }
}

impl From<Hash> for String {
    fn from(hash: Hash) -> String {
        hash.to_string()
    }
}

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

pub(crate) fn file_name_safe(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect()
}

pub(crate) fn make_directory(path: PathBuf) -> Result<PathBuf, FleetError> {
    std::fs::create_dir_all(&path).map_err(FleetError::file("create", &path))?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of FIPS 180-2, "abc".
    #[test]
    fn is_sha_256() {
        let text = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(Hash::of(b"abc").to_string(), text);
        assert_eq!(text.parse(), Ok(Hash::of(b"abc")));
        assert_eq!(Hash::of(b"abc").number(), 0xba78_16bf_8f01_cfea);
        for wrong in ["", "../x", &text[1..], &text.to_uppercase(), &text.replace('b', "+")] {
            assert!(wrong.parse::<Hash>().is_err(), "{wrong}");
        }
    }
}
