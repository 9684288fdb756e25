//! Warnings about recordings that were read despite a fault.

use crate::ChunkError;
use crate::logs::LogFinding;
use mapper_core::{Channel, step_number};

/// A warning for the user of a recording. Each displays as one sentence with values.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReadWarning {
    /// The file is truncated: the run was killed, or the copy is incomplete.
    #[error("the file is truncated at byte {offset}: everything after the last flush is lost")]
    Truncated {
        /// Byte offset of the first incomplete record.
        offset: u64,
    },
    /// A chunk could not be used; the others were used.
    #[error("the chunk at byte {offset} was left out: {source}")]
    DamagedChunk {
        /// Byte offset of the chunk's record.
        offset: u64,
        /// What is wrong with it.
        source: ChunkError,
    },
    /// A record other than a message could not be used.
    #[error("the record at byte {offset} was left out: {part}")]
    DamagedRecord {
        /// Byte offset of the record, or of the chunk it is in.
        offset: u64,
        /// Its kind, and what is wrong with it.
        part: DamagedPart,
    },
    /// More damage than is listed.
    #[error("{count} more chunks and records were left out: they are damaged as well")]
    MoreDamage {
        /// Number.
        count: u64,
    },
    /// Messages on a mapped topic that are not JSON objects.
    #[error("{count} messages on {topic} were left out: they are not JSON objects")]
    DamagedMessages {
        /// Topic.
        topic: String,
        /// Number.
        count: u64,
    },
    /// Messages on a topic that the file does not define.
    #[error("{count} messages were left out: the file does not define their channel")]
    UndefinedChannel {
        /// Number.
        count: u64,
    },
    /// Messages on a mapped topic in an encoding other than JSON.
    #[error("{topic} was left out: its messages are in encoding `{encoding}`, and only json can be read")]
    UnknownEncoding {
        /// Topic.
        topic: String,
        /// Its encoding.
        encoding: String,
    },
    /// A field held something other than a number or null.
    #[error("{count} values of {channel} are not numbers; they count as missing")]
    NotANumber {
        /// Channel.
        channel: Channel,
        /// Number.
        count: u64,
    },
    /// The rig itself reports readings as bad.
    #[error("the rig marked {count} readings of {channel} as bad; they count as missing")]
    BadReadings {
        /// Channel.
        channel: Channel,
        /// Number.
        count: u64,
    },
    /// The map names a field that the recording does not contain.
    #[error("the recording has no `{field}` on {topic}, which the channel map gives for {channel}")]
    MissingChannel {
        /// Channel.
        channel: Channel,
        /// Topic of the map.
        topic: String,
        /// Field of the map.
        field: String,
    },
    /// The map and the recording disagree about a unit.
    #[error(
        "the channel map gives {channel} in {mapped}, the recording in {recorded}; the channel map is used"
    )]
    UnitContradiction {
        /// Channel.
        channel: Channel,
        /// Unit of the map.
        mapped: String,
        /// Unit of the recording.
        recorded: String,
    },
    /// Times went back or did not advance.
    #[error(
        "{channel}: {reordered} samples came out of order and {repeated} repeated a time; they were sorted and the repeats left out"
    )]
    OutOfOrder {
        /// Channel.
        channel: Channel,
        /// Samples earlier than one before them.
        reordered: usize,
        /// Samples with the time of another one.
        repeated: usize,
    },
    /// The clock was set while it recorded.
    #[error("the clock was set by {by_s:+.1} s during the recording, or before it: the times were corrected")]
    ClockSet {
        /// By how much, s; positive: forward.
        by_s: f64,
    },
    /// More messages and other records than the reader takes.
    #[error("only the first {limit} messages and other records were read")]
    TooManyMessages {
        /// The limit.
        limit: u64,
    },
    /// More values than the reader keeps.
    #[error("only the first {limit} values were read; split the recording")]
    TooManyValues {
        /// The limit.
        limit: u64,
    },
    /// Rows or samples with impossible times.
    #[error(
        "{count} rows or samples were left out: their times (the first is {first_s} s) are invalid, go back, or are more than a day from their neighbours"
    )]
    StrayTimes {
        /// Number.
        count: u64,
        /// The first of these times, s.
        first_s: f64,
    },
    /// A finding of the log's reader.
    #[error("{finding}")]
    Log {
        /// The finding.
        finding: LogFinding,
    },
    /// A fast log was averaged during reading.
    #[error("the log is faster than identification needs: it was averaged to 10 samples a second")]
    Averaged,
    /// The opening of the valve is a measured position.
    #[error(
        "valve_command reverses in {turns_percent:.0} % of its samples, so it is a measured position; each step has the opening at its end"
    )]
    MeasuredValve {
        /// Samples in which it reverses, %.
        turns_percent: f64,
    },
    /// Steps were found from measured channels.
    #[error(
        "the recording has neither step markers nor commands that change: {count} steps were found at jumps of {channels}"
    )]
    StepsFound {
        /// Number.
        count: usize,
        /// Evaluated channels.
        channels: String,
    },
    /// The reference of a gauge pressure is missing.
    #[error(
        "{channel} is a gauge pressure, and the ambient pressure is not in the recording: it was left out"
    )]
    NoAmbient {
        /// The channel.
        channel: Channel,
    },
    /// Steps could not be found because no command is mapped.
    #[error(
        "no steps were found: the recording has neither step markers nor a mapped P3_command or valve_command"
    )]
    NoCommands,
    /// Steps were found, but one command is missing; its value is undefined in the steps.
    #[error(
        "steps were found without {channel}: it is not in the recording, so the steps have no value of it"
    )]
    MissingCommand {
        /// The command.
        channel: Channel,
    },
    /// A gap in the readings is most of a step.
    #[error(
        "step {} has no readings for {gap_s:.1} s of its {duration_s:.1} s, from {from_s:.1} s on: the log paused, or its clock was set; split the log there, or correct its times",
        step_number(*index)
    )]
    HollowStep {
        /// Index of the step, from 0.
        index: usize,
        /// Length of the gap, s.
        gap_s: f64,
        /// Its start, s.
        from_s: f64,
        /// Duration of the step, s.
        duration_s: f64,
    },
    /// The run ended within a step.
    #[error("step {} has no end: the run ended early, at {end_s} s", step_number(*index))]
    UnfinishedStep {
        /// Index of the step, from 0.
        index: usize,
        /// Time taken as its end: that of the last sample, s.
        end_s: f64,
    },
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
