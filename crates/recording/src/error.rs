//! Why a recording could not be written or read.

use crate::logs::LogError;
use crate::logs::units::{kind_of, remedy};
use crate::{FormatVersion, ReadWarning, UnitError};
use mapper_core::Channel;
use mapper_yaml::Findings;
use std::{io, path::PathBuf};

/// Why a recording could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// A file of this name exists.
    #[error("failed to create the recording `{}`: the file exists, and a run never overwrites another; choose another name, or move the file", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The file could not be created.
    #[error("failed to create the recording `{}`: {source}", path.display())]
    Create {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// Writing failed during the run, e.g. because the disk is full.
    #[error("failed to write the recording `{}`: {source}; {}; {}", path.display(), saved(*saved_until_s), advice(source))]
    Write {
        /// The file.
        path: PathBuf,
        /// Run time up to which all samples are in the file, s; `None` before the first flush.
        saved_until_s: Option<f64>,
        /// The system's error.
        source: io::Error,
    },
    /// A batch, event or step that cannot be written: a bug in the program that made it.
    #[error("failed to record into `{}`: {source}; report this as a bug of the program that made the batch", path.display())]
    BadInput {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: BatchError,
    },
    /// The file could not be opened or read.
    #[error("failed to read the recording `{}`: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The file has another format.
    #[error("failed to read `{}`: it is not an MCAP file (it starts with {found}); give the .mcap file of a run", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// Its first bytes, as text.
        found: String,
    },
    /// A log of another program cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The file is neither a recording nor a log.
    #[error("failed to read `{}`: it is neither an MCAP recording nor a log that can be read: {message}", path.display())]
    Neither {
        /// The file.
        path: PathBuf,
        /// Why it is not a log.
        message: String,
    },
    /// A log of another program without a channel map.
    #[error("failed to read `{}`: it is the log of another program, and no channel map assigns its columns to channels; give one", path.display())]
    LogWithoutMap {
        /// The file.
        path: PathBuf,
    },
    /// The channel map does not fit the recording: all mistakes, with their places.
    #[error("{0}")]
    ChannelMap(Box<Findings>),
    /// Written by a later version of this program.
    #[error("failed to read `{}`: it has recording format {found}, this program knows up to {}; use a newer program", path.display(), FormatVersion::CURRENT)]
    NewerFormat {
        /// The file.
        path: PathBuf,
        /// Its format.
        found: FormatVersion,
    },
    /// No chunk of the file can be read.
    #[error("failed to read `{}`: {warning}, and it contains no other measurement", path.display())]
    NothingReadable {
        /// The file.
        path: PathBuf,
        /// The first chunk that was left out.
        warning: ReadWarning,
    },
    /// The file contains none of the mapped measurements.
    #[error("failed to read `{}`: it contains none of the expected measurements; its topics are {}; give a channel map that names its topics and fields", path.display(), list(topics))]
    NothingMapped {
        /// The file.
        path: PathBuf,
        /// Topics it has.
        topics: Vec<String>,
    },
    /// Neither the map nor the recording gives the unit of a field.
    #[error("failed to read `{}`: neither the channel map nor the recording gives the unit of {channel} (`{field}` of {topic}); add it to the channel map, e.g. `unit: {}`", path.display(), channel.unit())]
    MissingUnit {
        /// The file.
        path: PathBuf,
        /// The channel.
        channel: Channel,
        /// Its topic.
        topic: String,
        /// Its field.
        field: String,
    },
    /// The unit the recording gives is unknown or measures something else.
    #[error("failed to read `{}`: unit of {channel} (`{field}` of {topic}): {source}; {}; or write another unit in the channel map", path.display(), remedy(kind_of(*channel), source))]
    BadUnit {
        /// The file.
        path: PathBuf,
        /// The channel.
        channel: Channel,
        /// Its topic.
        topic: String,
        /// Its field.
        field: String,
        /// What is wrong with the unit.
        source: Box<UnitError>,
    },
}

/// Why data cannot be recorded.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BatchError {
    /// A time that is not a number, or is outside the clock's range.
    #[error("the time {t_s} s cannot be recorded")]
    Time {
        /// The time, s.
        t_s: f64,
    },
    /// A column of another length than the times.
    #[error("{name} has {length} values for {samples} times")]
    Length {
        /// The column.
        name: String,
        /// Its values.
        length: usize,
        /// The times.
        samples: usize,
    },
    /// A duplicate column.
    #[error("`{name}` appears twice in a batch")]
    Twice {
        /// The column.
        name: String,
    },
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
