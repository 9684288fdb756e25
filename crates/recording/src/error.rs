//! Why a recording could not be written or read.

use crate::logs::LogError;
use crate::{FormatVersion, ReadWarning, UnitError};
use mapper_core::Channel;
use mapper_table::{kind_of, remedy};
use mapper_yaml::Findings;
use std::{io, path::PathBuf};

/// Why a recording could not be written or read.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum RecordError {
    #[error("failed to create the recording `{}`: the file exists, and a run never overwrites another; choose another name, or move the file", path.display())]
    Exists { path: PathBuf },
    #[error("failed to create the recording `{}`: {source}", path.display())]
    Create { path: PathBuf, source: io::Error },
    /// Writing failed during the run; `saved_until_s`: run time up to which all samples are in the file, `None` before the first flush.
    #[error("failed to write the recording `{}`: {source}; {}; {}", path.display(), saved(*saved_until_s), advice(source))]
    Write { path: PathBuf, saved_until_s: Option<f64>, source: io::Error },
    #[error("failed to record into `{}`: {source}; report this as a bug of the program that made the batch", path.display())]
    BadInput { path: PathBuf, source: BatchError },
    #[error("failed to read the recording `{}`: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("failed to read `{}`: it is not an MCAP file (it starts with {found}); give the .mcap file of a run", path.display())]
    NotMcap { path: PathBuf, found: String },
    #[error(transparent)]
    Log(#[from] LogError),
    #[error("failed to read `{}`: it is neither an MCAP recording nor a log that can be read: {message}", path.display())]
    Neither { path: PathBuf, message: String },
    #[error("failed to read `{}`: it is the log of another program, and no channel map assigns its columns to channels; give one", path.display())]
    LogWithoutMap { path: PathBuf },
    /// The channel map does not fit the recording: all mistakes, with their places.
    #[error("{0}")]
    ChannelMap(Box<Findings>),
    #[error("failed to read `{}`: it has recording format {found}, this program knows up to {}; use a newer program", path.display(), FormatVersion::CURRENT)]
    NewerFormat { path: PathBuf, found: FormatVersion },
    #[error("failed to read `{}`: {warning}, and it contains no other measurement", path.display())]
    NothingReadable { path: PathBuf, warning: ReadWarning },
    #[error("failed to read `{}`: it contains none of the expected measurements; its topics are {}; give a channel map that names its topics and fields", path.display(), list(topics))]
    NothingMapped { path: PathBuf, topics: Vec<String> },
    #[error("failed to read `{}`: neither the channel map nor the recording gives the unit of {channel} (`{field}` of {topic}); add it to the channel map, e.g. `unit: {}`", path.display(), channel.unit())]
    MissingUnit { path: PathBuf, channel: Channel, topic: String, field: String },
    #[error("failed to read `{}`: unit of {channel} (`{field}` of {topic}): {source}; {}; or write another unit in the channel map", path.display(), remedy(kind_of(*channel), source))]
    BadUnit { path: PathBuf, channel: Channel, topic: String, field: String, source: Box<UnitError> },
}

/// Why data cannot be recorded.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum BatchError {
    #[error("the time {t_s} s cannot be recorded")]
    Time { t_s: f64 },
    #[error("{name} has {length} values for {samples} times")]
    Length { name: String, length: usize, samples: usize },
    #[error("`{name}` appears twice in a batch")]
    Twice { name: String },
}

fn saved(saved_until_s: Option<f64>) -> String {
    match saved_until_s {
        Some(t_s) => format!("everything up to {t_s} s of the run is in the file and can be read"),
        None => "nothing of the run was saved".to_owned(),
    }
}

fn advice(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "make room on this disk or record to another one, and run again"
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            "record to a writable folder, and run again"
        }
        _ => "check the disk, and run again",
    }
}

fn list(topics: &[String]) -> String {
    if topics.is_empty() { "none".to_owned() } else { topics.join(", ") }
}
