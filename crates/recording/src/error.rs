//! Errors of reading and writing recordings, and warnings about recordings that were read despite a fault.

use crate::logs::{LogError, LogFinding};
use crate::{ChunkError, FormatVersion, UnitError};
use mapper_core::{Channel, step_number};
use mapper_table::{kind_of, remedy};
use mapper_yaml::Findings;
use std::io;
use std::path::PathBuf;

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

/// A warning for the user of a recording. Each displays as one sentence with values.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum ReadWarning {
    #[error("the file is truncated at byte {offset}: everything after the last flush is lost")]
    Truncated { offset: u64 },
    #[error("the chunk at byte {offset} was left out: {source}")]
    DamagedChunk { offset: u64, source: ChunkError },
    /// `offset`: of the record, or of the chunk it is in.
    #[error("the record at byte {offset} was left out: {part}")]
    DamagedRecord { offset: u64, part: DamagedPart },
    #[error("{count} more chunks and records were left out: they are damaged as well")]
    MoreDamage { count: u64 },
    #[error("{count} messages on {topic} were left out: they are not JSON objects")]
    DamagedMessages { topic: String, count: u64 },
    #[error("{count} messages were left out: the file does not define their channel")]
    UndefinedChannel { count: u64 },
    #[error("{topic} was left out: its messages are in encoding `{encoding}`, and only json can be read")]
    UnknownEncoding { topic: String, encoding: String },
    #[error("{count} values of {} are not numbers; they count as missing", symbols(channels))]
    NotANumber { channels: Vec<Channel>, count: u64 },
    #[error("the rig marked {count} readings of {channel} as bad; they count as missing")]
    BadReadings { channel: Channel, count: u64 },
    #[error("the recording has no `{field}` on {topic}, which the channel map gives for {channel}")]
    MissingChannel { channel: Channel, topic: String, field: String },
    #[error(
        "the channel map gives {channel} in {mapped}, the recording in {recorded}; the channel map is used"
    )]
    UnitContradiction { channel: Channel, mapped: String, recorded: String },
    #[error(
        "{}: {reordered} samples came out of order and {repeated} repeated a time; they were sorted and the repeats left out",
        symbols(channels)
    )]
    OutOfOrder { channels: Vec<Channel>, reordered: usize, repeated: usize },
    /// Positive: forward.
    #[error("the clock was set by {by_s:+.1} s during the recording, or before it: the times were corrected")]
    ClockSet { by_s: f64 },
    #[error("only the first {limit} messages and other records were read")]
    TooManyMessages { limit: u64 },
    #[error("only the first {limit} values were read; split the recording")]
    TooManyValues { limit: u64 },
    #[error(
        "{count} rows or samples were left out: their times (the first is {first_s} s) are invalid, go back, or are more than a day from their neighbours"
    )]
    StrayTimes { count: u64, first_s: f64 },
    #[error("{finding}")]
    Log { finding: LogFinding },
    #[error("the samples are faster than identification needs: they were averaged to 10 a second")]
    Averaged,
    #[error(
        "valve_command reverses in {turns_percent:.0} % of its samples, so it is a measured position; each step has the opening at its end"
    )]
    MeasuredValve { turns_percent: f64 },
    #[error("{0}")]
    StepsFound(Box<StepsFound>),
    #[error(
        "{channel} is a gauge pressure, and the ambient pressure is not in the recording: it was left out"
    )]
    NoAmbient { channel: Channel },
    #[error(
        "no steps were found: the recording has neither step markers nor a mapped P3_command or valve_command"
    )]
    NoCommands,
    /// A gap in the readings is most of a step; `index` counts from 0.
    #[error(
        "step {} has no readings for {gap_s:.1} s of its {duration_s:.1} s, from {from_s:.1} s on: the log paused, or its clock was set; split the log there, or correct its times",
        step_number(*index)
    )]
    HollowStep { index: usize, gap_s: f64, from_s: f64, duration_s: f64 },
    /// `index` counts from 0; `end_s`: time of the last sample.
    #[error("step {} has no end: the run ended early, at {end_s} s", step_number(*index))]
    UnfinishedStep { index: usize, end_s: f64 },
}

fn symbols(channels: &[Channel]) -> String {
    channels.iter().map(|channel| channel.symbol()).collect::<Vec<_>>().join(", ")
}

impl ReadWarning {
    /// Adds the warning to others. What is true of several channels is one warning.
    pub(crate) fn add_to(self, warnings: &mut Vec<ReadWarning>) {
        let takes = |other: &mut ReadWarning| match (other, &self) {
            (
                ReadWarning::NotANumber { channels, count },
                ReadWarning::NotANumber { channels: more, count: same },
            ) if count == same => {
                channels.extend(more);
                true
            }
            (
                ReadWarning::OutOfOrder { channels, reordered, repeated },
                ReadWarning::OutOfOrder { channels: more, reordered: same, repeated: alike },
            ) if (&*reordered, &*repeated) == (same, alike) => {
                channels.extend(more);
                true
            }
            _ => false,
        };
        if !warnings.iter_mut().any(takes) {
            warnings.push(self);
        }
    }
}

/// The steps of a recording without markers, and which channels show them.
#[derive(Debug, Clone, PartialEq)]
pub struct StepsFound {
    /// Steps with a turning shaft.
    pub count: usize,
    /// Jumps that each channel shows, starts from rest included; commands first.
    pub shown: Vec<(Channel, usize)>,
    /// Starts that readings show, and recorded commands of P3 and valve do not, s.
    pub only_readings_s: Vec<f64>,
    /// Starts that commands show, and no reading does, s.
    pub only_commands_s: Vec<f64>,
}

/// Longest list of times in a sentence. Bound: enough to find the cause.
const MAX_LISTED: usize = 5;

impl std::fmt::Display for StepsFound {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let shown: Vec<String> =
            self.shown.iter().map(|(channel, count)| format!("{channel} {count}")).collect();
        let (count, shown) = (self.count, shown.join(", "));
        write!(f, "the recording has no step markers: {count} steps were found; jumps by channel: {shown}")?;
        let apart = [
            ("commands do not show, and readings do", &self.only_readings_s),
            ("no reading follows the commands", &self.only_commands_s),
        ];
        for (what, times_s) in apart.into_iter().filter(|(_, times_s)| !times_s.is_empty()) {
            let times: Vec<String> = times_s.iter().take(MAX_LISTED).map(|t_s| format!("{t_s:.0}")).collect();
            let more = if times_s.len() > MAX_LISTED { " and later" } else { "" };
            write!(f, "; {what} at {} s{more}", times.join(", "))?;
        }
        Ok(())
    }
}

/// Kinds of damaged records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DamagedPart {
    /// A sample.
    Message,
    /// The description of a topic's fields.
    Schema,
    /// A topic.
    Topic,
    /// Pairs of names and values.
    Metadata,
    /// A file within the file.
    Attachment,
}

impl std::fmt::Display for DamagedPart {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            DamagedPart::Message => "a message without its header",
            DamagedPart::Schema => "a schema whose lengths do not fit",
            DamagedPart::Topic => "a topic whose lengths do not fit",
            DamagedPart::Metadata => "metadata whose lengths do not fit",
            DamagedPart::Attachment => "an attachment whose lengths or checksum do not fit",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_true_of_several_channels_is_one_warning() {
        let mut warnings = Vec::new();
        for (channel, reordered) in [(Channel::T1, 3), (Channel::P1, 3), (Channel::T2, 1)] {
            let channels = vec![channel];
            ReadWarning::OutOfOrder { channels, reordered, repeated: 0 }.add_to(&mut warnings);
        }
        let channels: Vec<&[Channel]> = warnings
            .iter()
            .filter_map(|warning| match warning {
                ReadWarning::OutOfOrder { channels, .. } => Some(channels.as_slice()),
                _ => None,
            })
            .collect();
        assert_eq!(channels, [&[Channel::T1, Channel::P1][..], &[Channel::T2]]);
    }
}
